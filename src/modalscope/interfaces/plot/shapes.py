"""Draw mode shapes on the geometry or as bars, with their phases."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from modalscope.data import Geometry, ModalModel
from modalscope.data.geometry import parse_dof
from modalscope.data.indicators import mpc
from modalscope.interfaces.plot._camera import AXES, View, extent, oblique, view_of
from modalscope.interfaces.plot._style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    PALE,
    VERMILLION,
    aside,
    decimals,
    diverging,
    dress,
    frameless,
    headline,
    key,
    new_axes,
    one_output,
    plain,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count, check_kind
from modalscope.numerics.errors import DataError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Maximum number of drawn lines, faces or nodes, and of bars; more are thinned.
_MAX_DRAWN, _MAX_BARS = 20_000, 2000

#: Largest displacement as a share of the size of the structure.
_AMPLITUDE = 0.14

#: Pieces of a line between two nodes, whose colour changes along it.
_PIECES = 16

#: Maximum number of channel names below bars.
_MAX_LABELS = 30


def thinned(geometry: Geometry, measured: Array) -> tuple[Geometry, Array]:
    """Return a geometry with a regular subset of its lines and faces, and the mask of drawn nodes."""
    lines, faces = geometry.lines, geometry.faces
    if max(len(lines), len(faces)) > _MAX_DRAWN:
        geometry = replace(geometry, lines=lines[spaced(len(lines))], faces=faces[spaced(len(faces))])
    nodes = np.flatnonzero(measured)
    shown = np.zeros_like(measured)
    shown[nodes[spaced(len(nodes))]] = True
    return geometry, shown


def spaced(count: int, most: int = _MAX_DRAWN) -> slice:
    """Return the slice of `count` items with the smallest step that takes at most `most`.

    Examples
    --------
    >>> spaced(1_000_000).step, spaced(100).step
    (50, 1)
    """
    return slice(None, None, max(-(-count // most), 1))


def turned(shapes: Array) -> ComplexArray:
    """Return shapes (l,) or (l, n) rotated by -arg(sum phi^2) / 2, which minimizes sum (Im phi)^2; largest components of length 1."""
    phi = shapes * np.exp(-0.5j * np.angle(np.sum(shapes**2, axis=0)))
    size = np.max(np.abs(phi), axis=0, initial=0.0)
    scaled: ComplexArray = phi / np.where(size > 0, size, 1.0)
    return scaled


def in_phase(shape: Array) -> RealArray:
    """Return the real part of a rotated shape (`turned`), its largest component 1."""
    real = turned(np.asarray(shape, dtype=np.complex128)).real
    largest = real[np.argmax(np.abs(real))] if real.size else 0.0
    return real / largest if largest else real


@named()
def shape(
    modes: ModalModel,
    index: int = 0,
    geometry: Geometry | None = None,
    ax: Axes | None = None,
    *,
    scale: float = _AMPLITUDE,
    azimuth: float | None = None,
    elevation: float | None = None,
    std: bool = False,
) -> Axes:
    """Draw one mode shape over the structure at rest.

    A complex shape is rotated to minimum imaginary parts; the MPC above the picture states how much is hidden (1: nothing). Nodes on a
    line are drawn as displacement over position, nodes with motion in their plane flat, all others obliquely. Without a geometry
    every channel is a bar. Of very many channels, lines and faces a regular subset is drawn. One output has no shape, which is written
    instead.

    Parameters
    ----------
    modes : ModalModel
    index : int
        Index of the mode, from zero; the first by default.
    geometry : Geometry, optional
        That of the modes by default.
    ax : Axes, optional
        Two-dimensional axes; a new figure by default.
    scale : float
        Largest displacement as a share of the diagonal of the structure.
    azimuth, elevation : float, optional
        Degrees; either selects the oblique view.
    std : bool
        Draw every channel as a bar with one standard deviation to either side (`modes.shapes_std`), without the geometry.

    Raises
    ------
    DataError
        An unknown mode, a geometry with none of the channels, or standard deviations that are not known.
    """
    check_mode(modes, index)
    if len(modes.output_dofs) == 1:
        return one_output(new_axes(ax), "a shape of one number says nothing")
    if std and modes.shapes_std is None:
        raise DataError(
            "bars with intervals need standard deviations of shapes",
            "these modes have none",
            "Refine them: ms.refine(data, modes).",
        )
    ax = new_axes(ax)
    geometry = None if std else modes.geometry if geometry is None else geometry
    values = in_phase(modes.shapes[:, index])
    title = f"mode {index + 1}: {modes.frequencies[index]:.{decimals(modes.frequencies)}f} Hz, {100 * modes.damping_ratios[index]:.2f} %"
    if geometry is None:
        largest = abs(complex(modes.shapes[np.argmax(np.abs(values)), index])) or 1.0
        spread = modes.shapes_std[:, index] / largest if std and modes.shapes_std is not None else None
        _bars(ax, modes.output_dofs, values, spread)
        dress(ax, title=title, ylabel="shape (largest component 1)" + (", ± one standard deviation" if std else ""))
    else:
        measured = _measured(geometry, modes.output_dofs)
        motion = geometry.displaced(modes.output_dofs, values)
        angles = {name: v for name, v in (("azimuth", azimuth), ("elevation", elevation)) if v is not None}
        view = oblique(**angles) if angles else view_of(geometry.coordinates, motion)
        dress(ax, title=title, grid=view.kind == "line")
        if view.kind == "line":
            _over_length(ax, geometry, motion, measured, view)
        else:
            _wireframe(ax, geometry, motion, measured, view, scale)
    aside(ax, f"MPC {float(mpc(modes.shapes[:, [index]])[0]):.3f}")
    return ax


def has_channels(geometry: Geometry | None, labels: tuple[str, ...]) -> TypeGuard[Geometry]:
    """Return whether there is a geometry, and one of the channels moves it."""
    return geometry is not None and any(geometry.motion_of(label) for label in labels)


def check_mode(modes: ModalModel, index: int) -> None:
    """Raise if there is no mode of that index."""
    check_kind("a plot of shapes", modes, ModalModel)
    check_count("index", index, least=0)
    if index >= len(modes):
        asked, count = f"the shape of mode index {index} was asked", f"there are {len(modes)} modes, counted from zero"
        raise DataError(asked, count, "Choose a lower index.")


def _measured(geometry: Geometry, labels: tuple[str, ...]) -> Array:
    """Return the mask of nodes that a channel moves."""
    moved = {node for label in labels for node, _ in geometry.motion_of(label)}
    measured = np.array([node in moved for node in geometry.nodes], dtype=bool)
    if not measured.any():
        nodes, channels = ", ".join(geometry.nodes[:4]), ", ".join(labels[:4])
        reason = f"the geometry (nodes {nodes}, ...) has none of the channels {channels}, ..."
        remedy = "Name the channels after its nodes, such as 3:+Z, or give it their motions."
        raise DataError("a shape is drawn at the nodes of its channels", reason, remedy)
    return measured


def in_order(labels: tuple[str, ...]) -> list[int]:
    """Return the order of channels on the structure: by direction, then by node, 2 before 10.

    Examples
    --------
    >>> in_order(("10:+Z", "2:+Z", "2:+X", "1:-Z"))
    [2, 3, 1, 0]
    """

    def place(k: int) -> tuple[str, list[tuple[int, str]]]:
        dof = parse_dof(labels[k])
        direction, node = ("", labels[k]) if dof is None else (dof.direction.lstrip("+-"), dof.node)
        parts = re.split(r"(\d+)", node)
        return direction, [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]

    return sorted(range(len(labels)), key=place)


def _bars(ax: Axes, labels: tuple[str, ...], values: RealArray, spread: RealArray | None = None) -> None:
    order = in_order(labels)
    order = order[spaced(len(order), _MAX_BARS)]
    labels, values = tuple(labels[k] for k in order), values[order]
    places = np.arange(values.size)
    ax.bar(places, values, width=0.72, color=np.where(values < 0, BLUE, VERMILLION).tolist(), zorder=2)
    if spread is not None:
        ax.errorbar(places, values, yerr=spread[order], fmt="none", ecolor=INK, capsize=3, zorder=3)
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.set_ylim(-1.12, 1.12)
    ax.set_xlim(-0.6, values.size - 0.4)
    every = max(1, -(-values.size // _MAX_LABELS))
    shown = [plain(label) for label in labels[::every]]
    ax.set_xticks(places[::every], shown, rotation=90 if sum(map(len, shown)) > 60 else 0)


def _over_length(ax: Axes, geometry: Geometry, motion: RealArray, measured: Array, view: View) -> None:
    """Draw displacement over position, with the axes exchanged for an upright structure."""
    position = geometry.coordinates @ view.matrix[:, 0]
    order = np.argsort(position, kind="stable")
    nodes, along = order[measured[order]], position[order]
    moving = np.flatnonzero(np.max(np.abs(motion), axis=0) > 1e-6 * float(np.max(np.abs(motion))))
    upright = view.names[0] == "z"
    flip = slice(None, None, -1) if upright else slice(None)
    ax.plot(*(along, np.zeros(order.size))[flip], color=PALE, linewidth=2.0, zorder=1)
    for axis, colour in zip(moving, (BLUE, VERMILLION, GREEN), strict=False):
        style: dict[str, Any] = {"color": colour, "linewidth": 1.8, "marker": "o", "markersize": 6, "zorder": 3}
        ax.plot(*(position[nodes], motion[nodes, axis])[flip], label=AXES[axis], **style)
        stems = ax.hlines if upright else ax.vlines
        stems(position[nodes], 0, motion[nodes, axis], color=colour, linewidth=0.7, alpha=0.5, zorder=2)
    directions = ", ".join(AXES[axis] for axis in moving) or "no direction"
    words = [f"position along {view.names[0]}", f"motion in {directions} (largest 1)"]
    xlabel, ylabel = words[flip]
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    (ax.set_xlim if upright else ax.set_ylim)(-1.2, 1.2)
    if moving.size > 1:
        key(ax)


def _wireframe(ax: Axes, geometry: Geometry, motion: RealArray, measured: Array, view: View, scale: float) -> None:
    """Draw the structure at rest in grey and displaced in colour: vermillion one way, blue the other."""
    rest = geometry.coordinates @ view.matrix
    size = float(np.max(np.linalg.norm(motion, axis=1))) or 1.0
    moved = (geometry.coordinates + motion * (scale * extent(geometry.coordinates) / size)) @ view.matrix
    # sign and size of the motion along the direction of the largest motion
    signed = motion @ np.linalg.svd(motion, full_matrices=False)[2][0] / size
    signed = signed * (np.sign(signed[np.argmax(np.abs(signed))]) or 1.0)
    geometry, shown = thinned(geometry, measured)
    live = measured[geometry.lines].any(axis=1) if len(geometry.lines) else np.zeros(0, dtype=bool)
    _faces(ax, geometry, moved, signed, view)
    _strokes(ax, rest[geometry.lines], color=PALE, linewidths=0.9, zorder=1)
    _strokes(ax, np.stack([rest[shown], moved[shown]], axis=1), color=PALE, linewidths=0.7, linestyles=":", zorder=1.5)
    _coloured(ax, moved[geometry.lines[live]], signed[geometry.lines[live]])
    still, live_nodes = rest[shown], moved[shown]
    ax.scatter(still[:, 0], still[:, 1], s=9, color=PALE, zorder=2, linewidths=0)
    style: dict[str, Any] = {"cmap": diverging(), "vmin": -1, "vmax": 1, "edgecolors": "white", "linewidths": 0.7}
    ax.scatter(live_nodes[:, 0], live_nodes[:, 1], s=34, c=signed[shown], zorder=5, **style)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.06)
    ax.set_xticks([])
    ax.set_yticks([])
    frameless(ax)
    _triad(ax, view)


def _strokes(ax: Axes, segments: Array, **style: Any) -> None:
    from matplotlib.collections import LineCollection

    if len(segments):
        ax.add_collection(LineCollection(list(segments), capstyle="round", **style), autolim=True)


def _coloured(ax: Axes, segments: Array, signed: Array) -> None:
    """Draw lines with colours interpolated between the values at their ends."""
    from matplotlib.collections import LineCollection

    if not len(segments):
        return
    t = np.linspace(0, 1, _PIECES + 1)[:, None, None]
    points = segments[:, 0] * (1 - t) + segments[:, 1] * t
    pieces = np.stack([points[:-1], points[1:]], axis=2).reshape(-1, 2, 2)
    middle = (t[:-1, :, 0] + t[1:, :, 0]) / 2
    values = (signed[:, 0] * (1 - middle) + signed[:, 1] * middle).ravel()
    lines = LineCollection(list(pieces), cmap=diverging(), linewidths=2.2, capstyle="round", zorder=4)
    lines.set_array(values)
    lines.set_clim(-1, 1)
    ax.add_collection(lines, autolim=True)


def _faces(ax: Axes, geometry: Geometry, moved: Array, signed: Array, view: View) -> None:
    from matplotlib.collections import PolyCollection

    if not len(geometry.faces):
        return
    depth = (geometry.coordinates @ view.depth)[geometry.faces].mean(axis=1)
    ordered = geometry.faces[np.argsort(depth, kind="stable")]
    faces = PolyCollection(
        list(moved[ordered]), cmap=diverging(), alpha=0.55, edgecolors="white", linewidths=0.5, zorder=3
    )
    faces.set_array(signed[ordered].mean(axis=1))
    faces.set_clim(-1, 1)
    ax.add_collection(faces, autolim=True)


def _triad(ax: Axes, view: View) -> None:
    """Show the directions of x, y and z in the lower left corner."""
    inset = ax.inset_axes((0.0, 0.0, 0.11, 0.16))
    inset.set_axis_off()
    inset.set_aspect("equal")
    for name, end in zip(AXES, view.matrix, strict=True):
        if np.linalg.norm(end) > 0.05:
            inset.plot([0, end[0]], [0, end[1]], color=MUTED, linewidth=1.1, solid_capstyle="round")
            x, y = 1.2 * end + 0.2 * end / np.linalg.norm(end)
            inset.text(x, y, name, fontsize=9, color=MUTED, ha="center", va="center")
    inset.set_xlim(-1.6, 1.6)
    inset.set_ylim(-1.6, 1.6)


@named()
def complexity(modes: ModalModel, index: int, ax: Axes | None = None) -> Axes:
    """Draw the components of one shape in the complex plane; on a line they are in phase or in opposition.

    Parameters
    ----------
    modes : ModalModel
    index : int
        Index of the mode, from zero.
    ax : Axes, optional
        Polar axes; those of a new figure by default.

    Raises
    ------
    DataError
        An unknown mode, or axes that are not polar.
    """
    check_mode(modes, index)
    ax = new_axes(ax, (6.0, 6.0), projection="polar")
    if ax.name != "polar":
        remedy = 'Create them with projection="polar".'
        raise DataError("the complexity of a shape needs polar axes", f"the axes are {ax.name}", remedy)
    for value in turned(modes.shapes[:, index]):
        ax.plot(
            [0, np.angle(value)], [0, np.abs(value)], color=BLUE, linewidth=1.6, marker="o", markevery=[1], markersize=5
        )
    ax.set_ylim(0, 1.08)
    ax.set_yticks([0.5, 1.0], ["", ""])
    ax.tick_params(labelsize=9, labelcolor=MUTED)
    ax.grid(True, color=PALE, linewidth=0.5)
    ax.spines["polar"].set_color(PALE)
    headline(ax, f"mode {index + 1}: {modes.frequencies[index]:.5g} Hz")
    aside(ax, f"MPC {float(mpc(modes.shapes[:, [index]])[0]):.3f}")
    return ax
