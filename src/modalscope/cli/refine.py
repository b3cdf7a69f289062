"""Refine modes to the maximum of the likelihood, with standard deviations."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Parser, add_choices, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    parser.add_argument("--modes", type=Path, required=True, help="modes to start from: .json, .npz, .mat or .h5")
    add_choices(parser)
    complete = "add poles that are significant in the residual, where it is white"
    parser.add_argument("--complete", action="store_true", help=complete)
    add_outputs(parser, "write .json, .csv, .uff, .npz, .mat or .h5")


def run(options: argparse.Namespace) -> None:
    """Refine modes on the data they were identified from, write them, and print the changes."""
    from modalscope.cli.output import check_outputs, write_outputs
    from modalscope.cli.reading import choices, read_modes, read_test
    from modalscope.identification.refine import refine
    from modalscope.modal.pairing import pair_modes

    check_outputs(options, (*options.files, options.modes))
    data, notes = read_test(options)
    modes = read_modes(options, options.modes)
    refined = refine(data, modes, complete=options.complete, settings=choices(options))
    written = write_outputs(options, refined, method="refined")
    remark(*dict.fromkeys((*notes, *refined.notes)))
    say(refined.table(), "", "before (a) and after (b):", pair_modes(modes, refined).table(), *written)
