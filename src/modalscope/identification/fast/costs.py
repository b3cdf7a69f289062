"""Predict operations and memory of factorizations from the shape of a matrix and the cost of its products."""

from __future__ import annotations

import os
from typing import NamedTuple

from modalscope.data.notes import Note
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import Operator

#: Directions in excess of the wanted ones, so that the last wanted one is as accurate as the first.
EXTRA = 20


#: Maximum number of entries, and of the shorter side, for which only the dense route is considered: a fraction of a second.
DENSE_ENTRIES, _DENSE_SIDE = 250_000, 400


#: Measured cost of an operation, on one thread, in operations of a matrix product: of an orthogonalization by two Cholesky
#: factors, of eigenvectors, of a singular value decomposition.
_CHOLESKY_COST, _EIGEN_COST, _SVD_COST = 2.0, 2.0, 4.0


#: Below this number of operations, half a second, exact directions of the noise are preferred.
_EXACT_OPERATIONS = 2e10


#: Directions of a randomized range per direction kept; each takes a product from either side.
_RANGE_RATIO = 2


class Cost(NamedTuple):
    """One way of factoring.

    `route`: as `factorize` takes it. `operations`: in units of those of a matrix product. `memory`: bytes beside the data. `passing`:
    operations among them of a refinement pass, which only data without noise, or with modes far below the strongest, need.
    """

    route: str
    operations: float
    memory: float
    passing: float = 0.0

    @property
    def exact_enough(self) -> bool:
        """Whether it gives every direction to rounding and takes little time."""
        return self.route in ("gram", "dense") and self.operations < _EXACT_OPERATIONS


def costs_of(matrix: Operator, wanted: int) -> tuple[Cost, ...]:
    """Return the ways that there are for the leading triplets of a tall matrix, in the order in which they are tried.

    The cheapest comes first, but the Gram matrix and the dense decomposition before a range where they are a matter of half a second: a
    range knows directions in the bulk of the noise, into which diagrams reach, to a few per cent.
    """
    rows, columns = matrix.shape
    if rows < columns:
        return costs_of(matrix.transposed(), wanted)
    k = min(wanted + EXTRA, columns)
    dense = Cost("dense", _SVD_COST * 6 * rows * columns**2, 8.0 * 3 * rows * columns)
    if k == columns or (rows * columns <= DENSE_ENTRIES and columns <= _DENSE_SIDE):
        return (dense,)
    product = matrix.product_operations * k
    both = 8.0 * k * (rows + columns)
    sides = _CHOLESKY_COST * 2.0 * _RANGE_RATIO * (_RANGE_RATIO + 1) * k**2 * (rows + columns)
    ranged = 2 * _RANGE_RATIO * product + sides
    costs = [dense, Cost("randomized", ranged, (_RANGE_RATIO + 1) * both)]
    if matrix.gram_operations is not None:
        eigen = _EIGEN_COST * (4 / 3 * columns**3 + 4 * columns**2 * k)
        refined = 2 * product + _CHOLESKY_COST * 4.0 * k**2 * rows
        memory = 8.0 * 3 * columns**2 + 2 * both
        costs.append(Cost("gram", matrix.gram_operations + eigen + refined, memory, refined))
    return tuple(sorted(costs, key=lambda cost: (not cost.exact_enough, cost.operations)))


#: Products of two columns per second of a core, with the columns themselves: measured from 1e10 to 1e12 of them.
_PRODUCTS_PER_SECOND = 2.5e10


#: Simultaneous triangular factors in memory, and bytes of all small arrays.
_TRIANGLES, _SMALL_BYTES = 4, 32e6


class RecordCost(NamedTuple):
    """Seconds of one core for the factor, bytes of the transforms and triangles, and (q + 1)(1 + m + l) columns."""

    seconds: float
    bytes: float
    columns: int
    lines: int

    @property
    def note(self) -> Note:
        """The cost in words."""
        seconds = "less than a second" if self.seconds < 1 else f"about {self.seconds:.2g} s"
        text = f"{self.columns} columns on {self.lines} lines: {seconds} of one core and {_words(self.bytes)} of memory predicted"
        return Note("cost", {"seconds": self.seconds, "bytes": self.bytes}, text)


def record_cost(lines: int, outputs: int, inputs: int, degree: int) -> RecordCost:
    """Return the cost of records on lines: 2 F ((q + 1)(1 + m + l))^2 products, 16 F (l + m) bytes and four triangles of the columns.

    `lines`: f, of all runs. `degree`: q.

    Examples
    --------
    >>> print(record_cost(999_999, 62, 2, 8).note)
    585 columns on 999999 lines: about 27 s of one core and 1.1 GB of memory predicted
    """
    columns = (degree + 1) * (1 + inputs + outputs)
    size = 16.0 * lines * (outputs + inputs) + _TRIANGLES * 8.0 * columns**2 + _SMALL_BYTES
    return RecordCost(2.0 * lines * columns**2 / _PRODUCTS_PER_SECOND, size, columns, lines)


def refuse_beyond_memory(cost: RecordCost) -> None:
    """Raise where records on lines would take more memory than the machine has.

    Raises `DataError`: names both, and what takes less.
    """
    there = _memory()
    if there is not None and cost.bytes > there:
        raise DataError(
            "records on lines were asked",
            f"{cost.columns} columns on {cost.lines} lines need {_words(cost.bytes)} besides the records, the machine has {_words(there)}",
            "Give a band, lower block_rows, exclude channels, or identify runs one by one.",
        )


def _memory() -> float | None:
    """Return the bytes of memory of the machine; None where it does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def _words(size: float) -> str:
    return f"{size / 1e9:.2g} GB" if size >= 1e9 else f"{size / 1e6:.2g} MB"
