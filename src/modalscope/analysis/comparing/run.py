"""Run every method on the same response: stabilization diagram, selection of modes, or the reason of its failure."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import partial
from itertools import chain
from threading import Event, Lock, Thread
from typing import Any, TypeVar

import numpy as np

from modalscope.analysis.checking.certificate import nearest_order
from modalscope.analysis.comparing.same_models import same_modes, same_poles
from modalscope.data.modes import ModalModel
from modalscope.data.rebuilt import fit_of
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.matrices.influence import Lines
from modalscope.identification.method import Built, Method, Problem
from modalscope.identification.options import Options
from modalscope.identification.pipeline import Factored, built, factor, factored, realized
from modalscope.identification.prepare import Measured, pose
from modalscope.identification.stabilize import swept
from modalscope.identification.sweep import Sweep, over
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError, as_printed
from modalscope.numerics.progress import stage
from modalscope.selection.judging.evidence import Gathered, same_data
from modalscope.selection.judging.select import chosen_of, contest_of, weighed
from modalscope.selection.judging.verdict import Contest
from modalscope.selection.likelihood.covariance import PoleInfluence, covariances_of_poles, influence_on
from modalscope.selection.likelihood.noise import SPLIT, Noise


@dataclass(frozen=True)
class Cell:
    """One method of a comparison, with its orders and options.

    `options`: block sizes other than the defaults. `exact`: whether the data are not transformed from lines to samples or back for it; only
    then it has a vote. `aside`: of a row that is shown without a vote: its poles are no part of what decides which modes the data need.
    """

    method: Method
    orders: tuple[int, ...]
    options: dict[str, Any] = field(default_factory=dict)
    exact: bool = True
    aside: bool = False


#: Minimum number of lines on which influences are computed, and the maximum number of lines that one of them represents.
_INFLUENCE_LINES, _MAX_LINE_STEP = 2000, 8

Item = TypeVar("Item")
Progress = Callable[[int, int], None]
Partial = Callable[["MethodResult"], None]


@dataclass(frozen=True, eq=False, slots=True)
class Moved:
    """First-order effect of the noise in the data on the modes of one method.

    `response`: the data; only methods on the same data share their noise value by value. `influence`: on the poles nearest to the modes,
    at the order that is nearest to all of them. `poles` (k,): these poles, rad/s. `row` (n,): the pole of each mode; -1 for a mode that
    this order does not have, or that it splits in two.
    """

    response: Response
    noise: Noise
    influence: PoleInfluence
    poles: ComplexArray
    row: IntArray


def moved_by_noise(sweep: Sweep, diagram: StabilizationDiagram, modes: ModalModel) -> Moved | None:
    """Return the effect of the noise on modes that were selected from the diagram of a sweep; None where it is unknown."""
    known, pipeline = sweep.deviating, sweep.pipeline
    asked = None if known is None or not len(modes) else known.asked.get(nearest_order(diagram, modes))
    if known is None or asked is None:
        return None
    response = pipeline.matrix.judged
    poles = asked.poles + response.added_damping
    distance = np.abs(poles[:, None] - modes.poles) / np.abs(modes.poles.real)
    nearest = np.argmin(distance, axis=0)
    matched = distance[nearest, np.arange(len(modes))] < 1
    if modes.frequencies_std is not None:  # a split mode is not the mode
        matched &= ~(known.deviations(asked)[0].frequency[nearest] > SPLIT * modes.frequencies_std)
    index = nearest[matched]
    if not index.size:  # modes of the residual, which no order has
        return None
    # the same lines for every method on the same data
    step = int(np.clip(response.count // _INFLUENCE_LINES, 1, _MAX_LINE_STEP))
    lines = None
    if step > 1 and response.grid is not None and response.added_damping <= 0:
        places = np.arange(step // 2, response.count, step)
        lines = Lines(places, np.full(places.size, float(step)))
    eigen = asked.eigen.take(index)
    try:
        influence = influence_on(pipeline.matrix, pipeline.realization, asked.order, asked.model, eigen, lines)
    except DataError:  # a realization without first-order influence
        return None
    row = np.where(matched, np.cumsum(matched) - 1, -1)
    return Moved(response, asked.noise, influence, poles[index], row)


def covariance(a: Moved, b: Moved, rows_a: IntArray, rows_b: IntArray, noise: Noise) -> tuple[RealArray, RealArray]:
    """Return the covariances of frequencies (Hz) and of damping ratios of modes of two methods on the same data, one to one.

    `rows_a`, `rows_b` (k,): which of their poles.
    """
    with np.errstate(all="ignore"):
        moments = noise.moments(a.influence.take(rows_a), b.influence.take(rows_b))
        f, zeta = covariances_of_poles(a.poles[rows_a], b.poles[rows_b], moments.covariance)
        return f, np.where(noise.damping_is_told(a.poles[rows_a]), zeta, np.nan)


@dataclass(frozen=True, eq=False, kw_only=True)
class MethodResult:
    """Result of one method.

    `exact`: whether it has a vote: its data were not transformed. `modes`: None when the method failed. `fit_error`:
    norm(measured - rebuilt from the modes) / norm(measured), in the method's domain. `moved`: effect of the noise on the modes, where it is
    known. `route`: from records with inputs; empty for other data. Each route has one vote. `seconds`: from the response to the selected
    modes. `failure`: why there are no modes; empty when there are.
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
        """Row and domain, as in `era (s)`: unique among the results."""
        return str(self.method)

    @property
    def label(self) -> str:
        """The method's name in the literature, for tables and pictures."""
        return self.method.label


