"""Name what is being done, for whoever shows it: the command line on its terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from typing import Any

#: Name of a stage -> a context in which it is shown.
Show = Callable[[str], AbstractContextManager[Any]]

_SHOWN: ContextVar[Show] = ContextVar("shown", default=nullcontext)


def stage(name: str) -> AbstractContextManager[Any]:
    """Return a context in which a stage of long work has a name."""
    return _SHOWN.get()(name)


@contextmanager
def stages_shown(show: Show) -> Iterator[None]:
    """Show the names of stages while the block runs.

    Examples
    --------
    >>> from contextlib import nullcontext
    >>> seen = []
    >>> with stages_shown(lambda name: nullcontext(seen.append(name))), stage("reading"):
    ...     pass
    >>> seen
    ['reading']
    """
    token = _SHOWN.set(show)
    try:
        yield
    finally:
        _SHOWN.reset(token)
