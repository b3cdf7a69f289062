"""The picture of a set: its stabilization diagram, and under it the list of every program, one line each."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import modalscope as ms
from arena.sets import ArenaSet

__all__ = ["draw"]

#: How a mode is marked: what it is, marker, colour.
_MARKS = {"found": ("|", "C2"), "false": ("x", "C3"), "twice": ("+", "C1"), "other": ("|", "C7")}


def draw(one: ArenaSet, entry: dict[str, Any], path: Path) -> None:
    """Draw and store one picture."""
    runs = {name: run for name, run in entry["results"].items() if run["status"] == "done"}
    low_height = 0.5 + 0.17 * len(runs)
    figure, (top, low) = plt.subplots(2, 1, figsize=(9, 3.4 + low_height), height_ratios=(2.6, low_height), sharex=True)
    limits = _diagram(one, top)
    for f in entry["known"] if entry["scored"] else []:
        low.axvline(f, color="0.7", linewidth=0.5, zorder=0)
    for kind, (marker, colour) in _MARKS.items():
        each = [
            (mode["f"], row) for row, run in enumerate(runs.values()) for mode in run["modes"] if mode["is"] == kind
        ]
        label = kind.replace("other", "not known")
        low.plot(*np.reshape(each, (-1, 2)).T, marker, color=colour, markersize=6, markeredgewidth=1.5, label=label)
    low.set(yticks=range(len(runs)), ylim=(max(len(runs), 1) - 0.5, -0.5), xlim=limits, xlabel="frequency [Hz]")
    low.set_yticklabels(list(runs), fontsize=7)
    figure.legend(*low.get_legend_handles_labels(), fontsize=7, ncols=4, loc="lower right")
    figure.subplots_adjust(left=0.14, right=0.92, top=0.97, bottom=0.45 / (3.4 + low_height) + 0.03, hspace=0.12)
    path.parent.mkdir(parents=True, exist_ok=True)
    with io.BytesIO() as held:
        figure.savefig(held, dpi=72)
        Image.open(held).convert("RGB").quantize(255).save(path, optimize=True)
    plt.close(figure)


def _diagram(one: ArenaSet, axes: plt.Axes) -> tuple[float, float] | None:
    """Draw the stabilization diagram of a set, of months every mode, or why there is none; return the ends of its axis."""
    data, _ = one.read()
    if isinstance(data, ms.monitoring.History):
        axes.plot(data.frequencies, data.record, ".", markersize=2)
        axes.set(ylabel="record")
        return axes.get_xlim()
    part = data.parts[0] if isinstance(data, ms.Setups) else data
    try:
        ms.plot.stabilization(ms.stabilize(part, **({} if one.band is None else {"band": one.band})), ax=axes)
    except ms.DataError as error:
        axes.text(0.5, 0.5, str(error).splitlines()[0], ha="center", transform=axes.transAxes, fontsize=8)
        return one.band
    for each in axes.figure.axes:
        if (legend := each.get_legend()) is not None:
            legend.remove()
        each.tick_params(labelsize=7)
    axes.set(xlabel="", title="")
    return axes.get_xlim()
