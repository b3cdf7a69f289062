"""The bands of an ambient record that nobody gave: from where something stands out, with room on both sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.model.checks import RealArray
from modalscope.model.notes import Note
from modalscope.model.stored import Record
from modalscope.preprocess.conditioning import decimate, filter_band
from modalscope.preprocess.prominent import Levels

__all__ = ["CHOSEN", "SPLIT", "OwnBands", "own_bands", "taken_down"]

#: The kinds of the note that says what was chosen: one band, or several.
CHOSEN, SPLIT = "band chosen", "bands chosen"

#: A band reaches beyond what stands out by these factors; a weak mode may lie there, and filters need room.
_BELOW, _ABOVE = 0.6, 1.25

#: A record of fewer samples a period of its band's upper end is taken as it is ...
_SLOW = 8.0

#: ... unless what lies below the band has this part of all power: drift.
_DRIFT = 0.2

#: One band is no wider than this ratio, where a gap of at least the second ratio is there to cut it at: lags that suit its slowest mode
#: suit the fastest.
_WIDE, _GAP = 4.0, 1.15

#: A record that is slowed down keeps so many samples a period of the highest frequency of its band: as many lags are used whatever the
#: rate, and they should end where the correlation is noise.
_SAMPLES_PER_PERIOD = 4.0

#: Significant digits of a band's ends.
_DIGITS = 3

Band = tuple[float, float]


class OwnBands(NamedTuple):
    """The band of a record, the parts it falls into, and from what they follow.

    Attributes
    ----------
    whole : (float, float) or None
        Hz; None where the record is taken as it is.
    parts : tuple of (float, float)
        One by one; one part where it is not wide. None of them where nothing stands out.
    drift : float or None
        Hz: what lies below is drift, and is taken off; None where there is little of it.
    span : (float, float) or None
        Hz: the lowest and the highest frequency at which something stands out.
    below : float
        Part of all power below the band.
    """

    whole: Band | None = None
    parts: tuple[Band, ...] = ()
    drift: float | None = None
    span: Band | None = None
    below: float = 0.0

    def note(self, parts: tuple[Band, ...]) -> Note:
        """Return in one line which bands were taken, and why.

        Parameters
        ----------
        parts : tuple of (float, float)
            The whole band, or its parts.
        """
        assert self.span is not None
        drift = "" if self.drift is None else f", and drift below ({100 * self.below:.2g} % of all power)"
        bands = ", ".join(f"{low:g} to {high:g} Hz" for low, high in parts)
        what = "the band {} was" if len(parts) == 1 else "bands of {} were"
        text = (
            f"{what.format(bands)} chosen: resonances stand out from {self.span[0]:.3g} to {self.span[1]:.3g} Hz{drift}"
        )
        numbers = {"lowest_hz": parts[0][0], "highest_hz": parts[-1][1], "parts": float(len(parts))}
        return Note(CHOSEN if len(parts) == 1 else SPLIT, {**numbers, "share_below": self.below}, text)


def own_bands(levels: Levels, rate: float) -> OwnBands:
    """Return the band of an ambient record: 0.6 times the lowest to 1.25 times the highest frequency at which something stands out.

    A record that is sampled for that band, and that does not drift, is taken as it is, and so is one in which nothing stands out. A band
    wider than 4 : 1 falls into parts, at the widest gaps.

    Parameters
    ----------
    levels : Levels
    rate : float
        Samples a second.

    Examples
    --------
    >>> from modalscope.preprocess.prominent import levels_of
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="ambient", duration=600, sampling_rate=200.0)
    >>> low, high = own_bands(levels_of(record), 200.0).whole
    >>> bool(low < chain5().modes().frequencies.min() and chain5().modes().frequencies.max() < high)
    True
    """
    shown = levels.frequencies[levels.stands_out]
    if not shown.size:
        return OwnBands()
    low, high = _rounded(_BELOW * shown[0]), _rounded(min(_ABOVE * shown[-1], 0.49 * rate))
    share = _share_below(levels, low)
    parts = _parts((low, high), shown)
    drift = low if share >= _DRIFT else None
    whole = None if rate < _SLOW * high and drift is None else (low, high)
    if whole is None and len(parts) == 1:
        return OwnBands()
    return OwnBands(whole, parts, drift, (float(shown[0]), float(shown[-1])), share)


def taken_down(signals: Record, highest: float, drift: float | None) -> Record:
    """Return a record at the lowest rate that carries its band, without drift.

    Noise stays as white as it was, so that it leaves correlations from lag 1 on alone: nothing is filtered that the lower rate or
    drift does not ask for. One sample in q is kept, q the largest with at least 4 samples a period of `highest`, behind a low-pass at
    0.8 of half the new rate; below `drift` a high-pass takes off what is there.

    Parameters
    ----------
    signals : Signals or StoredSignals
    highest : float
        Hz.
    drift : float, optional
        Hz.
    """
    factor = max(int(signals.sampling_rate / (_SAMPLES_PER_PERIOD * highest)), 1)
    slower = decimate(signals, min(factor, max(signals.samples // 2, 1)))
    if drift is None:
        return slower
    return filter_band(slower, drift, 0.499 * slower.sampling_rate, decimate=False)


def _parts(band: Band, shown: RealArray) -> tuple[Band, ...]:
    """Return a band cut at the widest gap of what stands out, again and again while a part is wide."""
    low, high = band
    inside = shown[(shown >= low) & (shown <= high)]
    if inside.size < 2 or inside[-1] < _WIDE * inside[0]:
        return (band,)
    ratios = inside[1:] / inside[:-1]
    widest = int(np.argmax(ratios))
    if ratios[widest] < _GAP:
        return (band,)
    cut = _rounded(float(np.sqrt(inside[widest] * inside[widest + 1])))
    return (*_parts((low, cut), shown), *_parts((cut, high), shown))


def _rounded(frequency: float) -> float:
    return float(f"{frequency:.{_DIGITS}g}")


def _share_below(levels: Levels, low: float) -> float:
    """Return how much of the outputs' power lies below a frequency; the mean of all, each brought to one."""
    power: RealArray = levels.levels * levels.widths[:, None]
    total = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    return float(np.mean(power[levels.frequencies < low].sum(axis=0) / total))
