"""Refinement in the whole job: better where the data allow it, and a reason where they do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow import refining
from modalscope.analysis.workflow.refining import _with_others
from modalscope.selection.judging.grades import grades
from modalscope.selection.judging.refine import Refinement, refinement
from modalscope.selection.likelihood.descent import Astray
from modalscope.selection.likelihood.settling import needed_beside
from modalscope.systems import chain5
from tests.support import FIVE, add_noise, match_poles

ORDERS = range(8, 25, 4)


def told(modes: ms.ModalModel, kind: str) -> str:
    return " ".join(str(note) for note in modes.notes if note.kind == kind)


@pytest.mark.parametrize("kind", ["samples", "lines"])
def test_real_poles_take_part_so_that_the_modes_need_not_make_up_for_them(kind):
    """Two overdamped modes are in no list; without them a refinement would drive a mode away, in frequency or in damping."""
    structure = FIVE["over4"]()
    clean = (
        structure.impulse_response(400) if kind == "samples" else structure.frequency_response(np.linspace(0.3, 8, 340))
    )
    truth = structure.modes()
    oscillating = truth.poles[np.array([k == "mode" for k in truth.kinds])]
    found = ms.analyze(add_noise(clean, 40, 3), orders=ORDERS).modes
    assert found.converged
    below = 2 if kind == "lines" else 0  # poles that stand for modes below the band
    assert f"{2 + below} computational poles kept fixed" in told(found, "held")
    # the bound at 40 dB is 1e-4 to 3e-4 of |s|
    assert match_poles(found.poles, oscillating).frequency_error < 1e-3
    assert max(match_poles(ms.refine(add_noise(clean, 40, 3), found.unrefined, fixed=()).poles, oscillating)[:2]) > 0.1


@pytest.mark.slow
def test_no_pole_of_noise_takes_part():
    clean = FIVE["chain5"]().frequency_response(np.linspace(0.3, 8, 340))
    truth = FIVE["chain5"]().modes().poles
    for seed in range(20):
        data = add_noise(clean, 40, seed)
        diagram = ms.stabilize(data, orders=[30])
        assert needed_beside(data, truth, diagram.poles).size == 0


def test_a_mode_that_was_refused_takes_part_all_the_same():
    data = ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)
    whole = ms.analyze(data, orders=ORDERS).modes
    less = ms.analyze(data, refuse=[whole.frequencies[1]], orders=ORDERS).modes
    # the refused pole is held where the diagram has it, not at its optimum
    assert np.all(np.abs(less.frequencies / np.delete(whole.frequencies, 1) - 1) < 1e-3)


def test_correlations_keep_their_values_and_say_why():
    record = ms.systems.chain5().simulate(inputs="ambient", samples=4000, sampling_rate=20.0, seed=0)
    assert not told(ms.analyze(record, orders=ORDERS).modes, "not refined")  # its lines are there
    found = ms.analyze(ms.estimate_correlation(record), orders=ORDERS).modes
    assert len(found)
    assert "errors of correlations are correlated" in told(found, "not refined")
    assert (found.unrefined, found.converged) == (None, None)


def test_samples_in_a_band_keep_their_values_and_say_why():
    data = ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)
    assert "samples are not filtered" in told(ms.analyze(data, band=(0.5, 4), orders=ORDERS).modes, "not refined")


def test_data_that_were_transformed_keep_their_values_and_say_why():
    data = add_noise(ms.systems.chain5().frequency_response(np.linspace(0, 10, 401)), 40)
    found = ms.analyze(data, method="era", domain="time", orders=ORDERS).modes
    assert "the data were transformed" in told(found, "not refined")


def test_an_optimum_far_away_is_not_reported_as_the_mode(monkeypatch):
    """A list that lacks modes, with nothing beside it: the refined values are another mode's."""
    data = add_noise(FIVE["over4"]().frequency_response(np.linspace(0.3, 8, 340)), 40, 5)
    monkeypatch.setattr("modalscope.selection.judging.outcome.needed_beside", lambda *_: np.zeros(0, complex))
    found = ms.analyze(data, orders=ORDERS).modes
    assert "their optimum lies at other modes" in told(found, "not refined")
    assert found.unrefined is None
    assert np.isnan(np.asarray(found.frequencies_std)).all()


