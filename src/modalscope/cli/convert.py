"""modalscope convert: one format to another."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Commands, add_force, add_reading
from modalscope.cli.process import remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser("convert", help="read one format, write another")
    parser.add_argument("input", type=Path)
    parser.add_argument("output", type=Path)
    add_reading(parser)
    add_force(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Read one format and write another."""
    from modalscope.cli.output import check_output, write_data
    from modalscope.cli.reading import read_data

    check_output(options.output, (options.input,), options.force)
    data, told = read_data(options, options.input)
    written = write_data(options.output, data)
    for note in told:
        remark(note)
    say(written)
