"""One thread of the linear algebra library while many small problems are solved.

Identification solves hundreds of small problems. Threads of the linear algebra library only wait for each other there: on two
busy cores they made the same work take ten times as long. The limit holds while a verb runs and is taken back after it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

__all__ = ["one_thread", "single_threaded"]

P = ParamSpec("P")
R = TypeVar("R")


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    """Find the libraries once, with the one that scipy brings for itself."""
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


class _Users:
    """How many calls want one thread at the moment: the first sets the limit, the last takes it back."""

    def __init__(self) -> None:
        self._lock, self._count = Lock(), 0
        self._limit: Any = None

    def enter(self) -> None:
        with self._lock:
            if self._count == 0:
                _free_control()
                self._limit = _controller().limit(limits=1, user_api="blas")
            self._count += 1

    def leave(self) -> None:
        with self._lock:
            self._count -= 1
            if self._count == 0:
                _free_control()
                self._limit.restore_original_limits()
                _free_control()


def _free_control() -> None:
    """Let any thread set the number: threadpoolctl leaves it to the thread that set it first, which need not be the last to end."""
    for library in _controller().lib_controllers:
        clear = getattr(library, "clear_controlling_thread", None)
        if clear is not None:
            clear(force=True)


_USERS = _Users()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Hold the linear algebra library at one thread; calls may overlap and lie inside each other, the number before comes back."""
    _USERS.enter()
    try:
        yield
    finally:
        _USERS.leave()


def one_thread(verb: Callable[P, R]) -> Callable[P, R]:
    """Run a function with one thread of the linear algebra library; see `single_threaded`."""

    @wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with single_threaded():
            return verb(*args, **kwargs)

    return run
