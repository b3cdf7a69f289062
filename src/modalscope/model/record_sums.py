"""What lines of records say: smoothed spectra, what drives a pole, inputs that are not told apart, and models rebuilt on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.notes import Note
from modalscope.model.output_levels import output_scale
from modalscope.model.response_facts import UNTOLD
from modalscope.model.statespace import StateSpace

if TYPE_CHECKING:
    from modalscope.model.record_spectra import RecordSpectra

__all__ = [
    "NEAR",
    "drive_of_poles",
    "left_power",
    "left_rows",
    "line_power",
    "rebuilt_values",
    "shortest_participation",
    "smoothed",
    "untold_notes",
]

#: Neighbouring lines on either side that one value of the smoothed spectrum is made of.
NEAR = 3

#: Complex numbers that are held at a time: 4 MB.
_NUMBERS = 1 << 18

#: Inputs are alike where a direction of them, each of length one, is shorter than this; an input has part in it from so much on.
_ALIKE, _SHARE = 1e-9, 1e-6


def line_power(lines: RecordSpectra) -> RealArray:
    """Return the squares of all outputs together on every line, each output level, (F,): to seven digits, for it only weighs lines."""
    scale = output_scale(lines)
    found: Any = np.empty(lines.count, np.float32)
    weight = np.where(scale > 0, scale, 1.0) ** -2.0
    step = max(_NUMBERS // weight.size, 1)
    for start in range(0, lines.count, step):
        some = slice(start, start + step)
        found[some] = np.abs(lines.values[some, :, 0]) ** 2 @ weight
    return np.asarray(found)


def left_power(lines: RecordSpectra, modelled: Iterator[tuple[slice, ComplexArray]]) -> RealArray:
    """Return the squares of what a model leaves of all outputs, (F, l), given it piece by piece."""
    found = np.empty(lines.values.shape[:2])
    for s, part in modelled:
        found[s] = np.abs(lines.values[s, :, 0] - part) ** 2
    return found


def left_rows(lines: RecordSpectra, modelled: Iterator[tuple[slice, ComplexArray]]) -> RealArray:
    """Return what a model leaves of all outputs, real parts above imaginary ones, (2 F, l, 1), given it piece by piece."""
    found = np.empty((2, *lines.values.shape))
    for s, part in modelled:
        left = lines.values[s, :, 0] - part
        found[0, s, :, 0], found[1, s, :, 0] = left.real, left.imag
    return found.reshape(-1, *lines.values.shape[1:])


def smoothed(lines: RecordSpectra) -> Iterator[tuple[RealArray, ComplexArray]]:
    """Yield some lines in Hz, increasing, and the outputs on them and their neighbours, (F, l, p): their singular values show modes."""
    order = np.argsort(lines.frequencies, kind="stable")
    spans, beside = lines.spans_of_runs, np.arange(-NEAR, NEAR + 1)
    lowest, highest = (np.array([getattr(own, end) for own in spans]) for end in ("start", "stop"))
    step = max(_NUMBERS // (lines.values.shape[1] * beside.size), 1)
    for start in range(0, order.size, step):
        some = order[start : start + step]
        r = lines.run[some, None]
        values = lines.values[np.clip(some[:, None] + beside, lowest[r], highest[r] - 1), :, 0]
        values /= np.sqrt(beside.size)
        yield lines.frequencies[some], values.transpose(0, 2, 1)


def untold_notes(lines: RecordSpectra) -> tuple[Note, ...]:
    """Return a note on the inputs that are zero or depend on the others, its numbers their parts in what was not excited."""
    _, alone = _silent(lines)
    part = dict(zip(lines.input_dofs, np.linalg.norm(alone, axis=0).tolist(), strict=True))
    untold = {dof: size for dof, size in part.items() if size > _SHARE}
    text = (
        f"inputs {', '.join(untold)} are zero or depend on each other: what they give together is known, "
        "how it is shared among them is not (participation is the shortest that fits, of inputs brought to one size)"
    )
    return (Note(UNTOLD, untold, text),) if untold else ()


def shortest_participation(lines: RecordSpectra, participation: Array) -> ComplexArray:
    """Return the shortest participation (n, m) of the inputs that gives the same on all lines, inputs brought to one size."""
    size, alone = _silent(lines)
    level = participation * size
    return np.asarray((level - (level @ alone.T) @ alone) / size)


def _silent(lines: RecordSpectra) -> tuple[RealArray, RealArray]:
    """Return the sizes of the inputs, one for what is zero, and what directions of the divided ones are zero on every line, (k, m)."""
    U = np.concatenate([lines.drive.real, lines.drive.imag])
    size = np.linalg.norm(U, axis=0)
    size = np.where(size > 0, size, 1)
    _, d, Vt = np.linalg.svd(np.linalg.qr(U / size, mode="r"))
    return size, Vt[np.count_nonzero(d > _ALIKE) :]


def drive_of_poles(lines: RecordSpectra, poles: Array, participation: Array) -> RealArray:
    """Return the root mean square of what drives each pole on the lines near its frequency, (n,)."""
    rate = lines.sampling_rate or 1.0
    f, half = np.abs(poles.imag) / (2 * np.pi), np.abs(poles.real) / (2 * np.pi)
    power, count = np.zeros(len(poles)), np.zeros(len(poles))
    for r, run in enumerate(lines.runs()):
        own = lines.frequencies[lines.run == r]
        if not own.size:
            continue
        drives = np.hstack([run.inputs, np.zeros((own.size, len(lines.durations)))])
        drives[:, run.inputs.shape[1] + r] = run.ends
        middle = np.searchsorted(own, f)
        low = np.clip(np.minimum(np.searchsorted(own, f - half), middle - NEAR), 0, own.size - 1)
        high = np.clip(np.maximum(np.searchsorted(own, f + half), middle + NEAR), low + 1, own.size)
        for j, (a, b) in enumerate(zip(low, high, strict=True)):
            power[j] += np.sum(np.abs(drives[a:b, : participation.shape[1]] @ participation[j]) ** 2)
            count[j] += b - a
    return np.asarray(rate * np.sqrt(power / np.maximum(count, 1)))


def rebuilt_values(lines: RecordSpectra, model: StateSpace) -> ComplexArray:
    """Return what a model gives on lines under the measured inputs, from the first states that fit best, (F, l, 1)."""
    s = 2j * np.pi * lines.frequencies
    x = s if model.dt is None else np.exp(s * model.dt)
    values = np.einsum("flm,fm->fl", model.transfer(x), lines.drive)
    states = StateSpace(A=model.A, B=np.eye(model.order), C=model.C, dt=model.dt)
    for r in range(len(lines.durations)):
        own = lines.run == r
        free = states.transfer(x[own]) * lines.ends(np.flatnonzero(own))[:, None, None]
        columns, left = free.reshape(-1, model.order), (lines.values[own, :, 0] - values[own]).reshape(-1)
        first = np.linalg.lstsq(
            np.concatenate([columns.real, columns.imag]), np.concatenate([left.real, left.imag]), rcond=None
        )[0]
        values[own] += free @ first
    return np.asarray(values[:, :, None])
