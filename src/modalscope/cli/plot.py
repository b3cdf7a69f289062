"""Draw the contents of a file: responses, spectra, mode shapes, a stabilization diagram.

A response is drawn with the modes of another file over it, records by their spectra, modes by the shape of one of them.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Parser, add_band, add_file, add_outputs
from modalscope.cli.process import remark, say

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_file(parser)
    parser.add_argument("--modes", type=Path, metavar="FILE", help="modes to draw over a response or a diagram")
    add_band(parser)
    parser.add_argument("--mode", type=int, default=1, metavar="K", help="number of the mode, from one (default: 1)")
    parser.add_argument("--channel", metavar="DOF", help="output to draw (default: the strongest)")
    parser.add_argument("--input", metavar="DOF", help="input to draw (default: the strongest)")
    add_outputs(parser, "write .png, .svg or .pdf")


def run(options: argparse.Namespace) -> None:
    """Draw the contents of a file."""
    from modalscope.cli.output import PICTURES, check_outputs, require_output, write_picture
    from modalscope.cli.reading import read_data, read_modes

    require_output(options, "picture.png")
    check_outputs(options, [path for path in (options.file, options.modes) if path is not None], PICTURES)
    data, notes = read_data(options, options.file)
    modes = None if options.modes is None else read_modes(options, options.modes)
    written = [write_picture(path, _picture(data, modes, options)) for path in options.outputs]
    remark(*notes)
    say(*written)


def _picture(data: Any, modes: Any, options: argparse.Namespace) -> Axes:
    from modalscope import plot
    from modalscope.data import DataError, ModalModel, Signals, StabilizationDiagram
    from modalscope.data.response import Response
    from modalscope.preprocess import decomposition

    if isinstance(data, ModalModel):
        return plot.shape(data, options.mode - 1)
    if isinstance(data, StabilizationDiagram):
        return plot.stabilization(data, modes)
    if isinstance(data, Response):
        band = None if options.band is None else tuple(options.band)
        return plot.response(data.in_band(band), modes, options.channel, options.input)
    if isinstance(data, Signals):
        return plot.spectra(decomposition(data))
    asked, contents = f"a picture of {options.file} was asked", f"it holds {type(data).__name__}"
    raise DataError(asked, contents, "Give responses, records, modes or a stabilization diagram.")
