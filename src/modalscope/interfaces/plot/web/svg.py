"""Write charts as SVG: axes with ticks, curves, marks, bars and texts.

Colours are classes of the style sheet of the page (`reporting/report.css`), so that a chart is light, dark or printed as its page is.
Coordinates are whole tenths of a pixel, which keeps paths short.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from modalscope.numerics.checks import Array, IntArray
from modalscope.numerics.errors import printable

#: Tenths of a pixel.
_UNITS = 10

#: Pixels of one character of a tick label, and of a line of text.
_CHARACTER, _LINE = 6.2, 14

#: Maximum number of ticks of an axis; minimum number of decades of a logarithmic one, and of powers of ten that alone have ticks.
_MAX_TICKS, _MIN_DECADES, _MIN_POWERS = 7, 0.8, 3

#: Path of each mark, drawn from its centre, tenths of a pixel.
MARKS = {
    "dot": "h0",
    "circle": "m-26 0a26 26 0 1 0 52 0a26 26 0 1 0-52 0z",
    "square": "m-22-22h44v44h-44z",
    "diamond": "m0-30 30 30-30 30-30-30z",
    "triangle": "m0-28 30 52h-60z",
}

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Scale:
    """A scale of an axis from `low` to `high`; `log`: both are positive, and ticks are powers of ten."""

    low: float
    high: float
    log: bool = False

    def shares(self, values: Array) -> Array:
        """Return where values lie between the ends, 0 to 1; NaN stays."""
        low, high = (np.log10(self.low), np.log10(self.high)) if self.log else (self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore"):
            v = np.log10(values) if self.log else np.asarray(values, dtype=float)
        return np.asarray((v - low) / (high - low or 1.0))

    def ticks(self) -> list[tuple[float, str]]:
        """Return values and labels of the ticks."""
        if self.log and np.log10(self.high / self.low) >= _MIN_DECADES:
            first, last = int(np.ceil(np.log10(self.low) - 1e-9)), int(np.floor(np.log10(self.high) + 1e-9))
            if last - first < _MIN_POWERS:
                steps = [(s, k) for k in range(first - 1, last + 1) for s in (1, 2, 5)]
                values = [s * 10.0**k for s, k in steps]
                return [(v, f"{v:g}") for v in values if self.low <= v <= self.high]
            powers = range(first, last + 1, -(-(last - first + 1) // _MAX_TICKS))
            return [(10.0**k, f"10{str(k).translate(_SUPERSCRIPTS)}") for k in powers]
        rough = (self.high - self.low) / _MAX_TICKS or 1.0
        power = 10.0 ** np.floor(np.log10(rough))
        step = float(next(s * power for s in (1, 2, 5, 10) if s * power >= rough * (1 - 1e-9)))
        count = range(int(np.ceil(self.low / step - 1e-9)), int(np.floor(self.high / step + 1e-9)) + 1)
        digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
        return [(k * step, f"{k * step + 0.0:.{digits}f}") for k in count]


def scale_of(values: Iterable[Array], *, log: bool = False, room: float = 0.05, zero: bool = False) -> Scale:
    """Return the scale that shows all finite values with some room; `zero`: it contains zero."""
    flat = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values] or [np.zeros(0)])
    flat = flat[np.isfinite(flat) & (flat > 0 if log else True)]
    if not flat.size:
        return Scale(0.1, 1.0, True) if log else Scale(0.0, 1.0)
    low, high = float(flat.min()), float(flat.max())
    if log:
        width = max(np.log10(high / low), 0.1) * room
        return Scale(low / 10**width, high * 10**width, True)
    low, high = (min(low, 0.0), max(high, 0.0)) if zero else (low, high)
    width = (high - low or abs(high) or 1.0) * room
    return Scale(low - width, high + width)


@dataclass(frozen=True, eq=False, slots=True)
class Panel:
    """A pair of axes: its box in pixels and its scales; what is drawn collects in `parts`."""

    left: float
    top: float
    width: float
    height: float
    x: Scale
    y: Scale
    parts: list[str]

    def across(self, values: Array) -> IntArray:
        """Return horizontal coordinates."""
        return _whole(self.left + self.width * self.x.shares(values))

    def upward(self, values: Array) -> IntArray:
        """Return vertical coordinates."""
        return _whole(self.top + self.height * (1 - self.y.shares(values)))

    def axes(self, xlabel: str = "", ylabel: str = "", *, ticks: Sequence[tuple[float, str]] | None = None) -> None:
        """Draw grid, ticks and labels; without `xlabel` the horizontal axis has no numbers. `ticks`: those of the horizontal axis."""
        right, bottom = self.left + self.width, self.top + self.height
        rows, columns = self.y.ticks(), self.x.ticks() if ticks is None else ticks
        ys, xs = (np.atleast_1d(side) for side in (self.upward(_of(rows)), self.across(_of(columns))))
        grid = "".join(f"M{_whole(self.left)} {y}H{_whole(right)}" for y in ys)
        if ticks is None:
            grid += "".join(f"M{x} {_whole(self.top)}V{_whole(bottom)}" for x in xs)
        self.parts.append(f'<path class="grid" d="{grid}"/>' if grid else "")
        for y, (_, label) in zip(ys, rows, strict=True):
            self.text(label, self.left - 5, y / _UNITS + 4, "end")
        if ylabel:
            where = f"rotate(-90 {_whole(12)} {_whole(self.top + self.height / 2)})"
            self.text(ylabel, 12, self.top + self.height / 2, "middle", f' transform="{where}"')
        if xlabel:
            for x, (_, label) in zip(xs, columns, strict=True):
                self.text(label, x / _UNITS, bottom + _LINE)
            self.text(xlabel, self.left + self.width / 2, bottom + 2.3 * _LINE)

    def right_axis(self, label: str, scale: Scale) -> None:
        """Draw ticks of another vertical scale at the right."""
        right = self.left + self.width
        for value, text in scale.ticks():
            y = self.top + self.height * (1 - float(scale.shares(np.array(value))))
            self.text(text, right + 5, y + 4, "start")
        x, y = right + 44, self.top + self.height / 2
        self.text(label, x, y, "middle", f' transform="rotate(90 {_whole(x)} {_whole(y)})"')

    def curve(self, x: Array, y: Array, kind: str) -> None:
        """Draw a curve; of more points than columns of pixels the lowest and highest of each column, so that no peak is lost."""
        x, y = _envelope(np.asarray(x, dtype=float), np.asarray(y, dtype=float), int(self.width))
        finite = np.isfinite(x) & np.isfinite(y)
        across, up = self.across(np.where(finite, x, self.x.low)), self.upward(np.where(finite, y, self.y.low))
        path, pen = [], "M"
        for known, a, b in zip(finite.tolist(), across.tolist(), up.tolist(), strict=True):
            if known:
                path.append(f"{pen}{a} {b}")
                pen = "L"
            else:
                pen = "M"
        self.parts.append(f'<path class="{kind}" d="{"".join(path)}"/>')

    def marks(self, x: Array, y: Array, kind: str, mark: str = "dot") -> None:
        """Draw a mark at every point, none outside the axes."""
        inside = (self.x.shares(x) >= 0) & (self.x.shares(x) <= 1)
        at = zip(self.across(np.asarray(x)[inside]).tolist(), self.upward(np.asarray(y)[inside]).tolist(), strict=True)
        path = "".join(f"M{a} {b}{MARKS[mark]}" for a, b in at)
        if path:
            self.parts.append(f'<path class="{kind}" d="{path}"/>')

    def ranges(self, x: Array, low: Array, high: Array, kind: str, cap: float = 4) -> None:
        """Draw error bars from `low` to `high`."""
        c = _whole(cap)
        ends = zip(*(side.tolist() for side in (self.across(x), self.upward(low), self.upward(high))), strict=True)
        path = "".join(f"M{a - c} {b}h{2 * c}M{a} {b}V{t}M{a - c} {t}h{2 * c}" for a, b, t in ends)
        self.parts.append(f'<path class="{kind}" d="{path}"/>')

    def bars(self, x: Array, y: Array, share: float, kinds: Sequence[str]) -> None:
        """Draw a bar from zero to each value, each of its kind; `share`: of the distance of neighbours."""
        half = _whole(share * self.width / (self.x.high - self.x.low) / 2)
        base = int(self.upward(np.zeros(1))[0])
        for a, b, kind in zip(self.across(x).tolist(), self.upward(y).tolist(), kinds, strict=True):
            self.parts.append(f'<path class="{kind}" d="M{a - half} {base}V{b}H{a + half}V{base}z"/>')

    def text(self, words: str, x: float, y: float, anchor: str = "middle", more: str = "") -> None:
        """Write text at pixels."""
        place = "" if anchor == "middle" else f' text-anchor="{anchor}"'
        self.parts.append(f'<text x="{_whole(x)}" y="{_whole(y)}"{place}{more}>{plain_text(words)}</text>')


def key(parts: list[str], entries: Iterable[tuple[str, str, str]], left: float, y: float) -> None:
    """Write a key in one row from `left` on: (mark, or "line", kind, words) each."""
    x = left
    for mark, kind, words in entries:
        path = "m-80 0h160" if mark == "line" else MARKS[mark]
        parts.append(f'<path class="{kind}" d="M{_whole(x + 8)} {_whole(y)}{path}"/>')
        parts.append(f'<text x="{_whole(x + 20)}" y="{_whole(y + 4)}" text-anchor="start">{plain_text(words)}</text>')
        x += 34 + _CHARACTER * len(words)


def chart(width: float, height: float, parts: Iterable[str], description: str) -> str:
    """Return the SVG of a chart; `description`: its alternative text."""
    size = f"0 0 {_whole(width)} {_whole(height)}"
    words = plain_text(description)
    return f'<svg class="chart" viewBox="{size}" text-anchor="middle" role="img" aria-label="{words}">{"".join(parts)}</svg>'


def plain_text(words: str) -> str:
    """Return text as it may stand in markup."""
    return escape(printable(words))


def shortened(words: str, most: int = 14) -> str:
    """Return a label with its end, which tells channels apart, where it is longer than `most`."""
    return words if len(words) <= most else f"{words[: most - 7]}…{words[-6:]}"


def _whole(pixels: float | Array) -> IntArray:
    """Return pixels as whole tenths."""
    return np.round(np.asarray(pixels) * _UNITS).astype(int)


def _of(ticks: Sequence[tuple[float, str]]) -> Array:
    return np.array([value for value, _ in ticks], dtype=float)


def _envelope(x: Array, y: Array, columns: int) -> tuple[Array, Array]:
    """Return the points that are drawn: the lowest and the highest of each of so many groups of neighbours, where there are more."""
    if len(x) <= 2 * columns or not np.all(np.isfinite(y)):
        every = max(1, len(x) // (2 * columns))
        return x[::every], y[::every]
    starts = np.linspace(0, len(x), columns, endpoint=False).astype(int)
    bounds = [*starts[1:].tolist(), len(x)]
    picked = [
        k
        for a, b in zip(starts.tolist(), bounds, strict=True)
        for k in sorted({a + int(np.argmin(y[a:b])), a + int(np.argmax(y[a:b]))})
    ]
    return x[picked], y[picked]
