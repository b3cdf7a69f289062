"""What to say about arrays whose names are not known: the nearest that are."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from itertools import islice
from typing import Any

from modalscope.io.arrays import names_of
from modalscope.model import DataError

__all__ = ["listed", "unknown_arrays"]

#: So many names of arrays are told in a message.
_NAMED = 12

#: Names that others use; only for the hint of an error message.
_OTHERS = {
    "fs": "sampling_rate", "rate": "sampling_rate", "f": "frequencies", "freq": "frequencies", "freqs": "frequencies",
    "frequency": "frequencies", "h": "values", "frf": "values", "y": "outputs", "acc": "outputs", "data": "outputs",
    "u": "inputs", "force": "inputs", "phi": "shapes",
}  # fmt: skip


def listed(names: Iterable[str]) -> str:
    """Return the first of the names: a file may have thousands."""
    first = list(islice(names, _NAMED + 1))
    return ", ".join([*first[:_NAMED], *(["..."] if len(first) > _NAMED else [])]) or "(none)"


def unknown_arrays(where: str, names: list[str], noun: type[Any] | None) -> DataError:
    """Return the error about arrays that make no data object, or are none of its fields.

    Parameters
    ----------
    where : str
        The file, for messages.
    names : list of str
        Of the arrays.
    noun : type, optional
        The data object that the others make.
    """
    known: list[str] = (
        sorted(names_of(noun))
        if noun
        else ["frequencies", "values", "sampling_rate", "outputs", "inputs", "poles", "shapes"]
    )
    hints = {}
    for name in names[:_NAMED]:
        near = _OTHERS.get(name.lower()) or next(iter(get_close_matches(name, known, n=1)), None)
        if near in known:
            hints[name] = near
    rename = f"rename={hints or {names[0] if names else 'y': 'outputs'}}"
    return DataError(
        f"reading {where} needs `frequencies` and `values`, `sampling_rate` with `outputs` (and `inputs`) "
        "or with `values`, or `poles` and `shapes`",
        f"the arrays {listed(names)} are unknown" + (f" beside those of {noun.__name__}" if noun else ""),
        f"Rename them, read(..., {rename}), or leave them out, read(..., ignore={names[:3]}).",
    )
