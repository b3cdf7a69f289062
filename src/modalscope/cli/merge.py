"""modalscope merge: the files of one test in one file."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser("merge", help="put the files of one test, runs or setups, into one file")
    add_files(parser)
    add_outputs(parser, "write .uff, .npz, .mat or .h5")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Merge the files of one test by the labels of their channels."""
    from modalscope.cli.output import DATA, check_outputs, needed, write_data
    from modalscope.cli.reading import read_test
    from modalscope.data import Setups
    from modalscope.preprocess.setups import correlations, merge_setups

    needed(options, "test.npz")
    check_outputs(options, options.files, DATA)
    data, told = read_test(options)
    if isinstance(data, Setups):  # no format holds several records: their correlation is one
        data = merge_setups(correlations(data))
    written = [write_data(path, data) for path in options.outputs]
    for note in told:
        remark(note)
    for line in written:
        say(line)
