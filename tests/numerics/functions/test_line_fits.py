"""Shapes fitted on lines by summed products, against least squares with all lines at once."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.numerics.functions import pole_basis
from modalscope.numerics.functions.pole_basis import LineFits, line_basis, line_data

POLES = np.array([-0.3 + 9.0j, -0.8 + 21.0j, -4.0])
F = np.linspace(0.3, 4.5, 300)


def response(poles: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return values (F, 3, 2) of modes with random shapes, and their participation."""
    rng = np.random.default_rng(0)
    shapes, participation = rng.standard_normal((3, poles.size)), rng.standard_normal((poles.size, 2))
    x = 2j * np.pi * F[:, None]
    H = (shapes / (x - poles)[:, None] + shapes / (x - poles.conj())[:, None] * (poles.imag != 0)) @ participation
    return H + noise * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)), participation


@pytest.mark.parametrize("piece", [200, 64_000], ids=["pieces", "whole"])
@pytest.mark.parametrize("weighted", [False, True], ids=["", "weighted"])
@pytest.mark.parametrize("noise", [1e-3, 0.0], ids=["noise", "exact"])
@pytest.mark.parametrize(
    ("poles", "powers"), [(POLES, (0,)), (POLES[[0, 1]], (-2, 0)), (POLES[[0, 0]] * [1, 1 + 1e-4], ())]
)
def test_sums_over_pieces_fit_as_all_lines_do(
    poles: np.ndarray,
    powers: tuple[int, ...],
    noise: float,
    weighted: bool,
    piece: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Residual terms or none, real poles, poles that nearly coincide, and data that leave rounding alone."""
    monkeypatch.setattr(pole_basis, "_NUMBERS_OF_A_PIECE", piece)
    values, participation = response(poles, noise)
    weights = np.linspace(0.5, 2.0, F.size) if weighted else None
    found = LineFits(F, None, values, powers, weights).fit_shapes(poles, participation)
    expected = line_basis(F, None, line_data(values, weights), poles, powers, weights).turned.solved(participation.T)
    unit = np.abs(expected.side).max()
    np.testing.assert_allclose(
        found.side, expected.side, rtol=0, atol=1e-9 * unit
    )  # rounding times the condition of the two poles
    np.testing.assert_allclose(found.terms, expected.terms, rtol=0, atol=1e-9 * unit)
    np.testing.assert_allclose(found.left, expected.left, rtol=1e-8, atol=1e-24)
    np.testing.assert_allclose(found.unexplained, expected.unexplained, rtol=1e-8)


def test_no_poles_leave_the_terms_alone() -> None:
    values, _ = response(POLES, 1e-3)
    found = LineFits(F, None, values, (0,), None).fit_shapes(POLES[:0], np.zeros((0, 2)))
    assert found.side.shape == (0, 3)
    np.testing.assert_allclose(found.terms[0], values.real.mean(axis=0).T)
    assert LineFits(F, None, values, (), None).fit_shapes(POLES[:0], np.zeros((0, 2))).left.sum() == pytest.approx(
        np.sum(np.abs(values) ** 2)
    )
