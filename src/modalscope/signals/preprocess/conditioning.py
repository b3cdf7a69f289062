"""Condition records: remove trends, filter, decimate, integrate and differentiate; `processing` names each step.

A stored record is filtered while it is read: every stretch with the samples before it, as the whole record would be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from scipy import fft

from modalscope.data.records import Signals
from modalscope.data.responses import ImpulseResponse
from modalscope.data.stored import Record, Rows, StoredSignals
from modalscope.numerics.arguments import COUNT, POSITIVE, named
from modalscope.numerics.checks import Array, RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.damped_tones import largest_step, one_in
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.numerics.statistics import MANY_NUMBERS, few_channels

#: Remainder of a filter's transient at the start of a stretch: below rounding, also for several poles.
_TRANSIENT = 1e-20

#: Order and ripple (dB) of the low-pass filter before decimation: 60 dB down at 1.5 times its edge. Order of the high-pass of a band.
_LOW_PASS, _HIGH_PASS_ORDER = (8, 0.05), 4

#: Filter edges lie outside the band by these factors, and so do the poles of the filters, which an identification finds.
_LOW_EDGE, _HIGH_EDGE = 0.8, 1.05

#: Minimum samples a period of the band's upper end: of a decimated record, and of a decimated correlation.
_RECORD_SAMPLES_PER_PERIOD, _LAGS_PER_PERIOD = 2.5, 4.0

#: A line of a stored record is fitted to so many stretches all along it, of which each has an equal part of an excerpt.
_STRETCHES = 64


@dataclass(frozen=True)
class FilteredRows:
    """Rows filtered by second-order sections as in `scipy.signal`, forwards and backwards for zero phase, one in `factor` kept."""

    rows: Rows
    sections: tuple[tuple[float, ...], ...]
    factor: int
    zero_phase: bool

    @property
    def shape(self) -> tuple[int, int]:
        """Remaining samples, and channels."""
        samples, channels = self.rows.shape
        return -(-samples // self.factor), channels

    @property
    def identity(self) -> str:
        """Identity of the rows and of the filter."""
        return f"{self.rows.identity} filtered {self.sections} {self.factor} {self.zero_phase}"

    def read(self, start: int, stop: int) -> Array:
        """Return filtered rows, with the samples before them (and behind them, for zero phase) in which the filter settles."""
        samples, q = self.rows.shape[0], self.factor
        first, last = start * q, min((stop - 1) * q + 1, samples)
        if not self.sections:
            return np.asarray(self.rows.read(first, last)[::q], dtype=float)
        sections = np.array(self.sections)
        transient = settling(sections)
        begin = max(first - transient, 0)
        end = min(last + transient, samples) if self.zero_phase else last
        rows = np.asarray(self.rows.read(begin, end), dtype=float)
        return np.ascontiguousarray(apply_filter(sections, rows, self.zero_phase)[first - begin : last - begin : q])


def settling(sections: Array) -> int:
    """Return the samples in which the slowest pole of a filter, sections (s, 6), decays to 1e-20.

    Examples
    --------
    >>> settling(np.array([[1.0, 0.0, 0.0, 1.0, -0.5, 0.0]]))
    67
    """
    size = max(float(np.abs(np.roots(section[3:])).max(initial=0.0)) for section in np.atleast_2d(sections))
    return int(np.ceil(np.log(_TRANSIENT) / np.log(size))) if size > 0 else 2 * len(sections)


def apply_filter(sections: Array, x: RealArray, zero_phase: bool) -> RealArray:
    """Return x (..., samples, channels) filtered along its samples."""
    if zero_phase:
        pad = min(3 * (2 * len(sections) + 1), x.shape[-2] - 1)
        return np.asarray(scipy.signal.sosfiltfilt(sections, x, axis=-2, padlen=pad))
    # in the steady state of the first sample: no step at the start of the record
    state = scipy.signal.sosfilt_zi(sections)
    start = np.moveaxis(np.multiply.outer(state, x[..., 0, :]), 1, -2)  # (sections, ..., 2, channels)
    return np.asarray(scipy.signal.sosfilt(sections, x, axis=-2, zi=start)[0])


def _on_all(signals: Signals, change: Callable[[RealArray], RealArray], note: str, **fields: object) -> Signals:
    """Return the record with `change` applied to outputs and inputs along the axis of the samples."""
    inputs = None if signals.inputs is None else change(signals.inputs)
    changed = {"outputs": change(signals.outputs), "inputs": inputs, **fields}
    return replace(signals, **changed).processed(note)  # type: ignore[arg-type]


@named(signals=Signals, kind=("constant", "linear"))
def detrend(signals: Signals, *, kind: str = "linear") -> Signals:
    """Return the record without its mean ("constant") or its straight-line trend ("linear"), channel by channel and run by run.

    Parameters
    ----------
    signals : Signals
    kind : {"linear", "constant"}
        The straight line by least squares, or the mean alone.

    Examples
    --------
    >>> record = Signals(outputs=np.arange(10.0)[:, None], sampling_rate=1.0)
    >>> float(np.abs(detrend(record).outputs).max()) < 1e-12
    True
    """
    if kind == "constant":
        return _on_all(signals, lambda x: np.asarray(x - x.mean(axis=-2, keepdims=True)), "mean removed")
    return _on_all(signals, _without_line, "straight-line trend removed")


def _without_line(x: RealArray) -> RealArray:
    """Return samples (..., N, l) without the straight line of each channel: of a few channels at a time, as each takes several copies."""
    straight = np.empty(x.shape)
    for few in few_channels(x[..., 0].size, x.shape[-1], MANY_NUMBERS):
        straight[..., few] = scipy.signal.detrend(x[..., few], axis=-2)
    return straight


def straightened(record: Any) -> Any:
    """Return a record without inputs, stored or not, without the straight line of every channel and run.

    The line of a stored record is fitted to 64 evenly spread stretches, or to all samples where these are no more than an excerpt. It is
    subtracted while the record is read.
    """
    if isinstance(record, StoredSignals):
        return _straightened_rows(record)
    return replace(record, outputs=_without_line(record.outputs))


def _straightened_rows(record: StoredSignals) -> StoredSignals:
    samples, count = record.samples, record.excerpt_samples
    edges = np.linspace(0, samples, _STRETCHES + 1 if count < samples else 2).astype(int)
    length = max(count // (len(edges) - 1), 2)
    products, of_time = np.zeros((2, len(record.output_dofs))), np.zeros((2, 2))
    for start, stop in pairwise(edges):
        y = record.chunk(start, min(stop, start + length))
        columns = np.stack([np.ones(len(y)), _times(start, start + len(y), samples)])
        products += columns @ y
        of_time += columns @ columns.T
    constant, slope = np.linalg.lstsq(of_time, products, rcond=None)[0]
    change, words = partial(_straight, constant, slope, samples), f"without line {tuple(constant)} {tuple(slope)}"
    return replace(record, rows=ChangedRows(record.rows, change, words))


def _times(start: int, stop: int, samples: int) -> RealArray:
    """Return the times of samples from the middle of a record, in its length."""
    return np.asarray((np.arange(start, stop) - (samples - 1) / 2) / samples)


@dataclass(frozen=True)
class ChangedRows:
    """Rows of which each stretch is changed by itself when it is read.

    `change`: of the first row and the rows, a function that other processes can be sent. `words`: what it does, with its numbers.
    """

    rows: Rows
    change: Callable[[int, RealArray], RealArray]
    words: str

    @property
    def shape(self) -> tuple[int, int]:
        """Samples, and channels."""
        return self.rows.shape

    @property
    def identity(self) -> str:
        """Identity of the rows and of the change."""
        return f"{self.rows.identity} {self.words}"

    def read(self, start: int, stop: int) -> Array:
        """Return changed rows."""
        return self.change(start, np.asarray(self.rows.read(start, stop), dtype=float))


def _straight(constant: RealArray, slope: RealArray, samples: int, start: int, rows: RealArray) -> RealArray:
    """Return rows without a line a column: `constant` in the middle, `slope` over all samples."""
    times = _times(start, start + len(rows), samples)
    return np.asarray(rows - constant - times[:, None] * slope)


def _filtered(signals: Record, sections: Array | None, factor: int, zero_phase: bool, note: str) -> Record:
    """Return a filtered record, one sample in `factor` kept; a stored one is filtered while it is read."""
    if signals.samples // factor < 2:
        have = f"the record has {signals.samples} samples"
        raise DataError(f"one sample in {factor}:", have, "Measure longer, or decimate less (decimate=False).")
    rate = signals.sampling_rate / factor
    if isinstance(signals, StoredSignals):
        of_filter = () if sections is None else tuple(tuple(map(float, section)) for section in sections)
        rows = FilteredRows(signals.rows, of_filter, factor, zero_phase)
        return replace(signals, rows=rows, sampling_rate=rate).processed(note)

    def change(x: RealArray) -> RealArray:
        y = x if sections is None else apply_filter(sections, x, zero_phase)
        return np.ascontiguousarray(y[..., ::factor, :])

    return _on_all(signals, change, note, sampling_rate=rate)


def _low_pass(edge: float, rate: float) -> Array:
    return np.asarray(scipy.signal.cheby1(*_LOW_PASS, edge, fs=rate, output="sos"))


@named(signals=(Signals, StoredSignals))
def filter_band(
    signals: Record, lowest: float, highest: float, *, zero_phase: bool = False, decimate: bool = True
) -> Record:
    """Return the record filtered to a band, at the lowest sampling rate that still carries it.

    Outputs and inputs pass the same filters, which leaves their response unchanged: a Butterworth high-pass of order 4
    at 0.8 `lowest` and a Chebyshev low-pass of order 8 (0.05 dB) at 1.05 `highest`. Their poles lie outside the band: an
    identification may find them there. Then one sample in q is kept, q the largest with at least 2.5 samples a period of
    `highest`.

    Parameters
    ----------
    signals : Signals or StoredSignals
        A stored record stays in its file and is filtered while it is read.
    lowest, highest : float
        Band in Hz; `lowest` may be 0: no high-pass.
    zero_phase : bool
        Filter forwards and backwards: nothing is delayed, and the amplitudes pass the filter twice.
    decimate : bool
        Whether the sampling rate is lowered.

    Raises
    ------
    DataError
        A band whose ends do not increase, or that reaches half the sampling rate.

    Examples
    --------
    >>> record = Signals(outputs=np.random.default_rng(0).standard_normal((4000, 1)), sampling_rate=100.0)
    >>> filter_band(record, 0.5, 4.0).sampling_rate
    10.0
    """
    rate = signals.sampling_rate
    if not (0 <= lowest < highest < rate / 2):
        have = f"the record contains 0 to {rate / 2:g} Hz"
        raise DataError(f"the band {lowest:g} to {highest:g} Hz:", have, "Give the lower end first, within these.")
    filters = []
    if lowest > 0:
        filters.append(scipy.signal.butter(_HIGH_PASS_ORDER, _LOW_EDGE * lowest, "highpass", fs=rate, output="sos"))
    if _HIGH_EDGE * highest < 0.95 * rate / 2:  # no low-pass where the band reaches nearly half the sampling rate
        filters.append(_low_pass(_HIGH_EDGE * highest, rate))
    factor = max(int(rate / (_RECORD_SAMPLES_PER_PERIOD * highest)), 1) if decimate else 1
    sections = np.concatenate(filters) if filters else None
    note = f"filtered to {lowest:g}-{highest:g} Hz" + (f", one sample in {factor} kept" if factor > 1 else "")
    return _filtered(signals, sections, factor, zero_phase, note)


@named(signals=(Signals, StoredSignals), factor=COUNT)
def decimate(signals: Record, factor: int, *, zero_phase: bool = False) -> Record:
    """Return the record low-pass filtered at 0.8 of the new Nyquist frequency, one sample in `factor` kept.

    Parameters
    ----------
    signals : Signals or StoredSignals
    factor : int
        Samples of the old record for one of the new.
    zero_phase : bool
        Filter forwards and backwards (see `filter_band`).

    Raises
    ------
    DataError
        A factor below 1, or one that leaves fewer than two samples.
    """
    if factor == 1:
        return signals
    sections = _low_pass(0.8 * signals.sampling_rate / factor / 2, signals.sampling_rate)
    return _filtered(signals, sections, factor, zero_phase, f"low-pass filtered, one sample in {factor} kept")


def _changed_quantities(signals: Signals, power: int) -> tuple[str | None, ...]:
    """Return the outputs' quantities after differentiating `power` times; unknown ones stay unknown."""
    names: dict[int, str | None] = {place: name for name, place in QUANTITIES.items()}
    for dof, quantity in zip(signals.output_dofs, signals.quantities, strict=True):
        if quantity is not None and QUANTITIES[quantity] + power not in names:
            asked = f"a record {'differentiated' if power > 0 else 'integrated'} {abs(power)} times:"
            change = "Lower times, or leave that output out with select(exclude=...)."
            raise DataError(asked, f"the quantity of output {dof} is {quantity}", change)
    return tuple(quantity and names[QUANTITIES[quantity] + power] for quantity in signals.quantities)


