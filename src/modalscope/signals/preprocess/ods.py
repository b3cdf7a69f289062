"""Compute operating deflection shapes: the measured motion of a structure at a frequency or an order of rotation, of all modes together."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, check_each, check_kind, check_positive, real_array
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.frf import estimate_frf
from modalscope.signals.preprocess.singular_spectra import decomposition

#: Turns of a rotation at least.
_LEAST_TURNS = 2


@named(data=(Signals, FrequencyResponse, ImpulseResponse))
def ods(
    data: Signals | FrequencyResponse | ImpulseResponse,
    frequency: float | Iterable[float] | None = None,
    *,
    input: str | int | None = None,
    order: float | Iterable[float] | None = None,
    tacho: str | ArrayLike | None = None,
    time: float | Iterable[float] | None = None,
) -> ModalModel:
    """Compute the operating deflection shapes at frequencies, orders of rotation or times: the measured motion, of all modes together.

    Of responses it is the column of one input at the nearest line, or of several inputs the first singular vector of the matrix of
    responses times its singular value. Of records without inputs it is the first singular vector of their cross spectra.

    Of an order k of a rotation it is c_k of the weighted least squares y(t) = offset + Re sum_k c_k exp(j k phi(t)), the angle phi a cubic
    spline through pulses of the tacho, one a turn, samples weighted by a Hann window: the speed may change.

    Of a time it is the analytic signal y + j H y there, H the Hilbert transform: the motion at that instant and a quarter of a period
    later, at the rate at which its phase grows. Of a sweep or a run-up this is the motion of what is excited then.

    Parameters
    ----------
    data : Signals, FrequencyResponse or ImpulseResponse
    frequency : float or iterable of float
        Hz; the nearest lines are taken.
    input : str or int, optional
        One input, by its label or from zero; by default all.
    order : float or iterable of float, optional
        Multiples of the speed of rotation, instead of frequencies; all that are loud, for they are fitted together.
    tacho : str or array, optional
        The channel of its pulses by its label, which is then no part of the shapes; their times in seconds from the first sample; or the
        samples of such a channel.
    time : float or iterable of float, optional
        Of a record, seconds from its first sample, instead of frequencies; the nearest samples are taken.

    Returns
    -------
    ModalModel
        Undamped, at the frequencies of the lines or at orders of the mean speed, to be drawn and animated as modes are: `plot.shape`,
        `plot.animate`.

    Raises
    ------
    DataError
        A frequency outside of the data, an input that is not there, or records from which no response can be estimated.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> chain = chain5()
    >>> shapes = ods(chain.frequency_response(np.linspace(0.1, 8, 80)), 0.9)
    >>> print(shapes[0])
    0.9000 Hz, 0.000 %
    """
    given = {"frequency": frequency, "order": order, "time": time, "tacho": tacho}
    named = [name for name, value in given.items() if value is not None]
    if named not in (["frequency"], ["order", "tacho"], ["time"]):
        have = f"{', '.join(named) or 'none'} was given"
        remedy = "Give frequency=, or time=, or order= and tacho=."
        raise DataError("deflection shapes are at a frequency, at a time, or at an order of a tacho", have, remedy)
    if time is not None:
        return _at_times(data, time)
    if order is not None:
        return _at_orders(data, _positive("order", order, "multiples of the speed"), tacho)
    asked = _positive("frequency", frequency, "numbers in Hz")
    lines, shapes = _on_lines(data, input)
    span = (float(lines[0]), float(lines[-1]))
    outside = [f for f in asked if not span[0] <= f <= span[1]]
    if outside or not asked:
        asked_for = f"deflection shapes at {', '.join(f'{f:g}' for f in asked) or 'no frequency'} Hz:"
        raise DataError(asked_for, f"the data go from {span[0]:g} to {span[1]:g} Hz", "Ask for frequencies in between.")
    index = np.array([int(np.argmin(np.abs(lines - f))) for f in asked])
    return _shapes(data, lines[index], np.array([shapes(k) for k in index]).T, "a frequency")


def _positive(name: str, values: Any, what: str) -> list[float]:
    several = np.iterable(values) and not isinstance(values, str)
    return [check_positive(name, value) for value in (check_each(name, values, what) if several else [values])]


def _shapes(data: Any, frequencies: Array, shapes: Array, at: str) -> ModalModel:
    text = f"Operating deflection shapes, not modes: the motion of all modes at {at}"
    labels = {name: value for name, value in data.labelled().items() if name in ("output_dofs", "geometry")}
    notes = (Note("deflection shapes", {}, text),)
    return ModalModel(poles=2j * np.pi * frequencies, shapes=shapes, scaling="as measured", notes=notes, **labels)


def _at_times(data: Any, time: Any) -> ModalModel:
    """Return the analytic signal of a record without its mean at the nearest samples."""
    check_kind("a time", data, Signals)
    if data.outputs.ndim > 2:
        raise DataError("deflection shapes at a time:", "the record has several runs", "Give one run.")
    asked = np.atleast_1d(real_array("time", np.array(list(time) if np.iterable(time) else [time]), "(times,)", 1))
    if asked.size == 0 or asked.min() < 0 or asked.max() > data.duration:
        asked_for = f"deflection shapes at {', '.join(f'{t:g}' for t in asked) or 'no time'} s:"
        raise DataError(asked_for, f"the record lasts {data.duration:g} s", "Ask for times within it.")
    k = np.clip(np.round(asked * data.sampling_rate).astype(int), 1, data.samples - 2)
    from scipy.signal import hilbert

    z = hilbert(data.outputs - data.outputs.mean(axis=0), axis=0)
    turned = np.angle(np.sum(z[k - 1].conj() * z[k + 1], axis=1)) % (2 * np.pi)
    return _shapes(data, turned * data.sampling_rate / (4 * np.pi), z[k].T, "a time")


def _at_orders(data: Any, orders: list[float], tacho: Any) -> ModalModel:
    """Return the shapes at orders of a rotation, by weighted least squares on functions of its angle."""
    check_kind("orders of a rotation", data, Signals)
    if data.outputs.ndim > 2:
        raise DataError("orders of a rotation:", "the record has several runs", "Give one run.")
    if isinstance(tacho, str):
        pulses, data = _pulses(data, tacho), data.select(exclude=[tacho])
    else:
        given = real_array("tacho", tacho, "(pulses,) or (samples,)", 1)
        # no turn is as short as a sample: as many numbers as there are samples are the signal itself
        pulses = _rises(given) / data.sampling_rate if given.size == data.samples else np.sort(given)
    time = np.arange(data.samples) / data.sampling_rate
    inside = np.flatnonzero((time >= pulses[0]) & (time <= pulses[-1])) if pulses.size else np.zeros(0, dtype=int)
    unknowns = 1 + 2 * len(orders)
    if pulses.size <= _LEAST_TURNS or inside.size < unknowns:
        have = f"the tacho has {pulses.size} pulses in {data.duration:.4g} s"
        change = "Give a longer record, or another channel of pulses."
        raise DataError(f"shapes at {len(orders)} orders of a rotation:", have, change)
    angle = 2 * np.pi * CubicSpline(pulses, np.arange(pulses.size))(time[inside])
    turns = [column for k in orders for column in (np.cos(k * angle), -np.sin(k * angle))]
    weight = np.hanning(inside.size + 2)[1:-1, None]
    columns = np.column_stack([np.ones(inside.size), *turns])
    found = np.linalg.lstsq(weight * columns, weight * data.outputs[inside], rcond=None)[0][1:]
    speed = (pulses.size - 1) / (pulses[-1] - pulses[0])
    return _shapes(data, speed * np.array(orders), (found[::2] + 1j * found[1::2]).T, "an order of a rotation")


def _pulses(record: Signals, tacho: str) -> Array:
    """Return the times of the pulses of a channel, seconds."""
    sides = [(record.output_dofs, record.outputs), (record.input_dofs, record.inputs)]
    found = [values[:, list(names).index(tacho)] for names, values in sides if values is not None and tacho in names]
    if not found:
        have = f"there are {', '.join(map(str, (*record.output_dofs, *record.input_dofs)))}"
        raise DataError(f"the tacho {tacho!r}:", have, "Name one of them, or give the times of the pulses.")
    return np.asarray(_rises(found[0]) / record.sampling_rate)


def _rises(channel: Array) -> Array:
    """Return at which samples a channel rises through the middle between its lowest and its highest value, by linear interpolation."""
    x = channel - (channel.min() + channel.max()) / 2
    k = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    return np.asarray(k + x[k] / (x[k] - x[k + 1]))


def _on_lines(data: Any, input: str | int | None) -> tuple[Array, Any]:
    """Return the lines, and a function of the shape (l,) on one of them."""
    if isinstance(data, Signals):
        if data.inputs is None:
            if input is not None:
                raise DataError(f"input {input!r}:", "the records have no inputs", "Leave input out.")
            fdd = decomposition(data)
            return fdd.frequencies, lambda k: fdd.vectors[k, :, 0] * np.sqrt(fdd.singular_values[k, 0])
        data = estimate_frf(data)
    lines, H = data.spectrum()
    if input is not None:
        column = _column(data.columns, input)
        return lines, lambda k: H[k, :, column]
    if H.shape[2] == 1:
        return lines, lambda k: H[k, :, 0]
    return lines, lambda k: _first(H[k])


def _first(H: ComplexArray) -> ComplexArray:
    """Return the first left singular vector times its singular value."""
    U, s, _ = np.linalg.svd(H, full_matrices=False)
    return np.asarray(U[:, 0] * s[0])


def _column(columns: Any, input: str | int) -> int:
    listed = list(map(str, columns))
    if isinstance(input, int) and not isinstance(input, bool) and 0 <= input < len(listed):
        return input
    if isinstance(input, str) and input in listed:
        return listed.index(input)
    raise DataError(f"input {input!r}:", f"there are {', '.join(listed)}", "Name one, or count from zero.")
