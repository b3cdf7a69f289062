"""Every method on the same response: each with its own stabilization diagram and selection, or the reason why it failed."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from threading import Lock
from typing import Any

import numpy as np

from modalscope.comparing.moved import Moved, moved_by_noise
from modalscope.comparing.plan import Cell
from modalscope.identification.measured import Measured
from modalscope.identification.method import Built, Method, Problem
from modalscope.identification.options import Options
from modalscope.identification.pipeline import Factored, built, factored
from modalscope.identification.prepare import pose
from modalscope.identification.sweep import Sweep, start
from modalscope.judging.evidence import Gathered
from modalscope.judging.select import chosen_of, weighed
from modalscope.judging.stabilize import swept
from modalscope.modal.rebuilt import fit_of
from modalscope.model.checks import DataError
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.modes import ModalModel

__all__ = ["MethodResult", "Progress", "run"]

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class MethodResult:
    """What one method made of the data.

    Parameters
    ----------
    method : Method
    exact : bool
        Whether it worked on the data themselves, not on a transform of them; only then it has a vote.
    diagram : StabilizationDiagram, optional
    modes : ModalModel, optional
        None when the method failed.
    fit_error : float, optional
        norm(measured - rebuilt from the modes) / norm(measured), in the method's own domain.
    moved : Moved, optional
        How the noise moves the modes, where that is known.
    route : str
        The way from records with inputs; empty for other data. Each way has one vote.
    seconds : float
        From the response to the selected modes.
    failure : str
        Why there are no modes; empty when there are.
    """

    method: Method
    exact: bool
    diagram: StabilizationDiagram | None = None
    modes: ModalModel | None = None
    fit_error: float | None = None
    moved: Moved | None = None
    route: str = ""
    seconds: float = 0.0
    failure: str = ""

    @property
    def name(self) -> str:
        """Row and domain, as in `era (s)`: what results are told apart by."""
        return str(self.method)

    @property
    def label(self) -> str:
        """What the literature calls the method, for tables and pictures."""
        return self.method.label


class _Count:
    """Orders done by all methods together."""

    def __init__(self, cells: Sequence[Cell], progress: Progress | None) -> None:
        self._progress, self._lock = progress, Lock()
        self._done, self._total = [0] * len(cells), sum(len(c.orders) for c in cells)

    def report(self, index: int, done: int) -> None:
        with self._lock:
            self._done[index] = done
            if self._progress is not None:
                self._progress(sum(self._done), self._total)


class _Group:
    """What cells that read their models off one data matrix have in common: its factors, and what is the same by several of them.

    Parameters
    ----------
    gathered : Gathered
        What data show, of all groups.
    """

    def __init__(self, gathered: Gathered) -> None:
        self.gathered = gathered
        self._built: dict[Any, Built] = {}
        self._factored: dict[tuple[int, Any], Factored] = {}
        self._done: list[tuple[Sweep, MethodResult]] = []

    def factored(self, problem: Problem, cell: Cell) -> Factored:
        """Return the factors of a row's data matrix, each made for the first cell that asks."""
        made, largest = self._made(problem, cell), cell.orders[-1]
        key = id(made.matrix), problem.method.factor
        if key not in self._factored:
            self._factored[key] = factored(problem, largest, made)
        return self._factored[key]

    def _made(self, problem: Problem, cell: Cell) -> Built:
        """Return a row's data matrix: that of a row which chooses its sizes alike, or of one whose sizes have come out the same."""
        sizes = problem.method.orders, tuple(sorted(cell.options.items())), cell.orders
        if sizes not in self._built:
            mine = built(problem, cell.orders[-1])
            same = (known for known in self._built.values() if _same_settings(known.settings, mine.settings))
            self._built[sizes] = mine._replace(matrix=next(same, mine).matrix)
        return self._built[sizes]

    def keep(self, found: Sweep, result: MethodResult) -> None:
        """Keep what a cell has found."""
        self._done.append((found, result))

    def with_poles_of(self, found: Sweep) -> Sweep | None:
        """Return the sweep of a cell that has the same poles at every order; None without one."""
        return next((other for other, _ in self._done if other.has_poles_of(found)), None)

    def with_modes_of(self, found: Sweep) -> MethodResult | None:
        """Return the result of a cell that has the same modes at every order; None without one."""
        return next((result for other, result in self._done if other.has_modes_of(found)), None)


