"""Check that the magnitudes of data allow squares and fourth powers, and that no channel is zero; find channels that are constant."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import numpy as np

from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.setups import Setups
from modalscope.data.shown import figures
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError

#: Limits of the largest number of a channel, and of its reciprocal: correlations of records are responses, which go with the square.
_MAX_OF_RECORDS, _MAX_OF_RESPONSES = 1e30, 1e60

#: Maximum RMS of a dead channel about its mean, over its largest value: 32 times the rounding. The size of other channels does not matter,
#: as they may have other units.
_DEAD_LEVEL = 32 * float(np.finfo(float).eps)

#: Samples that are compared side by side: rows of few numbers take several times as long.
_SAMPLES_SIDE_BY_SIDE = 64


def check_size(data: Signals | Records | Setups | Response) -> None:
    """Raise when a channel's numbers are so large or so small that powers of them cannot be computed with.

    Raises `DataError`: names the channel.

    Examples
    --------
    >>> check_size(Signals(outputs=[[1e-9], [1e-12]], sampling_rate=1.0))
    """
    if isinstance(data, Response):
        _check("responses", data.values, data.output_dofs, _MAX_OF_RESPONSES, channel=1)
        return
    for record in data.recordings:
        _check("records", _rows(record.outputs), record.output_dofs, _MAX_OF_RECORDS)
        if record.inputs is not None:
            _check("records", _rows(record.inputs), record.input_dofs, _MAX_OF_RECORDS)


def _rows(record: Array) -> Array:
    """Return the samples of all runs below each other, (R N, l)."""
    return record.reshape(-1, record.shape[-1])


def _check(name: str, array: Array, labels: tuple[str, ...], most: float, channel: int = -1) -> None:
    real = not np.iscomplexobj(array)
    largest = _largest(array) if real else np.abs(array).max(axis=0)
    rest = np.moveaxis(largest[None], channel, -1)  # whole lines or samples are compared first: they lie together
    size = rest.max(axis=tuple(range(rest.ndim - 1)))
    odd = np.flatnonzero((size > 0) & ((size < 1 / most) | (size > most)))
    if odd.size:
        raise DataError(
            f"{name} between {1 / most:g} and {most:g}:",
            f"the largest of channel {labels[odd[0]]} is {figures(size[odd[0]])}",
            "Give them in another unit, or correct the factor they were multiplied with.",
        )


def _largest(array: Array) -> Array:
    """Return the largest modulus of real numbers over the first axis; no copy is made, and of few channels many samples lie in a row."""
    few = array.ndim == 2 and array.shape[1] < _SAMPLES_SIDE_BY_SIDE and array.flags.c_contiguous
    head = len(array) - len(array) % _SAMPLES_SIDE_BY_SIDE if few else 0
    parts = (array[:head].reshape(-1, _SAMPLES_SIDE_BY_SIDE * array.shape[1]) if head else array[:0], array[head:])
    found = [np.maximum(part.max(axis=0), -part.min(axis=0)) for part in parts if len(part)]
    return np.asarray(np.max([each.reshape(-1, *array.shape[1:]).max(axis=0) for each in found], axis=0))


def check_alive(response: Response) -> None:
    """Raise on a channel of zeros: nothing can be read off it, and it hides a wrong cable or a wrong column."""
    speaks = np.zeros(response.values.shape[1:], dtype=bool)
    for values in response.values:  # nearly always the first line or sample settles it
        speaks |= values != 0
        if speaks.all():
            return
    for side, axis, labels in (("output", 1, response.output_dofs), ("input", 0, response.input_dofs)):
        if dead := [labels[i] for i in np.flatnonzero(~speaks.any(axis=axis))]:
            raise _zero(side, dead, labels)


def check_moving(signals: Signals) -> None:
    """Raise on a record whose outputs are all zero: it has no spectrum."""
    if not signals.outputs.any():
        raise _zero("output", signals.output_dofs, signals.output_dofs)


def check_upright(records: Records) -> None:
    """Raise on arrays of fewer samples than outputs that nobody named: rows may have been taken for columns.

    Labels, a geometry or a file say which axis is which.
    """
    first, count = records.runs[0], len(records.output_dofs)
    named = first.output_dofs != tuple(f"y{k + 1}" for k in range(count)) or records.geometry is not None
    if named or records.source_path is not None or sum(records.samples) >= count:
        return
    samples = max(records.samples)
    raise DataError(
        f"modes of {count} outputs of {samples} samples:",
        f"they may as well be {samples} outputs of {count} samples: nothing names them",
        f"If so, exchange rows and columns: Signals(outputs=y.T, ...). Else name the {count} outputs: output_dofs=[...].",
    )


def _zero(side: str, dead: Sequence[str], labels: Sequence[str]) -> DataError:
    leave = f"Leave it out: --exclude {shlex.join(dead)}."
    return DataError(
        f"data with a response in every {side}:",
        f"{side} {', '.join(dead)} is zero throughout",
        "Check cables, sensors and which columns were read." if len(dead) == len(labels) else leave,
    )


def constant_channels(samples: Array) -> list[int]:
    """Return the indices of channels (N, c) that are constant, but for the rounding of their values."""
    suspected = _least_spread(samples) < _DEAD_LEVEL
    return [i for i in np.flatnonzero(suspected).tolist() if _is_dead(samples[:, i])]


def _least_spread(samples: Array) -> RealArray:
    """Return a lower bound of the standard deviation of channels (N, c) over their largest value: of N samples range / sqrt(2 N).

    Two of them that are so far apart scatter by range / sqrt(2 N) at least, wherever the others are.
    """
    if not len(samples) or np.iscomplexobj(samples):
        return np.zeros(samples.shape[1])
    low, high = samples.min(axis=0), samples.max(axis=0)
    largest = np.maximum(np.abs(low), np.abs(high))
    scale = np.where(largest > 0, largest, 1.0)
    return np.asarray((high / scale - low / scale) / np.sqrt(2 * len(samples)))


def _is_dead(x: Array) -> bool:
    """Return whether a channel (N,) is constant, but for the rounding of its values."""
    largest = float(np.max(np.abs(x), initial=0.0))
    # the difference from the first sample has no rounding of a mean; over the largest, its square is finite at any scale
    return largest == 0 or float(np.std((x - x[0]) / largest)) < _DEAD_LEVEL
