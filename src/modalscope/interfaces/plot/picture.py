"""Describe a picture once, for Matplotlib, SVG and the page's canvas: curves, marks, bars, bands and words over axes.

A picture has panels, one below the other; a panel has two axes and what is drawn over them. Nothing is identified here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import DataError, printable

#: Name of an ink -> its colour on white and on dark ground. Data have the colours of Okabe and Ito (Color Universal Design, 2008), which
#: people of any colour vision tell apart; the others go from text to grid lines.
INKS = {
    "blue": ("#0072b2", "#56b4e9"),
    "vermillion": ("#d55e00", "#ff8a4c"),
    "green": ("#00875f", "#4cc79b"),
    "orange": ("#e69f00", "#f0b040"),
    "purple": ("#aa4499", "#e08ac7"),
    "amber": ("#b87700", "#f0b040"),
    "sky": ("#56b4e9", "#9bd3f5"),
    "ink": ("#1f2933", "#e4e8ec"),
    "muted": ("#5b6773", "#9aa7b3"),
    "middle": ("#9aa7b3", "#6b7785"),
    "pale": ("#b4bec9", "#4b5864"),
    "grid": ("#e4e8ec", "#2c363f"),
    "paper": ("#ffffff", "#1b2229"),
}

#: Maximum number of ticks of an axis; minimum number of decades of a logarithmic one, and of powers of ten that alone have ticks.
_MAX_TICKS, _MIN_DECADES, _MIN_POWERS = 7, 0.8, 3

#: Maximum characters of a label, and how many characters of its end a longer one keeps: ends tell channels apart, as in `wing ... 12:+Z`.
_MAX_LABEL, _LABEL_END = 40, 10

#: Characters of the names of ticks that fit side by side.
_MAX_CHARACTERS = 66

#: Seconds between ticks of dates, and the format of their words.
_DATE_STEPS = ((60, "%H:%M"), (600, "%H:%M"), (3600, "%d %b %H:%M"), (6 * 3600, "%d %b %H:%M"), (86_400, "%d %b"))
_MORE_DAYS = (2, 7, 14, 30, 61, 91, 182, 365, 730, 1826)

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


Numbers = Array | Sequence[float]


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis from `low` to `high` with its label, which has quantity and unit.

    `log`: both ends are positive. `named`: ticks with words in place of round numbers, none if empty. `dates`: seconds since 1970.
    """

    label: str = ""
    low: float = 0.0
    high: float = 1.0
    log: bool = False
    named: tuple[tuple[float, str], ...] | None = None
    dates: bool = False

    @property
    def upright(self) -> bool:
        """Whether the names of its ticks are too long to stand side by side."""
        named = self.named or ()
        return len(named) * (max((len(words) for _, words in named), default=0) + 2) > _MAX_CHARACTERS

    def shares(self, values: Array) -> RealArray:
        """Return where values lie between the ends, 0 to 1; NaN stays."""
        low, high = (np.log10(self.low), np.log10(self.high)) if self.log else (self.low, self.high)
        with np.errstate(divide="ignore", invalid="ignore"):
            v = np.log10(values) if self.log else np.asarray(values, dtype=float)
        return np.asarray((v - low) / (high - low or 1.0))

    def ticks(self) -> list[tuple[float, str]]:
        """Return values and labels of the ticks."""
        if self.named is not None:
            return list(self.named)
        if self.dates:
            return self._dates()
        if self.log and np.log10(self.high / self.low) >= _MIN_DECADES:
            return self._decades()
        rough = (self.high - self.low) / _MAX_TICKS or 1.0
        power = 10.0 ** np.floor(np.log10(rough))
        step = float(next(s * power for s in (1, 2, 5, 10) if s * power >= rough * (1 - 1e-9)))
        count = range(int(np.ceil(self.low / step - 1e-9)), int(np.floor(self.high / step + 1e-9)) + 1)
        digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
        return [(k * step, f"{k * step + 0.0:.{digits}f}") for k in count]

    def _decades(self) -> list[tuple[float, str]]:
        first, last = int(np.ceil(np.log10(self.low) - 1e-9)), int(np.floor(np.log10(self.high) + 1e-9))
        if last - first < _MIN_POWERS:
            values = [s * 10.0**k for k in range(first - 1, last + 1) for s in (1, 2, 5)]
            return [(v, f"{v:g}") for v in values if self.low <= v <= self.high]
        powers = range(first, last + 1, -(-(last - first + 1) // _MAX_TICKS))
        return [(10.0**k, f"10{str(k).translate(_SUPERSCRIPTS)}") for k in powers]

    def _dates(self) -> list[tuple[float, str]]:
        steps = [*_DATE_STEPS, *((86_400 * days, "%d %b %Y" if days > 180 else "%d %b") for days in _MORE_DAYS)]
        rough = (self.high - self.low) / (_MAX_TICKS - 1)
        step, words = next((each for each in steps if each[0] >= rough), steps[-1])
        at = np.arange(np.ceil(self.low / step), np.floor(self.high / step) + 1) * step
        return [(t, np.datetime64(int(t), "s").item().strftime(words)) for t in at.tolist()]


def axis_of(
    label: str, values: Iterable[Numbers], *, log: bool = False, room: float = 0.05, zero: bool = False
) -> Axis:
    """Return the axis that shows all finite values with some room; `zero`: it contains zero."""
    flat = np.concatenate([np.ravel(np.asarray(v, dtype=float)) for v in values] or [np.zeros(0)])
    flat = flat[np.isfinite(flat) & (flat > 0 if log else True)]
    if not flat.size:
        return Axis(label, 0.1, 1.0, True) if log else Axis(label)
    low, high = float(flat.min()), float(flat.max())
    if log:
        width = max(np.log10(high / low), 0.1) * room
        return Axis(label, low / 10**width, high * 10**width, True)
    low, high = (min(low, 0.0), max(high, 0.0)) if zero else (low, high)
    width = (high - low or abs(high) or 1.0) * room
    return Axis(label, low - width, high + width)


def axis_of_names(label: str, names: Sequence[str], most: int = 40) -> Axis:
    """Return an axis of places 0, 1, ... with their names, at most so many of them."""
    every = max(1, -(-len(names) // most))
    named = tuple((float(k), name) for k, name in enumerate(names))
    return Axis(label, -0.6, max(len(names), 1) - 0.4, named=named[::every])


@dataclass(frozen=True, eq=False, slots=True)
class Line:
    """A line through points (N,), broken at NaN; `tones` (N,): its colours, -1 to 1, instead of the ink. `mark`: at every point."""

    x: Numbers
    y: Numbers
    ink: str = "ink"
    words: str = ""
    width: float = 1.0
    dashed: bool = False
    mark: str = ""
    tones: Array | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Marks:
    """Marks at points (N,); `tones` (N,): as of a line. `letter`: stands for the mark where letters are usual."""

    x: Numbers
    y: Numbers
    ink: str = "blue"
    mark: str = "dot"
    words: str = ""
    size: float = 1.0
    hollow: bool = False
    letter: str = ""
    tones: Array | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Areas:
    """Areas with corners (N, k, 2), the first behind; `strength` (N,): from 0, nothing, to 1. `tones` (N,): as of a line."""

    corners: Array
    ink: str = "middle"
    words: str = ""
    strength: Numbers | float = 0.25
    tones: Array | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Words:
    """Texts at points (N,); `side`: of the text where its point is: left, middle, right. `turned`: upwards, from the point down."""

    x: Numbers
    y: Numbers
    texts: Sequence[str]
    ink: str = "ink"
    side: str = "middle"
    turned: bool = False


Item = Line | Marks | Areas | Words


def strokes(
    ends: Array, ink: str = "pale", width: float = 0.7, *, dashed: bool = False, tones: Array | None = None
) -> Line:
    """Return separate lines between points (N, 2, 2), with tones (N, 2) of their ends."""
    points = np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2)
    gaps = None if tones is None else np.concatenate([tones, tones[:, -1:]], axis=1).ravel()
    return Line(points[:, 0], points[:, 1], ink, "", width, dashed, tones=gaps)


def ranges(at: Numbers, low: Numbers, high: Numbers, ink: str, words: str = "", *, across: bool = False) -> list[Item]:
    """Return ranges from low to high at places (N,), with caps at their ends; `across`: along the horizontal axis."""
    places, values = np.repeat(np.asarray(at, dtype=float), 3), np.column_stack([low, high, np.full(len(low), np.nan)])
    ends = values.ravel(), places
    x, y = ends if across else ends[::-1]
    known = np.isfinite(values.ravel())
    return [Line(x, y, ink, words, 1.4), Marks(x[known], y[known], ink, "stick" if across else "bar")]


def boxes(left: Numbers, right: Numbers, low: Numbers | float, high: Numbers | float) -> Array:
    """Return the corners (N, 4, 2) of boxes with these sides."""
    x0, x1, y0, y1 = (np.asarray(side, dtype=float) for side in np.broadcast_arrays(left, right, low, high))
    return np.stack([np.column_stack(corner) for corner in ((x0, y0), (x0, y1), (x1, y1), (x1, y0))], axis=1)


def bars(at: Numbers, heights: Numbers, width: float = 0.72, ink: str = "", words: str = "") -> list[Item]:
    """Return bars from zero at places (N,); without an ink each has that of its sign."""
    places, values = np.asarray(at, dtype=float), np.asarray(heights, dtype=float)
    corners = boxes(places - width / 2, places + width / 2, 0.0, values)
    if ink:
        return [Areas(corners, ink, words, 1.0)]
    return [Areas(corners[side], own, "", 1.0) for side, own in ((values < 0, "blue"), (values >= 0, "vermillion"))]


def level(axis: Axis, value: float = 0.0, ink: str = "muted", words: str = "", *, dashed: bool = False) -> Line:
    """Return a line at one height over the whole of a horizontal axis."""
    return Line(np.array([axis.low, axis.high]), np.full(2, value), ink, words, 0.8, dashed)


@dataclass(frozen=True, eq=False, slots=True)
class Panel:
    """A pair of axes and what is drawn over them.

    `marked`: places on the horizontal axis with a line over the whole height, and their names above. `aside`: a remark at the right of the
    title. `share`: of the height of the picture. `behind`: lines on a vertical axis of their own at the right. `equal`: both axes have one
    scale. `bare`: neither frame nor ticks. `grid`: with lines at the ticks.
    """

    x: Axis
    y: Axis
    items: Sequence[Item] = ()
    title: str = ""
    aside: str = ""
    share: float = 1.0
    marked: Sequence[tuple[float, str]] = ()
    behind: tuple[Axis, Sequence[Line]] | None = None
    equal: bool = False
    bare: bool = False
    grid: bool = True

    @property
    def labelled(self) -> bool:
        """Whether the ticks of its horizontal axis have words where another panel lies below."""
        return bool(self.x.label or self.x.named)


@dataclass(frozen=True, eq=False, slots=True)
class Picture:
    """Panels, one below the other. `words`: what a reader who cannot see it is told. `size`: on paper, in hundredths of an inch.

    `above`: the key names what lies above first. `columns`: of the key, at most.
    """

    panels: Sequence[Panel]
    words: str
    size: tuple[int, int] = (900, 600)
    above: bool = False
    columns: int = 6

    def key(self) -> list[Line | Marks | Areas]:
        """Return what the key names, each word once."""
        items = [item for panel in self.panels for item in panel.items if not isinstance(item, Words) and item.words]
        listed = list({item.words: item for item in items}.values())
        return listed[::-1] if self.above else listed


def remark(text: str) -> Picture:
    """Return a picture that is a sentence: of what cannot be drawn, and why."""
    words = Words(np.array([0.5]), np.array([0.5]), [text], "muted")
    return Picture([Panel(Axis(named=()), Axis(named=()), [words], bare=True)], text, (900, 300))


def modes_marked(frequencies: Array, limits: tuple[float, float]) -> list[tuple[float, str]]:
    """Return all frequencies within limits, each named by its number and its value."""
    f = np.asarray(frequencies, dtype=float)
    shown = np.flatnonzero((f >= limits[0]) & (f <= limits[1]))
    digits = decimals(f[shown])
    return [(float(f[i]), f"{i + 1}   {f[i]:.{digits}f}") for i in shown[np.argsort(f[shown], kind="stable")]]


def decimals(frequencies: Array) -> int:
    """Return the decimals that give the highest frequency five digits."""
    highest = float(np.max(np.abs(frequencies), initial=0.0))
    return int(np.clip(4 - np.floor(np.log10(highest)), 0, 4)) if highest > 0 else 0


def dodge(positions: Array, gap: float, low: float = 0.0, high: float = 1.0) -> RealArray:
    """Move increasing positions as little as possible (least squares) so that they lie at least `gap` apart within [low, high].

    If there are too many for the interval, they go beyond `high`.

    Positions minus `gap` times their number must not decrease: that is an isotonic regression.
    """
    from scipy.optimize import isotonic_regression

    steps: RealArray = gap * np.arange(len(positions), dtype=float)
    if not len(positions):
        return steps
    shifted: RealArray = isotonic_regression(np.asarray(positions, dtype=float) - steps).x
    return np.clip(shifted, low, max(high - steps[-1], low)) + steps


def plain(text: str, most: int = _MAX_LABEL) -> str:
    r"""Return a label: one short line of printable characters.

    Examples
    --------
    >>> print(plain("tip" * 30))
    tiptiptiptiptiptiptiptiptip...ptiptiptip
    """
    line = printable(text).replace("\n", " ")
    end = min(_LABEL_END, most // 2)
    return line if len(line) <= most else f"{line[: most - 3 - end]}...{line[-end:]}"


def unit_of(response: Response, output: int | None = None, input: int | None = None) -> str:
    """Return the unit ` [output/input]` of a channel, or of all channels if they share it; empty if unknown.

    `output`, `input`: positions of the channel; None for all.
    """
    output_units, input_units = response.units
    above = set(output_units) if output is None else {output_units[output]}
    below = set(input_units) if input is None else {input_units[input]}
    if len(above) != 1 or len(below) != 1:
        return ""
    top, bottom = (plain(unit).replace("^2", "²").replace("s2", "s²") for unit in (above.pop(), below.pop()))
    if not top:
        return ""
    if response.ambient:  # spectra of two motions, not a motion of a force
        return f" [({top})²/Hz]" if top == bottom else f" [({top})({bottom})/Hz]"
    if top == bottom:
        return " [dimensionless]"
    return " [" + "/".join(f"({unit})" if bottom and "/" in unit else unit for unit in (top, bottom) if unit) + "]"


def channel(name: str, choice: str | int | None, labels: tuple[str, ...], default: int) -> int:
    """Return the position of a channel given by label or index, or the default; `name`: the argument, for the error."""
    if choice is None:
        return default
    if isinstance(choice, int) and 0 <= choice < len(labels):
        return choice
    if choice in labels:
        return labels.index(str(choice))
    choices = f"the channels are {', '.join(labels)}"
    raise DataError(f"{name} {choice!r}:", choices, "Use one of these, or its index from zero.")