def test_modes_that_a_refinement_leaves_out_have_no_values_before_it_either():
    """Of five one is kept as it was, for a stronger neighbour draws it away, and one is left out as no more than noise."""
    data = add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 340)), 40, 3)
    modes = ms.select(ms.stabilize(data))
    assert len(modes) == 5
    found = ms.refine(data, modes.take([0, 1, 3]))
    merged = _with_others(data, modes, found, modes.take([4]), np.zeros(0, complex))
    assert len(merged) == 4
    assert merged.unrefined is not None
    assert np.array_equal(merged.unrefined.poles, modes.poles[[0, 1, 3, 4]])


def _ended_early(found: Refinement) -> Refinement:
    """Return a refinement that ended on the way."""
    assert found.settled is not None
    note = ms.Note("not converged", {}, "Refinement did not converge: 60 iterations were not enough")
    ended = replace(found.settled.descent, converged=False)
    return replace(found, settled=replace(found.settled, descent=ended), notes=[*found.notes, note])


def _wandering(mode: int):
    """Return a refinement which the given mode leaves while it takes part."""

    def refined(data, modes, **options):
        if len(modes) > mode:
            raise Astray(modes.poles[[mode]])
        return refinement(data, modes, **options)

    return refined


def test_a_mode_that_leaves_its_place_leaves_the_others_refined(monkeypatch):
    data = add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 340)), 40, 3)
    whole = ms.analyze(data, orders=ORDERS).modes
    monkeypatch.setattr(refining, "refinement", _wandering(4))
    found = ms.analyze(data, orders=ORDERS).modes
    assert f"Not refined: {found.frequencies[4]:.5g} Hz" in told(found, "not refined")
    assert found.converged
    assert np.allclose(found.frequencies[:4], whole.frequencies[:4], rtol=1e-4)
    assert np.all(found.degrees[:4, 0] > 0)
    # it has no interval, nor deviations of which one could be made; what is not known of its shape takes no levels from the others
    assert not found.degrees[4].any()
    assert np.isnan([found.frequencies_std[4], found.damping_ratios_std[4], *found.shapes_std[:, 4]]).all()
    assert np.isfinite([found.frequencies_std[:4], found.damping_ratios_std[:4], *found.shapes_std[:, :4]]).all()
    assert np.allclose(np.abs(found.shapes), np.abs(whole.shapes), rtol=0.03, atol=0.003)
    assert [grade.word for grade in grades(found)] == ["good"] * 4 + ["doubtful"]


def test_shapes_beside_a_mode_that_left_are_weighted_by_the_noise_of_lines(monkeypatch):
    """Where the noise of half of the lines is 25 times that of the others, fits without weights err five times as much (1 - MAC)."""
    clean, errors, seen = chain5().frequency_response(f := np.linspace(0.3, 8, 340)), list[float](), chain5().modes()
    deviation = 0.01 * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=0)) * np.where(f < 3, 5, 0.2)[:, None, None]
    monkeypatch.setattr(refining, "refinement", _wandering(4))
    for seed in range(4):
        real, imag = np.random.default_rng(seed).standard_normal((2, *clean.values.shape)) * deviation / np.sqrt(2)
        found = ms.analyze(replace(clean, values=clean.values + real + 1j * imag, variance=deviation**2)).modes
        assert told(found, "not refined")
        errors += [1 - ms.mac(found.shapes[:, [k]], seen.shapes[:, [k]])[0, 0] for k in range(4)]
    assert np.mean(errors) < 7e-6


def test_where_no_mode_left_its_place_a_descent_that_did_not_end_refines_none(monkeypatch):
    data = add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 340)), 40, 3)

    monkeypatch.setattr(refining, "refinement", lambda *given, **options: _ended_early(refinement(*given, **options)))
    found = ms.analyze(data, orders=ORDERS).modes
    assert "60 iterations were not enough" in told(found, "not refined")
    assert found.converged is False
    assert {grade.word for grade in grades(found)} == {"look"}


@pytest.mark.slow
def test_deviations_that_are_given_are_not_denied_by_a_note_of_the_diagram() -> None:
    record = chain5().simulate(inputs="white", duration=200, sampling_rate=20.0, seed=0)
    noise = 0.01 * record.outputs.std() * np.random.default_rng(0).standard_normal(record.outputs.shape)
    result = ms.analyze(replace(record, outputs=record.outputs + noise), method="n4sid")
    assert result.modes.frequencies_std is not None
    assert np.all(np.isfinite(result.modes.frequencies_std))
    assert any("withheld" in note.numbers for note in result.diagram.notes)
    assert not any("withheld" in note.numbers for note in result.notes)
    plain = ms.analyze(record, method="n4sid", refine=False)
    assert any("withheld" in note.numbers for note in plain.notes)
