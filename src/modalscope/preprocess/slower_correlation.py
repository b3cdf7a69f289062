"""Correlations at the rate that suits a band."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from modalscope.model.checks import check_kind
from modalscope.model.impulse import ImpulseResponse

__all__ = ["slower_correlation"]

#: Samples that are kept a period of the band's upper end, at least; order and ripple (dB) of the low-pass at 0.8 of half the new rate.
_SAMPLES_PER_PERIOD, _ORDER, _RIPPLE = 4.0, 8, 0.05


def slower_correlation(correlation: ImpulseResponse, highest: float) -> ImpulseResponse:
    """Return a correlation low-pass filtered, one sample in q kept, q the largest with 4 samples a period of `highest`.

    Other impulse responses stay as they are.

    R(k), k >= 1, is a Markov sequence, and so is what a causal filter makes of it: with the same poles and the filter's, which lie at the
    band's end. R(0), which holds the noise of the channels, is no part of it and is left.

    Parameters
    ----------
    correlation : ImpulseResponse
    highest : float
        Hz.
    """
    check_kind("slower_correlation", correlation, ImpulseResponse)
    rate = correlation.sampling_rate
    factor = (
        1 if not correlation.ambient else min(int(rate / (_SAMPLES_PER_PERIOD * highest)), correlation.samples // 4)
    )
    if factor < 2:
        return correlation
    sections = scipy.signal.cheby1(_ORDER, _RIPPLE, 0.8 * rate / factor / 2, fs=rate, output="sos")
    filtered = np.asarray(scipy.signal.sosfilt(sections, correlation.values, axis=0))
    return replace(
        correlation,
        values=np.ascontiguousarray(filtered[factor - 1 :: factor]),  # the first is lag 1 of the new rate
        feedthrough=None,
        sampling_rate=rate / factor,
    ).processed(f"low-pass filtered, one lag in {factor} kept")
