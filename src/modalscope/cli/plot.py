"""modalscope plot: a picture of what a file holds."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Commands, add_band, add_file, add_outputs
from modalscope.cli.process import remark, say

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "plot",
        help="draw what a file holds: responses, spectra, mode shapes, a stabilization diagram",
        description="Draw what a file holds: a response with the modes of another file over it, spectra of records, the shape of one "
        "mode, or a stabilization diagram.",
    )
    add_file(parser)
    parser.add_argument("--modes", type=Path, metavar="FILE", help="modes to draw over a response or a diagram")
    add_band(parser)
    parser.add_argument("--mode", type=int, default=1, metavar="K", help="which mode's shape, counted from one (1)")
    parser.add_argument("--channel", metavar="DOF", help="output to draw; by default the strongest")
    parser.add_argument("--input", metavar="DOF", help="input to draw; by default the strongest")
    add_outputs(parser, "write .png, .svg or .pdf")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Draw what a file holds."""
    from modalscope.cli.output import PICTURES, check_outputs, needed, write_picture
    from modalscope.cli.reading import read_data, read_modes

    needed(options, "picture.png")
    sources = [path for path in (options.file, options.modes) if path is not None]
    check_outputs(options, sources, PICTURES)
    thing, told = read_data(options, options.file)
    over = None if options.modes is None else read_modes(options, options.modes)
    written = [write_picture(path, _picture(thing, over, options)) for path in options.outputs]
    for note in told:
        remark(note)
    for line in written:
        say(line)


def _picture(thing: Any, over: Any, options: argparse.Namespace) -> Axes:
    from modalscope import plot
    from modalscope.data import DataError, ModalModel, Signals, StabilizationDiagram
    from modalscope.data.response import Response
    from modalscope.preprocess import decomposition

    if isinstance(thing, ModalModel):
        return plot.shape(thing, options.mode - 1)
    if isinstance(thing, StabilizationDiagram):
        return plot.stabilization(thing, over)
    if isinstance(thing, Response):
        band = None if options.band is None else tuple(options.band)
        return plot.response(thing.in_band(band), over, options.channel, options.input)
    if isinstance(thing, Signals):
        return plot.spectra(decomposition(thing))
    raise DataError(
        f"a picture of {options.file} was asked",
        f"it holds {type(thing).__name__}",
        "Give responses, records, modes or a stabilization diagram.",
    )
