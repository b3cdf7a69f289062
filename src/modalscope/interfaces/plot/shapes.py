"""Describe mode shapes, on the geometry or as bars, at rest or at a phase of their motion."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from modalscope.data import Geometry, ModalModel
from modalscope.data.geometry import parse_dof
from modalscope.data.indicators import mpc
from modalscope.interfaces.plot._camera import AXES, View, extent, oblique, view_of
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
    axis_of_names,
    bars,
    level,
    plain,
    ranges,
    remark,
    strokes,
)
from modalscope.io.geometry import neighbour_lines
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, IntArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.orthonormal import most_real
from modalscope.selection.judging.description import described

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Maximum number of drawn lines, faces or nodes, and of bars; more are thinned.
_MAX_DRAWN, _MAX_BARS = 20_000, 2000

#: Ends of the axis of bars, of which the largest has length 1.
_BAR_ENDS = (-1.12, 1.12)

#: Largest displacement as a share of the size of the structure.
_AMPLITUDE = 0.14

#: What tones tell.
TONES = ("sign", "size")

#: Inks of motion along x, y and z.
_MOTIONS = ("blue", "vermillion", "green")

#: Maximum number of channel names below bars, of nodes joined by lines between neighbours, and width of the paper, hundredths of an inch.
_MAX_LABELS, _MAX_JOINED, _WIDTH = 30, 2000, 900


def thinned(geometry: Geometry, measured: Array) -> tuple[IntArray, IntArray, BoolArray]:
    """Return a regular subset of the lines and faces of a geometry, and the mask of drawn nodes."""
    lines, faces = (each[spaced(len(each))] for each in (geometry.lines, geometry.faces))
    nodes = np.flatnonzero(measured)
    shown = np.zeros_like(measured)
    shown[nodes[spaced(len(nodes))]] = True
    return lines, faces, shown


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
    phi = most_real(shapes)
    size = np.max(np.abs(phi), axis=0, initial=0.0)
    scaled: ComplexArray = phi / np.where(size > 0, size, 1.0)
    return scaled


def in_phase(shape: Array) -> RealArray:
    """Return the real part of a rotated shape (`turned`), its largest component 1."""
    real = turned(np.asarray(shape, dtype=np.complex128)).real
    largest = real[np.argmax(np.abs(real))] if real.size else 0.0
    return real / largest if largest else real


@named(modes=ModalModel, tones=TONES)
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
    tones: str = "sign",
    dark: bool = False,
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
    tones : {"sign", "size"}
        What colours tell on a geometry: one way and the other, or how far a point moves.
    dark : bool
        On dark ground.

    Raises
    ------
    DataError
        An unknown mode, a geometry with none of the channels, or standard deviations that are not known.
    """
    check_mode(modes, index)
    angles = {name: v for name, v in (("azimuth", azimuth), ("elevation", elevation)) if v is not None}
    view = oblique(**angles) if angles else None
    size = tones == "size"
    return painted(shape_picture(modes, index, geometry, scale=scale, view=view, std=std, size=size), ax, dark=dark)


def shape_picture(
    modes: ModalModel,
    index: int,
    geometry: Geometry | None = None,
    *,
    scale: float = _AMPLITUDE,
    view: View | None = None,
    std: bool = False,
    phase: float | None = None,
    size: bool = False,
) -> Picture:
    """Return a mode shape on the geometry, that of the modes by default, or as bars.

    `std`: bars with one standard deviation. `phase`: of the motion; by default the real part is drawn. `size`: tones tell how far a point
    moves, without its sign.
    """
    if len(modes.output_dofs) == 1:
        return remark("One output was measured: a shape of one number says nothing.")
    if std and modes.shapes_std is None:
        asked = "bars with intervals need standard deviations of shapes"
        raise DataError(asked, "these modes have none", "Refine them: ms.refine(data, modes).")
    geometry = None if std else modes.geometry if geometry is None else geometry
    complex_shape = turned(modes.shapes[:, index])
    values = in_phase(modes.shapes[:, index]) if phase is None else (complex_shape * np.exp(1j * phase)).real
    if geometry is None:
        panel = _bars(modes, index, values, std=std)
    else:
        joined = with_lines(geometry)
        motion = joined.displaced(modes.output_dofs, values)
        largest = np.abs(joined.displaced(modes.output_dofs, complex_shape)) if phase is not None else motion
        seen = view or view_of(joined.coordinates, np.asarray(largest, dtype=float))
        measured = measured_nodes(joined, modes.output_dofs)
        moving = _over_length if seen.kind == "line" else _wireframe
        panel = moving(joined, motion, np.asarray(largest, dtype=float), measured, seen, scale, size)
    title, aside = _head(modes, index)
    return Picture([replace(panel, title=title, aside=aside)], f"Shape of mode {index + 1}", (_WIDTH, 600))


