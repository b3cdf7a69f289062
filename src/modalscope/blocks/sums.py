"""Sums over chunks of data: add a chunk, merge two, finish. Files longer than memory, threads and clusters are one loop over chunks."""

from __future__ import annotations

from typing import Protocol, Self, TypeVar

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray
from modalscope.model.crew import crew
from modalscope.model.device import fetched, namespace

__all__ = ["Sums", "TriangleSum"]

Result_co = TypeVar("Result_co", covariant=True)


class Sums(Protocol[Result_co]):
    """What is gathered chunk by chunk: the order of the chunks, and who gathered which, changes nothing but rounding."""

    def add(self, chunk: RealArray) -> None:
        """Take one chunk in."""

    def merge(self, other: Self) -> None:
        """Take in what another has gathered."""

    def finish(self) -> Result_co:
        """What the chunks give together."""


class TriangleSum:
    """Triangular factor R of rows that come in chunks, R'R = sum of chunk'chunk: exact, with nothing of the data's size kept.

    Parameters
    ----------
    columns : int
        Length of a row.

    Examples
    --------
    >>> X = np.random.default_rng(0).standard_normal((50, 3))
    >>> total = TriangleSum(3)
    >>> for chunk in np.split(X, 5):
    ...     total.add(chunk)
    >>> R = total.finish()
    >>> bool(np.allclose(R.T @ R, X.T @ X)), R.shape
    (True, (3, 3))
    """

    def __init__(self, columns: int) -> None:
        self._R: RealArray = np.zeros((0, columns))

    def add(self, chunk: RealArray) -> None:
        """Take rows (k, columns) in."""
        stacked = np.asarray(np.vstack([self._R, chunk]), dtype=float)
        columns = stacked.shape[1]
        if len(stacked) >= columns:
            stacked = _triangle(stacked)
        self._R = stacked

    def merge(self, other: TriangleSum) -> None:
        """Take in the rows of another sum."""
        self.add(other._R)

    def finish(self) -> RealArray:
        """Return R, (at most columns, columns): fewer rows where fewer were added."""
        return self._R


def _triangle(rows: RealArray) -> RealArray:
    """Return R of Q R = rows, (columns, columns), computed where large products are."""
    placed, columns = crew().place(rows), rows.shape[1]
    if placed is not rows:
        return fetched(namespace(placed).linalg.qr(placed)[1])
    return np.asarray(sla.qr(rows, mode="r", overwrite_a=True, check_finite=False)[0], dtype=float)[:columns]
