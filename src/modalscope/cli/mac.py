"""Pair two sets of modes: differences, MAC and COMAC."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Parser, add_outputs, add_reading
from modalscope.cli.process import say


def add(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("first", type=Path, help="modes: .json, .uff, .npz, .mat or .h5")
    parser.add_argument("second", type=Path, help="modes to compare with")
    tolerance = "maximum relative difference of two frequencies (default: 0.1)"
    parser.add_argument("--tolerance", type=float, default=0.1, help=tolerance)
    add_reading(parser)
    add_outputs(parser, "write the MAC matrix as a picture, .png, .svg or .pdf")


def run(options: argparse.Namespace) -> None:
    """Pair two sets of modes, print the pairs, and draw the MAC matrix if asked."""
    from modalscope.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.cli.reading import read_modes
    from modalscope.modal.pairing import pair_modes
    from modalscope.plot import mac

    check_outputs(options, (options.first, options.second), PICTURES)
    first, second = (read_modes(options, path) for path in (options.first, options.second))
    pairs = pair_modes(first, second, tolerance=options.tolerance)
    say(pairs.table(), *(write_picture(path, mac(pairs.a, pairs.b)) for path in options.outputs))