def mode_title(modes: ModalModel, index: int) -> str:
    """Return the number of a mode, its frequency and its damping, with their 95 % intervals where they are known."""
    told = described(modes)[index]
    sides = ((told.frequency, told.frequency_half, "Hz"), (told.damping, told.damping_half, "%"))
    parts = [f"{value} {unit}" if half == "-" else f"{value} ± {half} {unit}" for value, half, unit in sides]
    return f"mode {index + 1}: {', '.join(parts[: 2 if modes.damping_ratios[index] else 1])}"


def with_lines(geometry: Geometry) -> Geometry:
    """Return a geometry with lines, those between neighbouring nodes where it has neither lines nor faces."""
    if geometry.lines.size or geometry.faces.size or len(geometry.nodes) > _MAX_JOINED:
        return geometry
    pairs = np.array(neighbour_lines(geometry.coordinates), dtype=int).reshape(-1, 2)
    return replace(geometry, lines=np.asarray(geometry.nodes)[pairs])


def has_channels(geometry: Geometry | None, labels: tuple[str, ...]) -> TypeGuard[Geometry]:
    """Return whether there is a geometry, and one of the channels moves it."""
    return geometry is not None and any(geometry.motion_of(label) for label in labels)


def check_mode(modes: ModalModel, index: int) -> None:
    """Raise if there is no mode of that index."""
    check_count("index", index, least=0)
    if index >= len(modes):
        asked, count = f"the shape of mode index {index}:", f"there are {len(modes)} modes, counted from zero"
        raise DataError(asked, count, "Choose a lower index.")


def measured_nodes(geometry: Geometry, labels: tuple[str, ...]) -> Array:
    """Return the mask of nodes that a channel moves; without any a shape cannot be drawn."""
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


def _bars(modes: ModalModel, index: int, values: RealArray, *, std: bool) -> Panel:
    """Return a bar for every channel, in the order of the structure."""
    order = in_order(modes.output_dofs)
    order = order[spaced(len(order), _MAX_BARS)]
    heights, places = values[order], np.arange(len(order))
    across = axis_of_names("", [plain(modes.output_dofs[k], 14) for k in order], _MAX_LABELS)
    items = [*bars(places, heights), level(across, 0.0, "ink")]
    if std and modes.shapes_std is not None:
        spread = modes.shapes_std[order, index] / (float(np.max(np.abs(modes.shapes[:, index]))) or 1.0)
        low, high = (np.clip(ends, *_BAR_ENDS) for ends in (heights - spread, heights + spread))
        items += ranges(places, low, high, "ink")
    label = "shape (largest 1)" + (", ± 1 deviation" if std else "")
    return Panel(across, Axis(label, *_BAR_ENDS), items)


def _over_length(
    geometry: Geometry, motion: RealArray, largest: RealArray, measured: Array, view: View, scale: float, size: bool
) -> Panel:
    """Return displacement over position, with the axes exchanged for an upright structure."""
    position = geometry.coordinates @ view.matrix[:, 0]
    order = np.argsort(position, kind="stable")
    nodes, along = order[measured[order]], position[order]
    moves = np.max(np.abs(largest), axis=0)
    moving = np.flatnonzero(moves > 1e-6 * float(np.max(moves, initial=0.0)))
    upright = view.names[0] == "z"

    def placed(x: Array, y: Array) -> tuple[Array, Array]:
        return (y, x) if upright else (x, y)

    x, y = placed(along, np.zeros(order.size))
    items: list[Item] = [Line(x, y, "pale", width=2.0)]
    for axis in moving:
        x, y = placed(position[nodes], motion[nodes, axis])
        foot = np.column_stack(placed(position[nodes], np.zeros(nodes.size)))
        items.append(strokes(np.stack([foot, np.column_stack((x, y))], axis=1), _MOTIONS[axis], 0.6))
        items.append(Line(x, y, _MOTIONS[axis], AXES[axis] if moving.size > 1 else "", 1.7, mark="circle"))
    directions = ", ".join(AXES[axis] for axis in moving) or "no direction"
    length, across = axis_of(f"position along {view.names[0]}", [along]), f"motion in {directions} (largest 1)"
    sides = length, Axis(across, -1.2, 1.2)
    return Panel(sides[1], sides[0], items) if upright else Panel(sides[0], sides[1], items)


