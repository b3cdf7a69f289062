"""The error class of the package, suggestions for misspelt names, and optional packages that are missing."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from difflib import get_close_matches
from importlib import import_module
from typing import Any

#: Maximum number of characters of a message, which is read on a terminal.
_MAX_MESSAGE_LENGTH = 600

#: Minimum number of characters of a shortened part of a message.
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


#: Whether who reads has the terminal, or its page: options stay as they are typed there.
AT_TERMINAL: ContextVar[bool] = ContextVar("at_terminal", default=False)

#: An option of the terminal, words that may be its values, and whether another option follows.
_VALUE = r"""(?:'[^']*'|"[^"]*"|[^\s;()'"]*[^\s,;().:'"])"""
_OPTION = re.compile(rf"(?<![^\s(])--([a-z][a-z-]*)((?: (?!--|or\b|and\b){_VALUE})*)((?= --))?")
_BARE = re.compile(r"[A-Z]+|-?\d+(\.\d+)?(e[-+]?\d+)?")

#: Options that Python writes otherwise: without a value or under another name, or with brackets around their values.
_NAMES = {name: f"{name}=True" for name in ("transpose", "conjugate", "exact_nodes", "allow_outside")}
_NAMES |= {"no_reciprocal": "reciprocal=False", "max_memory": "modalscope.io.set_max_memory", "test": "sheet"}
_BRACKETS = {**dict.fromkeys(("ignore", "exclude", "input_dofs", "output_dofs"), "[]"), "band": "()"}
_BRACKETS |= dict.fromkeys(("units", "rename", "axes", "delays"), "{}")


def as_printed(error: Exception) -> str:
    """Return the message of an error on one line, its options those of the terminal: what is kept of it is printed later."""
    return " ".join(str([*error.args, error][0]).split())


def in_python(text: str) -> str:
    """Return a message whose options of the terminal are the arguments of Python; commands in backticks stay.

    Examples
    --------
    >>> in_python("Leave it out: --ignore Temp --sampling-rate HZ, or --rows 1-400.")
    "Leave it out: ignore=['Temp'], sampling_rate=HZ, or rows='1-400'."
    """
    parts = re.split("(`[^`]*`)", text)
    parts[::2] = [_OPTION.sub(_argument, part) for part in parts[::2]]
    joined = "".join(parts).replace("], ignore=[", ", ").replace("}, rename={", ", ")
    return re.sub(r"(\S+=\S+|modalscope\S+), or \1(?=\W|$)", r"\1", joined)


def as_read(text: str) -> str:
    """Return a message in the words of who reads it: of the terminal as it stands (`AT_TERMINAL`), else with the arguments of Python."""
    return text if AT_TERMINAL.get() else in_python(text)


def _argument(option: re.Match[str]) -> str:
    """Return an option as an argument, and the words behind it that are none of its values."""
    name, words, comma = option[1].replace("-", "_"), re.findall(_VALUE, option[2]), "," * (option[3] is not None)
    if name == "max_memory" and words:
        return " ".join([f"{_NAMES[name]}({words[0].replace('GB', ' * 10**9')})", *words[1:]])
    brackets, called = _BRACKETS.get(name, ""), _NAMES.get(name, name)
    count = 0 if "=" in called else 2 if brackets == "()" else len(words) if brackets else 1
    values = [word.strip("'\"") for word in words[:count]]
    if brackets == "{}":
        pairs = [pair.partition("=") for word in values for pair in (word.split(",") if name == "units" else [word])]
        shown = [f"{old!r}: {_shown(new.replace(',', ' '))}" for old, _, new in pairs if new]
    else:
        shown = [repr(value) if name in ("exclude", "input_dofs", "output_dofs") else _shown(value) for value in values]
    value = f"={brackets[:1]}{', '.join(shown)}{brackets[1:]}" if values else ""
    return " ".join([f"{called}{value}{comma}", *words[count:]])


def _shown(value: str) -> str:
    """Return a value as Python has it: numbers, and the capitals that stand for one, without quotes."""
    return value if _BARE.fullmatch(value) else repr(value)


class DataError(ValueError):
    """Data that cannot be used, or an option that cannot be met.

    The message is one sentence of what was asked and what there is, and the remedy on a line of its own. It is printable, and cut in
    the middle of its longest part where it has more than 600 characters. Remedies may name options of the terminal: `args[0]` and the
    three parts have them, for print and page; in Python the text has its arguments (`as_read`).

    Parameters
    ----------
    asked : str
        What was asked for: a subject that ends in a colon ("order=12:"), or a clause, which "but" joins to `found`.
    found : str
        What there is.
    change : str
        What to change.
    text : str, optional
        The message where one sentence says all three.

    Examples
    --------
    >>> print(DataError("order=12:", "the data have rank 10", "Lower the order to at most 10."))
    order=12: the data have rank 10.
    Lower the order to at most 10.
    >>> print(DataError("a report needs modes", "there are none", "Select some."))
    a report needs modes, but there are none.
    Select some.
    """

    def __init__(self, asked: str, found: str, change: str, text: str | None = None) -> None:
        asked, found, change = _within(map(printable, (asked, found, change)), _MAX_MESSAGE_LENGTH - len(", but .\n"))
        text = None if text is None else shortened(text)
        self.asked, self.found, self.change, self.text = asked, found, change, text
        super().__init__(f"{self.fault}.\n{change}" if text is None else text)

    def __str__(self) -> str:
        return as_read(self.args[0])

    @property
    def fault(self) -> str:
        """The fault and what there is, without the remedy."""
        return f"{self.asked} {self.found}" if self.asked.endswith(":") else f"{self.asked}, but {self.found}"

    def __reduce__(self) -> tuple[type[DataError], tuple[str, str, str, str | None]]:
        return type(self), (self.asked, self.found, self.change, self.text)


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value` if it is one of the choices, or raise and name the nearest."""
    names = list(choices)
    if isinstance(value, str) and value in names:
        return value
    near = get_close_matches(str(value), names, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    raise DataError(f"{name}={value!r}:", f"there are only {', '.join(names)}", f"{hint}Choose one of these.")


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
    for name in [name for name in given if name not in options]:
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
        raise DataError(f"{name} of {call}:", found, f"{hint[0].upper()}{hint[1:]}", f"{found}; {hint}")


def optional_package(asked: str, package: str, extra: str, name: str | None = None) -> Any:
    """Return an optional package, or say which extra of modalscope brings it.

    `asked`: what it is needed for. `package`: the name that is imported. `name`: what the package is called, when that is not the name
    that is imported.

    Raises `DataError`: it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        fault = f"{name or package} is not installed"
        raise DataError(f"{asked}:", fault, f"Run: pip install 'modalscope[{extra}]'") from None
