"""A beam by finite elements against the continuous one."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import systems


@pytest.mark.parametrize("far_end", ["free", "pinned", "clamped"])
def test_beam_frequencies_converge_from_above_with_the_fourth_power_of_the_element(far_end: str) -> None:
    exact = systems.clamped_beam_frequencies(3, far_end=far_end)
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
        f = systems.clamped_beam_frequencies(3, far_end=far_end, bending_stiffness=1, mass_per_length=1)
        np.testing.assert_allclose(np.sqrt(2 * np.pi * f), roots, atol=5e-8)
