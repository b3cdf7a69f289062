"""Run every method on the same response: stabilization diagram, selection of modes, or the reason of its failure."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from threading import Lock
from typing import Any

import numpy as np

from modalscope.blocks.influence import Lines
from modalscope.checking.certificate import nearest_order
from modalscope.data.modes import ModalModel
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.method import DOMAINS, Built, Method, Problem
from modalscope.identification.method_names import find_method
from modalscope.identification.options import Options
from modalscope.identification.orders import STATES, checked_orders
from modalscope.identification.pipeline import Factored, built, factored
from modalscope.identification.prepare import Measured, pose
from modalscope.identification.stabilize import swept
from modalscope.identification.sweep import Sweep, start
from modalscope.identification.table import methods
from modalscope.judging.evidence import Gathered
from modalscope.judging.select import chosen_of, weighed
from modalscope.likelihood.covariance import PoleInfluence, covariances_of_poles, influence_on
from modalscope.likelihood.noise import SPLIT, Noise
from modalscope.modal.rebuilt import fit_of
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError, check_choice

# ---------------------------------------------------------------------------------------------------------------- plan


@dataclass(frozen=True)
class Cell:
    """One method as the comparison runs it.

    `options`: block sizes other than the defaults. `exact`: whether the method works on the data themselves; one on data transformed
    from lines to samples or back has no vote.
    """

    method: Method
    orders: tuple[int, ...]
    options: dict[str, Any] = field(default_factory=dict)
    exact: bool = True


def plan(
    response: Response,
    wanted: str | Iterable[Any],
    orders: Iterable[int] | None,
    *,
    records: bool = False,
    route: str | None = None,
) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Return the cells to try and notes on those that the data do not allow.

    `wanted`: "era" is the row in every domain that the data allow, "era/s" or ("era", "s") one cell. `orders`: by default 2, 4, ... up to
    80 for frequency responses, 60 for impulse responses and 40 for correlations. `records`: whether the records without inputs that the
    response was estimated from are there. `route`: from records with inputs: only rows that this way was made for.

    Raises `DataError`: an unknown name, or no method at all.
    """
    out: dict[str, list[str]] = {}
    found: list[Method] = []
    if isinstance(wanted, str) and wanted != "all":
        wanted = [wanted]
    table = [m for m in methods() if (not m.driven if route is None else m.route == route)]
    if isinstance(wanted, str):
        found = [m for m in table if _allowed(m, response, out, records)]
    else:
        for item in wanted:
            allowed = _named(item, response, out, records, None if route is None else table)
            found += [m for m in allowed if m not in found]
    notes = tuple(f"{', '.join(dict.fromkeys(names))} left out: {why}" for why, names in out.items())
    if not found and route is None:
        raise DataError(
            "a comparison was asked", notes[0] if notes else "no method was named", 'Name methods, or methods="all".'
        )
    asked = STATES.ladder(response) if orders is None else checked_orders(orders)
    return tuple(_cell(m, response, asked) for m in found), notes


def _named(
    item: Any, response: Response, out: dict[str, list[str]], records: bool, served: list[Method] | None
) -> list[Method]:
    """Return the cells that a name means, of those that a way from records serves where there is one."""
    if isinstance(item, Method):
        return [item] if served is None or item in served else []
    if not isinstance(item, str) and not (isinstance(item, tuple | list) and len(item) == 2):
        raise DataError(
            "methods to compare were asked",
            f"one of methods is {type(item).__name__}",
            'Name rows such as "era", or cells such as "era/s".',
        )
    name, _, domain = item.partition("/") if isinstance(item, str) else (item[0], "", item[1])
    if served is not None:
        row = find_method(name, None, "time").name
        return [m for m in served if m.name == row and domain in ("", m.domain)]
    if domain:
        return [find_method(name, check_choice("domain", domain, DOMAINS), domain)]
    row = find_method(name, None, "time").name  # an unknown name is an error
    return [m for m in methods() if m.name == row and not m.driven and _allowed(m, response, out, records)]


def _allowed(method: Method, response: Response, out: dict[str, list[str]], records: bool) -> bool:
    """Whether the data suit a cell; what does not is noted."""
    refusal = method.refusal(response, records)
    why = refusal.reason if refusal else method.reservation(response)
    if why:
        out.setdefault(why, []).append(str(method))
    return not why


def _cell(method: Method, response: Response, asked: Sequence[int]) -> Cell:
    return Cell(method, *method.orders.compared(asked, response), method.exact_on(response))


# --------------------------------------------------------------------------------------------------------------- moved
# First-order effect of the noise on the modes of a method, and their covariance with those of another on the same data.

#: Lines that influences are kept on; of more every second to eighth stands for its neighbours.
_LINES, _MOST = 2000, 8


@dataclass(frozen=True, eq=False, slots=True)
class Moved:
    """First-order effect of the noise in the data on the modes of one method.

    `response`: the data: only methods on the same ones share their noise value by value. `influence`: on the poles nearest to the modes,
    at the order that is nearest to all of them. `poles` (k,): these poles, rad/s. `row` (n,): where each mode stands among them; -1 for a
    mode that this order has not, or has split in two.
    """

    response: Response
    noise: Noise
    influence: PoleInfluence
    poles: ComplexArray
    row: IntArray


