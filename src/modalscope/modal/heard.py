"""Lines of frequency responses that hold more than noise: those on which it is asked how much the modes explain."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from modalscope.model.checks import Array
from modalscope.model.notes import Note
from modalscope.model.response import Response

__all__ = ["heard_lines", "of_noise"]

#: Neighbouring lines that are looked at together.
_BESIDE = 9

#: Times its noise that a stretch holds where it tells something: of noise alone, with variances from three averages of one channel, one
#: stretch in a thousand does (F with 18 and 36 degrees of freedom: 3.0).
_ABOVE = 3.0

#: Part of the measured mean square that lines of noise hold where they are left out: below, they change nothing.
_WORTH = 0.01


def heard_lines(response: Response) -> Array:
    """Return which lines or samples tell how much modes explain, (K,) of bool.

    Where no force goes in, above the filter of a recorder say, a frequency response is noise over noise, as large as it likes. No mode
    explains that, and its variance says so: with p = mean over channels of sum |H|^2 / sum var(H), both sums over nine neighbouring
    lines, lines with p < 3 are left out. All lines count where no variance is known, where none holds more than noise, and where the
    lines of noise hold less than a hundredth of the measured mean square.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse or RecordSpectra

    Examples
    --------
    >>> import modalscope as ms
    >>> lines = np.arange(1.0, 41.0)
    >>> values, variance = np.full((40, 1, 1), 1j), np.full((40, 1, 1), 1e-4)
    >>> values[20:], variance[20:] = 10j, 100.0
    >>> response = ms.FrequencyResponse(values=values, frequencies=lines, quantity="displacement", variance=variance)
    >>> int(heard_lines(response).sum())  # four lines beside the loud ones go with them
    16
    """
    every = np.ones(len(response.values), dtype=bool)
    variance = response.known_variance
    if variance is None or not np.iscomplexobj(response.values):
        return every
    power = np.abs(response.values) ** 2
    own, noise = (uniform_filter1d(each, _BESIDE, axis=0, mode="nearest") for each in (power, variance))
    known = noise > 0
    times = np.divide(own, noise, out=np.full(own.shape, np.inf), where=known)
    heard = np.asarray(times.mean(axis=(1, 2)) >= _ABOVE)
    by_line = power.sum(axis=(1, 2))
    if not heard.any() or by_line[~heard].sum() < _WORTH * by_line.sum():
        return every
    return heard


def of_noise(response: Response) -> tuple[Note, ...]:
    """Return a note that names the lines of noise that were left out of what the modes explain; nothing where all lines count."""
    heard = heard_lines(response)
    if heard.all():
        return ()
    lines = np.asarray(response.spectrum()[0])[~heard]
    low, high = float(lines[0]), float(lines[-1])
    facts = {"lines": float(lines.size), "lowest_hz": low, "highest_hz": high}
    text = (
        f"{lines.size} of {heard.size} lines, between {low:.5g} and {high:.5g} Hz, hold noise alone, by their variance: "
        "how much the modes explain is told without them"
    )
    return (Note("lines of noise", facts, text),)