@dataclass(eq=False)
class _Work:
    """One cell on its way to its result.

    `twin`: a cell with the same modes at every order, whose result it has. `failure`: why it has none.
    """

    measured: Measured
    cell: Cell
    sweep: Sweep | None = None
    diagram: StabilizationDiagram | None = None
    twin: _Work | None = None
    modes: ModalModel | None = None
    moved: Moved | None = None
    fit_error: float | None = None
    seconds: float = 0.0
    failure: str = ""

    @property
    def result(self) -> MethodResult:
        """What the cell found; a twin takes what the other cell found, under its own name."""
        of, method = self.twin or self, self.cell.method
        diagram = of.diagram if of is self or of.diagram is None else of.diagram.changed(method=method.name)
        return MethodResult(
            method=method,
            exact=self.cell.exact,
            diagram=None if of.failure else diagram,
            modes=of.modes,
            fit_error=of.fit_error,
            moved=of.moved,
            route=self.measured.route or "",
            seconds=self.seconds,
            failure=of.failure,
        )


@contextmanager
def _counted(*works: _Work) -> Iterator[None]:
    """Share the time of what is done between cells, and make what fails there the failure of them all."""
    begin = time.perf_counter()
    try:
        yield
    except (DataError, ValueError, ArithmeticError, MemoryError) as error:  # NumPy's: no convergence, no memory
        kind = "" if isinstance(error, DataError) else f"{type(error).__name__}: "
        for work in works:
            work.failure = f"{kind}{as_printed(error)}"
    finally:
        for work in works:
            work.seconds += (time.perf_counter() - begin) / len(works)


class _Group:
    """Cells that may share a data matrix, its factors, and results that are the same; `done`: those that were swept."""

    def __init__(self) -> None:
        self._built: dict[Any, Built] = {}
        self._factored: dict[tuple[int, Any], Factored] = {}
        self.done: list[tuple[Sweep, _Work]] = []

    def factored(self, problem: Problem, cell: Cell) -> Factored:
        """Return the factors of a row's data matrix, each made for the first cell that needs them."""
        matrix, largest = self._matrix(problem, cell), cell.orders[-1]
        key = id(matrix.matrix), problem.method.factor
        if key not in self._factored:
            self._factored[key] = factored(problem, largest, matrix)
        return self._factored[key]

    def _matrix(self, problem: Problem, cell: Cell) -> Built:
        """Return a row's data matrix, which rows that choose their sizes alike, or have the same sizes, share."""
        sizes = problem.method.orders, tuple(sorted(cell.options.items())), cell.orders
        if sizes not in self._built:
            candidate = built(problem, cell.orders[-1])
            same = (b for b in self._built.values() if _same_settings(b.settings, candidate.settings))
            self._built[sizes] = candidate._replace(matrix=next(same, candidate).matrix)
        return self._built[sizes]


