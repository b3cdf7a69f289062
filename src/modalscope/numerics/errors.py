"""The error class of the package, suggestions for misspelt names, and optional packages that are missing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import Any

#: Maximum number of characters of a message, which is read on a terminal.
_MAX_MESSAGE_LENGTH = 600

#: Minimum number of characters that are left of a part of a message.
_MIN_PART_LENGTH = 120


def printable(text: str) -> str:
    r"""Return text with an escape for every character that has no sign of its own; lines stay lines.

    Examples
    --------
    >>> print(printable("a\x1b[2Jb"))
    a\x1b[2Jb
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str) -> str:
    """Return text as a message may be: printable, and cut in the middle where it has more than 600 characters."""
    return _within([printable(text)], _MAX_MESSAGE_LENGTH)[0]


def _within(parts: Iterable[str], limit: int) -> list[str]:
    """Return the parts, the longest of them cut in the middle until all fit."""
    kept = list(parts)
    for k in sorted(range(len(kept)), key=lambda k: -len(kept[k])):
        size = max(len(kept[k]) - max(sum(map(len, kept)) - limit, 0), _MIN_PART_LENGTH)
        if size < len(kept[k]):
            kept[k] = f"{kept[k][: size - size // 3 - 5]} ... {kept[k][-(size // 3) :]}"
    return kept


class DataError(ValueError):
    """Data that cannot be used, or an option that cannot be met.

    The message names the fault first, then what there is, then the remedy: what ends in "was asked" is its subject alone. It is
    printable, and cut in the middle of its longest part where it has more than 600 characters.

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
    order=12: the data have rank 10.
    Lower the order to at most 10.
    """

    def __init__(self, asked: str, found: str, change: str, text: str | None = None) -> None:
        asked, found, change = _within(map(printable, (asked, found, change)), _MAX_MESSAGE_LENGTH - len(", but .\n"))
        text = None if text is None else shortened(text)
        self.asked, self.found, self.change, self.text = asked, found, change, text
        super().__init__(f"{self.fault}.\n{change}" if text is None else text)

    @property
    def fault(self) -> str:
        """The fault and what there is, without the remedy."""
        subject = self.asked.removesuffix(" was asked").removesuffix(" were asked").rstrip(",")
        return f"{self.asked}, but {self.found}" if subject == self.asked else f"{subject}: {self.found}"

    def __reduce__(self) -> tuple[type[DataError], tuple[str, str, str, str | None]]:
        return type(self), (self.asked, self.found, self.change, self.text)


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value` if it is one of the choices, or raise and name the nearest."""
    names = list(choices)
    if isinstance(value, str) and value in names:
        return value
    near = get_close_matches(str(value), names, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    raise DataError(f"{name}={value!r} was asked", f"there are only {', '.join(names)}", f"{hint}Choose one of these.")


#: What others call an option -> its name here.
_USUAL_NAMES = {
    **dict.fromkeys(("fs", "sample_rate", "samplerate", "rate", "fsamp", "sampling_frequency"), "sampling_rate"),
    **dict.fromkeys(("f", "freq", "freqs", "frequency"), "frequencies"),
    **dict.fromkeys(("y", "output", "acceleration", "accelerations"), "outputs"),
    **dict.fromkeys(("u", "input", "force", "forces"), "inputs"),
    **dict.fromkeys(("h", "frf", "frfs", "irf", "data"), "values"),
    **dict.fromkeys(("labels", "dofs", "channels"), "output_dofs"),
    **dict.fromkeys(("n", "model_order"), "order"),
}


def check_option_names(
    verb: str, given: Iterable[str], known: Iterable[str], owners: Mapping[str, Iterable[str]] | None = None
) -> None:
    """Raise when an option has a name that the verb does not know, and name the nearest.

    `verb`: what was called, such as "identify" or "identify(method='era')". `given`, `known`: names of the options that were given, and
    of those that there are. `owners`: who takes an option that this verb does not.

    Examples
    --------
    >>> check_option_names("identify", ["blok_rows"], ["block_rows", "block_columns", "order"])
    Traceback (most recent call last):
    modalscope.numerics.errors.DataError: identify() has no option 'blok_rows'; did you mean 'block_rows'?
    """
    options, elsewhere = list(dict.fromkeys(known)), dict(owners or {})
    for name in given:
        if name in options:
            continue
        call = verb if verb.endswith(")") else f"{verb}()"
        found = f"{call} has no option {name!r}"
        usual = _USUAL_NAMES.get(name.lower(), "")
        near = [usual] if usual in options else get_close_matches(name, [*options, *elsewhere], n=1)
        if name in elsewhere:
            hint = f"it belongs to {', '.join(elsewhere[name])}"
        elif near:
            hint = f"did you mean {near[0]!r}?"
        else:
            hint = f"its options are {', '.join(options)}" if options else "it has no options"
        raise DataError(f"{name} of {call} was asked", found, f"{hint[0].upper()}{hint[1:]}", f"{found}; {hint}")


def optional_package(asked: str, package: str, extra: str, name: str | None = None) -> Any:
    """Return an optional package, or say which extra of modalscope brings it.

    `asked`: what it is needed for. `package`: the name that is imported. `name`: what the package is called, when that is not the name
    that is imported.

    Raises `DataError`: it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        raise DataError(
            f"{asked} was asked", f"{name or package} is not installed", f"Run: pip install 'modalscope[{extra}]'"
        ) from None
