"""Whether an ambient record holds anything but noise: the whole of it is tested before any pole is looked at."""

from __future__ import annotations

import numpy as np
from scipy import special

from modalscope.model.checks import BoolArray
from modalscope.model.notes import Note
from modalscope.preprocess.prominent import Levels

__all__ = ["NOISE", "UNSEEN", "noise_notes"]

#: The kinds of the notes: nothing but noise; and a record that is not white, but in which nothing stands out.
NOISE, UNSEEN = "noise alone", "nothing stands out"

#: A record is white while its levels scatter by no more than this many standard deviations above what chance makes.
_CHANCE = 5.0

#: Bins that a test needs.
_FEWEST = 20


def noise_notes(levels: Levels, band: tuple[float, float] | None = None) -> tuple[Note, ...]:
    """Return a note where a record, in a band, is nothing but noise, or where nothing stands out of what is there.

    Noise alone has spectral levels that are the same at all frequencies, within chance: with x_b the logarithm of the level of bin b
    and v_b the variance that the number of its lines gives, sum_b (x_b - mean x)^2 / v_b is about the number of bins. And no bins
    stand out of their neighbourhood as a resonance does.

    Parameters
    ----------
    levels : Levels
        Of the record as it was measured.
    band : (float, float), optional
        Hz.
    """
    low, high = (0.0, np.inf) if band is None else band
    inside = (levels.frequencies >= low) & (levels.frequencies <= high)
    if inside.sum() < _FEWEST:
        return ()
    if np.any(levels.stands_out & inside):
        return ()
    ends = levels.frequencies[inside][[0, -1]]
    numbers = {"lowest_hz": float(ends[0]), "highest_hz": float(ends[1])}
    where = f"{ends[0]:.3g} to {ends[1]:.3g} Hz"
    if _scatter(levels, inside) < _CHANCE:
        text = f"nothing but noise in {where}: the level is the same at all frequencies, and nothing stands out"
        return (Note(NOISE, numbers, text),)
    text = f"nothing stands out in {where}: only what the record leaves little open can be a mode"
    return (Note(UNSEEN, numbers, text),)


def _scatter(levels: Levels, inside: BoolArray) -> float:
    """Return by how many standard deviations the levels scatter more than chance makes them, of the output that does most."""
    worth = levels.worth[inside]
    variance = special.polygamma(1, worth)
    x = (
        np.log(np.maximum(levels.levels[inside], np.finfo(float).tiny))
        - (special.digamma(worth) - np.log(worth))[:, None]
    )
    mean = (x / variance[:, None]).sum(axis=0) / (1 / variance).sum()
    total = ((x - mean) ** 2 / variance[:, None]).sum(axis=0)
    # the square of a log gamma variable has the fourth cumulant polygamma(3) beside twice the square of its variance
    spread = np.sqrt(np.sum(2 + special.polygamma(3, worth) / variance**2))
    return float(np.max((total - (len(worth) - 1)) / spread))
