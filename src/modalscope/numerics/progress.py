"""Tell what a run does and finds: named stages for whoever shows them, and records of the program's one logger, `modalscope`.

Notes and findings are records of level INFO, settings of DEBUG. Nothing is printed unless a program, or the command line, listens.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from typing import Any

LOG = logging.getLogger("modalscope")
LOG.addHandler(logging.NullHandler())

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


def tell(*texts: object) -> None:
    """Record what a run tells, one record a text."""
    for text in texts:
        LOG.info("%s", text)
