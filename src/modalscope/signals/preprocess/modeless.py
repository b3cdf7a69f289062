"""Tell ambient records that hold no modes: nothing but hum of machines, or motion that follows slow loads at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.shown import figures, percent
from modalscope.numerics.checks import RealArray
from modalscope.signals.preprocess.harmonics import Line
from modalscope.signals.preprocess.spectra import Spectrum
from modalscope.signals.preprocess.spectral_peaks import MIN_PEAK_RATIO, NOISE, UNSEEN, Levels

#: A line of a machine explains peaks within this part of its frequency, or so many standard deviations of it: a peak is averaged over three
#: bins of a hundredth.
_LINE_WIDTH, _LINE_SPREADS = 0.03, 6.0

#: Minimum share of the power, of a record of hum that of its lines, of quasi-static motion that of its slowest lines.
_MIN_SHARE = 0.5

#: Periods in a record below which motion is quasi-static where nothing stands out above: a resonance needs ten decay times, and lightly
#: damped ones decay in five periods and more.
_PERIODS = 50.0

#: Lines of machines that are named.
_NAMED = 6


def modeless_notes(spectrum: Spectrum, levels: Levels, lines: Sequence[Line]) -> tuple[Note, ...]:
    """Return a note on a record in which no peak stands out but those of machines, or nothing above slow motion.

    Examples
    --------
    >>> from modalscope.data.records import Signals
    >>> from modalscope.signals.preprocess.harmonics import lines_in
    >>> from modalscope.signals.preprocess.spectral_peaks import levels_in
    >>> hum = np.sin(2 * np.pi * 12.0 * np.arange(30000) / 50)[:, None] * [1.0, 0.5]
    >>> noise = 0.1 * np.random.default_rng(0).standard_normal((30000, 2))
    >>> spectrum = Spectrum.of(Signals(outputs=hum + noise, sampling_rate=50.0))
    >>> print(*modeless_notes(spectrum, levels_in(spectrum), lines_in(spectrum)))
    Nothing but hum of machines: the line at 12 Hz holds 97.3 % of the power; no other spectral peak
    """
    peaks = levels.in_peak.copy()
    for line in lines:
        peaks[_of_line(line, levels)] = False
    if peaks.any():
        return ()
    share = sum(line.level**2 for line in lines)
    if share > _MIN_SHARE:
        listed = ", ".join(f"{line.frequency:.4g}" for line in lines[:_NAMED]) + ", ..." * (len(lines) > _NAMED)
        which = f"the lines at {listed} Hz hold" if len(lines) > 1 else f"the line at {listed} Hz holds"
        text = f"Nothing but hum of machines: {which} {percent(min(share, 1.0))} of the power; no other spectral peak"
        return (Note(NOISE, {"lines": float(len(lines)), "share": share}, text),)
    power = np.sum(np.abs(spectrum.lines) ** 2, axis=(0, 2))
    slow = float(power[: int(_PERIODS)].sum() / power.sum())
    if slow > _MIN_SHARE:
        f = _PERIODS * spectrum.step
        held = f"{percent(slow)} of the power lies below {figures(f)} Hz"
        text = f"Quasi-static motion: {held}, without a spectral peak; only precise modes are reported"
        return (Note(UNSEEN, {"share": slow, "hz": f}, text),)
    return ()


def _of_line(line: Line, levels: Levels) -> slice:
    """Return the bins of a line and its skirts, which fall to either side: loads and speeds that vary widen it."""
    f = levels.frequencies
    reach = max(_LINE_WIDTH * line.frequency, _LINE_SPREADS * line.spread)
    first, last = np.searchsorted(f, [line.frequency - reach, line.frequency + reach]).tolist()
    level = np.sum(levels.levels / np.maximum(np.median(levels.levels, axis=0), np.finfo(float).tiny), axis=1)
    level = np.convolve(np.pad(level, 1, mode="edge"), np.ones(3) / 3, mode="valid")
    left, right = level[:first][::-1], level[last:]
    return slice(first - _falling(left), last + _falling(right))


def _falling(level: RealArray) -> int:
    """Return the number of bins over which a level falls before it rises from its minimum by what makes a peak."""
    rises = np.flatnonzero(level > MIN_PEAK_RATIO * np.minimum.accumulate(level)) if level.size else level
    return int(rises[0]) if rises.size else level.size
