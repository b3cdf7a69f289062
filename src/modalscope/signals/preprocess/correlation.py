"""Estimate correlations of records without measured forces, which decay as impulse responses, and their half spectra."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft

from modalscope.data.geometry import DofLike, references_of
from modalscope.data.records import Signals
from modalscope.data.response import CORRELATED, HALF
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredSignals
from modalscope.numerics.arguments import COUNT, at_least, named
from modalscope.numerics.checks import Array, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import allowed_memory, check_fits, one_thread
from modalscope.signals.preprocess.spectra import Segments, check_window
from modalscope.signals.preprocess.stored_correlation import LagSum, lag_sums

#: Default limit of references: enough for any group of modes within one resonance of each other.
MOST_REFERENCES = 30

#: Minimum residual of a channel from the chosen ones, as a part of it; below, it depends on them.
_MIN_RESIDUAL = 1e-12

#: Relative difference of what two channels explain below which the first of them is chosen.
_TIE = 1e-9

#: Samples whose products are summed at a time: those of all samples without their means would be a copy of the record.
_SAMPLES_AT_A_TIME = 4096

#: Maximum number of lags by default; a tenth of the samples of all runs where these are fewer.
_MAX_DEFAULT_LAGS = 2000

#: Blocks of a record from whose scatter standard deviations are computed.
BLOCKS = 20

#: Minimum correlation of the window with itself at the largest lag, over that at lag 0: below, the quotient is noise.
_MIN_WINDOW = 1e-3


def spanning_outputs(signals: Signals, most: int = MOST_REFERENCES) -> tuple[int, ...]:
    """Return the outputs that jointly explain most of all outputs, in ascending order; all where there are no more than `most`.

    Pivoted Cholesky factorization of the correlation coefficients R at lag zero: the next channel j has the largest sum_i R_ij^2 / R_jj,
    and R becomes R - R_j R_j' / R_jj. A channel of noise explains only itself.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((500, 2))
    >>> spanning_outputs(Signals(outputs=y @ [[1.0, 2.0, 3.0, 0.0], [0.0, 0.0, 0.0, 1.0]], sampling_rate=1.0), 2)
    (0, 3)
    """
    outputs, _ = signals.by_run()
    count = outputs.shape[2]
    if count <= most:
        return tuple(range(count))
    covariance = np.zeros((count, count))
    for run, mean in zip(outputs, outputs.mean(axis=1), strict=True):
        for start in range(0, len(run), _SAMPLES_AT_A_TIME):
            y = run[start : start + _SAMPLES_AT_A_TIME] - mean
            covariance += y.T @ y
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, np.inf)
    R = covariance / np.outer(size, size)
    chosen: list[int] = []
    for _ in range(most):
        power = np.diag(R)
        explained = np.where(power > _MIN_RESIDUAL, np.sum(R**2, axis=0) / np.maximum(power, _MIN_RESIDUAL), 0.0)
        if explained.max() <= 0:
            break
        j = int(np.argmax(explained >= (1 - _TIE) * explained.max()))
        chosen.append(j)
        R = R - np.outer(R[:, j], R[j]) / power[j]
    return tuple(sorted(chosen)) or tuple(range(most))


class CorrelationBlocks(NamedTuple):
    """Sums of y(t + k) y_ref(t)' over the samples t of consecutive blocks of a record.

    Attributes
    ----------
    sums : array, (blocks, lags + 1, l, r)
        Sums over the products of a block; lag 0 comes first.
    pairs : array, (blocks, lags + 1)
        How many products each sum has.
    """

    sums: RealArray
    pairs: RealArray

    @property
    def values(self) -> RealArray:
        """Unbiased estimates of every block, (blocks, lags + 1, l, r)."""
        return self.sums / self.pairs[:, :, None, None]

    @property
    def mean(self) -> RealArray:
        """The estimate of the whole record, (lags + 1, l, r): all products over their number."""
        return np.asarray(self.sums.sum(axis=0) / self.pairs.sum(axis=0)[:, None, None])


def _lags(signals: Signals | StoredSignals, lags: int | None) -> int:
    if lags is None:
        lags = max(2, min(signals.runs * signals.samples // 10, signals.samples // 2, _MAX_DEFAULT_LAGS))
    check_count("lags", lags, least=2)
    if lags >= signals.samples:
        change = f"Lower lags to at most {signals.samples - 1}; a tenth of that gives a reliable estimate."
        raise DataError(f"lags={lags}:", f"a run has {signals.samples} samples", change)
    return lags


def _centred(signals: Signals) -> RealArray:
    """Return the outputs (R, N, l) without the mean of every channel and run."""
    check_size(signals)
    outputs, _ = signals.by_run()
    return np.asarray(outputs - outputs.mean(axis=1, keepdims=True))


def _products(y: RealArray, times: int, references: list[int], lags: int) -> RealArray:
    """Return sum_t y(t + k) y(t)' for k = 0 ... lags and t over the first `times` rows of y."""
    total = LagSum(y.shape[1], references, lags)
    total.add(y, times)
    return total.finish()


