"""Draw the pictures of a comparison of methods as SVG: deviations from the consensus, the map of methods, distances between them."""

from __future__ import annotations

import numpy as np

from modalscope.analysis.comparing import Comparison
from modalscope.analysis.comparing.kinship import SAME, Kinship
from modalscope.interfaces.plot._style import dodge
from modalscope.interfaces.plot.methods import deviations_of, reach_of, scatter_of
from modalscope.interfaces.plot.web.svg import Panel, Scale, chart, key, shortened

#: Domain -> mark, class of the style sheet and words.
_DOMAINS = {"time": ("circle", "d-time", "time"), "z": ("square", "d-z", "z"), "s": ("triangle", "d-s", "s")}

#: Degrees below which an angle is zero to rounding.
_ZERO_ANGLE = 1e-4

#: Characters of the name of a method at most; of a name that several share.
_MAX_NAME, _MAX_NAMES = 34, 60


def deviations_svg(c: Comparison, description: str) -> str:
    """Draw the deviation of every method from the consensus, mode by mode, over the stated scatter; doubtful modes do not set the scale."""
    parts: list[str] = []
    labels = [(float(k), f"{g.frequency:.5g}") for k, g in enumerate(c.groups)]
    labels = labels[:: max(1, len(labels) // 14)]
    across = Scale(-0.6, len(c.groups) - 0.4)
    for kind, unit, top in (("frequency", "half bandwidths", 30), ("damping", "% of its value", 250)):
        panel = Panel(58, top, 822, 190, across, Scale(*reach_of(c, kind)), parts)
        panel.axes("mode [Hz]" if kind == "damping" else "", f"{kind} [{unit}]", ticks=labels)
        for k in range(len(c.groups)):
            width = float(np.fmin(scatter_of(c, kind, k), panel.y.high))  # the whole panel where there is no interval
            left, right = panel.across(np.array([k - 0.42, k + 0.42])).tolist()
            low, high = panel.upward(np.array([-width, width])).tolist()
            parts.append(f'<path class="band" d="M{left} {low}V{high}H{right}V{low}z"/>')
        for r, x, y in deviations_of(c, kind):
            mark, style, _ = _DOMAINS.get(r.method.domain, _DOMAINS["time"])
            seen = np.abs(y) <= panel.y.high
            panel.marks(x[seen], y[seen], style if r.exact else f"{style} open", mark)
    key(parts, [(mark, style, f"domain {words}") for mark, style, words in _DOMAINS.values()], 58, 14)
    return chart(900, 484, parts, description)


def method_map_svg(kin: Kinship, description: str) -> str:
    """Draw the map of methods: those at one place have the same poles, and are concentric rings."""
    parts: list[str] = []
    low, high = kin.places.min(axis=0), kin.places.max(axis=0)
    size = max(float(high[0] - low[0]), 1.5 * float(high[1] - low[1]), 1e-3)
    middle = (low + high) / 2
    x = Scale(float(middle[0] - 0.58 * size), float(middle[0] + 0.58 * size))
    y = Scale(float(middle[1] - 0.4 * size), float(middle[1] + 0.4 * size))
    panel = Panel(58, 30, 510, 352, x, y, parts)
    panel.axes("distance [half-power half-bandwidths]", "distance [half-power half-bandwidths]")
    order = sorted(kin.classes, key=lambda members: float(kin.places[members[0], 1]))
    heights = dodge(y.shares(np.array([kin.places[m[0], 1] for m in order])), gap=0.052, low=0.01, high=0.99)
    for members, height in zip(order, heights, strict=True):
        at = kin.places[members[0]]
        a, b = int(panel.across(at[0])), int(panel.upward(at[1]))
        text_at = 30 + 352 * (1 - float(height))
        parts.append(f'<path class="grid" d="M{a} {b}L5780 {round(10 * text_at)}"/>')
        for rank, i in enumerate(members):
            _, style, _ = _DOMAINS.get(kin.methods[i].domain if kin.methods else "time", _DOMAINS["time"])
            r = 36 + 22 * rank
            circle = f"m-{r} 0a{r} {r} 0 1 0 {2 * r} 0a{r} {r} 0 1 0-{2 * r} 0z"
            parts.append(f'<path class="{style}{" hollow" if rank else ""}" d="M{a} {b}{circle}"/>')
        words = " = ".join(kin.labels[i] for i in members)
        panel.text(shortened(words, _MAX_NAMES), 582, text_at + 4, "start")
    key(parts, [("circle", style, f"domain {words}") for _, style, words in _DOMAINS.values()], 58, 14)
    return chart(960, 424, parts, description)


def method_distances_svg(kin: Kinship, description: str) -> str:
    """Draw distances of pole sets below the diagonal, and principal angles in degrees above it."""
    count, parts = len(kin.names), list[str]()
    names = [shortened(label, _MAX_NAME) for label in kin.labels]
    left = 16 + 6.2 * max(map(len, names))
    cell = min(46.0, 620 / count)
    for a, b in np.ndindex(count, count):
        x, y = left + b * cell, 4 + a * cell
        distance, angle = float(kin.distances[a, b]), float(kin.angles[a, b])
        share = np.sqrt(min(distance if a > b else angle / 90, 1.0)) if a != b else 0.0
        box = f'x="{round(10 * x)}" y="{round(10 * y)}" width="{round(10 * cell - 8)}" height="{round(10 * cell - 8)}"'
        parts.append(f'<rect class="mac" {box} fill-opacity="{share:.2f}"/>')
        if a == b:
            continue
        words = f"{angle if angle > _ZERO_ANGLE else 0:.2g}°"
        if a > b:
            words = "0" if distance < SAME else f"{distance:.2g}".removeprefix("0")
        place = f'x="{round(10 * (x + cell / 2))}" y="{round(10 * (y + cell / 2 + 4))}"'
        parts.append(f'<text class="{"on" if share > 0.55 else "ink"}" {place}>{words}</text>')
    panel = Panel(0, 0, 1, 1, Scale(0, 1), Scale(0, 1), parts)  # for its texts
    bottom = 4 + count * cell
    for k, name in enumerate(names):
        middle = (k + 0.5) * cell
        panel.text(name, left - 6, 4 + middle + 4, "end")
        x = left + middle + 4
        panel.text(name, x, bottom + 8, "end", f' transform="rotate(-90 {round(10 * x)} {round(10 * (bottom + 8))})"')
    return chart(left + count * cell + 6, bottom + left, parts, description)