def _in_lines(x: RealArray, factor: Array) -> RealArray:
    """Return x with its spectrum multiplied by `factor`, the record being continued by its odd mirror image."""
    closed = np.concatenate([x, -x[..., -2:0:-1, :]], axis=-2)
    spectrum = fft.rfft(closed, axis=-2) * factor[:, None]
    return np.asarray(fft.irfft(spectrum, n=closed.shape[-2], axis=-2)[..., : x.shape[-2], :])


def _mirror_lines(signals: Signals) -> RealArray:
    if signals.samples < 3:
        raise DataError("a derivative or an integral needs three samples", "the record has two", "Give three or more.")
    return np.asarray(fft.rfftfreq(2 * signals.samples - 2, 1 / signals.sampling_rate))


@named(signals=Signals, times=COUNT)
def differentiate(signals: Signals, *, times: int = 1) -> Signals:
    """Return the record with its outputs differentiated `times` times, by (j 2 pi f)^times in the frequency domain.

    The inputs stay as they are. The line through the first and the last sample is subtracted first and its slope added
    again. A few samples at both ends are less accurate than the others.

    Parameters
    ----------
    signals : Signals
    times : int
        1 takes displacements to velocities, 2 to accelerations.

    Raises
    ------
    DataError
        An acceleration that would be differentiated.
    """
    quantities = _changed_quantities(signals, times)
    y = signals.outputs
    for _ in range(times):
        slope = (y[..., -1:, :] - y[..., :1, :]) / (signals.samples - 1)
        ramp = y[..., :1, :] + np.arange(signals.samples)[:, None] * slope
        y = _in_lines(y - ramp, 2j * np.pi * _mirror_lines(signals)) + slope * signals.sampling_rate
    return _outputs_only(signals, y, quantities, f"outputs differentiated {times} times")