def _same_settings(one: Options, other: Options) -> bool:
    """Whether two rows have made their data matrix in the same way; arrays that were given count as different."""

    def same(a: Any, b: Any) -> bool:
        return a is b or (type(a) is type(b) and not isinstance(a, np.ndarray) and bool(a == b))

    values = dict(one.items()), dict(other.items())
    return values[0].keys() == values[1].keys() and all(same(values[0][name], values[1][name]) for name in values[0])


def _grouped(cells: Sequence[Cell], given: Sequence[Measured]) -> list[list[int]]:
    """Return which cells may have a data matrix in common."""
    groups: dict[Any, list[int]] = {}
    for index, (cell, measured) in enumerate(zip(cells, given, strict=True)):
        m, largest = cell.method, cell.orders[-1]
        key = (id(measured), m.domain, m.takes, m.matrix, m.options_type, *m.fixed.items(), largest)
        groups.setdefault(key, []).append(index)
    return list(groups.values())


def run(
    measured: Measured | Sequence[Measured],
    cells: Sequence[Cell],
    *,
    progress: Progress | None = None,
    workers: int | None = None,
    **options: Any,
) -> tuple[MethodResult, ...]:
    """Run every cell on what was measured; what one of them cannot do is its row, and the others go on.

    Parameters
    ----------
    measured : Measured, or one a cell
        The response, and the records behind it where there are any: prepared once, for all methods.
    cells : sequence of Cell
    progress : callable, optional
        Called with (orders done, orders in all), over all methods.
    workers : int, optional
        Methods at a time; by default as many as there are processors, at most four.
    **options
        Of `stabilize`, for every method.
    """
    count = _Count(cells, progress)
    given = [measured] * len(cells) if isinstance(measured, Measured) else measured
    groups, gathered = _grouped(cells, given), Gathered()

    def of_group(indices: Sequence[int]) -> list[MethodResult]:
        group, found = _Group(gathered), []
        for index in indices:
            progress = partial(_report, count, index)
            found.append(_one(given[index], cells[index], group, progress, options))
            count.report(index, len(cells[index].orders))
        return found

    at_once = workers or min(os.cpu_count() or 1, 4)
    if at_once == 1:
        found = [of_group(indices) for indices in groups]
    else:
        with ThreadPoolExecutor(at_once) as pool:
            found = list(pool.map(of_group, groups))
    each = {
        i: result for indices, part in zip(groups, found, strict=True) for i, result in zip(indices, part, strict=True)
    }
    return tuple(each[i] for i in range(len(cells)))


def _report(count: _Count, index: int, done: int, _: int) -> None:
    count.report(index, done)


def _one(measured: Measured, cell: Cell, group: _Group, progress: Progress, options: dict[str, Any]) -> MethodResult:
    started = time.perf_counter()
    try:
        result = _found(measured, cell, group, progress, options)
    except DataError as trouble:
        failure = " ".join(str(trouble).split())
    except (ValueError, ArithmeticError, MemoryError) as trouble:  # numpy's own: no convergence, no memory
        failure = f"{type(trouble).__name__}: {' '.join(str(trouble).split())}"
    else:
        return replace(result, seconds=time.perf_counter() - started)
    return MethodResult(
        method=cell.method,
        exact=cell.exact,
        route=measured.route or "",
        seconds=time.perf_counter() - started,
        failure=failure,
    )


def _found(measured: Measured, cell: Cell, group: _Group, progress: Progress, options: dict[str, Any]) -> MethodResult:
    """Return what a cell finds; where another cell of its group has the same modes at every order, what that one has found."""
    method = cell.method
    problem = pose(measured, method, {**cell.options, **options})
    given = group.factored(problem, cell)
    found = start(problem, list(cell.orders), automatic=False, given=given)
    same = group.with_modes_of(found)
    if same is not None and same.diagram is not None:
        return replace(same, method=method, exact=cell.exact, diagram=replace(same.diagram, method=method.name))
    found.take_deviations_of(group.with_poles_of(found))
    diagram = swept(found, cell.orders, progress=progress)
    modes = chosen_of(diagram, weighed(diagram, group.gathered))
    result = MethodResult(
        method=method,
        exact=cell.exact,
        route=measured.route or "",
        diagram=diagram,
        modes=modes,
        fit_error=fit_of(modes, diagram.response),
        moved=moved_by_noise(found, diagram, modes),
    )
    group.keep(found, result)
    return result
