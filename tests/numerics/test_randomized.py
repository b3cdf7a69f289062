"""Leading triplets from a Krylov range: orthonormal, singular vectors where they stand out, and whatever the rank."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.numerics import randomized
from modalscope.numerics.checks import RealArray
from modalscope.numerics.operators import DenseMatrix
from modalscope.numerics.randomized import Triplets, by_range


def matrix_of(d: RealArray, rows: int = 400) -> DenseMatrix:
    """A matrix of given singular values, its vectors random."""
    rng = np.random.default_rng(1)
    left, right = (np.linalg.qr(rng.standard_normal((size, d.size)))[0] for size in (rows, d.size))
    return DenseMatrix((left * d) @ right.T)


def missed(H: RealArray, found: Triplets) -> float:
    """Largest distance from singular vectors of those that stand out twice above the last one."""
    out = slice(np.count_nonzero(found.d > 2 * found.d[-1]))
    P, d, Q = found.P[:, out], found.d[out], found.Q[:, out]
    return float(max(np.linalg.norm(H @ Q - P * d, axis=0).max(), np.linalg.norm(H.T @ P - Q * d, axis=0).max()))


def check_orthonormal(found: Triplets) -> None:
    """To rounding, which is 1e-14 of some dozen columns."""
    for columns in (found.P, found.Q):
        assert np.allclose(columns.T @ columns, np.eye(columns.shape[1]), rtol=0, atol=1e-13)


def test_what_stands_out_is_a_singular_vector_and_the_last_one_is_known_to_a_tenth() -> None:
    d = np.concatenate([1e4 * 0.5 ** np.arange(12), np.linspace(1.2, 1.0, 240)])
    H = matrix_of(d)
    found = by_range(H, 40)
    assert found.reached
    assert 80 <= found.directions < 160
    assert missed(H.array, found) < 0.01
    assert np.allclose(found.d[:12], d[:12], rtol=1e-9)  # the square of an error of 1e-5
    assert np.allclose(found.d, d[:40], rtol=0.1)
    check_orthonormal(found)


@pytest.mark.parametrize("rank", [1, 7, 30])
def test_of_a_matrix_of_low_rank_all_directions_are_orthonormal_and_its_own_are_exact(rank: int) -> None:
    d = np.concatenate([10.0 ** -np.linspace(0, 6, rank), np.zeros(250 - rank)])
    H = matrix_of(d)
    found = by_range(H, 40)
    assert found.reached
    assert np.allclose(found.d, d[:40], rtol=1e-8, atol=1e-14)
    check_orthonormal(found)


@pytest.mark.parametrize("columns", [41, 50, 83])
def test_a_range_that_fills_the_space_is_exact(columns: int) -> None:
    """Where fewer columns are left than a block has, as many as there are complete it."""
    d = 10.0 ** -np.linspace(0, 2, columns)
    H = matrix_of(d)
    found = by_range(H, 40)
    assert found.directions <= columns
    if columns <= 80:  # no more than at least
        assert found.directions == columns
        assert missed(H.array, found) < 1e-13
        assert np.allclose(found.d, d[:40], rtol=1e-12)
    check_orthonormal(found)


def test_directions_that_have_not_settled_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(randomized, "_MIN_MULTIPLE", 1)
    monkeypatch.setattr(randomized, "_MAX_MULTIPLE", 1)
    found = by_range(matrix_of(1.0 / np.arange(1.0, 301)), 40)
    assert not found.reached
    assert found.directions == 40