@named(signals=Signals, times=COUNT, lowest=POSITIVE)
def integrate(signals: Signals, *, times: int = 1, lowest: float | None = None) -> Signals:
    """Return the record with its outputs integrated `times` times, by division by (j 2 pi f)^times above `lowest` Hz.

    Frequencies below `lowest` are removed: there, an integral of a measured record is drift. The straight-line trend is removed
    first. Near the ends, within a period of the lowest frequencies, the result is less accurate.

    Parameters
    ----------
    signals : Signals
    times : int
        1 takes accelerations to velocities, 2 to displacements.
    lowest : float, optional
        Lower end in Hz; ten periods in the record by default.

    Raises
    ------
    DataError
        A displacement that would be integrated.
    """
    quantities = _changed_quantities(signals, -times)
    edge = 10 / signals.duration if lowest is None else lowest
    lines = _mirror_lines(signals)
    inside = lines >= edge
    factor = np.zeros(lines.size, dtype=complex)
    factor[inside] = (2j * np.pi * lines[inside]) ** -times
    y = _in_lines(np.asarray(scipy.signal.detrend(signals.outputs, axis=-2)), factor)
    return _outputs_only(signals, y, quantities, f"outputs integrated {times} times above {edge:g} Hz")


def _outputs_only(signals: Signals, y: RealArray, quantities: tuple[str | None, ...], note: str) -> Signals:
    units = (("",) * len(signals.output_dofs), signals.units[1])
    return replace(signals, outputs=y, quantities=quantities, units=units).processed(note)


