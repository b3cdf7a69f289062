"""From the covariance of a pole to the deviations of its frequency and damping ratio."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray

__all__ = ["frequency_and_damping_std"]


def frequency_and_damping_std(poles: Array, covariance: RealArray) -> tuple[RealArray, RealArray]:
    """Return standard deviations of f = |s| / 2 pi (Hz) and zeta = -Re s / |s|, (n,) each.

    With w = |s| the gradients by (Re s, Im s) are (Re s, Im s) / (2 pi w) and (-1 / w + Re^2 / w^3, Re Im / w^3).

    Parameters
    ----------
    poles : array of complex, (n,)
        rad/s.
    covariance : array, (n, 2, 2)
        Of real and imaginary part, (rad/s)^2.

    Examples
    --------
    >>> f, zeta = frequency_and_damping_std([-1 + 100j], np.array([np.eye(2)]))
    >>> f.round(4), zeta.round(4)
    (array([0.1592]), array([0.01]))
    """
    s = np.asarray(poles, dtype=complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        w = np.abs(s)
        by_f = np.stack([s.real, s.imag], axis=1) / (2 * np.pi * w[:, None])
        by_zeta = np.stack([-1 / w + s.real**2 / w**3, s.real * s.imag / w**3], axis=1)
        f, zeta = (np.sqrt(np.einsum("ka,kab,kb->k", g, covariance, g)) for g in (by_f, by_zeta))
    return f, zeta
