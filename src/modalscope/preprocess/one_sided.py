"""Half spectra of correlations: one-sided transforms, which are rational with the poles of a frequency response."""

from __future__ import annotations

import numpy as np
from scipy import fft

from modalscope.model.checks import Array, DataError, check_count, check_kind
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.keywords import named
from modalscope.model.response_facts import HALF
from modalscope.model.sizes import check_size

__all__ = ["half_spectra"]


@named()
def half_spectra(correlation: ImpulseResponse, *, lines: int | None = None) -> FrequencyResponse:
    """Turn correlations into half spectra, which frequency-domain methods take as they take frequency responses.

    S+(z) = R(0) / 2 + sum_k R(k) z^-k, k >= 1: rational with the poles of a frequency response.

    For correlations C A^(k-1) G they are R(0) / 2 + C (z I - A)^-1 G, and S+ + S+* (for all channels as references) is the
    cross spectral matrix. What lies beyond the last lag is taken as zero.

    Parameters
    ----------
    correlation : ImpulseResponse
        From `estimate_correlation`, with R(0) as its feedthrough.
    lines : int, optional
        Lines from 0 Hz to half the sampling rate; one more than half the lags by default.

    Returns
    -------
    FrequencyResponse
        Of a sampled system: for the domain "z".

    Raises
    ------
    DataError
        A response that is no correlation, or whose R(0) is missing.
    """
    check_kind("half_spectra", correlation, ImpulseResponse)
    check_size(correlation)
    if correlation.kind != "correlation" or correlation.feedthrough is None:
        raise DataError(
            "half spectra of a correlation were asked",
            f"this is a {correlation.kind} response" + (" without R(0)" if correlation.feedthrough is None else ""),
            "Give the result of estimate_correlation.",
        )
    R: Array = np.concatenate([correlation.feedthrough[None] / 2, correlation.values])
    count = correlation.samples // 2 + 1 if lines is None else check_count("lines", lines, least=2)
    length = 2 * (count - 1)
    # lines closer than the lags need zeros behind them, wider ones a sequence folded on itself
    folded = np.zeros((-(-R.shape[0] // length) * length, *R.shape[1:]))
    folded[: R.shape[0]] = R
    values = fft.rfft(folded.reshape(-1, length, *R.shape[1:]).sum(axis=0), axis=0)
    return FrequencyResponse(
        values=values,
        frequencies=fft.rfftfreq(length, 1 / correlation.sampling_rate),
        sampling_rate=correlation.sampling_rate,
        quantity=correlation.quantity,
        **correlation.labelled(),
    ).processed(f"{HALF} on {count} lines")
