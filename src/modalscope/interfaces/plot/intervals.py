"""Describe the confidence intervals of modes, and their certificates: predicted against simulated deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from modalscope.analysis.checking.certificate import Certificate
from modalscope.data import ModalModel
from modalscope.data.mode_fields import NORMAL_HALF_WIDTH
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import (
    Areas,
    Axis,
    Item,
    Marks,
    Panel,
    Picture,
    Words,
    axis_of,
    axis_of_names,
    boxes,
    level,
    ranges,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.selection.judging.description import decimals

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Quantity -> its attribute of the modes and of intervals and certificates, the factor to its unit, and the unit.
_QUANTITIES = {
    "frequency": ("frequencies", "frequency", 1.0, "Hz"),
    "damping": ("damping_ratios", "damping_ratio", 100.0, "%"),
}

#: Maximum width of a row, in widths of its interval: an earlier value far outside leaves the interval to be seen.
_MAX_WIDER = 2.5

#: Hundredths of an inch of one mode, and of all else.
_ROW, _REST = 30, 130


@named(modes=ModalModel, of=("frequency", "damping"))
def intervals(modes: ModalModel, ax: Axes | None = None, *, of: str = "frequency") -> Axes:
    """Draw the 95 % interval of every mode on a scale of its own, with its ends: from the noise, and between groups if these are known.

    A wide interval leaves the others as they are. A hollow mark is the value before refinement.

    Parameters
    ----------
    modes : ModalModel
        With standard deviations, of `refine` for instance.
    ax : Axes, optional
        A new figure by default.
    of : {"frequency", "damping"}

    Raises
    ------
    DataError
        No standard deviations are known.
    """
    return painted(intervals_picture(modes, of), ax)


def intervals_picture(modes: ModalModel, of: str) -> Picture:
    """Return the 95 % interval of every mode, each row with its own scale: half of its width is 1."""
    name, key, factor, unit = _QUANTITIES[of]
    if getattr(modes, f"{name}_std") is None and getattr(modes, f"{name}_repeatability") is None:
        raise DataError("intervals need standard deviations", "none are known", "Refine the modes.")
    values, ends = factor * np.asarray(getattr(modes, name)), factor * modes.interval(0.95)[key]
    earlier = modes.unrefined if modes.unrefined is not None and len(modes.unrefined) == len(modes) else None
    before = np.full(len(values), np.nan) if earlier is None else factor * np.asarray(getattr(earlier, name))
    known = np.isfinite(ends).all(axis=1)
    reach = _reach(np.nan_to_num(np.abs(ends - values[:, None]).max(axis=1)), np.nan_to_num(np.abs(before - values)))
    rows = np.arange(len(values), dtype=float)
    low, high, was = (np.clip((side - values) / reach, -1, 1) for side in (*ends.T, before))
    words = "95 % interval: noise" + ("" if modes.frequencies_repeatability is None else ", and what groups disagree")
    items = ranges(rows[known], low[known], high[known], "blue", words, across=True)
    items.append(Marks(np.zeros(len(rows)), rows, "blue", "dot"))
    digits = [decimals(values[j : j + 1], 6, [float(ends[j][1] - values[j])]) for j in np.flatnonzero(known)]
    for x, side, column in ((-1.08, "right", ends[known, 0]), (1.08, "left", ends[known, 1])):
        texts = [f"{v:.{d}f}" for v, d in zip(column, digits, strict=True)]
        items.append(Words(np.full(known.sum(), x), rows[known], texts, side=side))
    none = rows[~known]
    items.append(Words(np.full(len(none), 0.08), none, ["no interval"] * len(none), "muted", "left"))
    if earlier is not None:
        items.append(Marks(was[known], rows[known], "green", "diamond", "before refinement", hollow=True))
    named_rows = tuple((float(j), f"{j + 1}   {f:.5g} Hz") for j, f in enumerate(modes.frequencies))
    across = Axis("each mode on its own scale, with the ends of its interval", -1.8, 1.8, named=())
    panel = Panel(across, Axis("", len(rows) - 0.4, -0.6, named=named_rows), items, f"{of.capitalize()} [{unit}]")
    return Picture([panel], f"95 % intervals of every mode's {of}", (900, _ROW * len(rows) + _REST))


def _reach(interval: RealArray, before: RealArray) -> RealArray:
    """Return the half width of each row: what interval and earlier value need, an earlier value far outside at its edge."""
    wide = np.where(interval > 0, np.minimum(before, _MAX_WIDER * interval), before)
    reach = np.maximum(interval, wide)
    return np.where(reach > 0, reach, 1.0)


@named(found=Certificate, of=("frequency", "damping"))
def certificate(found: Certificate, ax: Axes | None = None, *, of: str = "frequency") -> Axes:
    """Draw the 95 % range of the simulated values of every mode over the predicted interval, in predicted standard deviations.

    Parameters
    ----------
    found : Certificate
    ax : Axes, optional
        A new figure by default.
    of : {"frequency", "damping"}
    """
    return painted(certificate_picture(found, of), ax)


def certificate_picture(found: Certificate, of: str = "frequency") -> Picture:
    """Return bias and range of the simulated values of every mode over the predicted interval, with the coverage."""
    key = _QUANTITIES[of][1]
    measures, holds = getattr(found, key), getattr(found, f"{key}_holds")
    place, bias = np.arange(len(found.modes)), np.nan_to_num(measures["bias"])
    half: RealArray = np.nan_to_num(NORMAL_HALF_WIDTH * measures["ratio"])
    top = max(NORMAL_HALF_WIDTH, float(np.max(np.abs(bias) + half, initial=0.0)))
    across = axis_of_names("mode [Hz]", [f"{f:.4g}" for f in found.modes.frequencies])
    predicted = boxes([across.low], [across.high], [-NORMAL_HALF_WIDTH], [NORMAL_HALF_WIDTH])
    items: list[Item] = [Areas(predicted, words="predicted"), level(across)]
    for kept, ink, words in ((holds, "blue", "holds"), (~holds, "orange", "does not hold")):
        if np.any(kept):
            items += ranges(place[kept], (bias - half)[kept], (bias + half)[kept], ink, words)
            items.append(Marks(place[kept], bias[kept], ink, "dot"))
    told = [f"{100 * share:.0f} %" if np.isfinite(share) else "no interval" for share in measures["coverage"]]
    items.append(Words(place, np.full(len(place), 1.22 * top), told, "muted"))
    upward = axis_of("deviation from the truth [predicted deviations]", [[-1.15 * top, 1.35 * top]], room=0.0)
    return Picture([Panel(across, upward, items, of.capitalize())], f"Simulated deviations of every mode's {of}")
