"""Samples that are missing without a gap in the numbers: all channels leave at once what their past predicts, and go on as before."""

from __future__ import annotations

import numpy as np
import scipy

from modalscope.model.checks import Array, RealArray
from modalscope.model.signals import Signals
from modalscope.preprocess.findings import Finding

__all__ = ["slips"]

#: Samples of the past that predict the next one; samples on either side that say what is usual.
_PAST, _NEAR = 20, 80

#: Most channels leave their prediction by so many deviations: of Gaussian ones a single does so once in 10^12 samples.
_FAR = 7.0

#: A blow makes a structure move more than before, by more than this over so many samples; a step in time does not.
_LOUDER, _AROUND = 1.5, 400


def slips(signals: Signals, kind: str) -> list[Finding]:
    """Find times at which samples are missing from all channels, or clocks jumped.

    A channel is predicted from its last 20 samples by the linear rule of least squares (Yule and Walker). What is left has a size of
    its own at every time; where it exceeds 7 times that in most channels at once, and the motion is as large after as before, time has
    jumped.

    Parameters
    ----------
    signals : Signals
    kind : str
        Of the excitation; hits, bursts and sweeps begin at once and are not looked at.
    """
    outputs, _ = signals.by_run()
    if kind not in ("random", "ambient") or signals.samples < 10 * _NEAR:
        return []
    places = [(r, k) for r, run in enumerate(outputs) for k in jumps(run)]
    if not places:
        return []
    where = ", ".join(
        f"{k / signals.sampling_rate:.6g} s" + (f" of run {r + 1}" if signals.runs > 1 else "") for r, k in places[:3]
    )
    more = ", ..." if len(places) > 3 else ""
    return [
        Finding(
            "missing samples",
            signals.output_dofs,
            f"at {len(places)} times most channels leave what their past predicts and go on as large as before: at {where}{more}",
            "Look for lost blocks or a clock that jumped; give the parts before and after as runs, merge([...]).",
        )
    ]


def jumps(y: RealArray) -> list[int]:
    """Return the samples k of y (N, l) at which most channels leave their prediction and the motion is no larger after than before.

    Parameters
    ----------
    y : array, (N, l)
    """
    y = y - y.mean(axis=0)
    alive = np.flatnonzero(np.ptp(y, axis=0) > 0)
    if not alive.size:
        return []
    far = np.stack([_surprise(y[:, i]) for i in alive], axis=1)
    most = np.median(far, axis=1) if alive.size > 1 else far[:, 0]
    found: list[int] = []
    for k in np.flatnonzero(most > _FAR):
        before, after = (
            np.sqrt(np.mean(part[:, alive] ** 2, axis=0)) for part in (y[max(k - _AROUND, 0) : k], y[k : k + _AROUND])
        )
        steady = np.median(after / np.maximum(before, 1e-300)) < _LOUDER
        if steady and (not found or k - found[-1] > _NEAR):
            found.append(int(k))
    return found


def _surprise(x: RealArray) -> RealArray:
    """Return how far every sample lies from its prediction, in deviations of what is usual before and after; 0 near the ends."""
    products = scipy.signal.correlate(x, x, method="fft")[len(x) - 1 : len(x) + _PAST]
    products[0] *= 1 + 1e-9
    rule = scipy.linalg.solve_toeplitz(products[:_PAST], products[1 : _PAST + 1])
    left = np.asarray(scipy.signal.lfilter(np.concatenate([[1.0], -rule]), [1.0], x), dtype=float)
    power: Array = np.concatenate([[0.0], np.cumsum(left**2)])
    mean = (power[_NEAR:] - power[:-_NEAR]) / _NEAR  # of the samples k ... k + _NEAR - 1
    k = np.arange(_NEAR + _PAST, len(x) - _NEAR - _PAST)
    usual = np.sqrt(np.maximum(mean[k - _NEAR], mean[k + _PAST]))
    far = np.zeros(len(x))
    far[k] = np.abs(left[k]) / np.maximum(usual, np.finfo(float).tiny)
    return far
