"""Write animated mode shapes as GIF or MP4."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.data import DataError, Geometry, ModalModel
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import INKS
from modalscope.interfaces.plot.shapes import TONES, check_mode, has_channels, shape_picture
from modalscope.io.atomic import replacing
from modalscope.io.formats import sources_of
from modalscope.numerics.arguments import COUNT, POSITIVE, named
from modalscope.numerics.checks import check_each, check_path
from modalscope.numerics.errors import optional_package

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Formats by suffix.
_SUFFIXES = (".gif", ".mp4")

#: Maximum frames of a period.
_MAX_FRAMES = 1000

#: Width of a film in inches, the share of it that a shape is high, dots per inch, and shapes side by side.
_WIDE, _HIGH, _DPI, _BESIDE = 12.0, 0.62, 100, 4

Paint = Callable[[float], None]


@named(modes=ModalModel, scale=POSITIVE, seconds=POSITIVE, rate=COUNT, tones=TONES)
def animate(
    modes: ModalModel,
    index: int | Iterable[int],
    path: str | Path,
    *,
    geometry: Geometry | None = None,
    scale: float = 0.12,
    seconds: float = 2.0,
    rate: int = 20,
    tones: str = "sign",
    dark: bool = False,
) -> Path:
    """Write an animation of one mode shape, or of several side by side, over one period; complex shapes travel.

    Parameters
    ----------
    modes : ModalModel
        Modes, or operating deflection shapes (`ods`).
    index : int or iterable of int
        Indices of the modes, from zero.
    path : path
        Ends in .gif, or .mp4 (needs the extra `video`).
    geometry : Geometry, optional
        That of the modes by default; without one every channel is a bar.
    scale : float
        Largest displacement as a share of the diagonal of the structure.
    seconds : float
        Duration of one period.
    rate : int
        Frames per second.
    tones : {"sign", "size"}
        What colours tell on a geometry: one way and the other, or how far a point moves.
    dark : bool
        On dark ground.

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
        asked = f"an animation of {len(chosen)} modes in {target.name!r}:"
        needs = f"it needs a mode, and the formats are {', '.join(_SUFFIXES)}"
        raise DataError(asked, needs, "Choose a mode and one of these suffixes.")
    frames = max(2.0, seconds * rate)
    if frames > _MAX_FRAMES:
        asked = f"{seconds:g} s at {rate:g} frames per second:"
        raise DataError(asked, f"the maximum is {_MAX_FRAMES} frames", "Lower seconds or rate.")
    figure, paint = _figure(modes, chosen, geometry, scale, size=tones == "size", dark=dark)
    with replacing(target, sources_of(modes)) as place:
        place.write_bytes(_written(figure, paint, round(frames), rate, suffix))
    return target


def _figure(
    modes: ModalModel, chosen: list[int], geometry: Geometry | None, scale: float, *, size: bool, dark: bool
) -> tuple[Figure, Paint]:
    """Return a figure with all shapes, and the function that draws them at a phase."""
    from matplotlib.figure import Figure

    wide = min(len(chosen), _BESIDE)
    rows = -(-len(chosen) // wide)
    inches = (_WIDE, _HIGH * _WIDE / wide * rows)
    figure = Figure(figsize=inches, dpi=_DPI, layout="constrained", facecolor=INKS["paper"][dark])
    places = [figure.add_subplot(rows, wide, k + 1) for k in range(len(chosen))]
    geometry = modes.geometry if geometry is None else geometry
    placed = geometry if has_channels(geometry, modes.output_dofs) else None

    def paint(phase: float) -> None:
        for ax, index in zip(places, chosen, strict=True):
            ax.clear()
            own = replace(modes, geometry=placed)
            painted(shape_picture(own, index, scale=scale, phase=phase, size=size), ax, dark=dark)

    return figure, paint


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
        film: dict[str, Any] = {"codec": "libx264", "extra_args": ["-pix_fmt", "yuv420p"]}
        writer: Any = PillowWriter(fps=rate) if suffix == ".gif" else FFMpegWriter(fps=rate, **film)
        with writer.saving(figure, str(place), _DPI):
            for k in range(frames):
                paint(2 * np.pi * k / frames)
                writer.grab_frame()
        return place.read_bytes()