@named(blocks=COUNT)
@one_thread
def correlation_blocks(
    signals: Signals | StoredSignals,
    *,
    references: Iterable[DofLike] | DofLike | None = None,
    lags: int | None = None,
    blocks: int = BLOCKS,
) -> CorrelationBlocks:
    """Correlate a record block by block: the scatter of the blocks gives the uncertainty of its correlations.

    Sums the products y(t + k) y_ref(t)' of `blocks` blocks of times t; t + k reaches into the next one, so that `mean` is the unbiased
    estimate of the whole record. Each of several runs has its share of the blocks, at least one.

    Parameters
    ----------
    signals : Signals or StoredSignals
        The mean of every channel and run is removed; inputs are not used. A stored record is read once, see `working`.
    references : labels or indices, optional
        All outputs by default.
    lags : int, optional
        Largest lag in samples; by default a tenth of the record, and at most 2000.
    blocks : int
        Number of blocks.

    Raises
    ------
    DataError
        Unknown references, more lags than samples, or blocks of no samples.
    """
    chosen, count = references_of(references, signals.output_dofs), _lags(signals, lags)
    blocks_per_run = max(1, -(-blocks // signals.runs))
    edges = np.linspace(0, signals.samples, blocks_per_run + 1).round().astype(int)
    if np.any(np.diff(edges) < 2):
        change = f"Lower blocks to at most {signals.runs * signals.samples // 2}."
        raise DataError(f"blocks={blocks}:", f"a run has {signals.samples} samples", change)
    last = np.minimum(edges[1:, None], signals.samples - np.arange(count + 1))
    counts = np.tile(np.maximum(last - edges[:-1, None], 0).astype(float), (signals.runs, 1))
    if np.any(counts == 0):
        have = "the last block is shorter than the largest lag"
        raise DataError(f"blocks={blocks} with {count} lags:", have, "Lower blocks or lags.")
    if isinstance(signals, StoredSignals):
        return CorrelationBlocks(lag_sums(signals, tuple(chosen), count, tuple(map(int, edges))), counts)
    sums = [
        _products(y[start : stop + count], stop - start, chosen, count)
        for y in _centred(signals)
        for start, stop in itertools.pairwise(edges)
    ]
    return CorrelationBlocks(np.array(sums), counts)


@named(signals=(Signals, StoredSignals), segment=at_least(2))
@one_thread
def estimate_correlation(
    signals: Signals | StoredSignals,
    *,
    references: Iterable[DofLike] | DofLike | None = None,
    lags: int | None = None,
    window: str | None = None,
    segment: int | None = None,
    overlap: float = 0.5,
) -> ImpulseResponse:
    """Estimate the correlations of a record of outputs alone (ambient vibration), which decay as free vibrations do.

    R(k) = E[y(t + k) y_ref(t)'] of the outputs with some of them, the natural excitation technique. Under white forces
    R(k) = C A^(k-1) G for k >= 1: a Markov sequence with the structure's own poles. It starts at lag 1; R(0) does not belong to it
    and is kept as `feedthrough`.

    Parameters
    ----------
    signals : Signals or StoredSignals
        The mean of every channel and run is removed, runs are averaged; inputs are not used. A stored record is read once, see `working`.
    references : labels or indices, optional
        All outputs by default.
    lags : int, optional
        Largest lag in samples; by default a tenth of the record, and at most 2000.
    window : str, optional
        Without it, the unbiased estimate: all products of the record over their number, 1 / (N - k) sum_t y(t + k) y_ref(t)'.
        With it, segments under that window are averaged and divided by the window's own correlation, which leaves
        the estimate unbiased and weighs the middle of the segments.
    segment : int, optional
        Samples of a segment with `window`; by default four times the lags.
    overlap : float
        Part of a segment that the next one shares.

    Returns
    -------
    ImpulseResponse
        `values[k]` = R(k + 1) of shape (lags, l, r), kind "correlation"; the references are its inputs.

    Raises
    ------
    DataError
        Unknown references, more lags than samples.

    References
    ----------
    James, Carne and Lauffer, "The natural excitation technique (NExT)", 1995; Bendat and Piersol, "Random Data", section 11.4.

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((2000, 2))
    >>> r = estimate_correlation(Signals(outputs=y, sampling_rate=10.0), references=["y2"], lags=50)
    >>> r.values.shape, r.kind
    ((50, 2, 1), 'correlation')
    """
    chosen, count = references_of(references, signals.output_dofs), _lags(signals, lags)
    if window is None:
        if segment is not None:
            raise DataError(f"segment={segment}:", "no window is given", 'Give window="hann" with segment.')
        R, estimate = _unbiased(signals, chosen, count), "unbiased"
    elif isinstance(signals, StoredSignals):
        change = "Leave window out, or load the record into memory: record.load()."
        raise DataError(f"window={window!r}:", "a stored record has no windowed estimate", change)
    else:
        R, estimate = _windowed(signals, chosen, count, check_window(window), segment, overlap)
    names = [signals.output_dofs[i] for i in chosen]
    note = f"{CORRELATED} ({estimate}, mean removed, {count} lags from lag 1) with {', '.join(names)}"
    return ImpulseResponse(
        values=R[1:],
        feedthrough=R[0],
        sampling_rate=signals.sampling_rate,
        kind="correlation",
        quantity=signals.quantity,
        output_dofs=signals.output_dofs,
        input_dofs=tuple(names),
        units=(signals.units[0], tuple(signals.units[0][i] for i in chosen)),
        geometry=signals.geometry,
        processing=(*signals.processing, note),
        source_path=signals.source_path,
    )


def _unbiased(signals: Signals | StoredSignals, references: list[int], lags: int) -> RealArray:
    """Return R(0 ... lags), all products of the record over their number; of a stored record by blocks, which are computed once."""
    if isinstance(signals, StoredSignals):
        size = 8.0 * (lags + 1) * (len(signals.output_dofs) + 1) * (len(references) + 1)
        blocks = min(BLOCKS, max(signals.samples // (lags + 2), 1)) if BLOCKS * size < allowed_memory() / 4 else 1
        return correlation_blocks(signals, references=references, lags=lags, blocks=blocks).mean
    check_size(signals)
    sums = LagSum(len(signals.output_dofs), references, lags)
    for y in signals.by_run()[0]:
        sums.mean = y.mean(axis=0)
        sums.add(y)
    return sums.finish() / (signals.runs * (signals.samples - np.arange(lags + 1)))[:, None, None]


def _windowed(
    signals: Signals, references: list[int], lags: int, window: str, segment: int | None, overlap: float
) -> tuple[RealArray, str]:
    """Return R(0 ... lags) averaged over windowed segments, divided by the correlation of the window."""
    length = min(4 * lags, signals.samples) if segment is None else segment
    if not lags < length <= signals.samples:
        asked, change = f"segment={length} for {lags} lags:", f"Give {lags + 1} to {signals.samples}."
        raise DataError(asked, f"a run has {signals.samples} samples", change)
    starts, w, _ = Segments.of(signals.samples, length, overlap, window)
    weight = scipy.signal.correlate(w, w)[length - 1 : length + lags]
    if weight[-1] < _MIN_WINDOW * weight[0]:
        asked = f"segment={length} under a {window} window for {lags} lags:"
        change = f"Raise segment to {2 * lags} or more, or lower lags."
        raise DataError(asked, "this window has no overlap with itself at the largest lag", change)
    total = np.zeros((lags + 1, len(signals.output_dofs), len(references)))
    for y in _centred(signals):
        for start in starts:
            total += _products(y[start : start + length] * w[:, None], length, references, lags)
    R = total / (signals.runs * len(starts) * weight)[:, None, None]
    return R, f"{signals.runs * len(starts)} segments of {length} samples, {window} window"


@named(correlation=ImpulseResponse, lines=at_least(2))
def half_spectra(correlation: ImpulseResponse, *, lines: int | None = None) -> FrequencyResponse:
    """Compute half spectra of correlations, which frequency-domain methods take as they take frequency responses.

    S+(z) = R(0) / 2 + sum_k R(k) z^-k, k >= 1: rational with the poles of a frequency response.

    For correlations C A^(k-1) G they are R(0) / 2 + C (z I - A)^-1 G, and S+ + S+* (for all channels as references) is the
    cross spectral matrix. Beyond the last lag R is taken as zero.

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
    check_size(correlation)
    if correlation.kind != "correlation" or correlation.feedthrough is None:
        have = f"this is a {correlation.kind} response" + (" without R(0)" if correlation.feedthrough is None else "")
        raise DataError("half spectra of a correlation:", have, "Give the result of estimate_correlation.")
    R: Array = np.concatenate([correlation.feedthrough[None] / 2, correlation.values])
    count = correlation.samples // 2 + 1 if lines is None else lines
    check_fits(f"half spectra on {count} lines", 32.0 * count * R[0].size, "Give fewer lines.")
    length = 2 * (count - 1)
    # lines closer than those of the lags need zero padding, wider ones a sequence folded on itself
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
