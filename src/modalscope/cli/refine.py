"""modalscope refine: known modes to the maximum of the likelihood."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Commands, add_band, add_files, add_outputs, add_part
from modalscope.cli.process import remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "refine", help="refine modes to the maximum of the likelihood, with the deviations of each"
    )
    add_files(parser)
    parser.add_argument("--modes", type=Path, required=True, help="modes to start from: .json, .npz, .mat or .h5")
    add_band(parser)
    add_part(parser)
    parser.add_argument(
        "--complete", action="store_true", help="add poles that stand out of what is left, where it is white"
    )
    add_outputs(parser, "write .json, .csv, .uff, .npz, .mat or .h5")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Refine modes on the data they were found in, write them, and print how far they moved."""
    from modalscope.cli.output import check_outputs, write_outputs
    from modalscope.cli.reading import parse_delays, read_modes, read_test
    from modalscope.identification.refine import refine
    from modalscope.modal.pairing import pair_modes

    check_outputs(options, (*options.files, options.modes))
    data, told = read_test(options)
    modes = read_modes(options, options.modes)
    settings = {name: getattr(options, name) for name in ("band", "route", "exclude")}
    settings["delays"] = parse_delays(options.delays)
    found = refine(data, modes, complete=options.complete, settings=settings)
    written = write_outputs(options, found, ", ".join(map(str, options.files)), method="refined")
    for note in dict.fromkeys((*told, *found.notes)):
        remark(note)
    for line in (found.table(), "", "before (a) and after (b):", pair_modes(modes, found).table(), *written):
        say(line)
