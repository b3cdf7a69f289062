"""Balanced models: their Gramians, their Hankel singular values, and what truncation costs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import given, settings, strategies as st

from modalscope import systems
from modalscope.data import DataError, StateSpace
from modalscope.numerics.checks import RealArray
from tests.support import EPS, FIVE, random_system, relative

quick = settings(max_examples=20, deadline=None)

#: A Gramian sums 1 / (1 - |z|^2) terms: damping of .1 % at .02 of the sampling rate makes that 4e3, and rounding follows it.
GRAMIAN = 1e6 * EPS


def _gramian(A: RealArray, B: RealArray, sampled: bool) -> RealArray:
    """Return the Gramian over all time, by Lyapunov's equation."""
    solve = sla.solve_discrete_lyapunov if sampled else sla.solve_continuous_lyapunov
    return np.asarray(solve(A, B @ B.T if sampled else -B @ B.T))


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize("name", FIVE)
def test_balanced_model_has_equal_diagonal_gramians_and_the_same_response(name: str, sampled: bool) -> None:
    structure = FIVE[name]()
    model = structure.state_space(dt=structure.dt if sampled else None)
    balanced = model.balanced()
    d = np.diag(balanced.hankel_singular_values)
    assert relative(_gramian(balanced.state_space.A, balanced.state_space.B, sampled), d) < GRAMIAN
    assert relative(_gramian(balanced.state_space.A.T, balanced.state_space.C.T, sampled), d) < GRAMIAN
    f = np.linspace(0.1, 9, 40)
    response = model.frequency_response(f).values
    assert relative(balanced.state_space.frequency_response(f).values, response) < GRAMIAN
    assert balanced.error_bound == 0
    np.testing.assert_allclose(balanced.inverse @ balanced.T, np.eye(model.order), atol=GRAMIAN)


def test_hankel_singular_values_are_those_of_the_long_hankel_matrix() -> None:
    model = FIVE["heavy4"]().state_space(dt=0.05)
    # H = V W of 1500 blocks; the slowest mode, 1 % at 1.1 Hz, has then come down to exp(-.0695 * .05 * 1500) = .5 %
    powers = [model.C, *(model.C @ np.linalg.matrix_power(model.A, k) for k in range(1, 1500))]
    states = [model.B, *(np.linalg.matrix_power(model.A, k) @ model.B for k in range(1, 1500))]
    triangles = [np.linalg.qr(np.vstack(V))[1] for V in (powers, [state.T for state in states])]
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


def test_a_model_whose_poles_do_not_decay_is_not_balanced() -> None:
    growing = StateSpace(A=[[0.5]], B=[[1.0]], C=[[1.0]])
    with pytest.raises(DataError, match="needs poles that decay, but 1 poles do not decay"):
        growing.balanced()
