"""Products of real and complex matrices by parts are the products."""

from __future__ import annotations

import numpy as np

from modalscope.numerics.operators import real_times, times_real


def test_products_by_parts_are_the_products() -> None:
    rng = np.random.default_rng(0)
    real, right = rng.standard_normal((2, 7, 5)), rng.standard_normal((5, 3)) + 1j * rng.standard_normal((5, 3))
    np.testing.assert_allclose(real_times(real[:, :, ::-1], right), real[:, :, ::-1] @ right, rtol=1e-12)
    np.testing.assert_allclose(times_real(right.T, real[0].T), right.T @ real[0].T, rtol=1e-12)
    assert not np.iscomplexobj(real_times(real, right.real))
    assert not np.iscomplexobj(times_real(right.real.T, real[0].T))
