"""Ambient modes scaled by a known change of mass: the modal masses of structures that are known."""

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import DataError
from modalscope.systems import chain

MASSES, SPRINGS = np.array([2.0, 1.0, 1.5, 1.0, 3.0]), np.array([900.0, 800, 700, 600, 500])
LABELS = [f"{k + 1}:+X" for k in range(5)]
ADDED = {"3:+X": 0.2, "5:+X": 0.3}


def structure(added=None, damping=0.01):
    more = np.array([(added or {}).get(dof, 0.0) for dof in LABELS])
    return chain(MASSES + more, SPRINGS, damping_ratios=damping)


def unscaled(modes, seed=0):
    """Modes as an ambient test gives them: every shape at a scale of its own."""
    rng = np.random.default_rng(seed)
    scale = rng.standard_normal(len(modes)) + 1j * rng.standard_normal(len(modes))
    return ms.ModalModel(poles=modes.poles, shapes=modes.shapes * scale, output_dofs=modes.output_dofs)


@pytest.mark.parametrize("size", [0.01, 1.0, 2.0])
def test_a_change_of_any_size_gives_unit_modal_masses_when_all_modes_are_known(size):
    added = {dof: size * mass for dof, mass in ADDED.items()}
    scaled = ms.scale_by_mass(unscaled(structure().modes()), unscaled(structure(added).modes(), 1), added)
    assert np.abs(scaled.shapes) == pytest.approx(np.abs(structure().modes().shapes), rel=1e-6)
    assert "0.2 kg at 3:+X" in str(scaled.notes[0]) or size != 1


def test_scaled_modes_give_the_responses_to_forces():
    scaled = ms.scale_by_mass(unscaled(structure().modes()), unscaled(structure(ADDED).modes(), 1), ADDED)
    lines = np.linspace(0.2, 8, 100)
    exact = structure().frequency_response(lines)
    assert scaled.frequency_response(lines).values == pytest.approx(exact.values, rel=1e-6, abs=1e-9)
    assert scaled.input_dofs == scaled.output_dofs


def test_of_few_modes_the_error_is_of_second_order_in_the_masses():
    """What the changed shapes have of modes that are not known leaves the square of the change."""
    errors = []
    for size in (0.1, 0.2):
        added = {dof: size * mass for dof, mass in ADDED.items()}
        few, more = (unscaled(s.modes().take([0, 1, 2])) for s in (structure(), structure(added)))
        scaled = ms.scale_by_mass(few, more, added)
        errors.append(np.abs(np.abs(scaled.shapes) / np.abs(structure().modes().shapes[:, :3]) - 1).max())
    assert errors[1] < 0.02
    assert errors[0] < 0.6 * errors[1]


def test_a_mode_that_the_masses_do_not_lower_is_left_out():
    before, after = unscaled(structure().modes()), structure(ADDED).modes()
    f = np.where(np.arange(5) == 1, 1.001 * before.frequencies, after.frequencies)
    odd = ms.ModalModel(poles=after.poles * f / after.frequencies, shapes=after.shapes, output_dofs=LABELS)
    scaled = ms.scale_by_mass(before, odd, ADDED)
    assert len(scaled) == 4
    assert "did not move as a mass moves it" in scaled.left_out[-1].reason


def test_the_deviation_of_a_modal_mass_is_that_of_the_difference_of_squares():
    before, after = structure().modes(), structure(ADDED).modes()
    std = 1e-4 * np.ones(5)
    known = [
        ms.ModalModel(poles=m.poles, shapes=m.shapes, output_dofs=LABELS, frequencies_std=std) for m in (before, after)
    ]
    scaled = ms.scale_by_mass(known[0], known[1], ADDED)
    f, g = before.frequencies[0], after.frequencies[0]
    expected = 2 * std[0] * np.hypot(f, g) / (f**2 - g**2)
    assert f"{100 * expected:.2g} % at {f:.5g} Hz" in str(scaled.notes[-1])


@pytest.mark.slow
def test_ambient_records_of_both_structures_give_modal_masses():
    options = {"inputs": "ambient", "samples": 60_000, "sampling_rate": 20.0, "noise": 0.01}
    found = [ms.analyze(s.simulate(**options, seed=k)).modes for k, s in enumerate((structure(), structure(ADDED)))]
    scaled = ms.scale_by_mass(*found, ADDED)
    exact = structure().modes()
    pairs = ms.pair_modes(exact, scaled)
    ratio = np.linalg.norm(scaled.shapes[:, pairs.second], axis=0) / np.linalg.norm(
        exact.shapes[:, pairs.first], axis=0
    )
    # in 3000 s frequencies scatter by .05 %, where the masses change them by 1 to 4 %
    assert len(ratio) >= 4
    assert ratio == pytest.approx(1, abs=0.12)


@pytest.mark.parametrize(
    ("masses", "text"),
    [({}, "none is given"), ({"9:+X": 1.0}, "mass at '9:\\+X'"), ({"1:+X": np.nan}, "the mass at 1:\\+X")],
)
def test_masses_that_say_nothing_are_refused(masses, text):
    with pytest.raises(DataError, match=text):
        ms.scale_by_mass(structure().modes(), structure(ADDED).modes(), masses)
