"""Show data and results: one line at a prompt, a picture and a table in a notebook.

What users wrote is escaped; the pictures are those that reports have.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from functools import singledispatch
from html import escape
from typing import Any

import numpy as np

from modalscope.numerics.errors import DataError
from modalscope.numerics.handed import handed


class Shown:
    """Something that shows itself: with one line at a prompt, in a notebook with a picture and a table, too, where it has them."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"<{summary_of(self)}>"

    def plot(self, ax: Any = None) -> Any:
        """Draw it as its kind is drawn: a diagram with its poles, modes as their shapes, responses as curves.

        Parameters
        ----------
        ax : Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        Axes

        Raises
        ------
        DataError
            It has no picture.
        """
        if ax is not None and not hasattr(ax, "transData"):
            raise DataError("a picture:", f"ax is {type(ax).__name__}", "Give Matplotlib axes, or leave ax out.")
        return handed("drawn")(self, ax)

    def _repr_html_(self) -> str:
        said = "".join(f"<p>{escape(sentence)}</p>" for sentence in said_of(self))
        return f"<div><p>{escape(summary_of(self))}</p>{handed('glance')(self)}{html_table(cells_of(self))}{said}</div>"


@singledispatch
def summary_of(thing: object) -> str:
    """Return what something is and how large, in one line.

    Examples
    --------
    >>> from modalscope.data import Signals
    >>> summary_of(Signals(outputs=[[0.0], [1.0]], sampling_rate=10.0, quantities="velocity"))
    'records: 2 samples at 10 Hz, 1 output (velocity), no inputs'
    """
    return type(thing).__name__


@singledispatch
def cells_of(thing: object) -> list[list[str]]:
    """Return the rows of a table of something, the first its heads; none where it has no table."""
    return []


@singledispatch
def said_of(thing: object) -> tuple[str, ...]:
    """Return what must be said of something, in sentences; none by default."""
    return ()


def counted(number: int, word: str) -> str:
    """Return a number with its noun.

    Examples
    --------
    >>> counted(1, "mode"), counted(2, "mode")
    ('1 mode', '2 modes')
    """
    return f"{number} {word}" + ("" if number == 1 else "s")


def list_some(names: Iterable[object], most: int = 3) -> str:
    """Return names, at most so many of them.

    Examples
    --------
    >>> list_some("abc"), list_some("abcde")
    ('a, b, c', 'a, b, c and 2 more')
    """
    listed = list(map(str, names))
    rest = len(listed) - most
    return ", ".join(listed[:most]) + (f" and {rest} more" if rest > 0 else "")


def frequency(hertz: float) -> str:
    """Return a frequency with five digits and its unit."""
    return f"{hertz:.5g} Hz"


def figures(value: float, digits: int = 3) -> str:
    """Return a number with so many digits, or with all that it has before its point, up to a million.

    Examples
    --------
    >>> figures(1.2345), figures(1234.5), figures(99.9, 2)
    ('1.23', '1234', '100')
    """
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e6 else text


def percent(ratio: float, digits: int = 3) -> str:
    """Return a ratio in per cent, or a dash if it is not finite."""
    return f"{figures(100 * ratio, digits)} %" if np.isfinite(ratio) else "–"


def text_table(rows: Iterable[Sequence[str]], left: Container[int] = ()) -> str:
    """Return rows of cells as lines of text, columns aligned to the right; those counted in `left` to the left.

    Examples
    --------
    >>> print(text_table([("mode", "f [Hz]"), ("1", "0.906")]))
    mode  f [Hz]
       1   0.906
    """
    columns = [
        [cell.ljust(width) if k in left else cell.rjust(width) for cell in column]
        for k, column in enumerate(zip(*rows, strict=True))
        for width in [max(map(len, column))]
    ]
    return "\n".join("  ".join(row).rstrip() for row in zip(*columns, strict=True))


def html_table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows as an HTML table, the first as its head; empty text where there is none."""
    if not rows:
        return ""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows[1:])
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
