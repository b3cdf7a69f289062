"""The residue of a mode that the data need several poles for, beside all others that they need."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import ComplexArray
from modalscope.model.response import Response

__all__ = ["one_residue"]


def one_residue(response: Response, pole: complex, parts: ComplexArray, residues: ComplexArray) -> ComplexArray:
    """Return the residue that one pole has in the place of several, (l, m): the nearest to what all of these give together.

        min over R, terms of |sum_k (R_k g(s_k) + conjugate) - R g(s) - conjugate - terms|^2

    in every channel. The data themselves do not come in: with the modes of a list alone the weak ones would make up for what shifts of the
    strong ones leave.

    Parameters
    ----------
    response : Response
        One channel of the data.
    pole : complex
        s, rad/s, as it is in the data.
    parts : array of complex, (k,)
        Poles s_k.
    residues : array of complex, (k, l, m)
    """
    basis = response.basis(np.append(pole, parts), response.outside_powers)
    columns, functions = (
        np.hstack([basis.terms, basis.by_pole[:, 0]]),
        basis.by_pole[:, 1:].reshape(len(basis.data), -1),
    )
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    whole = np.stack([residues.real, residues.imag], axis=1).reshape(functions.shape[1], -1)
    # of what all give together the columns see no more than what they see of each function: these are few, and channels many
    seen = np.linalg.lstsq(columns / size, functions, rcond=None)[0][-2:] / size[-2:, None]
    found = seen @ whole
    return np.asarray((found[0] + 1j * found[1]).reshape(residues.shape[1:]))
