"""Texts on their way into files: what no format keeps is refused by name, never changed in silence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from modalscope.model import DataError

__all__ = ["check_texts", "in_ascii"]

#: Signs of units, and what stands for them where there is ASCII alone.
_SIGNS = str.maketrans({"µ": "u", "μ": "u", "²": "2", "³": "3", "·": "*", "×": "x", "°": "deg", "Ω": "Ohm", "–": "-"})


def check_texts(kind: str, thing: Any) -> None:
    """Raise on texts that no file keeps: those with a NUL, at which most programs stop, and halves of characters.

    Names of indicators are names of arrays in a file, and need to be printable and without a slash, too.

    Parameters
    ----------
    kind : str
        The suffix, for the message.
    thing : data object
    """
    for where, text in _texts(thing):
        odd = "\0" in text or any("\ud800" <= c <= "\udfff" for c in text)
        if odd or (where.startswith("indicators") and ("/" in text or not text.isprintable())):
            raise DataError(
                f"writing {where} {text!r} as {kind} was asked",
                "that text has characters which files do not keep",
                "Rename it.",
            )


def _texts(thing: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """Give every text of a data object with the name of its field; notes and reasons are written as JSON, which has escapes."""
    if isinstance(thing, str):
        yield where, thing
    elif isinstance(thing, Mapping):
        for key in thing:
            yield from _texts(key, where)
    elif isinstance(thing, tuple | list):
        for item in thing:
            yield from _texts(item, where)
    elif is_dataclass(thing):
        for each in fields(thing):
            if each.name not in ("notes", "reasons", "left_out", "harmonics"):
                yield from _texts(getattr(thing, each.name), each.name)


def in_ascii(what: str, text: str, width: int) -> str:
    """Return text as a field of a universal file holds it, signs of units by their letters; what does not fit is refused.

    Examples
    --------
    >>> in_ascii("unit", "µm/s²", 20)
    'um/s2'
    """
    plain = text.translate(_SIGNS)
    if (
        not (plain.isascii() and (plain.isprintable()))
        or len(plain) > width
        or plain != plain.strip()
        or plain.upper() == "NONE"
    ):
        raise DataError(
            f"the {what} {text!r} was to be written to a universal file",
            f"it has {width} columns for ASCII characters there, with no blank at either end, and NONE means none",
            "Shorten or rename it, or choose another format.",
        )
    return plain
