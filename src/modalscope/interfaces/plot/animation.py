"""Write animated mode shapes as GIF, MP4 or HTML."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.data import DataError, Geometry, ModalModel
from modalscope.data.analysis import VERSION
from modalscope.interfaces.plot._camera import extent, view_of
from modalscope.interfaces.plot._style import (
    BLUE,
    INK,
    MUTED,
    PALE,
    VERMILLION,
    decimals,
    diverging,
    frameless,
    headline,
)
from modalscope.interfaces.plot.shapes import check_mode, has_channels, turned
from modalscope.io.atomic import replacing
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, RealArray, check_count, check_each, check_path, check_positive
from modalscope.numerics.errors import optional_package

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Formats by suffix.
_SUFFIXES = (".gif", ".mp4", ".html")

#: Maximum frames of a period.
_MAX_FRAMES = 1000

#: Size of one shape in inches, and dots per inch.
_SIZE, _DPI = (4.2, 3.4), 100

Paint = Callable[[float], None]


@named()
def animate(
    modes: ModalModel,
    index: int | Iterable[int],
    path: str | Path,
    *,
    geometry: Geometry | None = None,
    scale: float = 0.12,
    seconds: float = 2.0,
    rate: int = 20,
) -> Path:
    """Write an animation of one mode shape, or of several side by side, over one period; complex shapes travel.

    Parameters
    ----------
    modes : ModalModel
        Modes, or operating deflection shapes (`ods`).
    index : int or iterable of int
        Indices of the modes, from zero.
    path : path
        Ends in .gif, .mp4 (needs the extra `video`) or .html (one file).
    geometry : Geometry, optional
        That of the modes by default; without one every channel is a bar.
    scale : float
        Largest displacement as a share of the diagonal of the structure.
    seconds : float
        Duration of one period.
    rate : int
        Frames per second.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    DataError
        An unknown mode, another suffix, or .mp4 without imageio-ffmpeg.
    """
    several = np.iterable(index) and not isinstance(index, str)
    chosen: list[Any] = list(check_each("index", index, "indices of modes") if several else [index])
    for number in chosen:
        check_mode(modes, number)
    target = check_path(path)
    suffix = target.suffix.lower()
    if suffix not in _SUFFIXES or not chosen:
        asked, formats = f"an animation of {len(chosen)} modes in {target.name!r} was asked", ", ".join(_SUFFIXES)
        raise DataError(
            asked, f"it needs a mode, and the formats are {formats}", "Choose a mode and one of these suffixes."
        )
    frames = max(2.0, check_positive("seconds", seconds) * check_count("rate", rate))
    if frames > _MAX_FRAMES:
        asked = f"{seconds:g} s at {rate:g} frames per second were asked"
        raise DataError(asked, f"the maximum is {_MAX_FRAMES} frames", "Lower seconds or rate.")
    figure, paint = _figure(modes, chosen, geometry, check_positive("scale", scale))
    with replacing(
        target, [modes.source_path] if isinstance(modes.source_path, Path) else modes.source_path or ()
    ) as place:
        if suffix == ".html":
            picture = _written(figure, paint, round(frames), rate, ".gif")
            place.write_text(_page(modes, chosen, picture), encoding="utf-8")
        else:
            place.write_bytes(_written(figure, paint, round(frames), rate, suffix))
    return target


def _figure(modes: ModalModel, chosen: list[int], geometry: Geometry | None, scale: float) -> tuple[Figure, Paint]:
    """Return a figure with all shapes, and the function that draws them at a phase."""
    from matplotlib.figure import Figure

    wide = min(len(chosen), 4)
    rows = -(-len(chosen) // wide)
    figure = Figure(figsize=(_SIZE[0] * wide, _SIZE[1] * rows), dpi=_DPI, layout="constrained")
    geometry = modes.geometry if geometry is None else geometry
    parts: list[Paint] = []
    for k, j in enumerate(chosen):
        ax = figure.add_subplot(rows, wide, k + 1)
        shape = turned(modes.shapes[:, j])
        f = f"{modes.frequencies[j]:.{decimals(modes.frequencies)}f} Hz"
        headline(ax, f"{j + 1}: {f}, {100 * modes.damping_ratios[j]:.2f} %" if modes.damping_ratios[j] else f)
        parts.append(
            _structure(ax, geometry, modes, shape, scale)
            if has_channels(geometry, modes.output_dofs)
            else _bars(ax, modes, shape)
        )

    def paint(phase: float) -> None:
        for part in parts:
            part(phase)

    return figure, paint


def _structure(ax: Any, geometry: Geometry, modes: ModalModel, shape: ComplexArray, scale: float) -> Paint:
    from matplotlib.collections import LineCollection

    motion = geometry.displaced(modes.output_dofs, shape)
    motion = motion / (float(np.max(np.linalg.norm(motion, axis=1))) or 1.0)
    view = view_of(geometry.coordinates, np.abs(motion).astype(float))
    upright = np.linalg.svd(motion.real, full_matrices=False)[2][0]
    if view.kind == "line":  # show the motion across the line
        view = type(view)("plane", np.column_stack([view.depth, upright]), np.cross(view.depth, upright))
    reach = scale * extent(geometry.coordinates)
    rest, moved = geometry.coordinates @ view.matrix, reach * motion @ view.matrix
    colours = motion @ upright
    ax.add_collection(LineCollection(list(rest[geometry.lines]), colors=PALE, linewidths=0.9))
    lines = LineCollection([], cmap=diverging(), linewidths=2.2, capstyle="round")
    lines.set_clim(-1, 1)
    ax.add_collection(lines)
    nodes = ax.scatter(
        *rest.T, s=26, c=np.zeros(len(rest)), cmap=diverging(), vmin=-1, vmax=1, edgecolors="white", zorder=4
    )
    far = np.abs(moved).max(axis=0) + 0.04 * extent(geometry.coordinates)
    ax.set_xlim(rest[:, 0].min() - far[0], rest[:, 0].max() + far[0])
    ax.set_ylim(rest[:, 1].min() - far[1], rest[:, 1].max() + far[1])
    ax.set_aspect("equal", adjustable="box")
    ax.set_xticks([])
    ax.set_yticks([])
    frameless(ax)

    def paint(phase: float) -> None:
        turn = np.exp(1j * phase)
        now, signed = rest + (moved * turn).real, (colours * turn).real
        lines.set_segments(list(now[geometry.lines]))
        lines.set_array(signed[geometry.lines].mean(axis=1))
        nodes.set_offsets(now)
        nodes.set_array(signed)

    return paint


def _bars(ax: Any, modes: ModalModel, shape: ComplexArray) -> Paint:
    places = np.arange(shape.size)
    bars = ax.bar(places, shape.real, width=0.72)
    ax.axhline(0, color=INK, linewidth=0.8)
    ax.set_ylim(-1.1, 1.1)
    every = max(1, -(-shape.size // 12))
    ax.set_xticks(
        places[::every], [label[:12].replace("$", r"\$") for label in modes.output_dofs[::every]], rotation=90
    )
    ax.tick_params(labelsize=8, labelcolor=MUTED, length=0)
    frameless(ax)

    def paint(phase: float) -> None:
        values: RealArray = (shape * np.exp(1j * phase)).real
        for bar, value in zip(bars, values, strict=True):
            bar.set_height(value)
            bar.set_color(BLUE if value < 0 else VERMILLION)

    return paint


def _written(figure: Figure, paint: Paint, frames: int, rate: int, suffix: str) -> bytes:
    """Return the frames of one period as a file."""
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    program = "ffmpeg"
    if suffix == ".mp4":
        program = optional_package("an animation as .mp4", "imageio_ffmpeg", "video").get_ffmpeg_exe()
    with TemporaryDirectory() as folder, rc_context({"animation.ffmpeg_path": program}):
        place = Path(folder) / f"a{suffix}"
        writer: Any = (
            PillowWriter(fps=rate)
            if suffix == ".gif"
            else FFMpegWriter(fps=rate, codec="libx264", extra_args=["-pix_fmt", "yuv420p"])
        )
        with writer.saving(figure, str(place), _DPI):
            for k in range(frames):
                paint(2 * np.pi * k / frames)
                writer.grab_frame()
        return place.read_bytes()


def _page(modes: ModalModel, chosen: list[int], picture: bytes) -> str:
    """Return a page with the animation as data."""
    words = ", ".join(f"mode {j + 1} at {modes.frequencies[j]:.5g} Hz" for j in chosen)
    data = base64.b64encode(picture).decode("ascii")
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><meta name="generator" content="modalscope {VERSION}">'
        f"<title>{escape(words)}</title><style>body {{ margin: 2rem }} img {{ max-width: 100% }}</style>"
        f'</head><body><figure><img src="data:image/gif;base64,{data}" alt="{escape(words)}, animated"></figure></body></html>\n'
    )
