"""Verbs as users call them: a misspelt keyword is answered by the nearest there is, a wrong value by its name (`entries`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from functools import wraps
from typing import ParamSpec, TypeVar

from modalscope.model.entries import plainly
from modalscope.model.errors import check_option_names

__all__ = ["named"]

P = ParamSpec("P")
R = TypeVar("R")


def named(*options: Iterable[str]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that checks the names of keywords before the function is called, and names wrong values when it fails.

    Parameters
    ----------
    options : iterables of str
        What the function takes by `**options`, beside its own parameters.

    Examples
    --------
    >>> @named()
    ... def double(value: int, *, twice: bool = False) -> int:
    ...     return 4 * value if twice else 2 * value
    >>> double(2, twise=True)
    Traceback (most recent call last):
    modalscope.model.errors.DataError: double() has no option 'twise'; did you mean 'twice'?
    """
    more = [name for names in options for name in names]

    def decorate(verb: Callable[P, R]) -> Callable[P, R]:
        parameters = inspect.signature(verb).parameters.values()
        own = [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]

        plain = plainly(verb)

        @wraps(verb)
        def run(*args: P.args, **kwargs: P.kwargs) -> R:
            check_option_names(verb.__name__, kwargs, [*own, *more])
            return plain(*args, **kwargs)

        return run

    return decorate
