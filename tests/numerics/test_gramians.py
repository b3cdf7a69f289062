"""Controllability, observability, Gramians and balancing."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import given, settings, strategies as st
from scipy.integrate import quad_vec

from modalscope import systems
from modalscope.data import DataError, StateSpace
from tests.support import EPS, FIVE, random_system, random_systems, relative

quick = settings(max_examples=20, deadline=None)

#: A Gramian sums 1 / (1 - |z|^2) terms: damping of .1 % at .02 of the sampling rate makes that 4e3, and rounding follows it.
GRAMIAN = 1e6 * EPS


@given(model=random_systems(), blocks=st.integers(1, 9))
@quick
def test_observability_times_controllability_is_the_hankel_matrix(model: StateSpace, blocks: int) -> None:
    Y = model.markov_parameters(2 * blocks)
    hankel = np.block([[Y[i + j] for j in range(blocks)] for i in range(blocks)])  # Eq. 17
    product = model.observability_matrix(blocks) @ model.controllability_matrix(blocks)
    np.testing.assert_allclose(product, hankel, atol=1e-12 * np.abs(hankel).max())


def test_three_blocks_show_all_ten_states_of_chain5() -> None:
    # sufficient is as many blocks as states, necessary only the observability index (erratum to the text after Eq. 17)
    model = FIVE["chain5"]().state_space(dt=0.05)
    assert np.linalg.matrix_rank(model.observability_matrix(3)) == 10
    assert np.linalg.matrix_rank(model.observability_matrix(2)) == 8


@pytest.mark.parametrize("sampled", [True, False])
@given(seed=st.integers(0, 10_000))
@quick
def test_gramians_solve_lyapunov_equations(sampled: bool, seed: int) -> None:
    model = random_system(np.random.default_rng(seed), sampled=sampled)
    P, Q = model.controllability_gramian(), model.observability_gramian()
    if sampled:
        rest = [model.A @ P @ model.A.T - P + model.B @ model.B.T, model.A.T @ Q @ model.A - Q + model.C.T @ model.C]
    else:
        rest = [model.A @ P + P @ model.A.T + model.B @ model.B.T, model.A.T @ Q + Q @ model.A + model.C.T @ model.C]
    for residual, gramian in zip(rest, (P, Q), strict=True):
        assert np.linalg.norm(residual) < GRAMIAN * np.linalg.norm(gramian)


def test_gramian_over_samples_is_the_sum_and_grows_to_that_over_all_time() -> None:
    model = FIVE["heavy4"]().state_space(dt=0.05)
    W = model.controllability_matrix(37)
    assert relative(model.controllability_gramian(37), W @ W.T) < GRAMIAN
    # the slowest pole, 1 % at 1.1 Hz, leaves exp(-2 * .0695 * .05 * 10000) = 1e-30
    assert relative(model.observability_gramian(10_000), model.observability_gramian()) < GRAMIAN


def test_gramian_over_seconds_is_the_integral_also_of_an_unstable_model() -> None:
    model = StateSpace(A=[[0.3, 1, 0], [0, -2, 4], [0, -4, -2]], B=[[0], [1], [2]], C=[[1, 0, 0]])
    horizon = 1.7
    integral = quad_vec(
        lambda t: sla.expm(model.A * t) @ model.B @ model.B.T @ sla.expm(model.A.T * t), 0, horizon, epsrel=1e-13
    )[0]
    np.testing.assert_allclose(model.controllability_gramian(horizon), integral, rtol=1e-11)


def test_single_mode_has_the_textbook_gramian() -> None:
    w, zeta = 10.0, 0.02
    model = StateSpace(A=[[0, 1], [-(w**2), -2 * zeta * w]], B=[[0], [1]], C=[[1, 0]])
    # variance of displacement and velocity under unit white noise: 1 / (4 zeta w^3) and 1 / (4 zeta w)
    expected = np.diag([1 / (4 * zeta * w**3), 1 / (4 * zeta * w)])
    np.testing.assert_allclose(model.controllability_gramian(), expected, atol=1e-12)


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize("name", FIVE)
def test_balanced_model_has_equal_diagonal_gramians_and_the_same_response(name: str, sampled: bool) -> None:
    structure = FIVE[name]()
    model = structure.state_space(dt=structure.dt if sampled else None)
    balanced = model.balanced()
    d = np.diag(balanced.hankel_singular_values)
    assert relative(balanced.state_space.controllability_gramian(), d) < GRAMIAN
    assert relative(balanced.state_space.observability_gramian(), d) < GRAMIAN
    f = np.linspace(0.1, 9, 40)
    response = model.frequency_response(f).values
    assert relative(balanced.state_space.frequency_response(f).values, response) < GRAMIAN
    assert balanced.error_bound == 0
    np.testing.assert_allclose(balanced.inverse @ balanced.T, np.eye(model.order), atol=GRAMIAN)


def test_hankel_singular_values_are_those_of_the_long_hankel_matrix() -> None:
    model = FIVE["heavy4"]().state_space(dt=0.05)
    # H = V W of 1500 blocks; the slowest mode, 1 % at 1.1 Hz, has then come down to exp(-.0695 * .05 * 1500) = .5 %
    triangles = [np.linalg.qr(V)[1] for V in (model.observability_matrix(1500), model.controllability_matrix(1500).T)]
    d = np.linalg.svd(triangles[0] @ triangles[1].T, compute_uv=False)
    # what is left out is the square of that
    np.testing.assert_allclose(model.balanced().hankel_singular_values, d, rtol=1e-4)


@pytest.mark.parametrize("steady_state", [False, True])
@pytest.mark.parametrize("sampled", [False, True])
@given(seed=st.integers(0, 10_000), share=st.floats(0.1, 0.9))
@settings(max_examples=8, deadline=None)
def test_truncation_stays_within_twice_the_dropped_singular_values(
    sampled: bool, steady_state: bool, seed: int, share: float
) -> None:
    model = random_system(np.random.default_rng(seed), sampled=sampled, direct=True)
    kept = max(1, int(share * model.order))
    cut = model.balanced(kept, steady_state=steady_state)
    f = np.linspace(0, 0.5, 400)
    error = model.frequency_response(f).values - cut.state_space.frequency_response(f).values
    worst = np.linalg.svd(error, compute_uv=False).max()
    assert cut.error_bound == pytest.approx(2 * cut.hankel_singular_values[kept:].sum())
    assert worst <= cut.error_bound * (1 + 1e-6) + GRAMIAN * cut.hankel_singular_values[0]
    assert np.all(np.abs(cut.state_space.poles) < 1) if sampled else np.all(cut.state_space.poles.real < 0)


def test_steady_state_truncation_keeps_the_gain_at_0_hz_and_the_plain_one_the_first_instant() -> None:
    model = FIVE["chain5"]().state_space(quantity="acceleration")
    steady, plain = model.balanced(6, steady_state=True).state_space, model.balanced(6).state_space
    gain = model.transfer(0.0)
    # accelerations have no gain at 0 Hz: against the largest entry of D
    np.testing.assert_allclose(steady.transfer(0.0), gain, atol=1e-10)
    assert np.abs(plain.transfer(0.0) - gain).max() > 1e-6
    np.testing.assert_array_equal(plain.D, model.D)


def test_states_that_are_not_seen_are_left_out_of_the_balanced_model() -> None:
    fixed = systems.chain([1, 1, 1], [100, 100, 100, 100], damping_ratios=0.02)
    model = fixed.state_space(outputs=[1], inputs=[0])
    balanced = model.balanced()
    assert balanced.state_space.order == 4
    f = np.linspace(0.1, 5, 30)
    assert relative(balanced.state_space.frequency_response(f).values, model.frequency_response(f).values) < GRAMIAN
    with pytest.raises(DataError, match=r"order 5: 4 states are both observable"):
        model.balanced(5)


def test_small_hankel_singular_values_keep_their_digits() -> None:
    # modes far apart barely mix, and the weak one stands 1e-16 below the strong one: out of reach of a squared Gramian
    small = 1e-8
    model = StateSpace(
        A=sla.block_diag([[-0.1, 10], [-10, -0.1]], [[-0.1, 1000], [-1000, -0.1]]),
        B=[[1], [0], [small], [0]],
        C=[[1, 0, small, 0]],
    )
    d = model.balanced().hankel_singular_values
    # a light mode has the pair |c| |b| / (4 decay), to the order of decay / w
    np.testing.assert_allclose(d[:2], 2.5, rtol=0.02)
    np.testing.assert_allclose(d[2:], 2.5 * small**2, rtol=0.02)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.controllability_gramian(), "needs poles that decay, but 1 pole"),
        (lambda m: m.balanced(), "do not decay"),
        (lambda m: m.to_discrete(0.1).controllability_gramian(2.5), "horizon of whole samples: it is 2.5"),
        (lambda m: m.controllability_gramian(-1.0), "horizon needs a positive number"),
        (lambda m: m.observability_matrix(0), "blocks needs a whole number of at least 1"),
    ],
)
def test_gramians_of_growing_models_need_a_horizon(call, message: str) -> None:  # type: ignore[no-untyped-def]
    growing = StateSpace(A=[[0.5]], B=[[1.0]], C=[[1.0]])
    with pytest.raises(DataError, match=message):
        call(growing)
