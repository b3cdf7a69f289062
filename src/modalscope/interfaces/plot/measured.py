"""Describe what was measured, as one looks at it before choosing modes: points, coherence, driving points, reciprocity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from modalscope.data.geometry import Geometry, parse_dof
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import percent
from modalscope.interfaces.plot._camera import oblique
from modalscope.interfaces.plot.picture import (
    Areas,
    Axis,
    Item,
    Line,
    Marks,
    Panel,
    Picture,
    axis_of,
    axis_of_names,
    boxes,
    plain,
    strokes,
    unit_of,
)
from modalscope.interfaces.plot.responses import both, coherence_of
from modalscope.interfaces.plot.shapes import with_lines
from modalscope.interfaces.plot.web.poles import longest_of
from modalscope.numerics.checks import Array, IntArray, RealArray
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.signals.doctor.polarity import driving_points
from modalscope.signals.preprocess import estimate_frf

#: Mean coherence from which a point is good, and below which it is bad.
_GOOD, _BAD = 0.9, 0.7

#: Most columns and rows of the map of coherence, and curves of driving points.
_MAX_COLUMNS, _MAX_ROWS, _MAX_CURVES = 240, 400, 6

#: Inks of curves, in turn.
_INKS = ("blue", "vermillion", "green", "purple", "orange", "sky")


#: Output, input and sign of driving points.
Pairs = list[tuple[int, int, float]]


def measured_pictures(data: Any) -> dict[str, Picture]:
    """Return the pictures of data by name, as many as they have: points, coherence, driving points, reciprocity."""
    response, geometry, pictures = _response_of(data), getattr(data, "geometry", None), {}
    coherence = None if response is None else response.coherence
    if geometry is not None:
        pictures["points"] = points_picture(data, geometry, coherence)
    if response is None:
        return pictures
    if coherence is not None:
        pictures["coherence"] = coherence_picture(response, coherence)
    pairs = driving_points(response)
    if pairs and response.quantity in QUANTITIES:
        pictures["driving"] = driving_picture(response, pairs)
    return pictures | ({"reciprocity": reciprocity_picture(response, pairs)} if len(pairs) > 1 else {})


def _response_of(data: Any) -> FrequencyResponse | None:
    """Return the lines of data with forces: responses, or those estimated from the longest record; None of others."""
    longest = longest_of(data)
    if longest is not None:
        return None if longest.inputs is None else estimate_frf(longest)
    shown = data.picture() if isinstance(data, Response) else None
    return shown if isinstance(shown, FrequencyResponse) and shown.reciprocal else None


def points_picture(data: Any, geometry: Geometry, coherence: Array | None) -> Picture:
    """Return the points of a test on their geometry, coloured by mean coherence: of a roving hammer those of the forces."""
    roving = len(data.input_dofs) > len(data.output_dofs) and (coherence is None or coherence.ndim == 3)
    labels, others = (data.input_dofs, data.output_dofs) if roving else (data.output_dofs, data.input_dofs)
    means = None if coherence is None else coherence.reshape(*coherence.shape[:2], -1).mean((0, 1 if roving else 2))
    joined = with_lines(geometry)
    places = joined.coordinates @ oblique().matrix
    at = {node: k for k, node in enumerate(joined.nodes)}
    moved = [(node, o) for o, label in enumerate(labels) for node, _ in joined.motion_of(label)]
    seen = {at[node]: o for node, o in moved if node in at}
    nodes, outputs = np.array(list(seen), dtype=int), np.array(list(seen.values()), dtype=int)
    rest = np.setdiff1d(np.arange(len(places)), nodes)
    items: list[Item] = [
        strokes(places[joined.lines], width=0.9),
        _nodes(places[rest], "middle", "circle", "not measured" if len(rest) else "", 0.6, hollow=True),
    ]
    values = np.ones(len(nodes)) if means is None else means[outputs]
    for ink, own, words in _graded(values):
        told = words if means is not None else f"measured ({len(own)})"
        items.append(_nodes(places[nodes[own]], ink, "circle", told if len(own) else "", 2.0))
    driven = [at[dof.node] for dof in map(parse_dof, others) if dof is not None and dof.node in at]
    words = f"{'sensors' if roving else 'driven'} ({len(set(driven))})" if driven else ""
    items.append(_nodes(places[driven], "ink", "triangle", words, 3.0, hollow=True))
    across, upward = (axis_of("", [places[:, k]], room=0.12) for k in (0, 1))
    words = "Measured points on the geometry" + ("" if means is None else ", coloured by mean coherence")
    return Picture([Panel(across, upward, items, equal=True, bare=True)], words)


def _nodes(places: Array, ink: str, mark: str, words: str, size: float, *, hollow: bool = False) -> Marks:
    return Marks(places[:, 0], places[:, 1], ink, mark, words, size, hollow)


def _graded(values: RealArray) -> Iterator[tuple[str, IntArray, str]]:
    """Yield ink, positions and words of good, middling and bad coherences."""
    ends = (
        ("blue", _GOOD, np.inf, f"coherence from {_GOOD:g}"),
        ("orange", _BAD, _GOOD, f"from {_BAD:g}"),
        ("vermillion", -np.inf, _BAD, f"below {_BAD:g}"),
    )
    for ink, low, high, words in ends:
        own = np.flatnonzero((values >= low) & (values < high))
        yield ink, own, f"{words} ({len(own)})"


def coherence_picture(response: FrequencyResponse, coherence: Array) -> Picture:
    """Return the coherence of all channels over frequency as one picture: the darker, the less of it is explained by the force."""
    several = coherence.ndim == 3
    pairs = [(i, j) for i in range(coherence.shape[1]) for j in range(coherence.shape[2] if several else 1)][:_MAX_ROWS]
    f = response.frequencies
    starts = np.unique(np.linspace(0, len(f), min(_MAX_COLUMNS, len(f)), endpoint=False).astype(int))
    ends = np.append(f[starts[1:]], f[-1] + (f[-1] - f[-2] if len(f) > 1 else 1.0))
    counts = np.diff(np.append(starts, len(f)))
    rows = np.array([np.add.reduceat(coherence_of(coherence, i, j), starts) / counts for i, j in pairs])
    k, c = (index.ravel() for index in np.indices(rows.shape))
    missing = np.clip(1 - rows, 0, 1).ravel()
    kept = missing > 0.01
    corners = boxes(f[starts][c][kept], ends[c][kept], k[kept] - 0.5, k[kept] + 0.5)
    inputs = [f" / {plain(dof, 12)}" if several else "" for dof in response.input_dofs]
    names = [plain(response.output_dofs[i], 12) + inputs[j] for i, j in pairs]
    across = Axis("frequency [Hz]", float(f[0]), float(ends[-1]))
    down = replace(axis_of_names("", names, 24), low=len(names) - 0.5, high=-0.5)
    shades = Areas(corners, "vermillion", strength=missing[kept])
    panel = Panel(across, down, [shades], aside="white: coherence 1, dark: 0", grid=False)
    return Picture([panel], "Coherence of all channels over frequency")


def driving_picture(response: FrequencyResponse, pairs: Pairs) -> Picture:
    """Return the phase of driving points and the range in which a force does work on the structure: Re(velocity / force) >= 0."""
    power = QUANTITIES[response.quantity or "displacement"]
    low, high = 90.0 * (power - 1) - 90.0, 90.0 * (power - 1) + 90.0
    f, items = response.frequencies, list[Item]()
    across = Axis("frequency [Hz]", float(f[0]), float(f[-1]))
    for k, (i, j, sign) in enumerate(pairs[:_MAX_CURVES]):
        H = sign * response.values[:, i, j]
        phase = (np.degrees(np.angle(H)) - (low + high) / 2 + 180) % 360 - 180 + (low + high) / 2
        # the work of a force, weighted with the power of each line: what leaves the structure where it acts is an error
        work = np.abs(H) ** 2 * np.cos(np.radians(phase - (low + high) / 2))
        share = float(np.maximum(work, 0).sum() / max(np.abs(work).sum(), np.finfo(float).tiny))
        words = f"{plain(response.output_dofs[i], 14)}: {100 * share:.0f} %"
        items.append(Line(f, phase, _INKS[k % len(_INKS)], words, 0.9))
    allowed = Areas(boxes([across.low], [across.high], low, high), "green", "a force gives energy", 0.15)
    turns = tuple((t, f"{t:.0f}") for t in np.arange(low - 90, high + 91, 90).tolist())
    upward = Axis("phase [°]", low - 95, high + 95, named=turns)
    panel = Panel(across, upward, [allowed, *items], "Driving points", "part of the energy that enters the structure")
    return Picture([panel], "Phase of the driving points over frequency")


def reciprocity_picture(response: FrequencyResponse, pairs: Pairs) -> Picture:
    """Return the two responses between a pair of driving points that should be equal, of the pair that differs most."""
    f, values, found = response.frequencies, response.values, []
    for (i, j, sign), (k, m, other) in combinations(pairs, 2):
        H, G = other * values[:, i, m], sign * values[:, k, j]
        size = np.sqrt(np.linalg.norm(H) * np.linalg.norm(G))
        found.append((float(np.linalg.norm(H - G) / max(size, np.finfo(float).tiny)), (i, m), (k, j)))
    difference, *sides = max(found)
    names = [f"{plain(response.output_dofs[i], 14)} / {plain(response.input_dofs[j], 14)}" for i, j in sides]
    curves = [np.abs(values[:, i, j]) for i, j in sides]
    across = Axis("frequency [Hz]", float(f[0]), float(f[-1]))
    upward = axis_of(f"magnitude{unit_of(response)}", curves, log=True)
    lines = both([(f, curve) for curve in curves], (names[0], names[1]))
    words = "Two responses that reciprocity makes equal, of the pair of points that differs most"
    panel = Panel(across, upward, lines, "Reciprocity", f"differ by {percent(difference)}")
    return Picture([panel], words)
