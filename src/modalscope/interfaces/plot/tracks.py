"""Describe months of records: frequencies of tracks over time, against what moves them, and control charts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from modalscope.analysis.monitoring.change import Alarms
from modalscope.analysis.monitoring.history import as_times
from modalscope.analysis.monitoring.tracks import DOUBT, Explained, Tracks
from modalscope.data.mode_fields import NORMAL_HALF_WIDTH
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import (
    Areas,
    Axis,
    Item,
    Line,
    Marks,
    Panel,
    Picture,
    Words,
    axis_of,
    boxes,
    level,
    plain,
    strokes,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.errors import check_choice

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Inks of tracks, in turn.
_INKS = ("blue", "orange", "green", "vermillion", "purple", "sky")

#: Tracks below a chart.
_MOST_TRACKS = 6

#: Records up to which single intervals can be seen.
_MOST_INTERVALS = 500


@named(found=Tracks)
def tracks(found: Tracks, ax: Axes | None = None) -> Axes:
    """Draw the frequencies of tracks over time, with 95 % intervals where there is room, and what is of no track.

    A hollow mark is in doubt; a cross stands a second time in its record.

    Parameters
    ----------
    found : Tracks
    ax : Axes, optional
        A new figure by default.
    """
    return painted(tracks_picture(found), ax)


def tracks_picture(found: Tracks) -> Picture:
    """Return the frequencies of tracks over time, in their inks, and what is of no track."""
    history = found.history
    when, few = _seconds(history.times[history.record]), len(history) <= _MOST_INTERVALS
    size, alone = 0.5 if few else 0.1, found.track < 0
    f = history.frequencies
    items: list[Item] = [Marks(when[alone], f[alone], "pale", "dot", "of no track", size)]
    for k, name in enumerate(found.names):
        ink, own = _INKS[k % len(_INKS)], (found.track == k) & ~found.double
        sure = found.mode_probability >= DOUBT
        second = (found.track == k) & found.double
        if few:
            middle, half = found.frequencies[:, k], NORMAL_HALF_WIDTH * found.frequencies_std[:, k]
            ends = np.stack([np.column_stack([_seconds(history.times), middle + s * half]) for s in (-1, 1)], axis=1)
            items.append(strokes(ends, ink))
        items.append(Marks(when[own & sure], f[own & sure], ink, "dot", plain(f"{name}"), size))
        items.append(Marks(when[own & ~sure], f[own & ~sure], ink, "circle", size=size, hollow=True))
        items.append(Marks(when[second], f[second], ink, "cross", size=size))
    panel = Panel(_dates([when]), axis_of("frequency [Hz]", [f]), items, aside=f"{len(history)} records")
    return Picture([panel], "Frequencies of all tracks over time")


@named(found=Explained)
def against(found: Explained, covariate: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw relative changes of the frequencies against a covariate, and the lines by which it explains them.

    Parameters
    ----------
    found : Explained
    covariate : str, optional
        One of the regressors; the first by default.
    ax : Axes, optional
        A new figure by default.

    Raises
    ------
    DataError
        A covariate that is none of the regressors.
    """
    choices = [name for name in found.regressors[1:] if " below " not in name]
    name = check_choice("covariate", choices[0] if covariate is None and choices else covariate, choices)
    return painted(against_picture(found, name), ax)


def against_picture(found: Explained, name: str) -> Picture:
    """Return the relative changes of all tracks, one below the other, against a covariate."""
    own = [k for k, n in enumerate(found.regressors) if n == name or n.startswith(f"{name} below ")]
    x = found.design[:, own[0]]
    order, items, drawn = np.argsort(x, kind="stable"), list[Item](), list[Array]()
    spread = 6 * float(np.nanmax(found.residual_std, initial=0.0))
    for k, track_name in enumerate(found.tracks.names):
        line = found.design[:, own] @ found.coefficients[k, own] - k * spread
        words = plain(f"{track_name}: {100 * found.part_explained[k]:.0f} %")
        drawn.append(100 * (line + found.residual[:, k]))
        items.append(Marks(x, drawn[-1], _INKS[k % len(_INKS)], "dot", words, 0.15))
        items.append(Line(x[order], 100 * line[order], "ink"))
    label = "relative change of frequency [%], tracks one below the other"
    aside = "key: explained share of the variance"
    panel = Panel(axis_of(plain(f"{name}, as it is felt"), [x]), axis_of(label, drawn), items, aside=aside)
    return Picture([panel], f"Frequencies against {name}", columns=4)


