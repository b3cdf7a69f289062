"""Estimate time and memory of a stabilization diagram before it is computed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.data.response import Response
from modalscope.data.shown import counted
from modalscope.identification.matrices.combinations import enough
from modalscope.identification.matrices.costs import Cost, speed
from modalscope.identification.method import Problem
from modalscope.identification.options import HankelOptions, LineOptions
from modalscope.identification.orders import checked_orders
from modalscope.identification.prepare import prepare
from modalscope.identification.sizes import default_degree, default_windows
from modalscope.numerics.resources import allowed_memory, in_words, one_thread

#: Passes over the data of a randomized range: products from either side.
_PASSES_OF_RANGE = 12

#: Measured cost in operations of a matrix product: of eigenvalues a state cubed, of an indicator a number, and of a fit a number of its
#: functions.
_EIGENVALUE_OPERATIONS, _INDICATOR_OPERATIONS, _FIT_OPERATIONS = 800.0, 1200.0, 4000.0

#: Seconds of an order besides its arithmetic.
_SECONDS_AN_ORDER = 0.005

#: Maximum number of lines of an indicator, and copies of the data made by one order.
_INDICATOR_LINES, _COPIES_OF_DATA = 1000, 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan:
    """Time and memory of a stabilization diagram.

    `method`, `data`, `matrix`: in words. `ways`: routes of factoring in the order of trial; empty where unknown. `reading`, `sweeping`:
    seconds before the factors, and of all orders. `memory`: bytes besides the data, at most.
    """

    method: str
    data: str
    matrix: str
    orders: tuple[int, ...]
    ways: tuple[Cost, ...]
    reading: float
    sweeping: float
    memory: float

    @property
    def way(self) -> Cost | None:
        """The first route that fits into memory, or None."""
        return next((cost for cost in self.ways if cost.memory <= allowed_memory()), None)

    @property
    def seconds(self) -> float:
        """Total time on one thread of this machine."""
        return self.reading + self.sweeping + (0.0 if self.way is None else self.way.seconds)

    @property
    def fits(self) -> bool:
        """Whether it fits into memory."""
        return self.memory <= allowed_memory() and (self.way is not None or not self.ways)

    def __str__(self) -> str:
        lines = [f"{self.method} of {self.data}, orders {self.orders[0]} to {self.orders[-1]}", self.matrix]
        for cost in self.ways:
            mark = "<- taken" if cost is self.way else ""
            lines.append(f"  {cost.route:18s} {cost.seconds:8.2g} s   {in_words(cost.memory):>8s}   {mark}".rstrip())
        lines.append(f"  {len(self.orders)} orders          {self.sweeping:8.2g} s")
        there = in_words(allowed_memory())
        lines.append(
            f"about {self.seconds:.2g} s on one thread, {in_words(self.memory)} besides the data ({there} available)"
        )
        if not self.fits:
            lines.append(
                "Not enough memory: lower the order or the block sizes, or select fewer channels or a narrower band"
            )
        return "\n".join(lines)


@one_thread
def plan(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: Iterable[int] | None = None,
    **options: Any,
) -> Plan:
    """Estimate time and memory of a stabilization diagram without standard deviations; no large array is made.

    `method`, `domain`: a cell of the table of methods. `orders`, `**options`: as in `stabilize`.

    Raises `DataError`: data unsuited to the row.
    """
    problem = prepare(data, method, domain, **options)
    asked = tuple(problem.method.orders.ladder(problem.measured) if orders is None else checked_orders(orders))
    measured, largest = problem.response, asked[-1]
    small, reading, few = _thinned(problem, largest)
    matrix, _, _ = small.method.matrix(small, largest)
    ways = matrix.observable.costs(largest)
    rows = matrix.block_rows * matrix.observable.outputs
    states = float(problem.method.orders.states_each(measured))
    if not ways:  # normal equations: half of the poles are unstable and dropped, and there are no rows to compare
        rows, states = 0, states / 2
    sweeping = sum(_operations(small.response, rows, n * states) for n in asked) / speed()
    stored = 16.0 * len(measured.output_dofs) * sum(n // 2 for n in asked)
    passing = _COPIES_OF_DATA * small.response.values.nbytes + stored
    taken = next((cost.memory for cost in ways if cost.memory <= allowed_memory()), 0.0)
    return Plan(
        method=problem.method.label,
        data=f"{measured.count} {'samples' if measured.grid is None else 'lines'} of {counted(len(measured.output_dofs), 'output')} "
        f"and {counted(len(measured.input_dofs), 'input')} ({in_words(measured.values.nbytes)})",
        matrix=matrix.describe() + few,
        orders=asked,
        ways=ways,
        reading=reading,
        sweeping=sweeping + _SECONDS_AN_ORDER * len(asked),
        memory=taken + passing,
    )


def _thinned(problem: Problem, largest: int) -> tuple[Problem, float, str]:
    """Return the problem with as many outputs as combinations represent them, the seconds of making these, and words."""
    response, options = problem.response, problem.options
    outputs = len(response.output_dofs)
    count = enough(outputs, largest)
    sized = _sizes(response, largest, options)
    if count is None or sized is None or options.factorization != "auto" or response.ambient:
        return problem, 0.0, ""
    numbers = response.values.size * (2 if np.iscomplexobj(response.values) else 1)
    seconds = _PASSES_OF_RANGE * (numbers * count + 30 * numbers) / speed()
    thin = replace(problem, response=response.select(outputs=range(count)), options=replace(options, **sized))
    return thin, seconds, f"; {outputs} outputs through {count} combinations ({seconds:.2g} s)"


def _sizes(response: Any, largest: int, options: Any) -> dict[str, int] | None:
    """Return the block sizes that all outputs would have; None where they are not combined."""
    if isinstance(options, LineOptions):
        return (
            None if response.grid is None else {"block_rows": options.block_rows or default_degree(response, largest)}
        )
    if not isinstance(options, HankelOptions):
        return None
    rows, columns = default_windows(response, largest, *options.spans)
    return {"block_rows": rows, "block_columns": columns}


def _operations(response: Response, rows: int, states: float) -> float:
    """Return the cost of one order: eigenvalues, fit to the data, and indicators of the rows and columns of the matrix."""
    real = response.count * (2 if np.iscomplexobj(response.values) else 1)
    _, outputs, inputs = response.values.shape
    fit = real * states * (_FIT_OPERATIONS + 16 * states + 4 * outputs * inputs)
    compared = rows + 2 * inputs * min(response.count, _INDICATOR_LINES)
    return float(
        _EIGENVALUE_OPERATIONS * states**3 + fit + compared * states / 2 * (_INDICATOR_OPERATIONS + 4 * states)
    )
