"""One thread of the linear algebra library while many small problems are solved.

Identification solves hundreds of small problems. Threads of the linear algebra library only wait for each other there: on two
busy cores they made the same work take ten times as long. The limit holds while a verb runs and is taken back after it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

__all__ = ["one_thread"]

P = ParamSpec("P")
R = TypeVar("R")


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    """Find the libraries once, with the one that scipy brings for itself."""
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


def one_thread(verb: Callable[P, R]) -> Callable[P, R]:
    """Run a function with one thread of the linear algebra library; one call may run inside another."""

    @wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with _controller().limit(limits=1, user_api="blas"):
            return verb(*args, **kwargs)

    return run
