"""What methods are called in tables and pictures, and how a result is found by any of its method's names."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Protocol, TypeVar

from modalscope.identification.method import Method
from modalscope.model.checks import DataError

__all__ = ["find_by_name"]


class _HasMethod(Protocol):
    @property
    def method(self) -> Method: ...


T = TypeVar("T", bound=_HasMethod)


def find_by_name(results: Iterable[T], name: str | tuple[str, str]) -> T:
    """Return the one result whose method has a name: `era (s)`, `ERA/s`, `ssi_cov`, `PolyMAX`; case, blanks and signs do not matter.

    Raises
    ------
    DataError
        No such result, with the nearest name; or one name of several.
    """
    known = list(results)
    asked = name if isinstance(name, str) else "/".join(map(str, name))
    wanted = _plain(asked)
    found = [r for r in known if wanted in {n + r.method.domain for n in _names(r.method)}]
    found = found or [r for r in known if wanted in _names(r.method)]
    if len(found) == 1:
        return found[0]
    there = [str(r.method) for r in found or known]
    if found:
        raise DataError(f"the result of {asked!r} was asked", f"that is {' and '.join(there)}", "Name one of these.")
    spelt = {_plain(word): word for r in known for word in (str(r.method), r.method.label)}
    near = get_close_matches(wanted, spelt, n=1, cutoff=0.5)
    hint = f"Did you mean {spelt[near[0]]!r}? " if near else ""
    raise DataError(
        f"the result of {asked!r} was asked", f"there are {', '.join(there) or 'none'}", f"{hint}Name one of these."
    )


def _names(method: Method) -> set[str]:
    words = (method.name, method.label, method.common, *method.known_as, *method.aliases)
    return {_plain(word.partition(" on ")[0].partition(" with ")[0]) for word in words} | {_plain(method.label)}


def _plain(text: str) -> str:
    """Return letters and digits alone, in lower case."""
    return "".join(c for c in str(text).casefold() if c.isalnum())
