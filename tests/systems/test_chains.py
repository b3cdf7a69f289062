"""Chains of masses: closed-form modes at any length, and the published five storeys."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import systems
from modalscope.data import DataError
from tests.support import EPS


@given(n=st.integers(1, 40), m=st.floats(0.1, 100), k=st.floats(1, 1e6), zeta=st.floats(0.001, 0.5))
@settings(max_examples=25, deadline=None)
def test_spring_chain_of_any_length_has_the_closed_form_modes(n: int, m: float, k: float, zeta: float) -> None:
    numeric = systems.spring_chain(n, mass=m, stiffness=k, damping_ratio=zeta).modes(quantity="acceleration")
    # w = 2 sqrt(k / m) sin((2 j - 1) pi / (2 (2 n + 1))), phi(i) = 2 / sqrt(m (2 n + 1)) sin((2 j - 1) i pi / (2 n + 1))
    odd, i = 2 * np.arange(1, n + 1) - 1, np.arange(1, n + 1)
    frequencies = np.sqrt(k / m) / np.pi * np.sin(odd * np.pi / (2 * (2 * n + 1)))
    shapes = 2 / np.sqrt(m * (2 * n + 1)) * np.sin(np.outer(i, odd) * np.pi / (2 * n + 1))
    # the lowest of n frequencies is pi / 4n of the highest: its square loses (4n / pi)^2 of the digits
    tolerance = 100 * (1 + n) ** 2 * EPS
    np.testing.assert_allclose(numeric.frequencies, frequencies, rtol=tolerance)
    np.testing.assert_allclose(numeric.damping_ratios, zeta, rtol=tolerance)
    np.testing.assert_allclose(np.abs(numeric.shapes), np.abs(shapes), atol=tolerance / np.sqrt(m))
    assert numeric.feedthrough is not None
    np.testing.assert_allclose(numeric.feedthrough, np.eye(n) / m)


def test_spring_chain_has_the_published_five_storey_frequencies() -> None:
    published = [0.889952, 2.597758, 4.095108, 5.260697, 6.000096]
    np.testing.assert_allclose(systems.spring_chain().modes().frequencies, published, atol=5e-7)


def test_chain_refuses_links_that_do_not_fit() -> None:
    with pytest.raises(DataError, match="3 masses in a row need 3 dampings, or 4"):
        systems.chain([1, 1, 1], [1, 1, 1], [1, 1])
    with pytest.raises(DataError, match="dampers or damping ratios"):
        systems.chain([1], [1], [1], damping_ratios=0.1)
    fixed = systems.chain([1, 1], [5, 5, 5])
    np.testing.assert_array_equal(fixed.stiffness, [[10, -5], [-5, 10]])
