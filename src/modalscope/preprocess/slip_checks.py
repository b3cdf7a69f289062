"""Samples that are missing without a gap in the numbers: the past no longer agrees with what follows, but with what would follow later."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from modalscope.model.checks import Array, RealArray
from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding
from modalscope.preprocess.joint_prediction import FARTHEST, Joint, joints

__all__ = ["Slip", "jumps", "slips"]

#: How often a sound record of any length may be named.
_BY_CHANCE = 1e-3

#: Past and future are compared in the pairs of combinations that are correlated more than this, so many at most.
_ALIKE, _PAIRS = 0.5, 24


class Slip(NamedTuple):
    """A time at which samples are missing.

    Attributes
    ----------
    run, sample : int
        The first sample after it.
    missing : int
        How many, most likely.
    """

    run: int
    sample: int
    missing: int


def slips(signals: Signals, kind: str) -> list[Finding]:
    """Find times at which samples are missing from all channels, or clocks jumped.

    Parameters
    ----------
    signals : Signals
    kind : str
        Of the excitation; hits, bursts and sweeps begin at once and are not looked at.
    """
    outputs, _ = signals.by_run()
    places = jumps(outputs) if kind in ("random", "ambient") else []
    if not places:
        return []
    where = ", ".join(
        f"{place.sample / signals.sampling_rate:.6g} s" + (f" of run {place.run + 1}" if signals.runs > 1 else "")
        for place in places[:3]
    )
    more = ", ..." if len(places) > 3 else ""
    lost = int(np.median([place.missing for place in places]))
    return [
        Finding(
            "missing samples",
            signals.output_dofs,
            f"at {len(places)} times all channels go on as if some {lost} samples were missing: at {where}{more}",
            "Look for lost blocks or a clock that jumped; give the parts before and after as runs, merge([...]).",
        )
    ]


def jumps(runs: RealArray) -> list[Slip]:
    """Return where samples of runs (R, N, l) are missing, the clearest first.

    u and v are the canonical variates of the p samples before a time and of the p samples after it: E u v' = C_0, diagonal, and C_g where g
    samples lie in between. The likelihood of (u, v) with C_g over that with C_0 exceeds x by chance with probability 1 / x at most,
    whatever else is estimated: its expectation is 1. Times at which that is less than 1e-3 over all times and g <= 60 are events. A blow
    is one, too: there v - C_0 u is large, in some variates more than in others, and is given the variances that suit it best. All events
    together must speak for missing samples, by 1e3 times the number of g; their number may be the same at all events, or another, for
    which its own event pays that number.

    Parameters
    ----------
    runs : array, (R, N, l)

    References
    ----------
    The likelihood ratio's bound is Markov's inequality; canonical variates as in Larimore, "Canonical variate analysis in
    identification, filtering, and adaptive control", 1990.
    """
    known = next((known for _, known in joints(runs)), None)
    if known is None:
        return []
    U, V, C = _variates(known)
    events = [(r, *event) for r, run in enumerate(known.runs) for event in _events(run, known, U, V, C)]
    if not events:
        return []
    gains = np.array([gain for _, _, gain in events])
    dear = np.log(gains.shape[1])
    own = gains.max(axis=1) - dear
    together = np.maximum(gains, own[:, None])
    usual = int(np.argmax(together.sum(axis=0)))
    if float(together[:, usual].sum()) - dear < -np.log(_BY_CHANCE):
        return []
    lost = np.where(gains[:, usual] >= own, usual, np.argmax(gains, axis=1)) + 1
    order = np.argsort(-together[:, usual])
    return [Slip(events[i][0], events[i][1] + known.depth, int(lost[i])) for i in order]


def _variates(known: Joint) -> tuple[RealArray, RealArray, RealArray]:
    """Return rows that make u of the past and v of the future (p, l, n), and C_g for g = 0 ... FARTHEST."""
    p, l = known.depth, known.lags.shape[1]
    L = scipy.linalg.cholesky(known.within(p), lower=True)

    def whitened(M: Array) -> Array:
        half = scipy.linalg.solve_triangular(L, M, lower=True)
        return np.asarray(scipy.linalg.solve_triangular(L, half.T, lower=True).T)

    left, d, right = np.linalg.svd(whitened(known.between(0)))
    n = min(int(np.count_nonzero(d > _ALIKE)), _PAIRS)
    left, right = left[:, :n], right[:n].T
    C = np.array([left.T @ whitened(known.between(g)) @ right for g in range(FARTHEST + 1)])
    U, V = (scipy.linalg.solve_triangular(L, side, lower=True, trans=1).reshape(p, l, n) for side in (right, left))
    return U, V, C


def _sides(y: RealArray, p: int, U: RealArray, V: RealArray) -> tuple[RealArray, RealArray]:
    """Return u and v of every time of a run (N, l)."""
    count = len(y) - 2 * p + 1
    u = sum(y[i : i + count] @ U[i] for i in range(p))
    v = sum(y[p + i : p + i + count] @ V[i] for i in range(p))
    return np.asarray(u), np.asarray(v)


def _events(run: RealArray, known: Joint, U: RealArray, V: RealArray, C: RealArray) -> list[tuple[int, RealArray]]:
    """Return the events of a run (N, l): time, and logarithms of the likelihood of g = 1, 2, ... over that of a blow."""
    if not C.shape[1]:
        return []
    u, v = _sides(run, known.depth, U, V)
    bar = np.log(len(known.runs) * len(u) * (len(C) - 1) / _BY_CHANCE)
    w, Q = _spread(C[0])
    squares = ((v - u @ C[0].T) @ Q) ** 2
    # no ratio is larger than half of this
    k = np.flatnonzero(np.sum(squares / w, axis=1) > 2 * bar)
    if not k.size:
        return []
    each = np.array([_likelihood(u[k], v[k], M) for M in C])
    free = np.maximum(w, squares[k])
    blow = -0.5 * np.sum(np.log(free) + squares[k] / free, axis=1)
    ratio = each[1:].max(axis=0) - each[0]
    found: list[tuple[int, RealArray]] = []
    for i in np.argsort(-ratio):
        if ratio[i] < bar:
            break
        if all(abs(k[i] - other) > FARTHEST for other, _ in found):
            found.append((int(k[i]), each[1:, i] - blow[i]))
    return found


def _spread(C: RealArray) -> tuple[RealArray, RealArray]:
    """Return variances and directions of v - C u."""
    w, Q = np.linalg.eigh(np.eye(len(C)) - C @ C.T)
    return np.maximum(w, 1e-6), Q


def _likelihood(u: RealArray, v: RealArray, C: RealArray) -> RealArray:
    """Return the logarithm of the density of v where u is known, up to a constant."""
    w, Q = _spread(C)
    return np.asarray(-0.5 * np.sum(np.log(w)) - 0.5 * np.sum(((v - u @ C.T) @ Q) ** 2 / w, axis=1))
