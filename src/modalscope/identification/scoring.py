"""Fisher's scoring over several ambient records that share their poles: what each has of its own is eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.identification.spectral_likelihood import Cells, Driven, Equations, begun, equations, loss, moved
from modalscope.model.checks import ComplexArray, RealArray

__all__ = ["Scored", "covariance", "scored"]

#: Steps of scoring at most, as many that a record takes by itself first, and the fall of -log p of a record below which they end.
_STEPS, _ALONE, _DONE = 20, 6, 1e-3

#: Damping of the first step, what a whole step and none make of it, and where no step helps any more.
_FIRST, _EASE, _STIFFEN, _STUCK = 1e-2, 1 / 6, 8.0, 1e6

#: The square of a step, in deviations of the poles, that is no matter.
_LEFT = 0.01

#: How often a step is halved: beyond some part of it S is not positive definite.
_HALVED = 10

#: Of the information: shape and drive share a factor, of which nothing is known.
_RIDGE = 1e-9


class Scored(NamedTuple):
    """Where scoring ended.

    Attributes
    ----------
    poles : array of complex, (n,)
    informations : array, (records, 2n, 2n)
        Of Re and Im of the poles, in every record by itself.
    scores : array, (records, 2n)
    misfit : float
        As in `Equations`, the mean of all records.
    converged : bool
    """

    poles: ComplexArray
    informations: RealArray
    scores: RealArray
    misfit: float
    converged: bool


class _Eliminated(NamedTuple):
    """The equations of a record with what it has of its own eliminated: what a step of the poles asks of that."""

    information: RealArray
    score: RealArray
    own: RealArray
    follows: RealArray


def scored(records: Sequence[Cells], poles: ComplexArray) -> Scored:
    """Return the poles of greatest likelihood over all records, from a start near them.

    Parameters
    ----------
    records : sequence of Cells
    poles : array of complex, (n,)
    """
    parts = [begun(cells, poles) for cells in records]
    if not np.isfinite(_total(records, poles, parts)):
        nothing = np.zeros((len(records), 2 * len(poles)))
        return Scored(poles, nothing[:, :, None] * nothing[:, None], nothing, np.inf, False)
    parts = [_descended([cells], poles, [own], hold=True)[1][0] for cells, own in zip(records, parts, strict=True)]
    found, parts = _descended(records, poles, parts, hold=False)
    built = [equations(cells, found, own) for cells, own in zip(records, parts, strict=True)]
    last = [_eliminated(each, len(poles), 0.0) for each in built]
    informations, scores = np.array([e.information for e in last]), np.array([e.score for e in last])
    score = scores.sum(axis=0)
    left = score @ np.linalg.lstsq(informations.sum(axis=0), score, rcond=None)[0]
    return Scored(found, informations, scores, float(np.mean([each.misfit for each in built])), bool(left < _LEFT))


def covariance(found: Scored) -> RealArray:
    """Return the covariance of Re and Im of the poles, (2n, 2n): the inverse of all information, wider where the model does not fit.

    Parameters
    ----------
    found : Scored
    """
    return np.asarray(max(found.misfit, 1.0) * np.linalg.pinv(found.informations.sum(axis=0), hermitian=True))


def _descended(
    records: Sequence[Cells], poles: ComplexArray, parts: list[Driven], *, hold: bool
) -> tuple[ComplexArray, list[Driven]]:
    """Return poles and parts where no further step helps, or steps end; poles stay where they are to be held."""
    cost, damping = _total(records, poles, parts), _FIRST
    for _ in range(_ALONE if hold else _STEPS):
        built = [equations(cells, poles, own) for cells, own in zip(records, parts, strict=True)]
        while True:
            each = [_eliminated(one, len(poles), damping) for one in built]
            whole = np.zeros(2 * len(poles)) if hold else _step(each, damping)
            part, there, tried, new = _halved(records, poles, parts, each, whole, cost)
            if new < cost or damping > _STUCK:
                break
            damping *= _STIFFEN
        if not new < cost:
            break
        done = cost - new < _DONE * len(records)
        poles, parts, cost = there, tried, new
        damping *= _EASE if part == 1 else 1
        if done:
            break
    return poles, parts


def _halved(
    records: Sequence[Cells],
    poles: ComplexArray,
    parts: Sequence[Driven],
    each: Sequence[_Eliminated],
    whole: RealArray,
    cost: float,
) -> tuple[float, ComplexArray, list[Driven], float]:
    """Return the largest part of a step, of its halves, that lowers -log p, where it leads, and -log p there."""
    for part in 0.5 ** np.arange(_HALVED):
        step = part * whole
        there = poles + step[::2] + 1j * step[1::2]
        tried = [moved(own, part * (one.own - one.follows @ whole)) for own, one in zip(parts, each, strict=True)]
        near = bool(np.all(np.abs(there - poles) < np.abs(poles.real)) and np.all(there.real < 0))
        new = _total(records, there, tried) if near else np.inf
        if new < cost:
            break
    return float(part), there, tried, new


def _total(records: Sequence[Cells], poles: ComplexArray, parts: Sequence[Driven]) -> float:
    total = 0.0
    for cells, own in zip(records, parts, strict=True):
        total += loss(cells, poles, own)
        if not np.isfinite(total):
            break
    return total


def _step(each: Sequence[_Eliminated], damping: float) -> RealArray:
    information = np.sum([one.information for one in each], axis=0)
    stiff = information + damping * np.diag(np.diag(information))
    return np.asarray(np.linalg.lstsq(stiff, np.sum([one.score for one in each], axis=0), rcond=None)[0])


def _eliminated(built: Equations, modes: int, damping: float) -> _Eliminated:
    """Eliminate all but the poles, by Schur's complement."""
    k = 2 * modes
    size = np.sqrt(np.maximum(np.diag(built.information), 1e-300))
    H, r = built.information / size[:, None] / size, built.score / size
    stiff = H[k:, k:] + (damping + _RIDGE) * np.eye(len(H) - k)
    both = sla.cho_solve(sla.cho_factor(stiff), np.column_stack([r[k:], H[k:, :k]]))
    own, follows = both[:, 0], both[:, 1:]
    information = (H[:k, :k] - H[:k, k:] @ follows) * size[:k, None] * size[:k]
    score = (r[:k] - H[:k, k:] @ own) * size[:k]
    back = size[k:]
    return _Eliminated(information, score, own / back, follows * size[:k] / back[:, None])
