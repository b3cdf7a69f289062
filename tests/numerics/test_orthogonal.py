"""What columns leave of data, by their products, against least squares."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from modalscope.numerics.checks import RealArray
from modalscope.numerics.orthonormal import energy_left, resolved, resolved_by_products, scaled_span, span_by_products


@pytest.mark.parametrize("noise", [1e-2, 1e-9])
def test_what_is_left_is_that_of_least_squares_also_of_nearly_dependent_columns_and_of_data_without_noise(
    noise: float,
) -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((400, 12)) * 10.0 ** np.arange(-6, 6)
    columns[:, 1] = 0.0
    columns[:, 3] = columns[:, 2] * (1 + 1e-3 * rng.standard_normal(400))
    data = (columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)) @ rng.standard_normal((12, 3))
    data = data + noise * rng.standard_normal(data.shape)
    kept = np.delete(columns, 1, axis=1)
    kept /= np.linalg.norm(kept, axis=0)
    exact = data - kept @ np.linalg.lstsq(kept, data, rcond=None)[0]
    assert energy_left(data, columns) == pytest.approx(np.sum(exact**2, axis=0), rel=1e-6, abs=1e-24)


def test_a_column_of_zeros_beside_a_huge_one_takes_nothing_away() -> None:
    column = np.random.default_rng(1).standard_normal((50, 1)) * 1e200
    assert energy_left(column / 1e200, np.hstack([column, np.zeros((50, 1))])) == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("apart", [1.0, 1e-3, 1e-5, 1e-8], ids=["orthogonal", "near", "nearer", "by reflections"])
@pytest.mark.parametrize("rows", [200, 5000])
def test_what_columns_see_of_data_is_what_an_orthogonal_basis_sees(rows: int, apart: float) -> None:
    """Q'D and R, columns in other units, against reflections: the sign of a row of both is free."""
    rng = np.random.default_rng(0)
    X, D = rng.standard_normal((rows, 6)), rng.standard_normal((rows, 4))
    X[:, 5] = X[:, 4] + apart * X[:, 5]
    X *= [1, 1e3, 1e-6, 1, 1, 1]
    seen, R = resolved(X, D)
    Q, S = np.linalg.qr(X)
    sign = np.sign(np.diag(S) * np.diag(R))[:, None]
    error = 1e-14 * rows / apart  # rounding of the sums times the condition
    np.testing.assert_allclose(seen * sign, Q.T @ D, atol=error)
    np.testing.assert_allclose(R * sign / np.abs(S).max(axis=0), S / np.abs(S).max(axis=0), atol=error)


@pytest.mark.parametrize(("condition", "served"), [(20.0, True), (999.0, True), (1001.0, False), (1e17, False)])
def test_products_serve_as_long_as_their_condition_allows_twelve_digits(condition: float, served: bool) -> None:
    """Two columns with the cosine c have the condition (1 + c) / (1 - c) in the 1-norm."""
    rng = np.random.default_rng(0)
    Q, D, c = (
        np.linalg.qr(rng.standard_normal((300, 2)))[0],
        rng.standard_normal((300, 4)),
        (condition - 1) / (condition + 1),
    )
    X = np.column_stack([Q[:, 0], c * Q[:, 0] + np.sqrt(1 - c**2) * Q[:, 1]]) * [1.0, 1e6]
    found = resolved_by_products(X.T @ X, X.T @ D)
    assert (found is not None) == served
    if found is not None:
        seen, R = resolved(X, D)
        sign = np.sign(np.diag(R) * np.diag(found[1]))[:, None]
        np.testing.assert_allclose(found[0] * sign, seen, atol=1e-15 * condition * np.abs(seen).max())
        np.testing.assert_allclose(found[1] * sign, R, atol=1e-15 * condition * np.abs(R).max())


def test_no_columns_see_nothing() -> None:
    seen, R = resolved(np.zeros((9, 0)), np.ones((9, 4)))
    assert (seen.shape, R.shape) == ((0, 4), (0, 0))


@pytest.mark.parametrize("span", [scaled_span, span_by_products])
def test_the_span_of_scaled_columns_has_no_dependent_and_no_empty_directions(
    span: Callable[[RealArray], RealArray],
) -> None:
    rng = np.random.default_rng(8)
    X = rng.standard_normal((200, 4)) * [1.0, 1e8, 1e-8, 1.0]
    columns = np.column_stack([X[:, :2], np.zeros(200), X[:, 2:], X[:, 0] - X[:, 3]])
    before = columns.copy()
    Q = span(columns)
    assert Q.shape == (200, 4)
    np.testing.assert_allclose(Q.T @ Q, np.eye(4), atol=1e-13)
    X = X / np.linalg.norm(X, axis=0)
    np.testing.assert_allclose(Q @ (Q.T @ X), X, atol=1e-13)
    np.testing.assert_array_equal(columns, before)
    assert span(np.zeros((5, 2))).shape == (5, 0)
    independent = X[:, :3]
    Q = span(independent)
    np.testing.assert_allclose(Q.T @ Q, np.eye(3), atol=1e-13)
    np.testing.assert_allclose(Q @ (Q.T @ independent), independent, atol=1e-13)
