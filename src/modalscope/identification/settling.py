"""Poles and the noise of every channel settled together: each descent tells what the next one divides the data by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import singledispatch
from typing import NamedTuple

import numpy as np

from modalscope.identification.descent import Descent, descend
from modalscope.identification.driven import whitened_records
from modalscope.identification.information import residual
from modalscope.identification.likelihood import Whitened, whitened
from modalscope.identification.under_window import window_noise
from modalscope.identification.whitening import (
    Colour,
    Levels,
    colour,
    from_variance,
    levels_of,
    row_deviations,
    search_bound,
    told_under_window,
)
from modalscope.model.checks import Array, ComplexArray, DataError, RealArray
from modalscope.model.record_spectra import RecordSpectra
from modalscope.model.response import Response
from modalscope.model.window import fading, window_over_lines

__all__ = ["Settled", "Task", "least_gain", "settle", "task_of"]

#: Rounds at most, and the relative change of any deviation at which they end.
_ROUNDS, _SETTLED = 30, 1e-7


@dataclass(frozen=True, eq=False, slots=True)
class Task:
    """Data to be explained, and what stays as it is while modes are refined.

    Parameters
    ----------
    response : Response
    fixed : array of complex
        Poles, as they are in the data, that are held and free in every channel.
    powers : tuple of int
        Residual terms.
    rows : array, (K,)
        Standard deviations of the rows, relative to each other.
    known : Levels, optional
        Of the channels, where they are known.
    progress : callable, optional
    """

    response: Response
    fixed: ComplexArray
    powers: tuple[int, ...]
    rows: RealArray
    known: Levels | None
    progress: Callable[[int, int], None] | None = None

    @property
    def channels(self) -> tuple[int, int]:
        """Numbers of a shape and of what drives a pole."""
        return int(self.response.values.shape[1]), self.response.drives


def task_of(
    response: Response, fixed: ComplexArray, weights: Array | None, progress: Callable[[int, int], None] | None
) -> Task:
    """Return the task of a response: noise from its variance where it carries one and no weights are given, faded as a window made it.

    Parameters
    ----------
    response : Response
    fixed : array of complex
    weights : array, (lines or samples,), optional
    progress : callable, optional
    """
    powers = response.refined_powers
    rows = response.count * (1 + bool(np.iscomplexobj(response.values)))
    variance = response.known_variance
    if weights is None and variance is not None:
        by_row, known = from_variance(variance, rows, scattered=response.scattered_variance)
        return Task(response, fixed, powers, by_row, known, progress)
    faded = fading(response) if weights is None else None
    return Task(response, fixed, powers, row_deviations(rows, weights) if faded is None else faded, None, progress)


@dataclass(frozen=True, eq=False, slots=True)
class Settled:
    """The optimum, and the noise that goes with it.

    Parameters
    ----------
    descent : Descent
    variance : float
        Of a row of the whitened data.
    unknown : int
        Unknowns a channel.
    colour : Colour
        Of the residual.
    worth : array, (n,)
        What a gain in variances counts beside one in white noise; see `told_under_window`.
    """

    descent: Descent
    variance: float
    unknown: int
    colour: Colour
    worth: RealArray

    @property
    def gain(self) -> RealArray:
        """Rise of the squared misfit without each mode, in variances, (n,)."""
        return self.descent.fitted.gain / self.variance * self.worth

    @property
    def residues(self) -> tuple[ComplexArray, ComplexArray]:
        """Shapes (l, n) and participation (n, m)."""
        return self.descent.point.problem.scaled_back(self.descent.point, self.descent.fitted)


class _Start(NamedTuple):
    """Where a round begins: modes, the side with fewer channels as it is and the other to follow, and the noise of the channels."""

    poles: ComplexArray
    shapes: ComplexArray
    participation: ComplexArray
    levels: Levels


def settle(
    task: Task, poles: ComplexArray, shapes: ComplexArray, participation: ComplexArray, most: int = 60
) -> Settled:
    """Return the optimum from modes on.

    The first descent divides the channels by their own size. What it leaves tells the noise of each channel where it is white, and
    further descents and levels settle together. Where it is coloured it is model error, and no second descent: channels that happen
    to fit well would draw all weight to themselves.

    Parameters
    ----------
    task : Task
    poles : array of complex, (n,)
        As they are in the data.
    shapes, participation : array of complex, (l, n), (n, m)
        The side with fewer channels is where the descent starts; the other follows.
    most : int
        Iterations of a descent.

    Raises
    ------
    DataError
        No more data than unknowns.
    """
    levels = task.known or levels_of(np.sqrt(np.mean(np.abs(task.response.values) ** 2, axis=0)))
    found: _Start | Settled = _Start(poles, shapes, participation, levels)
    later = _ROUNDS
    while not isinstance(found, Settled):
        later -= 1
        found = _round(task, found, most, last=not later)
    return found


def _round(task: Task, start: _Start, most: int, *, last: bool) -> _Start | Settled:
    """Return the optimum under some levels where they are those that it leaves, else where to go on.

    Of long records a problem is large: with this function the one before has gone when the next is made.
    """
    levels, poles = start.levels, start.poles
    problem = _divided(task.response, task, levels)
    _check_freedom(task, problem, len(poles))
    sides = (start.shapes.T if problem.turned else start.participation) / problem.varying
    sides = sides / np.maximum(np.linalg.norm(sides, axis=1, keepdims=True), 1e-300)
    descent = descend(problem, poles, sides, most=most, progress=task.progress)
    point, fitted = descent.point, descent.fitted
    unknown = problem.terms.shape[1] + 2 * len(poles)
    window = window_over_lines(task.response)
    seen = colour(residual(point, fitted), task.response.count, unknown, window=window)
    left = np.sqrt(point.left_by_channel(fitted) / len(task.rows))
    following = levels_of(left * np.outer(levels.outputs, levels.inputs))
    done = task.known or seen.coloured or not descent.converged or following.change(levels) < _SETTLED
    if not (done or last):
        return _Start(point.poles, *problem.scaled_back(point, fitted), following)
    noise = window_noise(point, fitted, task.response)
    free = problem.freedom - 2 * len(poles) * sum(task.channels) if noise is None else noise.free
    variance = descent.cost / free
    if (
        task.known is not None and variance <= 1
    ):  # what is left is no more than the noise that is known: its colour is none of a model's
        variance, seen = 1.0, replace(seen, excess=0.0)
    return Settled(descent, variance, unknown, seen, _worth(task.response, point.poles))


def _worth(response: Response, poles: ComplexArray) -> RealArray:
    """Return what gains of poles count beside those in white noise, (n,)."""
    window = window_over_lines(response)
    if window <= 0:
        return np.ones(len(poles))
    return told_under_window(window, -poles.real * window / response.added_damping)


@singledispatch
def _divided(response: Response, task: Task, levels: Levels) -> Whitened:
    """Return the data divided by the noise, ready for a descent."""
    return whitened(response, task.fixed, task.powers, task.rows, levels.outputs, levels.inputs)


@_divided.register
def _(response: RecordSpectra, task: Task, levels: Levels) -> Whitened:
    outputs = levels.outputs * levels.inputs[0]
    return whitened_records(response, task.fixed, task.powers, task.rows, outputs)


def _check_freedom(task: Task, problem: Whitened, modes: int) -> None:
    l, m = task.channels
    if problem.freedom <= 2 * modes * (l + m):
        raise DataError(
            f"{modes} modes of {l} outputs and {m} inputs were to be refined, {2 * modes * (l + m)} unknowns",
            f"there are {max(problem.freedom, 0)} real values beside the residual terms",
            "Give more lines or samples, or fewer modes.",
        )


def least_gain(task: Task) -> float:
    """Return half of what the search over noise may explain: no noise explains more than half of the whole; see `search_bound`."""
    return search_bound(*task.channels, len(task.rows)) / 2
