"""Choose the band of a record: of ambient ones by their spectral peaks, of hits and sweeps by the power of their force."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.shown import figures, percent
from modalscope.data.stored import Record
from modalscope.numerics.checks import BoolArray, RealArray
from modalscope.signals.preprocess.conditioning import decimate, filter_band
from modalscope.signals.preprocess.excitation import excitation_of, find_excitation
from modalscope.signals.preprocess.impacts import find_hits
from modalscope.signals.preprocess.spectral_peaks import Levels, clear_peaks

Band = tuple[float, float]

#: The kinds of the note on the choice: one band, or several.
CHOSEN, SPLIT = "band chosen", "bands chosen"

#: Ends of a band over its lowest and its highest peak: room for weak modes and for the filters.
_LOW_END, _HIGH_END = 0.6, 1.25

#: A record of fewer samples a period of its band's upper end is used unchanged, unless this part of its power lies below the band (drift).
_MAX_UNCHANGED_SAMPLES, _DRIFT_SHARE = 8.0, 0.2

#: A wider band is cut at its widest gap of at least the second ratio: the lags for its slowest mode then suit the fastest.
_MAX_BAND_RATIO, _MIN_GAP_RATIO = 4.0, 1.15

#: Minimum samples a period of the band's upper end after decimation: the number of lags is the same at any rate, and they should end where
#: the correlation is noise.
_SAMPLES_PER_PERIOD = 4.0

#: Useful lines have at least this part of the largest power of the force.
USEFUL_POWER = 0.01

#: A band that reaches this part of half the sampling rate is not cut; above it filters let through some of what is folded back.
UNFOLDED = 0.8

#: Lines of the spectrum of a pulse, which is smooth.
_PULSE_LINES = 1025


class AutomaticBands(NamedTuple):
    """The automatic band of a record, its parts, and how they were chosen; frequencies in Hz."""

    whole: Band | None = None  # None where the record is used unchanged
    parts: tuple[Band, ...] = ()  # one if the band is not wide, none without a peak
    drift: float | None = None  # below is drift, to be removed; None where there is little of it
    span: Band | None = None  # the lowest and the highest peak
    below: float = 0.0  # part of all power below the band
    folded: Band | None = (
        None  # where there are peaks that may be folded back: from the end of the search to half the sampling rate
    )

    def note(self, parts: tuple[Band, ...]) -> Note:
        """Return the note on the bands used, the whole or its parts."""
        assert self.span is not None
        drift = "" if self.drift is None else f"; drift below ({percent(self.below, 2)} of the power) removed"
        if self.folded is not None:
            end, half = self.folded
            drift += f"; peaks above {UNFOLDED:g} of half the sampling rate may be aliases: to search there, --band {end:g} {half:g}"
        bands = ", ".join(f"{low:g} to {high:g} Hz" for low, high in parts)
        kind, noun = (CHOSEN, "Band") if len(parts) == 1 else (SPLIT, "Bands")
        text = f"{noun} {bands}: spectral peaks at {figures(self.span[0])} to {figures(self.span[1])} Hz{drift}"
        return Note(kind, {**_numbers(parts[0][0], parts[-1][1], len(parts)), "share_below": self.below}, text)


def _numbers(low: float, high: float, parts: int = 1) -> dict[str, float]:
    return {"lowest_hz": low, "highest_hz": high, "parts": float(parts)}


def band_up_to(high: float, text: str) -> tuple[Band, Note]:
    """Return the band from 0 Hz to a frequency, and the note on its choice."""
    return (0.0, high), Note(CHOSEN, _numbers(0.0, high), f"Band limited to {high:g} Hz: {text}")


def automatic_bands(levels: Levels, rate: float) -> AutomaticBands:
    """Return the band of an ambient record sampled at `rate` Hz: 0.6 times its lowest peak to 1.25 times the highest.

    It ends at .8 of half the rate: filters let through some of what lies above half the rate, and its peaks are folded back there. A record
    that is sampled for that band without drift is used unchanged, and so is one without peaks below that end. A band wider than 4 : 1 is
    cut into parts at the widest gaps.

    Examples
    --------
    >>> from modalscope.signals.preprocess.spectral_peaks import levels_of
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="ambient", duration=600, sampling_rate=200.0)
    >>> low, high = automatic_bands(levels_of(record), 200.0).whole
    >>> bool(low < chain5().modes().frequencies.min() and chain5().modes().frequencies.max() < high)
    True
    """
    peaks, end = levels.frequencies[levels.in_peak], rounded(UNFOLDED * rate / 2)
    folded = (end, rate / 2) if any(f > end for f in clear_peaks(levels)) else None
    peaks = peaks[peaks <= end]
    if not peaks.size:
        return AutomaticBands()
    low, high = rounded(_LOW_END * peaks[0]), min(rounded(_HIGH_END * peaks[-1]), end)
    power: RealArray = levels.levels * levels.widths[:, None]
    total = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    share = float(np.mean(power[levels.frequencies < low].sum(axis=0) / total))
    parts = _parts((low, high), peaks)
    drift = low if share >= _DRIFT_SHARE else None
    whole = None if rate < _MAX_UNCHANGED_SAMPLES * high and drift is None else (low, high)
    if whole is None and len(parts) == 1:
        if folded is None:
            return AutomaticBands()
        whole, parts = (0.0, end), ((0.0, end),)
    return AutomaticBands(whole, parts, drift, (float(peaks[0]), float(peaks[-1])), share, folded)


def at_lower_rate(signals: Record, highest: float, drift: float | None) -> Record:
    """Return a record at the lowest rate for its band, without drift.

    Only the filters that the lower rate or drift requires are applied, so that white noise stays white and enters correlations at lag 0
    alone. One sample in q is kept, q the largest with at least 4 samples a period of `highest`, behind a low-pass at 0.8 of half the new
    rate; a high-pass removes what is below `drift`. Both are in Hz.
    """
    factor = max(int(signals.sampling_rate / (_SAMPLES_PER_PERIOD * highest)), 1)
    slower = decimate(signals, min(factor, max(signals.samples // 2, 1)))
    if drift is None:
        return slower
    return filter_band(slower, drift, 0.499 * slower.sampling_rate, decimate=False)


def _parts(band: Band, peaks: RealArray) -> tuple[Band, ...]:
    """Return a band cut at the widest gap between peaks, recursively while a part is wide."""
    low, high = band
    inside = peaks[(peaks >= low) & (peaks <= high)]
    if inside.size < 2 or inside[-1] < _MAX_BAND_RATIO * inside[0]:
        return (band,)
    ratios = inside[1:] / inside[:-1]
    widest = int(np.argmax(ratios))
    if ratios[widest] < _MIN_GAP_RATIO:
        return (band,)
    cut = rounded(float(np.sqrt(inside[widest] * inside[widest + 1])))
    return (*_parts((low, cut), peaks), *_parts((cut, high), peaks))


def rounded(frequency: float) -> float:
    """Return the end of a band with three significant digits."""
    return float(f"{frequency:.3g}")


def struck_band(parts: Sequence[Signals], asked: Band | None = None) -> tuple[Band, Note] | None:
    """Return the band (Hz) into which the hits of a hammer put a hundredth of their largest power or more, and a note.

    Beyond, a response is noise over hardly any force, and would hide the modes in it. None where that band is nearly the whole, or where
    most parts (each of one place of the hammer) are not hits. A given band is kept, and noted where it contains that end.
    """
    if not all(len(part.input_dofs) == 1 for part in parts) or excitation_of(parts) != "impact":
        return None
    half = parts[0].sampling_rate / 2
    lines = np.linspace(0.0, half, _PULSE_LINES)
    highest = max(float(lines[useful_lines(part, lines)][-1]) for part in parts)
    high = rounded(highest)
    if highest >= UNFOLDED * half or (asked is not None and not asked[0] < high < UNFOLDED * asked[1]):
        return None
    other = f"--band {high:g} {min(2 * high, half):g}"
    if asked is None:
        return band_up_to(high, f"the hits have less than 1 % of their power above (else: {other})")
    text = f"The hits have less than 1 % of their power above {high:g} Hz: noise there may hide modes. Limit it, or take {other}"
    return asked, Note("band past the hits", {"highest_hz": high}, text)


def swept_band(parts: Sequence[Signals]) -> tuple[Band, Note] | None:
    """Return the band (Hz) into which sweeps or bursts put a hundredth of their largest power or more, and a note.

    Outside, a response is noise over hardly any force. None where that is nearly the whole, or where most parts are another test.
    """
    if 2 * sum(find_excitation(part) in ("sweep", "burst") for part in parts) <= len(parts):
        return None
    half = parts[0].sampling_rate / 2
    lines = np.linspace(0.0, half, max(part.samples for part in parts) // 2 + 1)
    useful = lines[np.any([swept_lines(part, lines) for part in parts], axis=0)]
    low, high = rounded(float(useful[0])), rounded(float(useful[-1]))
    high = half if high >= UNFOLDED * half else high
    if low == 0 and high == half:
        return None
    return (low, high), _note_on_driven((low, high))


def driven_band(parts: Sequence[Signals]) -> tuple[Band, Note] | None:
    """Return the band (Hz) of hits, sweeps or bursts and a note; see `struck_band` and `swept_band`."""
    return struck_band(parts) or swept_band(parts)


def driven_lines(response: Response) -> tuple[Band | None, tuple[Note, ...]]:
    """Return the band (Hz) of a response that its forces drive, and a note; None where all of it is, or that is not known."""
    band = response.excited
    if band is None or (band[0] <= response.span[0] and response.span[1] <= band[1]):
        return None, ()
    return band, (_note_on_driven(band),)


def _note_on_driven(band: Band) -> Note:
    low, high = band
    text = f"Band {low:g} to {high:g} Hz: the forces have less than 1 % of their largest power outside; for modes there, give another band"
    return Note(CHOSEN, _numbers(low, high), text)


def useful_lines(signals: Signals, frequencies: RealArray) -> BoolArray:
    """Return the lines into which good hits put a hundredth of their largest power or more; all where none is good."""
    _, inputs = signals.by_run()
    assert inputs is not None
    hits = [hit for hit in find_hits(inputs[:, :, 0]) if not hit.unfit]
    pulses = [inputs[h.run, h.start : h.stop, 0] - np.median(inputs[h.run, :, 0]) for h in hits]
    times = np.arange(max((p.size for p in pulses), default=0)) / signals.sampling_rate
    waves = np.exp(-2j * np.pi * np.outer(frequencies, times))
    power = sum((np.abs(waves[:, : p.size] @ p) ** 2 for p in pulses), np.zeros(len(frequencies)))
    return np.asarray(power >= USEFUL_POWER * np.max(power))


def swept_lines(signals: Signals, frequencies: RealArray) -> BoolArray:
    """Return the lines into which sweeps put a hundredth of their largest power or more, smoothed over a hundredth of the band."""
    _, inputs = signals.by_run()
    assert inputs is not None
    power = np.sum(np.abs(fft.rfft(inputs - inputs.mean(axis=1, keepdims=True), axis=1)) ** 2, axis=(0, 2))
    smooth = _over_a_hundredth(power)
    at_lines = np.interp(frequencies, fft.rfftfreq(signals.samples, 1 / signals.sampling_rate), smooth)
    return np.asarray(at_lines >= USEFUL_POWER * smooth.max())


def _over_a_hundredth(power: RealArray) -> RealArray:
    """Return the power of lines smoothed over a hundredth of them."""
    width = max(len(power) // 100, 1)
    return np.asarray(scipy.signal.oaconvolve(power, np.ones(width) / width, mode="same"))


def driven_share(records: RecordSpectra, frequencies: RealArray) -> RealArray:
    """Return the power of all forces at frequencies (Hz) relative to its largest, that of the run where it is most, (k,).

    Under a Hann window, W_k = U_k / 2 - (U_k-1 + U_k+1) / 4: what a run begins and ends with would fill lines without any power.
    """
    share = np.zeros(len(frequencies))
    for run in np.unique(records.run):
        own = records.run == run
        U = records.drive[own]
        if len(U) > 2:
            power = _over_a_hundredth(np.sum(np.abs(U[1:-1] / 2 - (U[:-2] + U[2:]) / 4) ** 2, axis=1))
            at = np.interp(frequencies, records.frequencies[own][1:-1], power)
            share = np.maximum(share, at / max(float(power.max()), np.finfo(float).tiny))
    return share
