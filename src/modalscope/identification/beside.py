"""Poles that take part beside the modes: what the data need and no mode is, so that the modes need not make up for it."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.output_levels import output_scale
from modalscope.model.response import Response

__all__ = ["needed_beside"]

#: A pole within so many decay rates of a mode may be part of it, and would take from it.
_PART = 3.0

#: One pole of noise in a thousand sets.
_FALSE = 1e-3


def needed_beside(response: Response, modes: Array, candidates: Array) -> ComplexArray:
    """Return those of the candidates that explain more than noise does beside the modes, all residues free.

    The weakest goes first, and the others are judged again. A pole with free residues in l m channels explains of white noise a
    chi-squared number of k = 2 l m degrees (in records 2 l (m + R), R the ends of runs); what is kept exceeds k + 2 sqrt(k t) + 2 t,
    t = ln(positions / 1e-3), in variances of what all poles together leave.

    Parameters
    ----------
    response : Response
    modes : array of complex, (n,)
        rad/s.
    candidates : array of complex, (k,)
        rad/s; those that grow, and those near a mode, are left out.

    Source
    ------
    B. Laurent and P. Massart, Annals of Statistics 28, 2000, Lemma 1.
    """
    added = response.added_damping
    far = np.abs(candidates[:, None] - modes) > _PART * np.abs(modes.real)
    poles = candidates[(candidates.real < added) & far.all(axis=1)]
    basis = response.whole_basis(np.concatenate([modes, poles]) - added, response.refined_powers)
    data = basis.data / np.maximum(output_scale(response), 1e-300)[:, None]
    channels, rows, width = data[0].size, len(data), basis.by_pole.shape[2]
    columns = np.hstack([basis.terms, basis.by_pole.reshape(rows, -1)])
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    free = (rows - columns.shape[1]) * channels
    if not poles.size or free < channels:
        return np.zeros(0, dtype=complex)
    Q, R = (np.asarray(factor) for factor in sla.qr(columns, mode="economic", check_finite=False))
    flat = data.reshape(rows, channels)
    Z = Q.T @ flat
    variance = float(np.sum((flat - Q @ Z) ** 2)) / free
    t = np.log(rows / 2 / _FALSE)
    least = variance * (width * channels + 2 * np.sqrt(width * channels * t) + 2 * t)
    before = basis.terms.shape[1] + width * len(modes)
    kept = np.arange(poles.size)
    while kept.size:
        gains = _gains(np.hstack([R[:, :before], _of_poles(R[:, before:], kept, width)]), Z, width)[-kept.size :]
        weakest = int(np.argmin(gains))
        if gains[weakest] >= least:
            break
        kept = np.delete(kept, weakest)
    return np.asarray(poles[kept])


def _of_poles(columns: RealArray, which: Array, width: int) -> RealArray:
    return columns.reshape(len(columns), -1, width)[:, which].reshape(len(columns), -1)


def _gains(columns: RealArray, data: RealArray, width: int) -> RealArray:
    """Return the rise of the squared misfit without each set of `width` columns; those left over stand first, for themselves."""
    odd = columns.shape[1] % width
    U, d, Vt = sla.svd(columns, full_matrices=False, check_finite=False)
    rank = int(np.count_nonzero(d > 1e-11 * d[0]))
    back = Vt[:rank].T / d[:rank]
    c = (back @ (U[:, :rank].T @ data))[odd:].reshape(-1, width, data.shape[1])
    sets = back[odd:].reshape(-1, width, rank)
    own = np.linalg.pinv(sets @ sets.transpose(0, 2, 1), hermitian=True)
    return np.asarray(np.sum(c * (own @ c), axis=(1, 2)))
