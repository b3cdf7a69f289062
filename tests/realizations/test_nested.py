"""Eigenvalues of a matrix with one row and column more, and of all leading blocks: the same as LAPACK's from the start."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from modalscope import ImpulseResponse, Signals, estimate_correlation
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import prepare
from modalscope.identification.sweep import Sweep
from modalscope.judging.stabilize import stabilize
from modalscope.realizations import nested
from modalscope.realizations.nested import Arrow, NestedEigen, Paired, roots
from modalscope.systems import chain5


def same(found: np.ndarray, expected: np.ndarray, atol: float) -> None:
    """Compare both as sets."""
    assert found.size == expected.size
    distance = np.abs(found[:, None] - expected)
    rows, columns = linear_sum_assignment(distance)
    assert distance[rows, columns].max() < atol


def arrow_of(A: np.ndarray) -> Arrow:
    values, V = np.linalg.eig(A[:-1, :-1])
    above, real = values.imag > 0, values.imag == 0

    def pairs(x: np.ndarray) -> Paired:
        return Paired(x[above].astype(complex), x[real].real)

    b, c = np.linalg.inv(V) @ A[:-1, -1], A[-1, :-1] @ V
    return Arrow(pairs(values), pairs(b), pairs(c), float(A[-1, -1]))


@pytest.mark.parametrize("size", [2, 3, 5, 12, 40])
def test_roots_are_the_eigenvalues_of_the_larger_matrix(size: int) -> None:
    unsettled = 0
    for seed in range(60):
        A = np.random.default_rng([size, seed]).standard_normal((size, size)) / np.sqrt(size)
        found = roots(arrow_of(A))
        if found is None:
            unsettled += 1
            continue
        expected = np.linalg.eigvals(A)
        same(found.values.all, expected, 1e-10)
    assert unsettled <= 1


@pytest.mark.parametrize("coupling", [0.0, 1e-14, 1e-7])
def test_a_pair_that_hardly_moves_keeps_its_digits(coupling: float) -> None:
    """To first order the root is lambda + b c / (lambda - d - the others' part)."""
    lam = np.array([0.9 + 0.3j, 0.2 + 0.6j])
    b, c = np.array([coupling + 0j, 0.5 + 0.2j]), np.array([1 + 0j, 0.4 - 0.3j])
    none = np.zeros(0)
    found = roots(Arrow(Paired(lam, none), Paired(b, none), Paired(c, none), 0.1))
    assert found is not None
    k = int(np.argmin(np.abs(found.values.upper - lam[0])))
    every, w = Paired(lam, none).all, Paired(b, none).all * Paired(c, none).all
    other = np.arange(4) != 0
    expected = w[0] / (lam[0] - 0.1 - np.sum(w[other] / (lam[0] - every[other])))
    np.testing.assert_allclose(1 / found.inverse[k, 0] if coupling else 0, expected, rtol=1e-5)


def test_pairs_meet_on_the_axis_and_leave_it() -> None:
    """[[0, -w, 0], [w, 0, g], [0, -g, 0]] and the like: from a pair to three real roots, and back to a pair."""
    apart = np.array([[0.5, -0.1, 0.0], [0.1, 0.5, 1.0], [0.3, 1.0, 0.0]])
    assert np.all(np.isreal(np.linalg.eigvals(apart)))
    together = np.array([[0.5, 0.0, -1.0], [0.0, 0.4, 1.0], [1.0, -1.0, 0.1]])
    assert not np.all(np.isreal(np.linalg.eigvals(together)))
    for A in (apart, together):
        found = roots(arrow_of(A))
        assert found is not None
        same(found.values.all, np.linalg.eigvals(A), 1e-12)


def test_vectors_of_all_leading_blocks_are_those_of_the_blocks() -> None:
    A = np.random.default_rng(3).standard_normal((70, 70)) / np.sqrt(70)
    own = NestedEigen(A)
    for n in range(1, 71):
        eigen = own.eigen(n)
        assert eigen is not None
        np.testing.assert_allclose(A[:n, :n] @ eigen.vectors, eigen.vectors * eigen.values, atol=1e-9)
        np.testing.assert_allclose(eigen.left @ eigen.vectors, np.eye(n), atol=1e-8)
        np.testing.assert_allclose(np.linalg.norm(eigen.vectors, axis=0), 1)


def test_few_blocks_are_solved_from_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that are asked to be, and where roots do not settle: of random matrices one in some hundreds."""
    made: list[int] = []
    directly = nested._directly
    monkeypatch.setattr(nested, "_directly", lambda A: made.append(len(A)) or directly(A))
    own = NestedEigen(np.random.default_rng(3).standard_normal((70, 70)) / np.sqrt(70))
    for n in range(1, 71):
        own.eigen(n)
    assert set(made) >= {1, 1 + nested._ANEW}
    assert len(made) <= 5


def test_an_order_is_the_same_whichever_were_asked_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nested, "_ANEW", 8)
    A = np.random.default_rng(4).standard_normal((30, 30))
    in_turn, alone = NestedEigen(A), NestedEigen(A)
    found = {n: in_turn.eigen(n) for n in range(1, 31)}
    for n in (25, 7, 30, 12, 13, 12):
        one, other = alone.eigen(n), found[n]
        assert one is not None
        assert other is not None
        np.testing.assert_array_equal(one.values, other.values)
        np.testing.assert_array_equal(one.left, other.left)


def test_vectors_that_are_lost_are_left_to_others() -> None:
    """A defective block has no inverse of its vectors: LAPACK's way to the model says what to do."""
    A = np.eye(3) + np.diag([1.0, 1.0], 1)
    assert NestedEigen(A).eigen(3) is None


def test_what_is_not_exact_enough_is_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    A = np.random.default_rng(5).standard_normal((20, 20))
    expected = NestedEigen(A).eigen(20)
    scaled = nested._scaled
    monkeypatch.setattr(nested, "_scaled", lambda v, w, p: scaled(v * (1 + 1e-6 * np.arange(len(v))[:, None]), w, p))
    eigen = NestedEigen(A).eigen(20)
    assert eigen is not None
    assert expected is not None
    same(eigen.values, expected.values, 1e-9)


def noisy() -> ImpulseResponse:
    response = chain5().state_space(dt=0.05).impulse_response(120)
    values = response.values + 1e-3 * np.random.default_rng(6).standard_normal(response.values.shape)
    return ImpulseResponse(values=values, sampling_rate=20.0)


@pytest.mark.parametrize("method", ["era", "alternate"])
def test_models_in_turn_have_the_eigenvalues_and_vectors_of_their_a(method: str) -> None:
    pipeline = factor(prepare(noisy(), method=method), 30).in_turn()
    for n in range(1, 31):
        model = pipeline.triple(n)
        eigen = model.eigen()
        assert model.known is not None
        assert model.known() is not None
        np.testing.assert_allclose(model.A @ eigen.vectors, eigen.vectors * eigen.values, atol=1e-9)
        np.testing.assert_allclose(eigen.left @ eigen.vectors, np.eye(n), atol=1e-8)
        np.testing.assert_allclose(np.linalg.norm(eigen.vectors, axis=0), 1)
        dual = model.dual()
        turned = dual.eigen()
        np.testing.assert_allclose(dual.A @ turned.vectors, turned.vectors * turned.values, atol=1e-9)


@pytest.mark.parametrize("method", ["era", "alternate"])
def test_a_diagram_of_every_order_is_that_of_single_orders(method: str) -> None:
    every = stabilize(noisy(), method=method, orders=range(1, 25), deviations=False)
    pipeline = factor(prepare(noisy(), method=method), 24)
    for n in (7, 24):
        cut = Sweep(pipeline, [n], deviations=False).cut(n)
        assert cut.triple.known is None
        at = every.order_of_pole == n
        np.testing.assert_allclose(every.poles[at], cut.modes.poles[cut.reported], rtol=1e-9)
        for name in ("emac", "mpc", "msv"):
            np.testing.assert_allclose(every.indicators[name][at], cut.indicators[name][cut.reported], atol=1e-7)


def test_correlations_are_identified_at_every_order_as_at_each() -> None:
    y = chain5().state_space(dt=0.05).simulate(np.random.default_rng(7).standard_normal((4000, 2)))
    correlation = estimate_correlation(Signals(outputs=y, sampling_rate=20.0), lags=60)
    every = stabilize(correlation, orders=range(1, 21), deviations=False)
    some = stabilize(correlation, orders=range(2, 21, 2), deviations=False, **_sizes(every))
    for n in (10, 20):
        one, other = every.poles[every.order_of_pole == n], some.poles[some.order_of_pole == n]
        np.testing.assert_allclose(one, other, rtol=1e-8)


def _sizes(diagram: object) -> dict[str, int]:
    settings = diagram.settings  # type: ignore[attr-defined]
    return {name: settings[name] for name in ("block_rows", "block_columns")}