def _same_settings(one: Options, other: Options) -> bool:
    """Return whether two rows make their data matrix in the same way; given arrays count as different."""

    def same(a: Any, b: Any) -> bool:
        return a is b or (type(a) is type(b) and not isinstance(a, np.ndarray) and bool(a == b))

    a, b = dict(one.items()), dict(other.items())
    return a.keys() == b.keys() and all(same(a[name], b[name]) for name in a)


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
    partial_results: Partial | None = None,
    **options: Any,
) -> tuple[MethodResult, ...]:
    """Run every cell on the measured data; a failure is the result of its cell.

    What the data need is decided once for all cells with the same data, from the poles of all of them; each cell has those modes that its
    own poles show, with its own values.

    `progress`: called with (orders done, orders in all), over all methods. `workers`: methods at a time, by default the number of
    processors, at most four. `partial_results`: called with each result as it comes. `**options`: of `stabilize`, for every method.
    """
    lock, orders_done, total = Lock(), [0] * len(cells), sum(len(c.orders) for c in cells)

    def report(index: int, done: int, _: int = 0) -> None:
        with lock:
            orders_done[index] = done
            if progress is not None:
                progress(sum(orders_done), total)

    def tell(done: Sequence[_Work]) -> None:
        with lock:
            if partial_results is not None:
                for work in done:
                    partial_results(work.result)

    given = [measured] * len(cells) if isinstance(measured, Measured) else measured
    works = [_Work(data, cell) for data, cell in zip(given, cells, strict=True)]

    def swept_in_group(indices: Sequence[int]) -> None:
        group = _Group()
        for index in indices:
            with _counted(works[index]):
                _sweep(works[index], group, partial(report, index), options)
            report(index, len(cells[index].orders))

    gathered = Gathered()
    with _pool(workers or min(os.cpu_count() or 1, 4)) as each:
        each(swept_in_group, _grouped(cells, given))
        own = [(work, work.diagram.as_measured) for work in works if work.diagram is not None]
        # cells whose data are the same before they were transformed
        sets = alike_sets(own, lambda one, other: same_data(one[1], other[1]))
        with stage("weighing the candidates of all"):
            contests = dict(chain(*each(_decided, [[work for work, _ in one] for one in sets])))
        tell([work for work in works if work.failure])

        def judged(work: _Work) -> None:
            _judge(work, gathered, contests.get(id(work)))
            tell([other for other in works if work in (other, other.twin)])

        with stage("selecting"):
            each(judged, [work for work, _ in own if not work.failure])
    return tuple(work.result for work in works)


@contextmanager
def _pool(at_once: int) -> Iterator[Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]]:
    """Give a `map` that does `at_once` pieces of work at a time, where `working` said: threads do not inherit the context.

    One after the other where no threads can be started: sandboxes and full machines refuse them.
    """
    if at_once == 1 or not _can_start(at_once):
        yield lambda do, pieces: [do(piece) for piece in pieces]
        return
    with ThreadPoolExecutor(at_once) as pool:

        def each(do: Callable[[Any], Any], pieces: Iterable[Any]) -> list[Any]:
            begun = [pool.submit(copy_context().run, do, piece) for piece in pieces]
            return [one.result() for one in begun]

        yield each


def _can_start(count: int) -> bool:
    """Whether so many threads can be started at a time."""
    done, begun = Event(), []
    try:
        for _ in range(count):
            begun.append(Thread(target=done.wait, daemon=True))
            begun[-1].start()
    except RuntimeError:
        begun.pop()
        return False
    finally:
        done.set()
        for each in begun:
            each.join()
    return True


