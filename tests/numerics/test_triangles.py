"""Triangular factors of rows in chunks: the same by Gram matrices and by reflections, and reflections where Gram matrices fail."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.numerics import orthonormal as module
from modalscope.numerics.orthonormal import factor_of_gram, triangle_of

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


@pytest.mark.parametrize("own", [1e-2, 3e-5, 3e-6, 1e-7, 1e-10, 0.0])
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


def test_a_second_factor_betters_the_first_without_reflections(monkeypatch):
    """Of 3e-6 of its length one Gram matrix leaves five digits, two leave eight, whatever is in the other columns; one of zeros stays."""
    X = RNG.standard_normal((200, 5))
    X[:, 3] = X[:, 1] - X[:, 2] + 3e-6 * X[:, 3]
    X[:, 4] = 0
    exact = np.linalg.qr(X[:, :4], mode="r")
    monkeypatch.setattr(module, "_orthogonally", None)
    R = triangle_of(in_chunks(X, 30), 5)
    assert np.allclose(np.abs(np.diag(R)[:4]), np.abs(np.diag(exact)), rtol=1e-8)
    assert not np.any(R[:, 4])


def test_who_needs_more_digits_gets_them(monkeypatch):
    X = RNG.standard_normal((100, 3))
    X[:, 2] = X[:, 1] + 5e-4 * X[:, 2]
    passes = []

    def chunks():
        passes.append(len(passes))
        return in_chunks(X, 40)()

    triangle_of(chunks, 3, 1e-4)
    assert len(passes) == 1
    triangle_of(chunks, 3, 1e-3)
    assert len(passes) == 3
