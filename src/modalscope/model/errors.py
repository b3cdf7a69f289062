"""One form for all errors, and names that are misspelt."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

__all__ = ["DataError", "check_choice", "check_option_names"]


class DataError(ValueError):
    """Data that cannot be used, or an option that cannot be met.

    Parameters
    ----------
    asked : str
        What was asked for.
    found : str
        What there is.
    change : str
        What to change.
    text : str, optional
        The message where one sentence says all three.

    Examples
    --------
    >>> print(DataError("order=12 was asked", "the data have rank 10", "Lower the order to at most 10."))
    order=12 was asked, but the data have rank 10.
    Lower the order to at most 10.
    """

    def __init__(self, asked: str, found: str, change: str, text: str | None = None) -> None:
        self.asked, self.found, self.change, self.text = asked, found, change, text
        super().__init__(f"{asked}, but {found}.\n{change}" if text is None else text)

    def __reduce__(self) -> tuple[type[DataError], tuple[str, str, str, str | None]]:
        return type(self), (self.asked, self.found, self.change, self.text)


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value` if it is one of the choices, or raise and name the nearest."""
    known = list(choices)
    if isinstance(value, str) and value in known:
        return value
    near = get_close_matches(str(value), known, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    raise DataError(f"{name}={value!r} was asked", f"there are only {', '.join(known)}", f"{hint}Choose one of these.")


def check_option_names(
    verb: str, given: Iterable[str], known: Iterable[str], owners: Mapping[str, Iterable[str]] | None = None
) -> None:
    """Raise when an option has a name that the verb does not know, and name the nearest.

    Parameters
    ----------
    verb : str
        What was called, such as "identify" or "identify(method='era')".
    given, known : iterable of str
        Names of the options that were given, and of those that there are.
    owners : mapping of option to names, optional
        Who takes an option that this verb does not.

    Examples
    --------
    >>> check_option_names("identify", ["blok_rows"], ["block_rows", "block_columns", "order"])
    Traceback (most recent call last):
    modalscope.model.errors.DataError: identify() has no option 'blok_rows'; did you mean 'block_rows'?
    """
    options, elsewhere = list(dict.fromkeys(known)), dict(owners or {})
    for name in given:
        if name in options:
            continue
        call = verb if verb.endswith(")") else f"{verb}()"
        found = f"{call} has no option {name!r}"
        near = get_close_matches(name, [*options, *elsewhere], n=1)
        if name in elsewhere:
            hint = f"it belongs to {', '.join(elsewhere[name])}"
        elif near:
            hint = f"did you mean {near[0]!r}?"
        else:
            hint = f"its options are {', '.join(options)}" if options else "it has no options"
        raise DataError(f"{name} of {call} was asked", found, f"{hint[0].upper()}{hint[1:]}", f"{found}; {hint}")