def moved_by_noise(found: Sweep, diagram: StabilizationDiagram, modes: ModalModel) -> Moved | None:
    """Return how the noise moves modes that were selected from the diagram of a sweep; None where that is not known."""
    if found.noise is None or not len(modes):
        return None
    pipeline = found.pipeline
    cut = found.cut(nearest_order(diagram, modes))
    response = pipeline.matrix.judged
    poles = cut.modal.poles + response.added_damping
    away = np.abs(poles[:, None] - modes.poles) / np.abs(modes.poles.real)
    nearest = np.argmin(away, axis=0)
    there = away[nearest, np.arange(len(modes))] < 1
    if cut.std is not None and modes.frequencies_std is not None:  # a split mode is not the mode
        there &= ~(cut.std.frequency[nearest] > SPLIT * modes.frequencies_std)
    index = nearest[there]
    if not index.size:  # modes that no pole of the order is: what the orders do not show was found in the residual
        return None
    try:
        influence = influence_on(
            pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen.take(index), _lines(response)
        )
    except DataError:  # a way of reading poles off whose first order is not known
        return None
    noise = found.noise_beside(cut)
    row = np.where(there, np.cumsum(there) - 1, -1)
    return None if noise is None else Moved(response, noise, influence, poles[index], row)


def _lines(response: Response) -> Lines | None:
    """Return the same lines for every method on the same data; None for all."""
    every = int(np.clip(response.count // _LINES, 1, _MOST))
    if every == 1 or response.grid is None or response.added_damping > 0:
        return None
    index = np.arange(every // 2, response.count, every)
    return Lines(index, np.full(index.size, float(every)))


def covariance(one: Moved, other: Moved, rows: IntArray, beside: IntArray, noise: Noise) -> tuple[RealArray, RealArray]:
    """Return the covariances of frequencies (Hz) and of damping ratios of modes of two methods, one to one.

    `one`, `other`: of the same data. `rows`, `beside` (k,): which of their poles.
    """
    with np.errstate(all="ignore"):
        moments = noise.moments(one.influence.take(rows), other.influence.take(beside))
        f, zeta = covariances_of_poles(one.poles[rows], other.poles[beside], moments.covariance)
        return f, np.where(noise.damping_is_told(one.poles[rows]), zeta, np.nan)


# ----------------------------------------------------------------------------------------------------------------- run

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class MethodResult:
    """What one method made of the data.

    `exact`: whether it worked on the data themselves, not on a transform of them; only then it has a vote. `modes`: none when the method
    failed. `fit_error`: norm(measured - rebuilt from the modes) / norm(measured), in the method's own domain. `moved`: how the noise
    moves the modes, where that is known. `route`: the way from records with inputs; empty for other data. Each way has one vote.
    `seconds`: from the response to the selected modes. `failure`: why there are no modes; empty when there are.
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


class _Group:
    """What cells with one data matrix share: the matrix, its factors, and results that are the same; `gathered`: of all groups."""

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
    """Return groups of cells that may share a data matrix."""
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
    """Run every cell on the measured data; a failure is the result of its cell, and the others go on.

    `progress`: called with (orders done, orders in all), over all methods. `workers`: methods at a time, by default the number of
    processors, at most four. `**options`: of `stabilize`, for every method.
    """
    lock, each_done, total = Lock(), [0] * len(cells), sum(len(c.orders) for c in cells)

    def report(index: int, done: int, _: int = 0) -> None:
        with lock:
            each_done[index] = done
            if progress is not None:
                progress(sum(each_done), total)

    given = [measured] * len(cells) if isinstance(measured, Measured) else measured
    groups, gathered = _grouped(cells, given), Gathered()

    def of_group(indices: Sequence[int]) -> list[MethodResult]:
        group, found = _Group(gathered), []
        for index in indices:
            found.append(_one(given[index], cells[index], group, partial(report, index), options))
            report(index, len(cells[index].orders))
        return found

    at_once = workers or min(os.cpu_count() or 1, 4)
    if at_once == 1:
        found = [of_group(indices) for indices in groups]
    else:
        with ThreadPoolExecutor(at_once) as pool:
            found = list(pool.map(of_group, groups))
    each = dict(zip(chain(*groups), chain(*found), strict=True))
    return tuple(each[i] for i in range(len(cells)))


def _one(measured: Measured, cell: Cell, group: _Group, progress: Progress, options: dict[str, Any]) -> MethodResult:
    started = time.perf_counter()
    try:
        result = _found(measured, cell, group, progress, options)
    except (DataError, ValueError, ArithmeticError, MemoryError) as trouble:  # NumPy's: no convergence, no memory
        kind = "" if isinstance(trouble, DataError) else f"{type(trouble).__name__}: "
        failure = f"{kind}{' '.join(str(trouble).split())}"
        result = MethodResult(method=cell.method, exact=cell.exact, route=measured.route or "", failure=failure)
    return replace(result, seconds=time.perf_counter() - started)


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
