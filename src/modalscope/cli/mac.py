"""modalscope mac: two sets of modes beside each other."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Commands, add_outputs, add_reading
from modalscope.cli.process import say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "mac", help="pair two sets of modes: differences, MAC and COMAC", description="Pair two sets of modes."
    )
    parser.add_argument("first", type=Path, help="modes: .json, .uff, .npz, .mat or .h5")
    parser.add_argument("second", type=Path, help="modes to compare with")
    parser.add_argument(
        "--tolerance", type=float, default=0.1, help="largest relative distance of two frequencies (default: 0.1)"
    )
    add_reading(parser)
    add_outputs(parser, "write the matrix as a picture, .png, .svg or .pdf")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Pair two sets of modes, print the pairs, and draw the matrix where that is asked."""
    from modalscope.cli.output import PICTURES, check_outputs, write_picture
    from modalscope.cli.reading import read_modes
    from modalscope.modal.pairing import pair_modes
    from modalscope.plot import mac

    check_outputs(options, (options.first, options.second), PICTURES)
    pairs = pair_modes(
        *(read_modes(options, path) for path in (options.first, options.second)), tolerance=options.tolerance
    )
    written = [write_picture(path, mac(pairs.a, pairs.b)) for path in options.outputs]
    for line in (pairs.table(), *written):
        say(line)