def slower_correlation(correlation: ImpulseResponse, highest: float) -> ImpulseResponse:
    """Return a correlation or a free decay low-pass filtered, one sample in q kept, q the largest with 4 samples a period of `highest`.

    Other impulse responses are returned unchanged. R(k), k >= 1, is a Markov sequence, and so is its causally filtered version: with the
    same poles and those of the filter, which lie at the end of the band. R(0) contains the noise of the channels, is no part of it and is
    dropped. A free decay filtered by a symmetric filter of finite length has its own poles alone, from half a filter length on.

    `highest`: Hz.
    """
    check_kind("slower_correlation", correlation, ImpulseResponse)
    rate = correlation.sampling_rate
    if correlation.origin not in ("correlation", "free decay"):
        return correlation
    decays = correlation.origin == "free decay"
    largest = largest_step(correlation.samples) if decays else correlation.samples // 4
    factor = min(int(rate / (_LAGS_PER_PERIOD * highest)), largest)
    if factor < 2:
        return correlation
    if decays:
        slower = replace(correlation, values=one_in(correlation.values, factor), sampling_rate=rate / factor)
        return slower.processed(f"low-pass filtered, one sample in {factor} kept")
    filtered = scipy.signal.sosfilt(_low_pass(0.8 * rate / factor / 2, rate), correlation.values, axis=0)
    values = np.ascontiguousarray(filtered[factor - 1 :: factor])  # the first is lag 1 of the new rate
    slower = replace(correlation, values=values, feedthrough=None, sampling_rate=rate / factor)
    return slower.processed(f"low-pass filtered, one lag in {factor} kept")
