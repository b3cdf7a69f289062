"""Triangular factors of rows in chunks: the same by Gram matrices and by reflections, and reflections where Gram matrices fail."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.model.triangles import factor_of_gram, triangle_of

RNG = np.random.default_rng(0)


def in_chunks(X: np.ndarray, step: int):
    return lambda: (X[k : k + step] for k in range(0, len(X), step))


@pytest.mark.parametrize(("rows", "columns", "step"), [(50, 7, 9), (50, 7, 50), (30, 29, 4), (7, 50, 3), (5, 5, 2)])
def test_the_factor_is_that_of_the_whole(rows, columns, step):
    X = RNG.standard_normal((rows, columns))
    R = triangle_of(in_chunks(X, step), columns)
    assert R.shape == (min(rows, columns), columns)
    assert np.allclose(R.T @ R, X.T @ X, atol=1e-12)
    assert not np.any(np.tril(R[:, : len(R)], -1))


@pytest.mark.parametrize("own", [1e-2, 1e-6, 1e-10, 0.0])
def test_what_a_column_has_of_its_own_is_known_to_eight_digits(own):
    X = RNG.standard_normal((200, 4))
    Q, _ = np.linalg.qr(X)
    X[:, 3] = X[:, 1] - X[:, 2] + own * Q[:, 3]
    R = triangle_of(in_chunks(X, 30), 4)
    # rounding of columns of length 14 is a few 1e-15 times that
    assert abs(R[3, 3]) == pytest.approx(own, rel=1e-7, abs=1e-13)


def test_columns_of_zeros_stay():
    X = RNG.standard_normal((20, 3))
    X[:, 1] = 0
    R = factor_of_gram(X.T @ X)
    assert R is not None
    assert not np.any(R[:, 1])
    assert np.allclose(R.T @ R, X.T @ X)
