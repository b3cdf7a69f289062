"""Hold numbers of many poles that cost much and are read of few: each is computed when it is first read."""

from __future__ import annotations

from collections.abc import Callable
from threading import RLock
from typing import Any, overload

import numpy as np

from modalscope.numerics.checks import Array, IntArray, RealArray, locked

#: Indices of poles -> their columns, (rows, k).
Compute = Callable[[IntArray], RealArray]


class Deferred:
    """Some numbers per pole, two by default for frequency and damping, computed when they are first read.

    `count`: of poles. `compute`: is let go, with all that it holds, once all are known. `rows`: numbers per pole.

    Examples
    --------
    >>> asked = []
    >>> numbers = Deferred(3, lambda index: asked.append(index.tolist()) or np.stack([index, 10.0 * index]))
    >>> numbers.at(np.array([2])).tolist(), numbers.whole()[1].tolist(), asked
    ([[2.0], [20.0]], [0.0, 10.0, 20.0], [[2], [0, 1]])
    """

    def __init__(self, count: int, compute: Compute, rows: int = 2) -> None:
        self._values, self._missing = np.full((rows, count), np.nan), np.ones(count, bool)
        self._compute: Compute | None = compute
        self._whole: RealArray | None = None
        self._lock = RLock()

    def at(self, index: Array, *, known: bool = False) -> RealArray:
        """Return the numbers of some poles, (rows, k); `known`: compute none, NaN for those that were not read."""
        with self._lock:
            missing = np.unique(index[self._missing[index]])
            if missing.size and self._compute is not None and not known:
                self._values[:, missing] = self._compute(missing)
                self._missing[missing] = False
            return np.asarray(self._values[:, index])

    def whole(self) -> RealArray:
        """Return the numbers of all poles, (rows, count)."""
        with self._lock:
            if self._whole is None:
                self._whole = locked(self.at(np.arange(len(self._missing))))
                self._compute = None
            return self._whole


class Column:
    """A field of a class with slots that may hold `Deferred` numbers, and gives one of their columns."""

    def __init__(self, slot: Any, column: int) -> None:
        self._slot, self._column = slot, column

    @overload
    def __get__(self, thing: None, owner: type) -> Column: ...
    @overload
    def __get__(self, thing: object, owner: type) -> RealArray | None: ...
    def __get__(self, thing: object | None, owner: type) -> Any:
        if thing is None:
            return self
        value = self._slot.__get__(thing, owner)
        return value.whole()[self._column] if isinstance(value, Deferred) else value

    def __set__(self, thing: object, value: Any) -> None:
        self._slot.__set__(thing, value)

    def unread(self, thing: object) -> Any:
        """Return what the field holds, without computing it."""
        return self._slot.__get__(thing, type(thing))

    def at(self, thing: object, index: Array, *, known: bool = False) -> RealArray | None:
        """Return the numbers of some poles; None where the field holds none. `known`: see `Deferred.at`."""
        value = self.unread(thing)
        if isinstance(value, Deferred):
            return np.asarray(value.at(index, known=known)[self._column])
        return None if value is None else np.asarray(value[index])
