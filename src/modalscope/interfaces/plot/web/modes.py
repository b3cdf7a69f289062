"""Collect the modes for the page: values, intervals, reasons and shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data import Geometry, ModalModel
from modalscope.data.analysis import named_near
from modalscope.data.indicators import mac
from modalscope.data.mode_fields import interval_ends
from modalscope.data.response import Response
from modalscope.interfaces.plot._camera import extent
from modalscope.interfaces.plot.shapes import has_channels, measured_nodes, turned, with_lines
from modalscope.interfaces.plot.web.blob import pack, parts_of
from modalscope.io.geometry import points_table
from modalscope.numerics.checks import Array, ComplexArray
from modalscope.selection.judging.description import ModeDescription, described

#: What is known of frequencies and damping, whatever the points are over which the shapes are drawn.
_KEPT = ("poles", "geometry", "scaling", "frequencies_std", "damping_ratios_std", "degrees")
_REPEATED = ("frequencies_repeatability", "damping_ratios_repeatability")

#: Maximum number of nodes that are edited as a table.
_MAX_EDITED = 500


def modes_blob(
    modes: ModalModel,
    names: Mapping[str, str],
    head: Mapping[str, Any],
    response: Response | None = None,
    *,
    preliminary: bool = False,
) -> bytes:
    """Return modes and their arrays as a blob.

    `head`: entries on the whole result. `response`: as in `over_points`. `preliminary`: the values will be refined.
    """
    parts, arrays = modes_parts(modes, names, points=over_points(modes, response), preliminary=preliminary)
    return pack({**head, **parts}, arrays)


def over_points(modes: ModalModel, response: Response | None) -> ModalModel:
    """Return modes with the shapes that are drawn: over the inputs where these are forces at more points than were measured.

    Of a roving hammer the inputs are the points. By H_ij = H_ji the participation of a mode is its shape over them.
    """
    inputs = modes.input_dofs
    if modes.geometry is not None and not has_channels(modes.geometry, (*modes.output_dofs, *inputs)):
        modes = replace(modes, geometry=None)
    fewer = len(inputs) <= len(modes.output_dofs)
    if fewer or response is None or not response.reciprocal or modes.participation is None:
        return modes
    kept = {name: getattr(modes, name) for name in (*_KEPT, *_REPEATED)}
    return ModalModel(shapes=modes.participation.T, output_dofs=inputs, **kept)


def modes_parts(
    modes: ModalModel,
    names: Mapping[str, str],
    holds: Array | None = None,
    *,
    points: ModalModel | None = None,
    preliminary: bool = False,
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return the entries and the arrays of modes; `points`: as of `over_points`. `holds`, `preliminary`: as in `described`."""
    points = modes if points is None else points
    entries: dict[str, Any] = {
        "modes": _rows(modes, names, described(modes, holds, preliminary=preliminary)),
        "left_out": [candidate.to_dict() for candidate in modes.left_out],
        "outputs": list(modes.output_dofs),
        "points": list(points.output_dofs),
        "over": "outputs" if points is modes else "inputs",
    }
    shapes = turned(points.shapes)
    alike = mac(points.shapes) if len(modes) else np.zeros((0, 0))
    arrays = {**parts_of(shape=shapes.T), "mac": alike}
    if points.shapes_std is not None:
        size = np.linalg.norm(shapes, axis=0) / np.maximum(np.linalg.norm(points.shapes, axis=0), 1e-300)
        arrays["shape_std"] = np.nan_to_num(points.shapes_std * size).T
    if points.geometry is not None and len(points.geometry.nodes) <= _MAX_EDITED:
        entries["table"] = points_table(points.geometry)
    if not has_channels(points.geometry, points.output_dofs):
        return {**entries, "nodes": None}, arrays
    moved = _moved(points.geometry, points.output_dofs, shapes)
    return {**entries, "nodes": list(points.geometry.nodes)}, arrays | moved


def _rows(modes: ModalModel, names: Mapping[str, str], shown: Sequence[ModeDescription]) -> list[dict[str, Any]]:
    """Return one row per mode: what is shown of it, values, 95 % intervals, indicators and why it is a mode."""
    (ends, _), before = interval_ends(modes, 0.95), modes.unrefined
    rows = []
    for j, mode in enumerate(modes):
        row: dict[str, Any] = {
            "frequency": mode.frequency,
            "damping": mode.damping_ratio,
            "frequency_interval": ends[j],
            "shown": shown[j].to_dict(),
            "indicators": {name: float(values[j]) for name, values in modes.indicators.items()},
            "text": str(mode.reason.get("text", "")),
            "name": named_near(names, mode.frequency),
            "gain": None if modes.gain is None else float(modes.gain[j]),
        }
        if before is not None and len(before) == len(modes):
            row |= {"frequency_before": before.frequencies[j], "damping_before": before.damping_ratios[j]}
        rows.append(row)
    return rows


def _moved(geometry: Geometry, labels: tuple[str, ...], shapes: ComplexArray) -> dict[str, Array]:
    """Return nodes at rest and their motion, scaled to a structure of size 1 and a largest motion of 1."""
    size = extent(geometry.coordinates) or 1.0
    middle = (geometry.coordinates.max(axis=0) + geometry.coordinates.min(axis=0)) / 2
    motion = np.array([geometry.displaced(labels, phi) for phi in shapes.T]).reshape(-1, len(geometry.nodes), 3)
    largest = np.max(np.linalg.norm(motion, axis=2), axis=1, initial=0.0)
    motion = motion / np.where(largest > 0, largest, 1.0)[:, None, None]
    signed = np.array([_signed(u) for u in motion]).reshape(len(motion), len(geometry.nodes))
    faces = geometry.faces
    if faces.shape[1] == 4:
        faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return {
        "rest": (geometry.coordinates - middle) / size,
        "lines": with_lines(geometry).lines,
        "faces": faces,
        "measured": measured_nodes(geometry, labels),
        **parts_of(moved=motion, signed=signed),
    }


def _signed(motion: Array) -> ComplexArray:
    """Return the motion of every node along the direction of the largest motion, (nodes,)."""
    direction = np.linalg.svd(motion.real, full_matrices=False)[2][0]
    along = motion @ direction
    return np.asarray(along * (np.sign(along.real[np.argmax(np.abs(along.real))]) or 1.0))
