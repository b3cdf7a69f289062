"""Levenberg and Marquardt's steps: what a linear model promises of them, and the damping that follows from what is kept of it."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.likelihood.descent import _lessening, _Step


@pytest.mark.parametrize("apart", [True, False])
def test_the_fall_of_a_step_is_that_of_the_linear_model(apart: bool) -> None:
    rng = np.random.default_rng(3)
    J, r = rng.standard_normal((40, 6)), rng.standard_normal(40)
    if not apart:
        J[:, 5] = J[:, 4]
    step = _Step(J.T @ J, J.T @ r)
    assert step.apart is apart
    for damping in (1e-6, 1e-2, 1.0):
        moved = step.damped(damping)
        h = np.stack([moved.real, moved.imag], axis=1).reshape(-1)
        assert step.fall(moved) == pytest.approx(r @ r - np.sum((r - J @ h) ** 2), rel=1e-9)
    # the whole of what is promised is had without damping
    assert step.fall(step.damped(1e-13)) == pytest.approx(step.promised, rel=1e-6)


def test_damping_falls_to_a_third_where_the_misfit_falls_as_promised_and_holds_at_half_of_it() -> None:
    assert _lessening(1.0, 1.0) == _lessening(5.0, 1.0) == pytest.approx(1 / 3)
    assert _lessening(0.5, 1.0) == pytest.approx(1)
    assert _lessening(0.0, 1.0) == pytest.approx(2)
    # what a shortened step promises may be nothing: the misfit fell all the same
    assert _lessening(1.0, 0.0) == _lessening(1.0, -1.0) == pytest.approx(1 / 3)
