"""Draw the pictures of a report as SVG, from the arrays that the page draws; those of Matplotlib as PNG."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.analysis.checking.certificate import Certificate
from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.indicators import mac
from modalscope.data.mode_fields import NORMAL_HALF_WIDTH
from modalscope.data.rebuilt import asked_ends
from modalscope.interfaces.plot._camera import AXES, View, view_of
from modalscope.interfaces.plot._style import SIZE
from modalscope.interfaces.plot.shapes import in_order, spaced
from modalscope.interfaces.plot.web.alive import Drawing
from modalscope.interfaces.plot.web.fits import Lines, strongest
from modalscope.interfaces.plot.web.poles import behind, decibels, pole_arrays
from modalscope.interfaces.plot.web.svg import MARKS, Panel, Scale, chart, key, scale_of, shortened
from modalscope.numerics.checks import Array, RealArray
from modalscope.selection.judging.description import decimals
from modalscope.signals.preprocess.singular_spectra import Decomposition

#: Kind of a pole, as its number in `pole_arrays` -> mark, class and words; drawn from the least to the most.
_POLES = (
    (0, "dot", "p-new", "new"),
    (1, "diamond", "p-f", "frequency"),
    (2, "triangle", "p-d", "and damping"),
    (3, "square", "p-v", "and shape"),
    (4, "dot", "p-s", "all: stable"),
)

#: Dots an inch of a PNG.
_DPI = 140

#: Points of a curve behind the poles.
_MAX_POINTS = 1600

#: Maximum number of bars and of names below them; of modes whose MAC values are written; of tones of a shape.
_MAX_BARS, _MAX_NAMES, _MAX_NUMBERED, _TONES = 400, 30, 12, 8

#: Largest displacement as a share of the size of the structure.
_AMPLITUDE = 0.14

#: Of the intervals: pixels between modes, of the middle of their axes, and of the largest deviation from it.
_ROW, _MIDDLE, _REACH = 21, 262, 130


def stabilization_svg(
    diagram: StabilizationDiagram, modes: ModalModel, spectra: Decomposition | None = None, description: str = ""
) -> str:
    """Draw the poles of all orders with the selected modes, over the mode indicator or the given spectra."""
    lines, curves = behind((diagram,), _MAX_POINTS, spectra)
    levels, name = decibels(curves), "mode indicator [dB]" if spectra is None else "singular values [dB]"
    low, high = asked_ends(diagram)
    if not high > low:
        low, high = diagram.response.span
    inside = (lines >= low) & (lines <= high)
    orders = Scale(0, 1.04 * max(diagram.orders, default=2))
    level = scale_of([levels[:, inside]])
    parts: list[str] = []
    panel = Panel(52, 46, 780, 400, Scale(low, high), level, parts)
    for k, curve in enumerate(levels[:, inside][::-1]):
        panel.curve(lines[inside], curve, f"line b-{min(len(levels) - k, 3)}")
    panel.right_axis(name, level)
    panel = Panel(52, 46, 780, 400, Scale(low, high), orders, parts)
    panel.axes("frequency [Hz]", "model order (states)")
    poles, entries = pole_arrays((diagram,)), []
    for number, mark, kind, words in _POLES:
        chosen = poles["kind"] == number
        panel.marks(poles["frequency"][chosen], poles["order"][chosen], kind, mark)
        entries.append((mark, kind, f"{words} ({np.count_nonzero(chosen)})"))
    key(parts, entries[::-1], 52, 12)
    ends = [-np.inf, -np.inf]  # of the labels in two rows: what has no room in the lower one stands in the upper
    for i, f in enumerate(modes.frequencies):
        if low <= f <= high:
            x, words = float(panel.across(np.array(f))) / 10, str(i + 1)
            parts.append(f'<path class="line mode dashed" d="M{round(10 * x)} 460V4460"/>')
            row = next((r for r in (0, 1) if x - 4 * len(words) > ends[r]), None)
            if row is not None:
                panel.text(words, x, 42 - 13 * row)
                ends[row] = x + 4 * len(words)
    return chart(900, 490, parts, description)


def singular_values_svg(singular_values: RealArray, orders: Sequence[int], description: str) -> str:
    """Draw the singular values up to three times the largest order."""
    shown = singular_values[: 3 * max(orders, default=20)]
    positive = np.flatnonzero(shown > 0)
    values = shown[positive] / (np.max(shown, initial=0.0) or 1.0)
    return _of_orders(positive + 1.0, values, "number", "singular value / largest", description)


def fit_errors_svg(diagram: StabilizationDiagram, description: str) -> str:
    """Draw what is unexplained at every order."""
    orders = np.asarray(diagram.orders, dtype=float)
    return _of_orders(
        orders, 100 * np.asarray(diagram.fit_errors), "model order (states)", "unexplained [%]", description
    )


def _of_orders(x: Array, y: Array, xlabel: str, ylabel: str, description: str) -> str:
    """Draw single values over a count on a logarithmic scale."""
    parts: list[str] = []
    panel = Panel(58, 12, 420, 220, scale_of([x]), scale_of([y], log=True), parts)
    panel.axes(xlabel, ylabel)
    panel.curve(x, np.where(y > 0, y, np.nan), "line c-1")
    panel.marks(x[y > 0], y[y > 0], "p-s")
    return chart(490, 276, parts, description)


def response_svg(lines: Lines, output: int, column: int, coherence: Array | None, description: str) -> str:
    """Draw magnitude and phase of one channel, measured and rebuilt, and its coherence, where that is known."""
    f, sides = lines.frequencies, [side[:, output, column] for side in (lines.measured, lines.rebuilt)]
    levels = [decibels(np.abs(side)) for side in sides]
    x, parts = Scale(float(f[0]), float(f[-1])), list[str]()
    low = 240 if coherence is None else 210
    upper = Panel(58, 28, 420, 150, x, scale_of(levels), parts)
    upper.axes("", "magnitude [dB]")
    lower = Panel(58, 190, 420, low - 150, x, Scale(-180, 180), parts)
    lower.axes("frequency [Hz]" if coherence is None else "", "phase [°]")
    for level, side, kind in zip(levels, sides, ("line measured", "line mode dashed"), strict=True):
        upper.curve(f, level, kind)
        angle = np.degrees(np.angle(side))
        jumps = np.flatnonzero(np.abs(np.diff(angle)) > 180) + 1
        lower.curve(np.insert(f, jumps, np.nan), np.insert(angle, jumps, np.nan), kind)
    if coherence is not None:
        third = Panel(58, 262, 420, 40, x, Scale(0, 1.02), parts)
        third.axes("frequency [Hz]", "coh.")
        third.curve(f, coherence, "line c-1")
    key(parts, [("line", "line measured", "measured"), ("line", "line mode dashed", "rebuilt")], 58, 14)
    return chart(490, 326 if coherence is None else 348, parts, description)


def shape_svg(modes: ModalModel, index: int, drawn: Mapping[str, Array], description: str) -> str:
    """Draw one mode shape on the geometry, or as bars if that has none of the channels; `drawn`: the arrays of `modes_parts`."""
    if "rest" not in drawn:
        return _bars(modes, drawn["shape_real"][index], drawn.get("shape_std"), index, description)
    rest, motion = drawn["rest"], drawn["moved_real"][index]
    view = view_of(rest, motion)
    if view.kind == "line":
        return _over_length(rest, motion, drawn["measured"], view, description)
    return _wireframe(rest, motion, drawn["signed_real"][index], drawn, view, description)


def _bars(modes: ModalModel, values: Array, std: Array | None, index: int, description: str) -> str:
    order = in_order(modes.output_dofs)
    order = order[spaced(len(order), _MAX_BARS)]
    values, places, parts = values[order], np.arange(len(order)), list[str]()
    names = [shortened(modes.output_dofs[k]) for k in order]
    every = max(1, -(-len(order) // _MAX_NAMES))
    upright = sum(map(len, names[::every])) > 60
    panel = Panel(40, 10, 438, 230 - (60 if upright else 0), Scale(-0.6, len(order) - 0.4), Scale(-1.15, 1.15), parts)
    panel.axes("", "", ticks=())
    panel.bars(places, values, 0.72, ["above" if v >= 0 else "below" for v in values])
    if std is not None and np.isfinite(std[index]).all():
        spread = std[index][order]
        panel.ranges(places, values - spread, values + spread, "line measured", 3)
    bottom = panel.top + panel.height + 12
    for k in range(0, len(order), every):
        x = float(panel.across(np.array(float(k)))) / 10
        turn = f' transform="rotate(-90 {round(10 * x + 40)} {round(10 * bottom)})"' if upright else ""
        panel.text(names[k], x + (4 if upright else 0), bottom, "end" if upright else "middle", turn)
    return chart(490, 262, parts, description)


def _over_length(rest: Array, motion: Array, measured: Array, view: View, description: str) -> str:
    """Draw displacement over position, with the axes exchanged for an upright structure."""
    along, parts = rest @ view.matrix[:, 0], list[str]()
    nodes = np.flatnonzero(measured)
    nodes = nodes[np.argsort(along[nodes], kind="stable")]
    moving = np.flatnonzero(np.max(np.abs(motion), axis=0) > 1e-6 * float(np.max(np.abs(motion))))
    upright, words = view.names[0] == "z", f"motion in {', '.join(AXES[k] for k in moving)} (largest 1)"
    scales = scale_of([along]), Scale(-1.15, 1.15)
    x, y = scales[::-1] if upright else scales
    panel = Panel(52, 28, 426, 200, x, y, parts)
    labels = f"position along {view.names[0]} (length 1)", words
    panel.axes(*(labels[::-1] if upright else labels))
    for k, kind in zip(moving, ("c-1", "mode", "p-d"), strict=False):
        a, b = (motion[nodes, k], along[nodes]) if upright else (along[nodes], motion[nodes, k])
        panel.curve(a, b, f"line {kind}")
        panel.marks(a, b, "p-s")
    if moving.size > 1:
        key(
            parts,
            [("line", f"line {c}", AXES[k]) for k, c in zip(moving, ("c-1", "mode", "p-d"), strict=False)],
            58,
            14,
        )
    return chart(490, 272, parts, description)


def _wireframe(
    rest: Array, motion: Array, signed: Array, drawn: Mapping[str, Array], view: View, description: str
) -> str:
    """Draw the structure at rest in grey and displaced, with tones from one way over none to the other."""
    still, moved = rest @ view.matrix, (rest + _AMPLITUDE * motion) @ view.matrix
    both = np.concatenate([still, moved])
    low, span = both.min(axis=0), np.maximum(np.ptp(both, axis=0), 1e-9)
    factor = min(470 / span[0], 250 / span[1])
    middle = low + span / 2
    at = {
        name: np.round(10 * (np.array([245, 134]) + (points - middle) * [factor, -factor])).astype(int)
        for name, points in (("still", still), ("moved", moved))
    }
    lines, faces, measured = drawn["lines"].astype(int), drawn["faces"].astype(int), drawn["measured"].astype(bool)
    parts = [_segments(at["still"], lines[spaced(len(lines))], "line rest")]
    depth = np.argsort(rest[faces].mean(axis=1) @ view.depth, kind="stable") if len(faces) else np.zeros(0, int)
    for corners in faces[depth]:
        path = "L".join(f"{a} {b}" for a, b in at["moved"][corners].tolist())
        parts.append(f'<path class="face f{_tone(signed[corners].mean())}" d="M{path}z"/>')
    live = lines[measured[lines].any(axis=1)] if len(lines) else lines
    tones = np.array([_tone(v) for v in signed[live].mean(axis=1)]) if len(live) else np.zeros(0, int)
    parts += [_segments(at["moved"], live[tones == k], f"line t{k}") for k in np.unique(tones)]
    nodes = np.flatnonzero(measured)
    shades = np.array([_tone(v) for v in signed[nodes]])
    for k in np.unique(shades):
        path = "".join(f"M{a} {b}h0" for a, b in at["moved"][nodes[shades == k]].tolist())
        parts.append(f'<path class="node t{k}" d="{path}"/>')
    for name, end in zip(AXES, view.matrix, strict=True):
        if np.linalg.norm(end) > 0.05:
            x, y = np.round([250 + 160 * end[0], 2440 - 160 * end[1]]).astype(int)
            parts.append(f'<path class="line rest" d="M250 2440L{x} {y}"/><text x="{x}" y="{y}">{name}</text>')
    return chart(490, 268, parts, description)


def _segments(at: Array, lines: Array, kind: str) -> str:
    """Return lines between points as one path."""
    path = "".join(f"M{a} {b}L{c} {d}" for a, b, c, d in at[lines].reshape(-1, 4).tolist())
    return f'<path class="{kind}" d="{path}"/>' if path else ""


def _tone(signed: float) -> int:
    """Return the tone of a motion, 0 (one way) to `_TONES` (the other)."""
    return int(np.clip(np.round((signed + 1) / 2 * _TONES), 0, _TONES))


def intervals_svg(modes: ModalModel, of: str, description: str) -> str:
    """Draw the 95 % interval of every mode on an axis of its own, with its ends; a hollow mark is the value before refinement."""
    name, unit, scale = ("frequencies", "Hz", 1.0) if of == "frequency" else ("damping_ratios", "%", 100.0)
    values = scale * np.asarray(getattr(modes, name))
    ends = scale * modes.interval(0.95)["frequency" if of == "frequency" else "damping_ratio"]
    before = None if modes.unrefined is None else scale * np.asarray(getattr(modes.unrefined, name))
    entries = [("line", "line c-1", "95 % interval")]
    entries += [] if before is None else [("diamond", "p-d", "before refinement")]
    parts: list[str] = []
    key(parts, entries, 58, 14)
    panel = Panel(0, 0, 490, 1, Scale(0, 490), Scale(0, 1), parts)  # for its texts
    panel.text(f"{of} [{unit}]", 482, 18, "end")
    for j, value in enumerate(values):
        y = 42 + _ROW * j
        panel.text(str(j + 1), 30, y + 4, "end")
        parts.append(f'<path class="grid" d="M{10 * (_MIDDLE - _REACH)} {10 * y}h{20 * _REACH}"/>')
        others = [] if before is None else [before[j]]
        reach = max((abs(v - value) for v in (*ends[j], *others) if np.isfinite(v)), default=0.0) or 1.0
        low, high = (round(10 * (_MIDDLE + _REACH * (v - value) / reach)) if np.isfinite(v) else None for v in ends[j])
        if low is not None and high is not None:
            top = 10 * y - 40
            parts.append(f'<path class="line c-1" d="M{low} {top}v80M{low} {10 * y}H{high}M{high} {top}v80"/>')
            digits = decimals(values[j : j + 1], 6, [float(ends[j][1] - value)])
            panel.text(f"{ends[j][0]:.{digits}f}", _MIDDLE - _REACH - 10, y + 4, "end")
            panel.text(f"{ends[j][1]:.{digits}f}", _MIDDLE + _REACH + 10, y + 4, "start")
        parts.append(f'<path class="p-s" d="M{10 * _MIDDLE} {10 * y}h0"/>')
        for v in others:
            at = round(10 * (_MIDDLE + _REACH * (v - value) / reach))
            parts.append(f'<path class="p-d" d="M{at} {10 * y}{MARKS["diamond"]}"/>')
    return chart(490, 50 + _ROW * len(modes), parts, description)


def certificate_svg(certificate: Certificate, of: str, description: str) -> str:
    """Draw the 95 % range of the simulated values of every mode, in predicted standard deviations."""
    name = "frequency" if of == "frequency" else "damping_ratio"
    measures, holds = getattr(certificate, name), getattr(certificate, f"{name}_holds")
    half, parts = np.nan_to_num(NORMAL_HALF_WIDTH * measures["ratio"]), list[str]()
    bias, place = np.nan_to_num(measures["bias"]), np.arange(len(holds))
    scale = scale_of([bias - half, bias + half, np.array([-NORMAL_HALF_WIDTH, NORMAL_HALF_WIDTH])])
    panel = _of_modes(parts, certificate.modes, scale, f"{of} [predicted deviations]")
    bottom, top = panel.upward(np.array([-NORMAL_HALF_WIDTH, NORMAL_HALF_WIDTH]))
    parts.append(f'<path class="band" d="M580 {bottom}V{top}H4780V{bottom}z"/>')
    for kept, kind in ((holds, "line c-1"), (~holds, "line mode")):
        panel.ranges(place[kept], (bias - half)[kept], (bias + half)[kept], kind)
    key(parts, [("line", "line c-1", "holds"), ("line", "line mode", "does not hold")], 58, 14)
    return chart(490, 276, parts, description)


def _of_modes(parts: list[str], modes: ModalModel, scale: Scale, ylabel: str) -> Panel:
    """Return a panel with one place for each mode."""
    count = len(modes)
    panel = Panel(58, 26, 420, 208, Scale(-0.6, count - 0.4), scale, parts)
    every = max(1, -(-count // _MAX_NAMES))
    panel.axes("mode", ylabel, ticks=[(float(k), str(k + 1)) for k in range(0, count, every)])
    return panel


def mac_svg(modes: ModalModel, description: str) -> str:
    """Draw the AutoMAC matrix with a key, and its values for few modes."""
    values, count, parts = mac(modes.shapes), len(modes), list[str]()
    cell = min(42.0, 400 / count)
    for i, j in np.ndindex(count, count):
        box = f'x="{round(10 * (30 + j * cell))}" y="{round(10 * (4 + i * cell))}"'
        size = f'width="{round(10 * cell - 8)}" height="{round(10 * cell - 8)}"'
        title = f"<title>modes {i + 1} and {j + 1}: {values[i, j]:.3f}</title>" if count <= 40 else ""
        if values[i, j] >= 0.005 or count <= 40:
            parts.append(f'<rect class="mac" {box} {size} fill-opacity="{values[i, j]:.2f}">{title}</rect>')
        if count <= _MAX_NUMBERED:
            words = f"{values[i, j]:.2f}".removeprefix("0") if values[i, j] < 0.995 else "1"
            place = f'x="{round(10 * (30 + (j + 0.5) * cell))}" y="{round(10 * (8 + (i + 0.5) * cell))}"'
            parts.append(f'<text class="{"on" if values[i, j] > 0.55 else "ink"}" {place}>{words}</text>')
    for k in range(0, count, max(1, int(np.ceil(13 / cell)))):
        middle = (k + 0.5) * cell
        parts.append(f'<text x="150" y="{round(10 * (8 + middle))}">{k + 1}</text>')
        parts.append(f'<text x="{round(10 * (30 + middle))}" y="{round(10 * (18 + count * cell))}">{k + 1}</text>')
    bottom, side = 34 + count * cell, max(count * cell, 160.0)
    for k in range(11):
        box = f'x="{round(10 * (30 + k * side / 11))}" y="{round(10 * bottom)}" width="{round(10 * side / 11)}" height="80"'
        parts.append(f'<rect class="mac" {box} fill-opacity="{k / 10:.1f}"/>')
    for share in (0.0, 0.5, 1.0):
        parts.append(f'<text x="{round(10 * (30 + share * side))}" y="{round(10 * (bottom + 20))}">{share:g}</text>')
    return chart(50 + side, bottom + 26, parts, description)


def pictures_of(drawing: Drawing) -> dict[str, str]:
    """Return the pictures of a result as SVG files of their own, by name: diagrams, shapes, AutoMAC, strongest response."""
    modes, pictures = drawing.modes, {}
    for k, diagram in enumerate(drawing.diagrams):
        number = f"_{k + 1}" if len(drawing.diagrams) > 1 else ""
        pictures[f"diagram{number}"] = stabilization_svg(diagram, modes, drawing.spectra, "Stabilization diagram")
    points = drawing.points
    if len(points.output_dofs) > 1:
        for k in range(len(modes)):
            pictures[f"mode_{k + 1}"] = shape_svg(points, k, drawing.arrays, f"Shape of mode {k + 1}")
    if len(modes) > 1 and len(points.output_dofs) > 1:
        pictures["automac"] = mac_svg(points, "AutoMAC")
    if drawing.lines is not None and len(modes):
        i, j = strongest(drawing.lines.measured)
        pictures["response"] = response_svg(drawing.lines, i, j, None, "Measured and rebuilt response")
    return {name: alone(picture) for name, picture in pictures.items()}


def alone(picture: str) -> str:
    """Return a picture of a report as a file of its own: with its name space, its size and the light colours of the report."""
    style = Path(__file__).with_name("report.css").read_text(encoding="utf-8")
    colours = dict(re.findall(r"--([\w-]+): (#\w+)", style.partition("}")[0]))
    rules = "".join(line for line in style.splitlines(keepends=True) if line.startswith(".chart"))
    rules = re.sub(r"var\(--([\w-]+)\)", lambda found: colours[found[1]], rules)
    rules = re.sub(r"color-mix\(in srgb, (#\w+) (\d+)%, (#\w+)\)", _mixed, rules)
    width, height = (int(side) / 10 for side in picture.partition('viewBox="0 0 ')[2].partition('"')[0].split())
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" class="chart"'
    body = picture.removeprefix('<svg class="chart"')
    inner = body.index(">") + 1
    back = f'<rect width="{10 * width:g}" height="{10 * height:g}" fill="#ffffff"/>'
    return f"{head}{body[:inner]}<style>{rules}</style>{back}{body[inner:]}"


def _mixed(found: re.Match[str]) -> str:
    """Return a mixture of two colours as one: programs for drawings know no mixtures and no variables of style sheets."""
    share = int(found[2]) / 100
    first, second = (np.array([int(found[k][i : i + 2], 16) for i in (1, 3, 5)]) for k in (1, 3))
    return "#" + "".join(f"{v:02x}" for v in np.round(share * first + (1 - share) * second).astype(int).tolist())


def png(draw: Callable[[Any], object], size: tuple[float, float] = SIZE) -> bytes:
    """Return a picture as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    draw(figure.add_subplot())
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI)
    return buffer.getvalue()
