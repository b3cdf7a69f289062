"""Rows on lines by their products: the same as the array, its triangular factor, and the diagrams made of either."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import FrequencyResponse, stabilize
from modalscope.identification.fast import line_products
from modalscope.identification.fast.line_products import LineProducts
from modalscope.identification.matrices import transfer as module
from modalscope.identification.matrices.transfer import transfer
from modalscope.numerics.functions.poles import poles_from
from tests.support import relative

#: Rounding of some thousand additions and products.
ROUNDING = 1e-12


def responses(outputs: int, inputs: int, *, noise: float, weak: float = 1.0, lines: int = 300) -> FrequencyResponse:
    """Return receptances of ten modes, one of them `weak` times the others."""
    rng = np.random.default_rng(0)
    f = np.linspace(10, 500, lines)
    s = poles_from(np.sort(rng.uniform(30, 470, 10)), rng.uniform(0.004, 0.02, 10))
    C, B = rng.standard_normal((outputs, 10)), rng.standard_normal((10, inputs))
    B[4] *= weak
    x = 2j * np.pi * f[:, None]
    H = (C * (-1j / (x - s) + 1j / (x - s.conj()))[:, None]) @ B
    error = rng.standard_normal((2, *H.shape)) * noise * np.sqrt(np.mean(np.abs(H) ** 2) / 2)
    return FrequencyResponse(values=H + error[0] + 1j * error[1], frequencies=f, quantity="displacement")


@pytest.mark.parametrize("few", [-1, 1000])  # sums over pairs of functions, and over the rows themselves
@pytest.mark.parametrize("weighted", [False, True])
def test_products_are_those_of_the_array(weighted: bool, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(line_products, "_MAX_ROW_SUM_SIZE", few)
    monkeypatch.setattr(line_products, "_BLOCK_NUMBERS", 1000)
    response = responses(9, 2, noise=0.1, lines=120)
    w = np.linspace(0.5, 2, 120) if weighted else None
    matrix = transfer(response, domain="s", block_rows=29, weights=w)
    assert matrix.products
    whole, rng = np.vstack([matrix.columns_array(i) for i in range(2)]).T, np.random.default_rng(1)
    operator = matrix.tall()
    assert isinstance(operator, LineProducts)
    assert operator.shape == whole.shape
    assert relative(operator.dense(), whole) < ROUNDING
    X, Z = rng.standard_normal((whole.shape[1], 3)), rng.standard_normal((whole.shape[0], 3))
    assert relative(operator.times(X), whole @ X) < ROUNDING
    assert relative(operator.transposed_times(Z), whole.T @ Z) < ROUNDING
    gram = operator.row_gram()
    assert gram is not None
    assert relative(gram, whole @ whole.T) < ROUNDING
    assert np.isclose(operator.energy, np.sum(whole**2), rtol=ROUNDING)
    chunks = operator.transposed().row_chunks(100)
    assert relative(np.vstack(list(chunks)), whole.T) < ROUNDING
    assert relative(np.vstack(list(operator.row_chunks(50))), whole) < ROUNDING
    # H(0) and H(1) are the first rows, and the recurrence of the basis on all of them
    before, after = matrix.full_shift.split(whole)
    assert relative(matrix.shifted(0).dense(), before) < ROUNDING
    assert relative(matrix.shifted(1).dense(), after) < ROUNDING
    for k, part in enumerate((before, after)):
        assert (
            relative(matrix.first_rows(X, k) / matrix.output_scale[:, None] * matrix.first_value, part[:9] @ X) < 1e-11
        )


def test_rows_of_which_little_is_left_are_told_from_rounding() -> None:
    """Polynomials times a constant are polynomials: all is eliminated, and the difference of the Gram matrices is rounding."""
    constant = FrequencyResponse(values=-np.ones((80, 9, 2), dtype=complex), frequencies=np.linspace(1, 9, 80))
    operator = transfer(constant, domain="s", block_rows=24).tall()
    assert isinstance(operator, LineProducts)
    assert operator.row_gram() is None


@pytest.mark.parametrize("method", ["alternate", pytest.param("era", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("noise", "weak"), [(0.01, 1.0), (0.0, 1e-7)], ids=["40 dB", "a mode at 1e-7"])
def test_both_routes_give_one_diagram(method: str, noise: float, weak: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """By products and by the triangular factor. Poles of a weak mode keep the digits that its share of the data leaves."""
    response = responses(12, 3, noise=noise, weak=weak)
    orders = range(16, 29 if noise else 21, 4)
    found = []
    for many in (200, 10**9):
        monkeypatch.setattr(module, "_MIN_PRODUCT_ROWS", many)
        found.append(stabilize(response, method=method, orders=orders, deviations=False))
    ours, theirs = found
    assert "Gram" in str(ours.notes)
    assert "Gram" not in str(theirs.notes)
    np.testing.assert_allclose(ours.poles, theirs.poles, rtol=1e-8)
    np.testing.assert_allclose(ours.fit_errors, theirs.fit_errors, rtol=1e-6, atol=1e-9)
    for name in ("emac", "amplitude_coherence", "mpc"):
        np.testing.assert_allclose(ours.indicators[name], theirs.indicators[name], atol=1e-6)
