"""Show data and results: one line at a prompt, a picture and a table in a notebook.

What users wrote is escaped; the pictures are lines of SVG, made of at most a few hundred points.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from functools import singledispatch
from html import escape
from typing import Any

import numpy as np

from modalscope.numerics.checks import Array
from modalscope.numerics.errors import DataError
from modalscope.numerics.handed import handed

_WIDTH_PIXELS, _HEIGHT_PIXELS, _MAX_COLUMNS = 420, 90, 400

#: Maximum number of dots that are drawn.
_MAX_DOTS = 3000


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
            found = f"ax is {type(ax).__name__}"
            raise DataError("a picture was asked", found, "Give Matplotlib axes, or leave ax out.")
        return handed("drawn")(self, ax)

    def _repr_html_(self) -> str:
        said = "".join(f"<p>{escape(sentence)}</p>" for sentence in said_of(self))
        return f"<div><p>{escape(summary_of(self))}</p>{sketch_of(self)}{html_table(cells_of(self))}{said}</div>"


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
def sketch_of(thing: object) -> str:
    """Return a small picture of something as SVG; empty text where it has none."""
    return ""


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


def frequency(hertz: float) -> str:
    """Return a frequency with five digits and its unit."""
    return f"{hertz:.5g} Hz"


def percent(ratio: float, digits: int = 3) -> str:
    """Return a ratio in per cent, or a dash if it is not finite."""
    if not np.isfinite(ratio):
        return "–"
    return f"{100 * ratio:.0f} %" if abs(100 * ratio) >= 10**digits else f"{100 * ratio:.{digits}g} %"


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


def curve(values: Array) -> str:
    """Return a curve as SVG: of long data the lowest and the highest value of every column of the picture.

    `values` (N,): values that are not finite are left out.
    """
    y = np.asarray(values, dtype=float)
    parts = [part[np.isfinite(part)] for part in np.array_split(y, max(min(len(y), _MAX_COLUMNS), 1))]
    points = [
        (k / max(len(parts) - 1, 1), v)
        for k, part in enumerate(parts)
        if part.size
        for v in dict.fromkeys((float(part.min()), float(part.max())))
    ]
    if len(points) < 2:
        return ""
    x, level = (np.array(side) for side in zip(*points, strict=True))
    at = " ".join(f"{px:.1f},{py:.1f}" for px, py in zip(*_placed(x, level), strict=True))
    return _framed(f'<polyline points="{at}" fill="none" stroke="currentColor" stroke-width="1"/>')


def dots(x: Array, y: Array, dark: Array) -> str:
    """Return dots as SVG, dark ones over pale ones.

    `x`, `y` (N,). `dark` (N,).
    """
    step = max(1, -(-len(x) // _MAX_DOTS))
    chosen = np.argsort(dark, kind="stable")[::step]
    if not len(chosen):
        return ""
    px, py = _placed(np.asarray(x)[chosen], np.asarray(y)[chosen])
    full = np.asarray(dark)[chosen].astype(bool)
    paths = []
    for kept, opacity in ((~full, 0.2), (full, 0.9)):
        at = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(px[kept], py[kept], strict=True))
        paths.append(f'<path stroke-opacity="{opacity}" d="{at}"/>')
    style = 'stroke="currentColor" stroke-width="2.6" stroke-linecap="round"'
    return _framed(f"<g {style}>{''.join(paths)}</g>")


def _placed(x: Array, y: Array) -> tuple[Array, Array]:
    """Return points in the frame of the picture."""
    wide, high = (max(float(np.ptp(side)), np.finfo(float).tiny) for side in (x, y))
    return 3 + (x - x.min()) / wide * (_WIDTH_PIXELS - 6), _HEIGHT_PIXELS - 3 - (y - y.min()) / high * (
        _HEIGHT_PIXELS - 6
    )


def _framed(inner: str) -> str:
    size = f'width="{_WIDTH_PIXELS}" height="{_HEIGHT_PIXELS}" viewBox="0 0 {_WIDTH_PIXELS} {_HEIGHT_PIXELS}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="overview" {size}>{inner}</svg>'
