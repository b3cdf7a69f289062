"""Structures: closed forms, two routes to every response, and the published numbers."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import systems
from modalscope.data import DataError
from tests.support import EPS, FIVE, match_poles, relative

QUANTITIES = ("displacement", "velocity", "acceleration")


#: Responses by two routes differ by rounding times the ratio of the stiffest to the softest pole, below 1e3 here.
ROUNDING = 1e4 * EPS


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
def test_modes_state_space_and_dynamic_stiffness_give_one_frequency_response(name: str, quantity: str) -> None:
    structure, f = FIVE[name](), np.linspace(0.2, 9, 60)
    expected = structure.frequency_response(f, quantity=quantity)
    model = structure.state_space(quantity=quantity).frequency_response(f)
    modal = structure.modes(quantity=quantity).frequency_response(f)
    assert relative(model.values, expected.values) < ROUNDING
    assert relative(modal.values, expected.values) < ROUNDING
    assert modal.output_dofs == expected.output_dofs
    assert modal.quantity == quantity


@pytest.mark.parametrize("name", FIVE)
def test_poles_of_the_modes_are_those_of_the_state_space_model(name: str) -> None:
    structure = FIVE[name]()
    match = match_poles(structure.state_space().poles, structure.modes().poles)
    # damping ratios down to .25 %: 400 times the rounding of a pole
    assert match.frequency_error < ROUNDING
    assert match.damping_error < 1e2 * ROUNDING


def test_free_decay_from_a_displacement_is_the_sum_of_its_modes() -> None:
    structure = systems.chain([2.0], [200.0], [0.8], dt=0.01)
    decay = structure.free_decay(50, displacement=[0.3])
    t, w, zeta = np.arange(50) * 0.01, 10.0, 0.02
    wd = w * np.sqrt(1 - zeta**2)
    exact = 0.3 * np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))
    np.testing.assert_allclose(decay.values[:, 0, 0], exact, atol=1e-13)


def test_rigid_motion_stands_in_the_lower_residual() -> None:
    free = systems.Structure(mass=np.diag([1.0, 2.0]), stiffness=[[8, -8], [-8, 8]], damping=[[0.1, -0.1], [-0.1, 0.1]])  # type: ignore[arg-type]
    f = np.linspace(0.1, 2, 20)
    for quantity in QUANTITIES:
        modes = free.modes(quantity=quantity)
        assert len(modes) == 1
        expected = free.frequency_response(f, quantity=quantity)
        assert relative(modes.frequency_response(f).values, expected.values) < ROUNDING


def test_critical_damping_is_refused_by_name() -> None:
    critical = systems.chain([1.0], [100.0], [20.0])
    with pytest.raises(DataError, match="repeated without an eigenvector"):
        critical.modes()
    blocks = critical.state_space().modal_form().blocks
    assert [block.separate for block in blocks] == [False]


def test_repeated_modes_under_coupled_damping_keep_their_residues() -> None:
    # two equal oscillators coupled through a damper only: repeated frequencies that classical shapes must be turned for
    damping = np.array([[0.5, -0.3], [-0.3, 0.5]])
    twins = systems.Structure(mass=np.eye(2), stiffness=100 * np.eye(2), damping=damping)
    f = np.linspace(0.5, 3, 30)
    assert relative(twins.modes().frequency_response(f).values, twins.frequency_response(f).values) < ROUNDING
    np.testing.assert_allclose(np.sort(twins.modes().damping_ratios), [0.01, 0.04], rtol=1e-12)


@pytest.mark.parametrize("input", ["held", "dirac"])
def test_impulse_response_says_what_its_input_was(input: str) -> None:
    structure = systems.chain5()
    response = structure.impulse_response(30, quantity="acceleration", input=input)
    assert response.kind == {"held": "pulse", "dirac": "dirac"}[input]
    assert (response.feedthrough is None) == (input == "dirac")
    assert response.sampling_rate == 20
    assert response.units == (("m/s2",) * 4, ("N",) * 2)


def test_channels_are_chosen_by_label_or_number_and_appear_in_that_order() -> None:
    structure = systems.chain5()
    by_label = structure.frequency_response([1.0, 2.0], outputs=["5:+X", "1:+X"], inputs="3:+X")
    by_number = structure.frequency_response([1.0, 2.0], outputs=[4, 0], inputs=[2])
    np.testing.assert_array_equal(by_label.values, by_number.values)
    assert by_label.output_dofs == ("5:+X", "1:+X")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass": [[1, 0], [0, -1]]}, "mass needs a positive definite matrix"),
        ({"stiffness": [[1, 2], [3, 4]]}, "stiffness needs a symmetric matrix"),
        ({"stiffness": [[1]]}, r"stiffness needs shape \(2, 2\), but it has \(1, 1\)"),
        ({"damping": [[np.nan, 0], [0, 1]]}, "damping needs finite numbers"),
        ({"outputs": [2]}, "output '2'"),
        ({"dofs": ["1:X", "1:X"]}, "dofs needs different labels"),
        ({"dt": 0}, "dt needs a positive number"),
    ],
)
def test_structures_that_do_not_fit_are_refused(change: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(DataError, match=message):
        systems.Structure(**{"mass": np.eye(2), "stiffness": np.eye(2), **change})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.state_space(quantity="force"), "quantity='force'"),
        (lambda s: s.modes(outputs=["9:+X"]), "output '9:\\+X'"),
        (lambda s: s.impulse_response(10), "chain has no sampling interval.*\nGive sampling_rate"),
        (lambda s: s.free_decay(10, velocity=[1], sampling_rate=10), "velocity needs 2 entries"),
        (lambda s: s.frequency_response([1.0], noise=-1), "noise needs a fraction"),
        (lambda s: s.simulate(sampling_rate=10), "a record needs a length"),
        (lambda s: s.simulate(samples=10, inputs="pink", sampling_rate=10), "inputs='pink'"),
        (lambda s: s.simulate(inputs=np.ones((9, 1)), sampling_rate=10), "inputs has 1 columns"),
        (
            lambda s: s.simulate(inputs=np.ones((9, 2)), samples=5, sampling_rate=10),
            "the forces have samples=9, runs=1",
        ),
        (lambda s: s.simulate(inputs="ambient", samples=9, sampling_rate=10), "a stationary start"),
    ],
)
def test_calls_that_cannot_be_met_say_why(call, message: str) -> None:  # type: ignore[no-untyped-def]
    undamped = systems.chain([1, 1], [10, 10])
    with pytest.raises(DataError, match=message):
        call(undamped)


def test_an_undamped_structure_at_resonance_has_no_response() -> None:
    single = systems.chain([1.0], [(2 * np.pi) ** 2])
    with pytest.raises(DataError, match="frequency response at 1 Hz: the structure has an undamped pole there"):
        single.frequency_response([1.0])


def test_modal_damping_gives_every_mode_its_ratio_or_refuses_another_number_of_them() -> None:
    M, K = np.diag([1.0, 2.0]), np.array([[30.0, -10.0], [-10.0, 10.0]])
    for ratios in (0.02, [0.01, 0.03]):
        D = systems.modal_damping(M, K, ratios)
        w, Phi = np.linalg.eig(np.linalg.solve(M, K))
        first = np.argsort(w)
        modal = np.diag(Phi.T @ D @ Phi)[first] / np.diag(Phi.T @ M @ Phi)[first]
        assert np.allclose(modal / (2 * np.sqrt(w[first])), ratios, rtol=1e-10)
    with pytest.raises(DataError, match=r"damping ratios of 2 modes: their shape is \(3,\)"):
        systems.modal_damping(M, K, [0.01, 0.02, 0.03])
