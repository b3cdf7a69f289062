"""Convert a file to another format."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Parser, add_force, add_reading
from modalscope.cli.process import remark, say


def add(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("input", type=Path, help="file to read")
    parser.add_argument("output", type=Path, help="file to write; its suffix is the format")
    add_reading(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Read one format and write another."""
    from modalscope.cli.output import check_output, write_data
    from modalscope.cli.reading import read_data

    check_output(options.output, (options.input,), options.force)
    data, notes = read_data(options, options.input)
    written = write_data(options.output, data)
    remark(*notes)
    say(written)
