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
    exact = systems.spring_chain_modes(n, mass=m, stiffness=k, damping_ratio=zeta, quantity="acceleration")
    # the lowest of n frequencies is pi / 4n of the highest: its square loses (4n / pi)^2 of the digits
    tolerance = 100 * (1 + n) ** 2 * EPS
    np.testing.assert_allclose(numeric.frequencies, exact.frequencies, rtol=tolerance)
    np.testing.assert_allclose(numeric.damping_ratios, zeta, rtol=tolerance)
    np.testing.assert_allclose(np.abs(numeric.shapes), np.abs(exact.shapes), atol=tolerance / np.sqrt(m))
    assert exact.feedthrough is not None
    np.testing.assert_allclose(exact.feedthrough, np.eye(n) / m)


def test_spring_chain_has_the_published_five_storey_frequencies() -> None:
    published = [0.889952, 2.597758, 4.095108, 5.260697, 6.000096]
    np.testing.assert_allclose(systems.spring_chain().modes().frequencies, published, atol=5e-7)


def test_closed_form_modes_of_a_hundred_thousand_masses_need_no_matrix() -> None:
    n = 100_000
    modes = systems.spring_chain_modes(n, modes=12, outputs=[0, n // 2, n - 1], inputs=[n - 1])
    assert modes.shapes.shape == (3, 12)
    assert modes.participation is not None
    # modal mass one: m sum phi^2 = 1 over all masses
    every = systems.spring_chain_modes(n, modes=2).shapes.real
    np.testing.assert_allclose(25.91 * np.sum(every**2, axis=0), 1, rtol=1e-10)


def test_chain_refuses_links_that_do_not_fit() -> None:
    with pytest.raises(DataError, match="3 masses in a row need 3 dampings, or 4"):
        systems.chain([1, 1, 1], [1, 1, 1], [1, 1])
    with pytest.raises(DataError, match="dampers or damping ratios"):
        systems.chain([1], [1], [1], damping_ratios=0.1)
    fixed = systems.chain([1, 1], [5, 5, 5])
    np.testing.assert_array_equal(fixed.stiffness, [[10, -5], [-5, 10]])
