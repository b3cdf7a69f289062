"""Draw months of records: frequencies of tracks over time, against what moves them, and control charts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.analysis.monitoring.change import Alarms
from modalscope.analysis.monitoring.history import as_times
from modalscope.analysis.monitoring.tracks import DOUBT, Explained, Tracks
from modalscope.data.mode_fields import NORMAL_HALF_WIDTH
from modalscope.interfaces.plot._style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILLION,
    aside,
    dress,
    key,
    new_axes,
    plain,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_kind
from modalscope.numerics.errors import check_choice

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Colours of tracks, in turn.
_COLOURS = (BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY)

#: Records up to which single intervals can be seen.
_MOST_INTERVALS = 500


@named()
def tracks(found: Tracks, ax: Axes | None = None) -> Axes:
    """Draw the frequencies of tracks over time, with 95 % intervals where there is room, and what is of no track.

    A hollow mark is in doubt; a cross stands a second time in its record.

    Parameters
    ----------
    found : Tracks
    ax : Axes, optional
        A new figure by default.
    """
    check_kind("found of tracks", found, Tracks)
    ax, history = new_axes(ax), found.history
    when = history.times[history.record]
    few = len(history) <= _MOST_INTERVALS
    size = 4.0 if few else 1.6
    alone = found.track < 0
    ax.plot(when[alone], history.frequencies[alone], ".", color=PALE, markersize=size, label="of no track", zorder=1)
    std = found.frequencies_std
    for k, name in enumerate(found.names):
        colour, own = _COLOURS[k % len(_COLOURS)], (found.track == k) & ~found.double
        sure, doubt = own & (found.mode_probability >= DOUBT), own & (found.mode_probability < DOUBT)
        ax.plot(when[sure], history.frequencies[sure], ".", color=colour, markersize=size, label=plain(f"{name}"))
        hollow = {"markerfacecolor": "white", "markeredgecolor": colour, "markersize": size}
        ax.plot(when[doubt], history.frequencies[doubt], "o", **hollow)  # type: ignore[arg-type]
        second = (found.track == k) & found.double
        ax.plot(when[second], history.frequencies[second], "x", color=colour, markersize=size)
        if few:
            f = found.frequencies[:, k]
            ax.vlines(
                history.times,
                f - NORMAL_HALF_WIDTH * std[:, k],
                f + NORMAL_HALF_WIDTH * std[:, k],
                color=colour,
                linewidth=0.6,
            )
    dress(ax, xlabel="time (UTC)", ylabel="frequency [Hz]")
    aside(ax, f"{len(history)} records")
    _dates(ax)
    key(ax, ncols=5, markerscale=2 if few else 5)
    return ax


@named()
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
    check_kind("found of against", found, Explained)
    choices = [name for name in found.regressors[1:] if " below " not in name]
    name = check_choice("covariate", choices[0] if covariate is None and choices else covariate, choices)
    ax, own = new_axes(ax), [k for k, n in enumerate(found.regressors) if n == name or n.startswith(f"{name} below ")]
    x = found.design[:, own[0]]
    order = np.argsort(x)
    spread = 6 * float(np.nanmax(found.residual_std, initial=0.0))
    for k, track_name in enumerate(found.tracks.names):
        colour, offset = _COLOURS[k % len(_COLOURS)], -k * spread
        line = found.design[:, own] @ found.coefficients[k, own]
        y = 100 * (line + found.residual[:, k] + offset)
        ax.plot(x, y, ".", color=colour, markersize=1.8, alpha=0.5)
        ax.plot(x[order], 100 * (line + offset)[order], color=INK, linewidth=1.0)
        label = f"{track_name}: {100 * found.part_explained[k]:.0f} %"
        ax.plot([], [], ".", color=colour, markersize=8, label=plain(label))
    dress(
        ax,
        xlabel=plain(f"{name}, as it is felt"),
        ylabel="relative change of frequency [%], tracks one below the other",
    )
    aside(ax, "legend: explained share of the variance")
    key(ax, ncols=4)
    return ax


@named()
def control_chart(found: Alarms, ax: Axes | None = None) -> Axes:
    """Draw a control chart over time, with its limit at 1, the records of the reference, and the alarms with their times of change.

    Parameters
    ----------
    found : Alarms
    ax : Axes, optional
        A new figure by default.
    """
    check_kind("found of control_chart", found, Alarms)
    ax, times = new_axes(ax), found.explained.tracks.history.times
    inside = found.explained.reference
    ax.plot(times[inside], found.statistic[inside], ".", color=MUTED, markersize=2.4, label="reference")
    ax.plot(times[~inside], found.statistic[~inside], ".", color=BLUE, markersize=2.4, label="judged")
    label = f"limit: {found.false_per_year:g} false alarms a year"
    ax.axhline(1, color=VERMILLION, linewidth=1.0, linestyle=(0, (5, 3)), label=label)
    for number, alarm in enumerate(found.alarms):
        label = "change, 95 %" if number == 0 else "_"
        change, *interval = as_times("times", [alarm.change, *alarm.interval])
        ax.axvspan(*interval, color=ORANGE, alpha=0.4, linewidth=0, label=label)
        ax.axvline(change, color=ORANGE, linewidth=1.2)
        text = f"{change.astype('datetime64[D]')!s}: {', '.join(alarm.tracks[:2])}"
        ax.annotate(
            plain(text),
            (change, 0.98),
            xycoords=("data", "axes fraction"),
            ha="right",
            va="top",
            rotation=90,
            fontsize=8.5,
        )
    dress(ax, xlabel="time (UTC)", ylabel=f"chart ({found.chart}) over its limit")
    _dates(ax)
    key(ax)
    return ax


def _dates(ax: Axes) -> None:
    """Write dates short."""
    from matplotlib import dates

    locator: Any = dates.AutoDateLocator()  # type: ignore[no-untyped-call]
    ax.xaxis.set_major_locator(locator)
    ax.xaxis.set_major_formatter(dates.ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
