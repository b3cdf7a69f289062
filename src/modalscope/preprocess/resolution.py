"""Whether lines lie close enough for the modes that were read off them: averaged segments leak, and leakage looks like damping."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from modalscope.model.checks import Array, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.notes import Note
from modalscope.model.records import Records
from modalscope.model.response import Response
from modalscope.model.signals import Signals
from modalscope.preprocess.excitation import find_excitation

__all__ = ["leakage_note", "narrowest_peak"]

#: Lines in a half bandwidth that a Hann window's leakage needs to stay below a few per cent of the damping.
_LINES = 4.0

#: A peak stands out of the averaged spectrum when it is this far above its feet (10 dB).
_PEAK = 10.0


def leakage_note(data: Any, response: Response, frequencies: Array, damping_ratios: Array) -> Note | None:
    """Return a warning where 1/T is not four times below the half bandwidth zeta f of a mode; None where all are wide enough.

    A window of T seconds widens a resonance by about 1/T: the damping that is read off averaged segments is too high. Records whose
    vibration begins and ends within a run do not leak.

    Parameters
    ----------
    data : object
        What was given; only records under random forces are averaged over segments.
    response : Response
        What the modes were identified from.
    frequencies, damping_ratios : array, (n,)
        Hz, and as ratios.
    """
    if not (isinstance(response, FrequencyResponse) and response.averages and response.lines > 1 and _is_random(data)):
        return None
    spacing = float(np.min(np.diff(response.frequencies)))
    half = np.asarray(damping_ratios) * np.asarray(frequencies)
    narrow = np.flatnonzero((half > 0) & (half < _LINES * spacing))
    if not narrow.size:
        return None
    worst = narrow[np.argmin(half[narrow])]
    f, width = float(frequencies[worst]), float(half[worst])
    text = (
        f"the half bandwidth of {narrow.size} of {half.size} modes is less than four times the {spacing:.3g} Hz between lines "
        f"({width:.3g} Hz at {f:.4g} Hz the narrowest): leakage makes their damping too high. "
        f"Take the records themselves (route='records'), estimator='lrm', or segments of {_LINES / width:.3g} s"
    )
    return Note("leakage", {"modes": narrow.size, "spacing": spacing, "frequency": f, "half_bandwidth": width}, text)


def _is_random(data: Any) -> bool:
    runs = data.runs if isinstance(data, Records) else (data,)
    return all(isinstance(run, Signals) and run.inputs is not None and find_excitation(run) == "random" for run in runs)


def narrowest_peak(frequencies: RealArray, power: RealArray) -> float | None:
    """Return the width in Hz at half power of the narrowest peak that stands out of a power spectrum; None where there is none.

    A resonance is three times as wide at a tenth of its power, where the scatter of few averages does not cut its top off.

    Parameters
    ----------
    frequencies, power : array, (F,)
        Equally spaced.
    """
    level = 10 * np.log10(np.maximum(power, np.finfo(float).tiny))
    peaks, _ = scipy.signal.find_peaks(level, prominence=_PEAK)
    if not peaks.size:
        return None
    widths = scipy.signal.peak_widths(power, peaks, rel_height=0.9)[0] / 3
    return float(widths.min() * (frequencies[1] - frequencies[0]))
