"""What each way of factoring costs: operations, seconds and memory from the shape of the matrix and the price of its products."""

from __future__ import annotations

import time
from functools import cache
from typing import NamedTuple

import numpy as np

from modalscope.blocks.operators import Operator
from modalscope.blocks.threads import one_thread

__all__ = ["EXTRA", "Cost", "cost_of_triangle", "costs_of", "speed"]

#: Directions carried beside those that are wanted, so that the last is as good as the first.
EXTRA = 20

#: Up to this many entries, and while the shorter side stays below `_DENSE_SIDE`, the dense route takes a fraction of a second.
_DENSE_ENTRIES, _DENSE_SIDE = 250_000, 400

#: How much longer than a matrix product an operation takes: of reflections, of an orthogonalization by two Cholesky factors, of
#: eigenvectors, of a singular value decomposition. Measured on one thread.
_QR, _CHOLESKY, _EIGEN, _SINGULAR = 5.0, 2.0, 2.0, 4.0

#: Operations that exact directions in the noise are worth: half a second.
_PATIENCE = 2e10

#: Directions of a randomized range by those that are carried, each of which takes a product from either side.
_DIRECTIONS = 2


class Cost(NamedTuple):
    """One way of factoring.

    Parameters
    ----------
    route : str
        As `factorize` takes it.
    operations : float
        In units of those of a matrix product.
    memory : float
        Bytes beside the data.
    passing : float
        Operations among them of a refinement pass, which only data without noise, or with modes far below the strongest, need.
    """

    route: str
    operations: float
    memory: float
    passing: float = 0.0

    @property
    def exact_enough(self) -> bool:
        """Whether it gives every direction to rounding and takes little time."""
        return self.route in ("gram", "dense") and self.operations < _PATIENCE

    @property
    def seconds(self) -> float:
        """On this machine, one thread."""
        return self.operations / speed()


def costs_of(matrix: Operator, wanted: int) -> tuple[Cost, ...]:
    """Return the ways that there are for the leading triplets of a tall matrix, in the order in which they are tried.

    The cheapest comes first, but the Gram matrix and the dense decomposition before a range where they are a matter of half a second: a
    range knows directions in the bulk of the noise, into which diagrams reach, to a few per cent.

    Parameters
    ----------
    matrix : Operator
    wanted : int
    """
    rows, columns = matrix.shape
    if rows < columns:
        return costs_of(matrix.transposed(), wanted)
    k = min(wanted + EXTRA, columns)
    dense = Cost("dense", _SINGULAR * 6 * rows * columns**2, 8.0 * 3 * rows * columns)
    if k == columns or (rows * columns <= _DENSE_ENTRIES and columns <= _DENSE_SIDE):
        return (dense,)
    product = matrix.product_operations * k
    both = 8.0 * k * (rows + columns)
    sides = _CHOLESKY * 2.0 * _DIRECTIONS * (_DIRECTIONS + 1) * k**2 * (rows + columns)
    ranged = 2 * _DIRECTIONS * product + sides
    found = [dense, Cost("randomized", ranged, (_DIRECTIONS + 1) * both)]
    if matrix.gram_operations is not None:
        eigen = _EIGEN * (4 / 3 * columns**3 + 4 * columns**2 * k)
        refined = 2 * product + _CHOLESKY * 4.0 * k**2 * rows
        memory = 8.0 * 3 * columns**2 + 2 * both
        found.append(Cost("gram", matrix.gram_operations + eigen + refined, memory, refined))
    return tuple(sorted(found, key=lambda cost: (not cost.exact_enough, cost.operations)))


def cost_of_triangle(rows: int, columns: int, together: int) -> Cost:
    """Return what a matrix of many columns costs through its triangular factor, `together` columns at a time."""
    operations = _QR * 2.0 * columns * rows**2 + _SINGULAR * 6.0 * rows**3
    return Cost("triangular factor", operations, 8.0 * (3 * together * rows + 2 * rows**2))


@cache
@one_thread
def speed() -> float:
    """Return operations a second of a matrix product on one thread, measured once (some milliseconds)."""
    a, times = np.ones((400, 400)), []
    for _ in range(5):
        start = time.process_time()
        a @ a
        times.append(time.process_time() - start)
    return float(2 * 400**3 / min(times))
