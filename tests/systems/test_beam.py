"""A beam by finite elements against the continuous one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from modalscope import systems

#: Roots b of cos b cosh b = -1 (far end free), cos b cosh b = 1 (clamped), tan b = tanh b (pinned), divided by cosh b.
CHARACTERISTIC = {
    "free": lambda b: np.cos(b) + 1 / np.cosh(b),
    "clamped": lambda b: np.cos(b) - 1 / np.cosh(b),
    "pinned": lambda b: np.sin(b) - np.cos(b) * np.tanh(b),
}


def exact_roots(far_end: str) -> np.ndarray:
    """Return the lowest three: one lies between neighbouring multiples of pi."""
    first = 0 if far_end == "free" else 1
    return np.array(
        [brentq(CHARACTERISTIC[far_end], np.pi * j, np.pi * (j + 1), xtol=1e-14) for j in range(first, first + 3)]
    )


@pytest.mark.parametrize("far_end", ["free", "pinned", "clamped"])
def test_beam_frequencies_converge_from_above_with_the_fourth_power_of_the_element(far_end: str) -> None:
    # f = b^2 / (2 pi L^2) sqrt(E I / (rho A)) of the bar of aluminium that is the default, 1 m by 40 mm by 10 mm
    exact = exact_roots(far_end) ** 2 / (2 * np.pi) * np.sqrt(70e9 * 0.01**2 / 12 / 2700)
    coarse, fine = (systems.clamped_beam(e, far_end=far_end).modes().frequencies[:3] / exact - 1 for e in (6, 12))
    assert np.all(fine > 0)
    np.testing.assert_allclose(coarse / fine, 16, rtol=0.1)  # h^4, with the next power still felt


def test_clamped_beam_roots_are_the_textbook_ones() -> None:
    # Blevins, Formulas for Natural Frequency and Mode Shape, table 8-1
    for far_end, roots in (
        ("free", [1.87510407, 4.69409113, 7.85475744]),
        ("clamped", [4.73004074, 7.85320462, 10.9956078]),
        ("pinned", [3.92660231, 7.06858275, 10.21017612]),
    ):
        np.testing.assert_allclose(exact_roots(far_end), roots, atol=5e-8)