@named(found=Alarms)
def control_chart(found: Alarms, ax: Axes | None = None) -> Axes:
    """Draw a control chart over time, with its limit at 1, the records of the reference, and the alarms with their times of change.

    Below it, where no axes are given, the frequencies of the tracks that moved most, six at most: relative changes in per cent without
    what weather explains, each on an axis of its own.

    Parameters
    ----------
    found : Alarms
    ax : Axes, optional
        A new figure by default.
    """
    return painted(chart_picture(found), ax)


def chart_picture(found: Alarms) -> Picture:
    """Return a control chart over time with its limit, its reference and its alarms."""
    times = _seconds(found.explained.tracks.history.times)
    limit = f"limit: {found.false_per_year:g} false alarms a year"
    items: list[Item] = [*_judged(found, found.statistic, ("reference", "judged"))]
    across = _dates([times])
    items.append(level(across, 1.0, "vermillion", limit, dashed=True))
    upward = axis_of(f"chart ({found.chart}) over its limit", [found.statistic, [0.0, 1.1]])
    for alarm in found.alarms:
        change, low, high = as_times("times", [alarm.change, *alarm.interval])
        items.append(Areas(boxes(_seconds([low]), _seconds([high]), upward.low, upward.high), "orange", "change, 95 %"))
        text = plain(f"{change.astype('datetime64[D]')!s}: {', '.join(alarm.tracks[:2])}")
        items.append(Line(_seconds([change, change]), np.array([upward.low, upward.high]), "orange"))
        items.append(Words(_seconds([change]), np.array([0.98 * upward.high]), [text], turned=True))
    charts = [Panel(across, upward, items), *(_change(found, k, across) for k in _most_moved(found))]
    charts = [*(replace(each, x=replace(across, label="")) for each in charts[:-1]), charts[-1]]
    height = 500 + 130 * (len(charts) - 1)
    return Picture(charts, "Control chart with its limit and its alarms, and the change of each track", (900, height))


def _most_moved(found: Alarms) -> list[int]:
    """Return the tracks that are drawn below the chart, in their order: where there are many, those that moved most."""
    explained = found.explained
    judged = np.nan_to_num(explained.residual[~explained.reference] / explained.residual_std)
    moved = np.abs(np.median(judged, axis=0)) if len(judged) else np.zeros(len(explained.residual_std))
    return sorted(np.argsort(-moved, kind="stable")[:_MOST_TRACKS].tolist())


def _change(found: Alarms, k: int, across: Axis) -> Panel:
    """Return the relative change of the frequency of one track without what weather explains, on an axis of its own."""
    moved = 100 * found.explained.residual[:, k]
    items: list[Item] = [*_judged(found, moved), level(across)]
    name = plain(found.explained.tracks.names[k])
    return Panel(across, axis_of("change [%]", [moved], zero=True), items, name, share=0.35)


def _judged(found: Alarms, values: Array, words: tuple[str, str] = ("", "")) -> list[Marks]:
    """Return a value of every record over time, those of the reference apart from those that are judged by it."""
    times, inside = _seconds(found.explained.tracks.history.times), found.explained.reference
    sides = zip((inside, ~inside), ("muted", "blue"), words, strict=True)
    return [Marks(times[kept], values[kept], ink, "dot", said, 0.2) for kept, ink, said in sides]


def _seconds(times: object) -> RealArray:
    """Return dates as seconds since 1970."""
    return np.asarray(times, dtype="datetime64[ms]").astype(float) / 1000


def _dates(values: list[Array]) -> Axis:
    return replace(axis_of("time (UTC)", values, room=0.02), dates=True)
