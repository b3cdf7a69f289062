"""Merge the files of one test, runs or setups, into one file."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    add_outputs(parser, "write .uff, .npz, .mat or .h5")


def run(options: argparse.Namespace) -> None:
    """Merge the files of one test by the labels of their channels."""
    from modalscope.cli.output import DATA, check_outputs, require_output, write_data
    from modalscope.cli.reading import read_test
    from modalscope.data import Setups
    from modalscope.preprocess.setups import correlations, merge_setups

    require_output(options, "test.npz")
    check_outputs(options, options.files, DATA)
    data, notes = read_test(options)
    if isinstance(data, Setups):  # no format stores several records: their merged correlation is one
        data = merge_setups(correlations(data))
    written = [write_data(path, data) for path in options.outputs]
    remark(*notes)
    say(*written)
