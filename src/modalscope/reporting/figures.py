"""Draw the pictures of a report as SVG."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from modalscope import plot
from modalscope.checking.certificate import Certificate
from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.response import Response
from modalscope.numerics.checks import RealArray
from modalscope.plot.shapes import has_channels
from modalscope.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(size: tuple[float, float], paint: Callable[[Figure], object]) -> bytes:
    """Return what `paint` draws on a figure of `size` (inches) as SVG; the bytes are reproducible."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(["default", {"svg.hashsalt": "modalscope", "svg.fonttype": "path"}]):
        figure = Figure(figsize=size, layout="constrained")
        paint(figure)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": "modalscope"})
    return buffer.getvalue()


def stabilization_svg(diagram: StabilizationDiagram, modes: ModalModel, spectra: Decomposition | None = None) -> bytes:
    """Draw the stabilization diagram with the selected modes, over the mode indicator or the given spectra."""
    return draw((11.0, 6.6), lambda figure: plot.stabilization(diagram, modes, figure.add_subplot(), spectra=spectra))


def singular_values_svg(singular_values: RealArray, orders: Sequence[int]) -> bytes:
    """Draw the singular values up to three times the largest order."""
    shown = singular_values[: 3 * max(orders, default=20)]
    return draw((7.0, 4.0), lambda figure: plot.singular_values(shown, figure.add_subplot()))


def fit_errors_svg(diagram: StabilizationDiagram) -> bytes:
    """Draw the fit error of every order."""
    return draw((7.0, 4.0), lambda figure: plot.fit_errors(diagram, figure.add_subplot()))


def response_svg(data: Response, modes: ModalModel, output: int, input: int) -> bytes:
    """Draw one channel, measured and rebuilt."""
    heights = [2.2, 1] if data.coherence is None else [2.2, 1, 0.6]

    def paint(figure: Figure) -> None:
        panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        plot.response(data, modes, output, input, tuple(panels))

    return draw((7.0, 4.8 if data.coherence is None else 5.4), paint)


def shape_svg(modes: ModalModel, index: int) -> bytes:
    """Draw one mode shape on the geometry, or as bars if that has none of the channels."""
    drawn = modes if has_channels(modes.geometry, modes.output_dofs) else replace(modes, geometry=None)
    std = (
        drawn.geometry is None and drawn.shapes_std is not None and bool(np.isfinite(drawn.shapes_std[:, index]).all())
    )
    return draw((6.4, 4.0), lambda figure: plot.shape(drawn, index, ax=figure.add_subplot(), std=std))


def intervals_svg(modes: ModalModel, of: str) -> bytes:
    """Draw the 95 % intervals of all modes."""
    return draw((7.0, 4.0), lambda figure: plot.intervals(modes, figure.add_subplot(), of=of))


def certificate_svg(certificate: Certificate, of: str) -> bytes:
    """Draw the simulated deviations of all modes."""
    return draw((7.0, 4.0), lambda figure: plot.certificate(certificate, figure.add_subplot(), of=of))


def mac_svg(modes: ModalModel) -> bytes:
    """Draw the AutoMAC matrix of the modes."""
    side = min(max(3.4, 0.62 * len(modes) + 1.2), 8.0)
    return draw((side + 0.6, side), lambda figure: plot.mac(modes, ax=figure.add_subplot()))
