"""Sizes of what was measured: beyond them the squares and fourth powers that verbs form are no numbers any more."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array
from modalscope.model.errors import DataError
from modalscope.model.records import Records
from modalscope.model.response import Response
from modalscope.model.signals import Signals

__all__ = ["check_size"]

#: The largest number of a channel lies between 1 over these and these. Correlations of records are responses: they go with the square.
_RECORDS, _RESPONSES = 1e30, 1e60


def check_size(data: Signals | Records | Response) -> None:
    """Raise when a channel's numbers are so large or so small that powers of them cannot be computed with.

    Parameters
    ----------
    data : Signals, Records, FrequencyResponse or ImpulseResponse

    Raises
    ------
    DataError
        Names the channel.

    Examples
    --------
    >>> check_size(Signals(outputs=[[1e-9], [1e-12]], sampling_rate=1.0))
    """
    if isinstance(data, Records):
        for run in data.runs:
            check_size(run)
    elif isinstance(data, Signals):
        _check("records", data.outputs, data.output_dofs, _RECORDS)
        if data.inputs is not None:
            _check("records", data.inputs, data.input_dofs, _RECORDS)
    else:
        _check("responses", np.swapaxes(data.values, 1, 2), data.output_dofs, _RESPONSES)


def _check(name: str, array: Array, labels: tuple[str, ...], most: float) -> None:
    size = np.abs(array).max(axis=tuple(range(array.ndim - 1)))
    odd = np.flatnonzero((size > 0) & ((size < 1 / most) | (size > most)))
    if odd.size:
        raise DataError(
            f"{name} between {1 / most:g} and {most:g} were asked",
            f"the largest of channel {labels[odd[0]]} is {size[odd[0]]:.3g}, in whatever unit that is",
            "Give them in another unit, or correct the factor they were multiplied with.",
        )
