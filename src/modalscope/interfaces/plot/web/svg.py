"""Paint a described picture as SVG, for reports, notebooks and files.

Inks are variables of the page's style sheet, so that a picture is light, dark or printed as its page is; `alone` writes them out.
Coordinates are whole tenths of a pixel, which keeps paths short.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from modalscope.interfaces.plot.picture import INKS, Areas, Axis, Item, Line, Marks, Panel, Picture, Words, dodge
from modalscope.numerics.checks import Array, IntArray
from modalscope.numerics.errors import printable

#: Tenths of a pixel; tones from one way (0) over none to the other.
_UNITS, _TONES = 10, 8

#: Pixels of one character, of a line of text, of a name above the axes with its distance to the next, and between panels.
_CHARACTER, _LINE, _NAME, _GAP = 6.2, 15, 13, 12

#: How a picture begins, and the rules of the style sheet that it needs, beside the variables of `inks`.
_HEAD = '<svg class="chart"'
STYLE = """.chart { display: block; width: 100%; height: auto; }
.chart text { font: 110px system-ui, -apple-system, "Segoe UI", Roboto, Arial, sans-serif; font-variant-numeric: tabular-nums; }
.chart path { stroke-linecap: round; stroke-linejoin: round; }
"""


def inks(*, dark: bool) -> str:
    """Return the inks as variables of a style sheet."""
    return " ".join(f"--{name}: {colours[dark]};" for name, colours in INKS.items())


def svg(picture: Picture, width: float = 490, height: float | None = None) -> str:
    """Return a picture as SVG of that many pixels; by default as high as it is on paper."""
    whole = width * picture.size[1] / picture.size[0] if height is None else height
    parts: list[str] = []
    top = 6.0 + _LINE * _key(picture, width, parts)
    left, right = max(map(_left, picture.panels)), max(map(_right, picture.panels))
    room = [(_above(panel), _below(panel, last=panel is picture.panels[-1])) for panel in picture.panels]
    free = whole - top - sum(above + below for above, below in room)
    shares = sum(panel.share for panel in picture.panels)
    for panel, (above, below) in zip(picture.panels, room, strict=True):
        high = max(free * panel.share / shares, 20)
        _Sheet(panel, left, top + above, width - left - right, high, parts).paint(named=below > _GAP)
        top += above + high + below
    size = f"0 0 {_whole(width)} {_whole(max(top, whole))}"
    words = f'text-anchor="middle" role="img" aria-label="{_plain(picture.words)}"'
    return f'{_HEAD} viewBox="{size}" {words}>{"".join(parts)}</svg>'


def alone(picture: str) -> str:
    """Return a painted picture as a file of its own: with its name space, its size, and the colours of white ground.

    Programs for drawings know neither variables nor mixtures of style sheets.
    """
    body = re.sub(r"var\(--([\w-]+)\)", lambda found: INKS[found[1]][0], picture)
    body = re.sub(r"color-mix\(in srgb, (#\w+) (\d+)%, (#\w+)\)", _mixed, body)
    width, height = (int(side) / _UNITS for side in body.partition('viewBox="0 0 ')[2].partition('"')[0].split())
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" class="chart"'
    inner = body.index(">") + 1
    back = f'<rect width="{_whole(width)}" height="{_whole(height)}" fill="#ffffff"/>'
    return f"{head}{body[len(_HEAD) : inner]}<style>{STYLE}</style>{back}{body[inner:]}"


def _mixed(found: re.Match[str]) -> str:
    share = int(found[2]) / 100
    first, second = (np.array([int(found[k][i : i + 2], 16) for i in (1, 3, 5)]) for k in (1, 3))
    return "#" + "".join(f"{v:02x}" for v in np.round(share * first + (1 - share) * second).astype(int).tolist())


def _longest(axis: Axis) -> int:
    return max((len(words) for _, words in axis.ticks()), default=0)


def _left(panel: Panel) -> float:
    """Return the pixels that ticks and label of a panel take at the left."""
    return 8 if panel.bare else 10 + _CHARACTER * _longest(panel.y) + (_LINE if panel.y.label else 0)


def _right(panel: Panel) -> float:
    if panel.behind is None:
        return 8 if panel.bare else 8 + _CHARACTER * _longest(panel.x) / 2
    return 12 + _CHARACTER * _longest(panel.behind[0]) + _LINE


def _above(panel: Panel) -> float:
    """Return the pixels that title and names of a panel take above its axes."""
    names = max((len(name) for _, name in panel.marked), default=0)
    return 6 + (_LINE if panel.title or panel.aside else 0) + (12 + 5.6 * names if names else 0)


def _ticks_high(axis: Axis) -> float:
    return 8 + _CHARACTER * _longest(axis) if axis.upright else _LINE + 4 if _longest(axis) else 4


def _below(panel: Panel, *, last: bool) -> float:
    """Return the pixels that ticks and label of a panel take below its axes."""
    if panel.bare or not (last or panel.labelled):
        return _GAP
    return _ticks_high(panel.x) + (_LINE + 3 if panel.x.label else 2)


@dataclass(eq=False, slots=True)
class _Sheet:
    """A panel on paper: its box in pixels; what is drawn collects in `parts`."""

    panel: Panel
    left: float
    top: float
    width: float
    height: float
    parts: list[str]

    def paint(self, *, named: bool) -> None:
        """Draw the panel; `named`: with the words of the horizontal axis."""
        panel = self.panel
        y, left, right = self.top - _above(panel) + _LINE - 2, self.left, self.left + self.width
        if panel.equal:
            self._fit()
        if panel.behind is not None:
            self._behind(*panel.behind)
        if not panel.bare:
            self._axes(named=named)
        if panel.title:
            self.text(panel.title, left, y, "ink", "start", ' font-weight="600"')
        if panel.aside and _CHARACTER * (len(panel.title) + len(panel.aside) + 3) < right - left:
            self.text(panel.aside, right, y, "muted", "end")
        self._marked()
        for item in panel.items:
            self.draw(item)

    def across(self, values: Any) -> IntArray:
        """Return horizontal coordinates."""
        return _whole(self.left + self.width * self.panel.x.shares(np.asarray(values)))

    def upward(self, values: Any, axis: Axis | None = None) -> IntArray:
        """Return vertical coordinates."""
        return _whole(self.top + self.height * (1 - (axis or self.panel.y).shares(np.asarray(values))))

    def path(self, d: str, *, stroke: str = "", fill: str = "", width: float = 1.0, more: str = "") -> None:
        """Draw a path; `stroke`, `fill`: inks or colours."""
        if d:
            look = f' stroke="{_ink(stroke)}" stroke-width="{round(10 * width)}"' if stroke else ""
            self.parts.append(f'<path fill="{_ink(fill) if fill else "none"}"{look}{more} d="{d}"/>')

    def text(
        self, words: str, x: float, y: float, ink: str = "muted", anchor: str = "middle", more: str = "", angle: int = 0
    ) -> None:
        """Write text at pixels; `angle`: -90 upwards."""
        place = "" if anchor == "middle" else f' text-anchor="{anchor}"'
        more += f' transform="rotate({angle} {_whole(x)} {_whole(y)})"' if angle else ""
        look = f'fill="{_ink(ink)}" x="{_whole(x)}" y="{_whole(y)}"{place}{more}'
        self.parts.append(f"<text {look}>{_plain(words)}</text>")

    def draw(self, item: Item, axis: Axis | None = None) -> None:
        """Draw one of the things of which pictures are made; `axis`: a vertical one of its own."""
        if isinstance(item, Line):
            self._line(item, axis)
        elif isinstance(item, Marks):
            self._marks(item)
        elif isinstance(item, Areas):
            self._areas(item)
        else:
            self._words(item)

    def stamp(self, x: Any, y: Any, item: Line | Marks) -> None:
        """Draw a mark at tenths of pixels, each place once: full, or its outline."""
        size, hollow = (item.size, item.hollow) if isinstance(item, Marks) else (1.0, False)
        mark = "circle" if item.mark == "dot" and hollow else item.mark
        drawn = _mark(mark, size)
        places = dict.fromkeys(zip(np.atleast_1d(x).tolist(), np.atleast_1d(y).tolist(), strict=True))
        path = "".join(f"M{a} {b}{drawn}" for a, b in places)
        if mark == "dot":
            self.path(path, stroke=item.ink, width=5.2 * np.sqrt(size))
        elif hollow or mark in ("cross", "bar", "stick"):
            self.path(path, stroke=item.ink, width=1.2)
        else:
            self.path(path, fill=item.ink)

    def _line(self, item: Line, axis: Axis | None = None) -> None:
        """Draw a line; of more points than columns of pixels the lowest and highest of each column, so that no peak is lost."""
        x, y = np.asarray(item.x, dtype=float), np.asarray(item.y, dtype=float)
        if item.tones is not None:
            self._toned(x, y, item.tones, item.width)
            return
        x, y = envelope(x, y, int(self.width))
        known = np.isfinite(x) & np.isfinite(y) & (self.panel.x.shares(x) > -0.01) & (self.panel.x.shares(x) < 1.01)
        across, up = self.across(x), self.upward(y, axis)
        self.path(_joined(known, across, up), stroke=item.ink, width=item.width, more=_dashes(item))
        if item.mark:
            self.stamp(across[known], up[known], item)

    def _toned(self, x: Array, y: Array, tones: Array, width: float) -> None:
        """Draw separate lines, those of one tone in one path."""
        known = np.isfinite(x[:-1]) & np.isfinite(x[1:])
        own, across, up = _tone((tones[:-1] + tones[1:]) / 2), self.across(x), self.upward(y)
        for tone in np.unique(own[known]):
            chosen = np.flatnonzero(known & (own == tone))
            path = "".join(f"M{across[k]} {up[k]}L{across[k + 1]} {up[k + 1]}" for k in chosen)
            self.path(path, stroke=_toned(tone), width=width)

    def _marks(self, item: Marks) -> None:
        """Draw marks inside the axes."""
        x, y = np.asarray(item.x, dtype=float), np.asarray(item.y, dtype=float)
        inside = np.isfinite(y)
        for shares in (self.panel.x.shares(x), self.panel.y.shares(y)):
            inside &= (shares >= 0) & (shares <= 1)
        across, up = self.across(x[inside]), self.upward(y[inside])
        if item.tones is None:
            self.stamp(across, up, item)
            return
        tones = _tone(np.asarray(item.tones)[inside])
        for tone in np.unique(tones):
            path = "".join(f"M{a} {b}h0" for a, b in zip(across[tones == tone], up[tones == tone], strict=True))
            self.path(path, stroke=_toned(tone), width=6.6 * item.size)

    def _areas(self, item: Areas) -> None:
        strengths = np.broadcast_to(np.asarray(item.strength, dtype=float), len(item.corners))
        colours = [item.ink] * len(item.corners) if item.tones is None else [_toned(t) for t in _tone(item.tones)]
        across, up = self.across(item.corners[..., 0]), np.clip(self.upward(item.corners[..., 1]), *self._ends())
        edge = "paper" if item.tones is not None else ""
        for xs, ys, colour, strength in zip(across, up, colours, strengths, strict=True):
            path = "L".join(f"{a} {b}" for a, b in zip(xs, ys, strict=True))
            more = f' fill-opacity="{strength:.2f}"' if strength < 1 else ""
            self.path(f"M{path}z" if strength >= 0.005 else "", stroke=edge, fill=colour, width=0.5, more=more)

    def _ends(self) -> tuple[int, int]:
        """Return the vertical coordinates of the upper and the lower end of the axes."""
        return int(_whole(self.top)), int(_whole(self.top + self.height))

    def _words(self, item: Words) -> None:
        anchor = {"left": "start", "middle": "middle", "right": "end"}[item.side]
        for a, b, text in zip(self.across(item.x) / _UNITS, self.upward(item.y) / _UNITS, item.texts, strict=True):
            if item.turned:
                self.text(text, a + 4, b, item.ink, "end", angle=-90)
            else:
                self.text(text, a, b + 4, item.ink, anchor)

    def _fit(self) -> None:
        """Make one scale of both axes: the box is narrowed, of bare axes about its middle."""
        x, y = self.panel.x, self.panel.y
        wide, high = abs(x.high - x.low) or 1.0, abs(y.high - y.low) or 1.0
        scale = min(self.width / wide, self.height / high)
        if self.panel.bare:
            self.left += (self.width - scale * wide) / 2
            self.top += (self.height - scale * high) / 2
        self.width, self.height = scale * wide, scale * high

    def _axes(self, *, named: bool) -> None:
        """Draw grid, ticks and labels."""
        panel, right, (top, bottom) = self.panel, _whole(self.left + self.width), self._ends()
        for y, words in ((self.upward(value), words) for value, words in panel.y.ticks()):
            self.path(f"M{_whole(self.left)} {y}H{right}" if panel.grid else "", stroke="grid", width=0.8)
            self.text(words, self.left - 5, float(y) / _UNITS + 4, anchor="end")
        if panel.y.label:
            self.text(panel.y.label, self.left - _left(panel) + 12, self.top + self.height / 2, angle=-90)
        foot = bottom / _UNITS
        for x, words in ((self.across(value), words) for value, words in panel.x.ticks()):
            self.path(f"M{x} {top}V{bottom}" if panel.grid and panel.x.named is None else "", stroke="grid", width=0.8)
            if named and panel.x.upright:
                self.text(words, float(x) / _UNITS + 4, foot + 7, anchor="end", angle=-90)
            elif named:
                self.text(words, float(x) / _UNITS, foot + _LINE)
        if named and panel.x.label:
            self.text(panel.x.label, self.left + self.width / 2, foot + _ticks_high(panel.x) + _LINE - 2)

    def _behind(self, axis: Axis, lines: Sequence[Line]) -> None:
        for line in lines[::-1]:
            self.draw(line, axis)
        right = self.left + self.width
        for value, words in axis.ticks():
            self.text(words, right + 5, float(self.upward(value, axis)) / _UNITS + 4, anchor="start")
        self.text(axis.label, right + _right(self.panel) - 10, self.top + self.height / 2, angle=90)

    def _marked(self) -> None:
        """Draw a line at every marked place, with its name above the axes, apart from its neighbours."""
        at, (top, bottom) = np.array([place for place, _ in self.panel.marked]), self._ends()
        shares = dodge(self.panel.x.shares(at), gap=_NAME / self.width)
        for place, share, (_, name) in zip(self.across(at), shares, self.panel.marked, strict=True):
            x = self.left + share * self.width
            self.path(f"M{place} {bottom}V{top}", stroke="vermillion", width=1.1, more=' stroke-dasharray="50 32"')
            self.path(f"M{place} {top}L{_whole(x)} {top - 70}", stroke="vermillion", width=0.9)
            self.text(name, x + 4, self.top - 10, "vermillion", "start", angle=-90)


def _key(picture: Picture, width: float, parts: list[str]) -> int:
    """Write the key in rows, and return how many."""
    x, row, named = 8.0, 0, picture.key()
    sheet = _Sheet(picture.panels[0], 0, 0, 1, 1, parts)
    for item in named:
        wide = 30 + _CHARACTER * len(item.words)
        if x > 8 and x + wide > width:
            x, row = 8.0, row + 1
        y = 12 + _LINE * row
        if isinstance(item, Areas):
            sheet.path(f"M{_whole(x)} {_whole(y - 4)}h140v80h-140z", fill=item.ink, more=' fill-opacity="0.4"')
        elif isinstance(item, Marks):
            sheet.stamp(_whole(x + 8), _whole(y), item)
        else:
            sheet.path(f"M{_whole(x)} {_whole(y)}h160", stroke=item.ink, width=1.4, more=_dashes(item))
        sheet.text(item.words, x + 20, y + 4, anchor="start")
        x += wide + 10
    return row + 1 if named else 0


def _dashes(item: Line) -> str:
    return ' stroke-dasharray="50 32"' if item.dashed else ""


def _mark(mark: str, size: float) -> str:
    """Return the path of a mark, drawn from its centre."""
    s = round(26 * np.sqrt(size))
    return {
        "dot": "h0",
        "circle": f"m-{s} 0a{s} {s} 0 1 0 {2 * s} 0a{s} {s} 0 1 0-{2 * s} 0z",
        "square": f"m-{s}-{s}h{2 * s}v{2 * s}h-{2 * s}z",
        "diamond": f"m0-{s} {s} {s}-{s} {s}-{s}-{s}z",
        "triangle": f"m0-{s} {s} {2 * s}h-{2 * s}z",
        "cross": f"m-{s}-{s}l{2 * s} {2 * s}m0-{2 * s}l-{2 * s} {2 * s}",
        "bar": f"m-{2 * s} 0h{4 * s}",
        "stick": f"m0-{2 * s}v{4 * s}",
    }[mark]


def _joined(known: Array, across: IntArray, up: IntArray) -> str:
    """Return the path of a line, broken where nothing is known."""
    path, pen = [], "M"
    for seen, a, b in zip(known.tolist(), across.tolist(), up.tolist(), strict=True):
        path.append(f"{pen}{a} {b}" if seen else "")
        pen = "L" if seen else "M"
    return "".join(path)


def _ink(name: str) -> str:
    return f"var(--{name})" if name in INKS else name


def _tone(signed: Array) -> IntArray:
    """Return the tones of motions, 0 (one way) to `_TONES` (the other)."""
    return np.asarray(np.clip(np.round((np.nan_to_num(signed) + 1) / 2 * _TONES), 0, _TONES), dtype=int)


def _toned(tone: int) -> str:
    """Return the colour of a tone."""
    away = int(tone) - _TONES // 2
    return f"color-mix(in srgb, {_ink('vermillion' if away > 0 else 'blue')} {200 * abs(away) // _TONES}%, {_ink('middle')})"


def _plain(words: str) -> str:
    """Return text as it may stand in markup."""
    return escape(printable(words))


def _whole(pixels: float | Array) -> IntArray:
    """Return pixels as whole tenths."""
    return np.asarray(np.round(np.nan_to_num(np.asarray(pixels, dtype=float) * _UNITS)), dtype=int)


def envelope(x: Array, y: Array, columns: int) -> tuple[Array, Array]:
    """Return the points that are drawn: the lowest and the highest of each of so many groups of neighbours, where there are more.

    A gap ends a group.
    """
    if len(x) <= 2 * columns:
        return x, y
    known = np.isfinite(y)
    group = np.arange(len(x)) * columns // len(x) + len(x) * np.cumsum(~known)
    seen = np.flatnonzero(known)
    ranked = seen[np.lexsort((y[seen], group[seen]))]
    starts = np.flatnonzero(np.diff(group[ranked], prepend=-1))
    ends = np.append(starts[1:], len(ranked))[: len(starts)] - 1
    kept = np.unique(np.concatenate([ranked[starts], ranked[ends], np.flatnonzero(~known)]))
    return x[kept], y[kept]