def _wireframe(
    geometry: Geometry, motion: RealArray, largest: RealArray, measured: Array, view: View, scale: float, size: bool
) -> Panel:
    """Return the structure at rest in grey and displaced, with tones from one way over none to the other."""
    rest, far = geometry.coordinates @ view.matrix, extent(geometry.coordinates)
    most = float(np.max(np.linalg.norm(largest, axis=1))) or 1.0
    moved = (geometry.coordinates + motion * (scale * far / most)) @ view.matrix
    # sign and size of the motion along the direction of the largest motion
    along = np.linalg.svd(largest, full_matrices=False)[2][0]
    sign = np.sign((largest @ along)[np.argmax(np.abs(largest @ along))]) or 1.0
    signed = np.linalg.norm(motion, axis=1) / most if size else sign * (motion @ along) / most
    lines, faces, shown = thinned(geometry, measured)
    live = lines[measured[lines].any(axis=1)]
    faces = faces[np.argsort((geometry.coordinates @ view.depth)[faces].mean(axis=1), kind="stable")]
    items: list[Item] = [
        Areas(moved[faces], strength=0.6, tones=signed[faces].mean(axis=1)),
        strokes(rest[lines], width=0.9),
        strokes(np.stack([rest[shown], moved[shown]], axis=1), dashed=True),
        strokes(moved[live], width=2.0, tones=signed[live]),
        Marks(rest[shown, 0], rest[shown, 1], "pale", "dot", size=0.4),
        Marks(moved[shown, 0], moved[shown, 1], tones=signed[shown]),
    ]
    low, high = rest.min(axis=0), rest.max(axis=0)
    reach = np.abs(largest @ view.matrix).max(axis=0) * scale * far / most + 0.05 * far
    foot = low - reach
    across = Axis("", low[0] - reach[0] - 0.02 * far, high[0] + reach[0], named=())
    upward = Axis("", foot[1], high[1] + reach[1], named=())
    return Panel(across, upward, [*items, *triad(view, foot, far)], equal=True, bare=True)


def triad(view: View, foot: Array, far: float) -> list[Item]:
    """Return the directions of x, y and z in the lower left corner."""
    seen = [k for k, end in enumerate(view.matrix) if np.linalg.norm(end) > 0.05]
    corner, tips = foot + 0.05 * far, view.matrix[seen]
    names = corner + 0.08 * far * tips * (1 + 0.25 / np.linalg.norm(tips, axis=1))[:, None]
    arrows = np.stack([np.broadcast_to(corner, tips.shape), corner + 0.08 * far * tips], axis=1)
    return [strokes(arrows, "muted", 1.0), Words(names[:, 0], names[:, 1], [AXES[k] for k in seen], "muted")]


@named(modes=ModalModel)
def complexity(modes: ModalModel, index: int, ax: Axes | None = None) -> Axes:
    """Draw the components of one shape in the complex plane; on a line they are in phase or in opposition.

    Parameters
    ----------
    modes : ModalModel
    index : int
        Index of the mode, from zero.
    ax : Axes, optional
        A new figure by default.

    Raises
    ------
    DataError
        An unknown mode.
    """
    check_mode(modes, index)
    return painted(complexity_picture(modes, index), ax)


def complexity_picture(modes: ModalModel, index: int) -> Picture:
    """Return the components of a shape in the complex plane, turned to the smallest imaginary parts, the largest of length 1."""
    phi, ring = turned(modes.shapes[:, index]), np.exp(2j * np.pi * np.linspace(0, 1, 181))
    ends = np.stack([np.zeros_like(phi), phi], axis=1)
    items: list[Item] = [Line(r * ring.real, r * ring.imag, "pale", width=0.7) for r in (0.5, 1.0)]
    items += [strokes(np.stack([ends.real, ends.imag], axis=-1), "blue", 1.5), Marks(phi.real, phi.imag)]
    title, aside = _head(modes, index)
    across, upward = Axis("real part", -1.1, 1.1), Axis("imaginary part", -1.1, 1.1)
    panel = Panel(across, upward, items, title, aside, equal=True, grid=False)
    return Picture([panel], f"Components of mode {index + 1} in the complex plane", (640, 640))


def _head(modes: ModalModel, index: int) -> tuple[str, str]:
    """Return the title of a mode, and its MPC as a remark."""
    return mode_title(modes, index), f"MPC {float(mpc(modes.shapes[:, [index]])[0]):.3f}"
