"""The shear building of the IASC-ASCE: published frequencies, whole and damaged, and members by hand."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import systems
from modalscope.data import DataError


def test_iasc_asce_has_the_published_frequencies() -> None:
    published = [9.41, 11.79, 16.38, 25.54, 32.01, 38.66, 48.01, 60.15]
    found = systems.iasc_asce().modes()
    assert set(published) <= set(found.frequencies.round(2))
    np.testing.assert_allclose(found.damping_ratios, 0.01, rtol=1e-10)


def test_iasc_asce_storey_stiffness_is_that_of_its_members() -> None:
    # nine columns of 12 E I / h^3 and braces of E A cos^2 / L, member by member about the axis: published to 4-5 digits
    E, h, b = 2e11, 0.9, 1.25
    column = {"x": 12 * E * 1.97e-6 / h**3, "y": 12 * E * 0.664e-6 / h**3}
    brace = E * 0.141e-3 / np.hypot(b, h) ** 3 * b**2
    turned = sum(column["x"] * y**2 + column["y"] * x**2 for x in (-b, 0, b) for y in (-b, 0, b)) + 8 * brace * b**2
    structure = systems.iasc_asce()
    top = structure.stiffness[-3:, -3:]
    np.testing.assert_allclose(
        np.diag(top), [9 * column["x"] + 4 * brace, 9 * column["y"] + 4 * brace, turned], rtol=1e-4
    )


def test_iasc_asce_without_braces_has_the_frequencies_of_its_damage_patterns() -> None:
    for storeys, published in (((1,), [6.24, 21.53, 37.37, 47.83]), ((1, 3), [5.82, 14.89, 36.06, 41.35])):
        frequencies = systems.iasc_asce(without_braces=storeys).modes().frequencies
        # weak direction; the members' stiffness is published to four digits
        assert all(np.min(np.abs(frequencies - f)) < 0.01 for f in published)
    with pytest.raises(DataError, match=r"storeys \[5\] without braces: the storeys are 1 to 4"):
        systems.iasc_asce(without_braces=[5])
