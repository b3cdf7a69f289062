"""One thread of the linear algebra library while many small problems are solved.

Identification solves hundreds of small problems. Threads of the linear algebra library only wait for each other there: on two busy
cores they made the same work take ten times as long. The limit holds while a verb runs and is taken back when the last of
those that run at the same time is done.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

__all__ = ["one_thread"]

P = ParamSpec("P")
R = TypeVar("R")

_lock = Lock()
_running: list[Any] = []
_depth = 0


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    """Find the libraries once: every one that matters is loaded by the time a verb runs."""
    import scipy.linalg  # noqa: F401  (it brings a linear algebra library of its own)

    return ThreadpoolController()


@contextmanager
def _limited() -> Iterator[None]:
    global _depth
    with _lock:
        if _depth == 0:
            _running.append(_controller().limit(limits=1, user_api="blas"))
        _depth += 1
    try:
        yield
    finally:
        with _lock:
            _depth -= 1
            if _depth == 0:
                _running.pop().restore_original_limits()


def one_thread(verb: Callable[P, R]) -> Callable[P, R]:
    """Run a function with one thread of the linear algebra library."""

    @wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with _limited():
            return verb(*args, **kwargs)

    return run
