"""Shapes of more outputs than memory holds: poles and participation are known, and each output is a small least-squares problem."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from modalscope.model.checks import ComplexArray, DataError, RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.stored_response import StoredResponse

__all__ = ["Fitted", "fitted_shapes"]

#: Share of an output's energy below which what is left, a difference of sums, is told from rounding by rebuilding the samples.
_ROUNDING = 1e-10


class Fitted(NamedTuple):
    """Shapes of some outputs.

    Parameters
    ----------
    outputs : slice
        Which.
    shapes : array of complex, (c, n)
    left, whole : array, (c,)
        Energy that is left, and all of it.
    """

    outputs: slice
    shapes: ComplexArray
    left: RealArray
    whole: RealArray


def fitted_shapes(stored: StoredResponse, modes: ModalModel) -> Iterator[Fitted]:
    """Yield shapes phi of all outputs, some at a time: y(k) = 2 Re sum_j phi_j z_j^k l_j' by least squares over samples and inputs.

    All outputs share one matrix, (N m, 2 n) real, so that its pseudo-inverse serves them all.

    Parameters
    ----------
    stored : StoredResponse
    modes : ModalModel
        With participation in the inputs of the responses.

    Raises
    ------
    DataError
        Modes without participation, or in other inputs.
    """
    basis = _basis(stored, modes)
    size = np.linalg.norm(basis, axis=0)
    size = np.where(size > 0, size, 1.0)
    Q, d, turn = np.linalg.svd(basis / size, full_matrices=False)
    kept = d > len(Q) * np.finfo(float).eps * d[0]
    back = (turn[kept].T / d[kept]).T / size
    for part, X in stored.parts():
        found = X @ Q[:, kept]
        whole = np.einsum("lk,lk->l", X, X)
        left = whole - np.einsum("lk,lk->l", found, found)
        if not np.all(left > _ROUNDING * whole):
            X -= found @ Q[:, kept].T
            left = np.einsum("lk,lk->l", X, X)
        yield Fitted(part, (found @ back).view(np.complex128), left, whole)


def _basis(stored: StoredResponse, modes: ModalModel) -> RealArray:
    """Return what Re phi_j and Im phi_j of each mode give in all samples and inputs, (N m, 2 n)."""
    participation = modes.known_participation("shapes of all outputs")
    inputs = len(stored.input_dofs)
    if participation.shape[1] != inputs:
        raise DataError(
            f"shapes of responses to {inputs} inputs were asked",
            f"the modes have participation in {participation.shape[1]}",
            "Give the modes that were identified from these responses.",
        )
    first = stored.part(0, 1)
    g = first.basis(modes.poles - stored.added_damping).by_pole[:, None]  # (N, 1, n, 2)
    re, im = participation.real.T[None], participation.imag.T[None]  # (1, m, n)
    of_real, of_imaginary = g[..., 0] * re + g[..., 1] * im, g[..., 1] * re - g[..., 0] * im
    return np.asarray(np.stack([of_real, of_imaginary], axis=3).reshape(stored.samples * inputs, -1))
