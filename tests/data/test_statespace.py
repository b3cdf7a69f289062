"""State-space models: exact sampling, change of coordinates, responses and simulation (Eqs. 1-16)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import given, settings, strategies as st
from scipy import signal
from scipy.integrate import quad_vec

import modalscope as ms
from modalscope.data import DataError, Signals, StateSpace
from modalscope.systems import chain5
from tests.support import EPS, FIVE, match_poles, random_system, random_systems, refused, relative

#: Two exact routes of matrices of 24 states and poles of like size: their order times rounding, with two digits to spare.
ROUNDING = 24 * 100 * EPS

quick = settings(max_examples=25, deadline=None)


@pytest.mark.parametrize("input", ["held", "dirac"])
@given(model=random_systems(sampled=False))
@quick
def test_sampling_and_back_is_the_identity(model: StateSpace, input: str) -> None:
    back = model.to_discrete(1.0, input).to_continuous(input)
    # heavily damped fast poles leave exp(-2 pi .45 .3) of themselves in a sample, and eigenvectors of close ones cost digits
    assert relative(back.A, model.A) < 1e-9
    assert relative(back.B, model.B) < 1e-9


@given(model=random_systems(sampled=False))
@quick
def test_sampled_poles_are_exponentials_of_the_continuous_ones(model: StateSpace) -> None:
    sampled = model.to_discrete(0.7)
    match = match_poles(sampled.continuous_poles, model.poles)
    assert match.frequency_error < ROUNDING
    # a ratio down to .1 % is a thousandth of the pole
    assert match.damping_error < 1e3 * ROUNDING


def test_held_input_matrix_is_the_integral_of_the_exponential_also_for_a_rigid_body() -> None:
    model = StateSpace(A=[[0, 1, 0], [0, 0, 0], [0, 0, -3]], B=[[0], [2], [1]], C=[[1, 0, 0]])
    dt = 0.3
    integral = quad_vec(lambda t: sla.expm(model.A * t) @ model.B, 0, dt, epsrel=1e-13)[0]
    np.testing.assert_allclose(model.to_discrete(dt).B, integral, atol=1e-14)
    closed = [[2 * dt**2 / 2], [2 * dt], [(1 - np.exp(-3 * dt)) / 3]]  # a double integrator and a lag
    np.testing.assert_allclose(model.to_discrete(dt).B, closed, atol=1e-15)


def test_double_integrator_and_critical_damping_come_back_from_sampling() -> None:
    for A in ([[0, 1], [0, 0]], [[0, 1], [-400, -40]]):
        model = StateSpace(A=A, B=[[0], [1]], C=[[1, 0]])
        back = model.to_discrete(0.05).to_continuous()
        # A has entries up to 400 and a defective pole: ten digits of the largest entry
        np.testing.assert_allclose(back.A, model.A, atol=1e-10 * max(1, np.abs(model.A).max()))
        np.testing.assert_allclose(back.B, model.B, atol=1e-12)


def test_held_and_dirac_inputs_differ_by_the_third_power_of_the_step() -> None:
    # erratum to Eq. 8: B held = dt A^(1/2) B dirac + O(dt^3), while B held = B dirac is off by its whole size
    model = FIVE["chain5"]().state_space()
    errors = []
    for dt in (0.002, 0.001):
        held, dirac = model.to_discrete(dt), model.to_discrete(dt, "dirac")
        half = sla.expm(model.A * dt / 2)
        errors.append(float(np.linalg.norm(held.B - dt * half @ dirac.B)))
    assert abs(errors[0] / errors[1] - 8) < 0.1  # the next power is felt by (w dt)^2, w up to 38 rad/s


def test_pulse_response_is_the_markov_sequence_one_sample_late() -> None:
    # erratum to Eqs. 9-11: u(0) = 1 gives y(0) = D and y(k) = C A^(k-1) B
    model = FIVE["chain5"]().state_space(quantity="acceleration", dt=0.05)
    pulse = np.zeros((40, 2))
    pulse[0, 1] = 1
    y, Y = model.simulate(pulse), model.markov_parameters(39)
    np.testing.assert_array_equal(y[0], model.D[:, 1])
    np.testing.assert_allclose(y[1:], Y[:, :, 1], atol=1e-14)


@given(model=random_systems(direct=True), seed=st.integers(0, 1000))
@quick
def test_responses_do_not_depend_on_the_coordinates(model: StateSpace, seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = np.linalg.qr(rng.standard_normal(model.A.shape))[0] * rng.uniform(0.5, 2, model.order)
    other = model.transformed(T)
    assert relative(other.markov_parameters(40), model.markov_parameters(40)) < ROUNDING
    assert relative(other.transfer(np.exp(1j)), model.transfer(np.exp(1j))) < 1e2 * ROUNDING
    assert match_poles(other.continuous_poles, model.continuous_poles).frequency_error < 1e2 * ROUNDING


@given(model=random_systems(direct=True))
@quick
def test_transfer_function_is_the_sum_of_the_markov_parameters(model: StateSpace) -> None:
    z = 1.5 * np.exp(
        1j * np.array([0.1, 1.0, 3.0])
    )  # outside the circle the series converges: 1.5^-120 is below rounding
    Y = model.markov_parameters(120)
    series = model.D + np.einsum("pk,kab->pab", z[:, None] ** -(np.arange(120) + 1), Y)
    assert relative(model.transfer(z), series) < ROUNDING


@given(model=random_systems(sampled=False, direct=True))
@quick
def test_transfer_by_schur_form_is_that_of_the_plain_solve(model: StateSpace) -> None:
    x = 1j * np.linspace(0, 3, 40)
    plain = [model.C @ np.linalg.solve(s * np.eye(model.order) - model.A, model.B) + model.D for s in x]
    # near a pole of .1 % damping the solve amplifies rounding by a thousand
    assert relative(model.transfer(x), np.array(plain)) < 1e3 * ROUNDING


@given(model=random_systems(direct=True), samples=st.integers(1, 60), seed=st.integers(0, 1000))
@quick
def test_simulation_is_that_of_scipy_from_any_state(model: StateSpace, samples: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, x0 = rng.standard_normal((samples, model.B.shape[1])), rng.standard_normal(model.order)
    other = signal.dlsim(model.to_scipy(), u, x0=x0)[1]
    np.testing.assert_allclose(model.simulate(u, x0), other, atol=1e-12 * max(1, np.abs(other).max()))


def test_a_free_decay_is_the_simulation_without_input() -> None:
    structure = FIVE["heavy4"]()
    model = structure.state_space(dt=0.05)
    x0 = np.r_[np.zeros(4), np.ones(4)]
    free = structure.free_decay(30, velocity=np.ones(4))
    np.testing.assert_allclose(model.simulate(np.zeros((30, 2)), x0), free.values[:, :, 0], atol=1e-15)


def test_scipy_and_control_models_are_the_same_model() -> None:
    pytest.importorskip("control")
    for model in (
        random_system(np.random.default_rng(0), sampled=False),
        random_system(np.random.default_rng(1), direct=True),
    ):
        for other in (model.to_scipy(), model.to_control()):
            for name in "ABCD":
                np.testing.assert_array_equal(getattr(other, name), getattr(model, name))
            assert (other.dt or None) == model.dt
        f = np.linspace(0.01, 0.4, 5)
        points = 2j * np.pi * f if model.dt is None else np.exp(2j * np.pi * f)
        theirs = np.stack([np.atleast_2d(model.to_control()(p, squeeze=False)) for p in points])
        assert relative(model.frequency_response(f).values, theirs.reshape(5, *model.D.shape)) < 1e3 * ROUNDING


def test_a_pole_on_the_negative_real_axis_has_no_continuous_model() -> None:
    model = StateSpace(A=[[-0.5, 0], [0, 0.9]], B=[[1], [1]], C=[[1, 1]], dt=0.1)
    with pytest.raises(DataError, match=r"1 poles of the sampled one lie on the real axis at or below zero \(-0.5\)"):
        model.to_continuous()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: StateSpace(A=[[1, 2]], B=[[1]], C=[[1]]), r"the shapes are A \(1, 2\)"),
        (lambda: StateSpace(A=[[np.inf]], B=[[1]], C=[[1]]), "A needs finite numbers, but 1 of 1 values"),
        (lambda: StateSpace(A=[[1j]], B=[[1]], C=[[1]]), "A needs real numbers, but it is complex"),
        (lambda: StateSpace(A=[[1]], B=[[1]], C=[[1]], dt=-1), "dt needs a positive number, but it is -1"),
        (lambda: _one().to_discrete(0.1, "ramp"), "input='ramp': there are only held, dirac"),
        (lambda: _one().markov_parameters(3), r"this one is continuous.*\nCall to_discrete\(dt\) first"),
        (lambda: _one().to_discrete(0.1).to_discrete(0.1), r"Call to_continuous\(\) first"),
        (lambda: _one().transfer(-1.0), "at a pole: it is infinite"),
        (lambda: _one().transformed([[0.0]]), "singular"),
        (lambda: _one().to_discrete(0.1).simulate(np.ones((3, 2))), "the model has 1 inputs, but there are 2"),
        (lambda: _one().to_discrete(0.1).simulate(np.ones((3, 1)), [1, 2]), "initial needs 1 entries, but it has 2"),
        (lambda: _one().to_discrete(0.1).impulse_response(0), "samples needs a whole number of at least 1"),
    ],
)
def test_what_a_model_cannot_do_it_refuses_by_name(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DataError, match=message):
        call()


def _one() -> StateSpace:
    return StateSpace(A=[[-1.0]], B=[[1.0]], C=[[1.0]])


def innovations_form(seed=0):
    model = random_system(np.random.default_rng(seed), outputs=2, inputs=1, modes=2, damping=(0.05, 0.2), direct=True)
    gain = 0.2 * np.random.default_rng(seed).standard_normal((4, 2))
    return StateSpace(A=model.A, B=model.B, C=model.C, D=model.D, dt=1.0, gain=gain, innovation_covariance=np.eye(2))


def test_predictions_follow_the_recursion_and_their_errors_are_the_innovations():
    model, rng = innovations_form(), np.random.default_rng(1)
    u, e = rng.standard_normal((2, 60, 1)), rng.standard_normal((2, 60, 2))
    y, x0 = np.zeros((2, 60, 2)), rng.standard_normal(4)
    for r in range(2):
        x = x0
        for k in range(60):
            y[r, k] = model.C @ x + model.D @ u[r, k] + e[r, k]
            x = model.A @ x + model.B @ u[r, k] + model.gain @ e[r, k]
    record = Signals(outputs=y, inputs=u, sampling_rate=1.0)
    assert np.allclose(y - model.predict(record, x0), e, atol=1e-10)
    one = Signals(outputs=y[0], inputs=u[0], sampling_rate=1.0)
    assert np.allclose(model.predict(one, initial=x0), model.predict(record, x0)[0])


def test_a_gain_goes_along_with_the_states():
    model, rng = innovations_form(), np.random.default_rng(2)
    record = Signals(outputs=rng.standard_normal((40, 2)), inputs=rng.standard_normal((40, 1)), sampling_rate=1.0)
    for other in (model.transformed(rng.standard_normal((4, 4)) + 3 * np.eye(4)), model.modal_form().state_space):
        assert np.allclose(other.predict(record), model.predict(record), atol=1e-9)
        assert other.innovation_covariance is model.innovation_covariance


def test_predictions_need_a_gain_and_the_models_channels():
    model = innovations_form()
    bare = StateSpace(A=model.A, B=model.B, C=model.C, D=model.D, dt=1.0)
    record = Signals(outputs=np.ones((9, 2)), inputs=np.ones((9, 1)), sampling_rate=1.0)
    refused("need the gain of the innovations", bare.predict, record)
    refused("at 2 Hz", model.predict, Signals(outputs=np.ones((9, 2)), inputs=np.ones((9, 1)), sampling_rate=2.0))
    refused(
        "has 1 outputs and 1 inputs",
        model.predict,
        Signals(outputs=np.ones((9, 1)), inputs=np.ones((9, 1)), sampling_rate=1.0),
    )
    refused(r"gain needs shape \(4, 2\)", StateSpace, A=model.A, B=model.B, C=model.C, dt=1.0, gain=np.ones((2, 4)))
    refused("is continuous", StateSpace, A=model.A, B=model.B, C=model.C, gain=np.ones((4, 2)))


def test_names_and_units_of_channels_travel_with_a_model(tmp_path: Path) -> None:
    record = chain5().simulate(inputs="white", samples=1500, sampling_rate=20.0, noise=0.02, seed=1)
    model = ms.realize(record, order=10, holdout=0)
    assert model.names == {
        "output_dofs": record.output_dofs,
        "input_dofs": record.input_dofs,
        "output_units": record.units[0],
        "input_units": record.units[1],
    }
    assert model.to_continuous().names == model.names
    for suffix in (".mat", ".npz", ".json"):
        ms.write(tmp_path / f"model{suffix}", model)
        again = ms.read(tmp_path / f"model{suffix}")
        assert isinstance(again, ms.StateSpace)
        assert again.names == model.names
    with pytest.raises(DataError, match="output_dofs needs one text for each of 4, but 3 are given"):
        replace(model, output_dofs=("a", "b", "c"))


def test_signals_of_python_control_are_named_after_the_channels() -> None:
    pytest.importorskip("control")
    model = StateSpace(A=[[0.5]], B=[[1.0]], C=[[1.0]], dt=0.1, output_dofs=("1.2:+Z",), input_dofs=("hammer",))
    assert (model.to_control().output_labels, model.to_control().input_labels) == (["1_2:+Z"], ["hammer"])
