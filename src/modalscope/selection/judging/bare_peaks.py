"""Name the peaks of a response that no mode of a list explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Response, line_step, output_scale
from modalscope.numerics.checks import RealArray
from modalscope.numerics.statistics import few_channels

#: The kind of the note on peaks without a mode.
BARE = "peaks without a mode"

#: A peak that stands out by ten times in power (10 dB) is plain to see: of its surroundings, and of the noise of its lines.
_PLAIN = 10.0

#: The noise of a line is that of the median of so many neighbours on either side.
_NEIGHBOURS = 8

#: Largest number of peaks that a note names.
_MOST = 5


def bare_peaks(response: Response, modes: ModalModel, band: tuple[float, float]) -> RealArray:
    """Return the frequencies (k,) of plain peaks of responses on lines without a mode within a half bandwidth, the highest first.

    A resonance is smooth from line to line, noise is not: the variance of the noise is 2/3 of the mean square of x_k - (x_k-1 + x_k+1) / 2
    there. A peak that falls to half its power on both neighbouring lines is a single line, and no resonance that was resolved.

    `band`: hz: that of the modes.
    """
    grid = response.grid
    if grid is None or response.ambient or not response.separable or len(grid) < 2 * _NEIGHBOURS:
        return np.zeros(0)
    power, rough = _by_line(response)
    noise = scipy.ndimage.median_filter(rough, 2 * _NEIGHBOURS + 1, mode="nearest")
    tiny = np.finfo(float).tiny
    at, seen = scipy.signal.find_peaks(10 * np.log10(np.maximum(power, tiny)), prominence=10 * np.log10(_PLAIN))
    wide = np.maximum(power[at - 1], power[at + 1]) > power[at] / 2
    plain = wide & (power[at] > _PLAIN * noise[at]) & (grid[at] >= band[0]) & (grid[at] <= band[1])
    f, height = grid[at[plain]], seen["prominences"][plain]
    reach = np.maximum(2 * line_step(response), modes.damping_ratios * modes.frequencies)
    bare = np.all(np.abs(f[:, None] - modes.frequencies) > reach, axis=1)
    return np.asarray(f[bare][np.argsort(-height[bare], kind="stable")])


def _by_line(response: Response) -> tuple[RealArray, RealArray]:
    """Return the power of every line, outputs brought level, and its variance of noise by the neighbours, zero at the ends, (F,) each."""
    lines, outputs, inputs = response.values.shape
    scale = output_scale(response)
    power, rough = np.zeros((2, lines))
    for few in few_channels(2 * lines * inputs, outputs):
        x = np.ascontiguousarray(response.values[:, few]) / scale[few, None]
        x = x.view(np.float64).reshape(lines, -1)
        power += np.einsum("kc,kc->k", x, x)
        bend = x[1:-1] - (x[:-2] + x[2:]) / 2
        rough[1:-1] += np.einsum("kc,kc->k", bend, bend) / 1.5
    return power, rough


def with_note_on_peaks(modes: ModalModel, response: Response, band: tuple[float, float]) -> ModalModel:
    """Return modes with a note on the peaks without one, each with what speaks against the candidate there; an earlier one is replaced."""
    others = tuple(note for note in modes.notes if note.kind != BARE)
    bare = bare_peaks(response, modes, band)
    if bare.size:
        listed = ", ".join(f"{f:.5g} Hz ({_why(modes, float(f), response)})" for f in bare[:_MOST])
        more = f" and {bare.size - _MOST} more" if bare.size > _MOST else ""
        others = (*others, Note(BARE, {"peaks": int(bare.size)}, f"Peaks without a mode: {listed}{more}"))
    return replace(modes, notes=others)


def _why(modes: ModalModel, frequency: float, response: Response) -> str:
    """Return what speaks against the candidate at a peak that is nearest, or that no poles agree there."""
    step = 2 * line_step(response)
    near = [c for c in modes.left_out if abs(c.frequency - frequency) <= max(step, c.damping_ratio * c.frequency)]
    if not near:
        return "no poles agree there"
    return min(near, key=lambda c: abs(c.frequency - frequency)).reason
