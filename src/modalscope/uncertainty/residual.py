"""The variance of noise by what the poles of a model leave of the data."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.modal_basis import ModalBasis
from modalscope.model.orthogonal import energy_left

__all__ = ["residual_variance", "unexplained_energy"]


def unexplained_energy(basis: ModalBasis) -> RealArray:
    """Return the energy that the best terms and residues of every channel leave, whatever their rank, (l, m)."""
    found = energy_left(basis.data.reshape(len(basis.data), -1), basis.columns)
    return np.asarray(found.reshape(basis.data.shape[1:]))


def residual_variance(energy: Array, free: float, is_complex: bool) -> RealArray:
    """Return the variance E|noise|^2 (l, m) of noise by what a model leaves.

    NaN where there are no more values than unknowns.

    Parameters
    ----------
    energy : array, (l, m)
        Sum of squares of what is left of every channel.
    free : float
        Real values of a channel less the real numbers that were fitted to it.
    is_complex : bool
        Whether the values are lines, of two real numbers each.
    """
    return np.asarray((1 + is_complex) * energy / free if free > 0 else np.full(energy.shape, np.nan))