def _sweep(work: _Work, group: _Group, progress: Progress, options: dict[str, Any]) -> None:
    """Compute the diagram of a cell, or find another of its group with the same modes at every order."""
    cell = work.cell
    problem = pose(work.measured, cell.method, {**cell.options, **options})
    given = group.factored(problem, cell)
    pipeline = factor(problem, cell.orders[-1]) if given is None else realized(problem, given)
    sweep = over(pipeline, list(cell.orders), automatic=False, indicators=False)
    work.twin = next((twin for other, twin in group.done if same_modes(other, sweep)), None)
    if work.twin is None:
        same = next((other for other, _ in group.done if same_poles(other, sweep)), None)
        if same is not None and same.deviating is not None and sweep.deviating is not None:
            sweep.deviating.take_from(same.deviating)
        work.sweep, work.diagram = sweep, swept(sweep, cell.orders, progress=progress)
        group.done.append((sweep, work))


def alike_sets(items: Iterable[Item], alike: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Return items in sets, each of items that are alike to the first of the set.

    Examples
    --------
    >>> alike_sets([1.0, 5.0, 1.1], lambda one, other: abs(one - other) < 0.5)
    [[1.0, 1.1], [5.0]]
    """
    sets: list[list[Item]] = []
    for item in items:
        found = next((one for one in sets if alike(one[0], item)), [])
        if not found:
            sets.append(found)
        found.append(item)
    return sets


def _decided(works: Sequence[_Work]) -> list[tuple[int, Contest | None]]:
    """Return what the data of some cells need, by the identity of each."""
    found, deciding = None, [work for work in works if not work.cell.aside] or works
    with _counted(*works):
        found = contest_of([work.diagram for work in deciding if work.diagram is not None])
    return [(id(work), found) for work in works]


def _judge(work: _Work, gathered: Gathered, known: Contest | None) -> None:
    """Find the modes of a cell among the poles of its diagram."""
    sweep, diagram = work.sweep, work.diagram
    assert sweep is not None
    assert diagram is not None
    with _counted(work):
        modes = chosen_of(diagram, weighed(diagram, gathered, known))
        work.fit_error, work.moved = fit_of(modes, diagram.response), moved_by_noise(sweep, diagram, modes)
        work.modes = modes


def find_by_name(results: Sequence[MethodResult], name: str | tuple[str, str]) -> MethodResult:
    """Return the one result whose method has a name: `era (s)`, `ERA/s`, `ssi_cov`, `PolyMAX`; case, blanks and signs do not matter.

    Raises `DataError`: no such result, with the nearest name; or one name of several.
    """
    asked = name if isinstance(name, str) else "/".join(map(str, name))
    wanted = _plain(asked)
    matches = [r for r in results if wanted in {n + r.method.domain for n in _names(r.method)}]
    matches = matches or [r for r in results if wanted in _names(r.method)]
    if len(matches) == 1:
        return matches[0]
    listed = [r.name for r in matches or results]
    if matches:
        raise DataError(f"the result of {asked!r}:", f"that is {' and '.join(listed)}", "Name one of these.")
    spelt = {_plain(word): word for r in results for word in (r.name, r.label)}
    near = get_close_matches(wanted, spelt, n=1, cutoff=0.5)
    change = f"Did you mean {spelt[near[0]]!r}? Name one of these." if near else "Name one of these."
    raise DataError(f"the result of {asked!r}:", f"there are {', '.join(listed) or 'none'}", change)


def _names(method: Method) -> set[str]:
    """Return all names of a method, plain."""
    words = (method.name, method.label, method.common, *method.known_as, *method.aliases)
    return {_plain(word.partition(" on ")[0].partition(" with ")[0]) for word in words} | {_plain(method.label)}


def _plain(text: str) -> str:
    """Return letters and digits alone, in lower case."""
    return "".join(c for c in str(text).casefold() if c.isalnum())
