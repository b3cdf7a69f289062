"""modalscope certify: whether the intervals of the modes hold."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from modalscope.cli.parser import Commands, add_cell, add_choices, add_files, add_outputs
from modalscope.cli.process import say

if TYPE_CHECKING:
    from modalscope.data.results import Result


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "certify",
        help="try the intervals of the modes on simulations of this very case",
        description="Find the modes in a file, simulate that very case, and count how often the intervals hold.",
    )
    add_files(parser)
    add_cell(parser)
    add_choices(parser, bands=True)
    parser.add_argument("--no-refine", dest="refine", action="store_false", help="certify the values of the diagram")
    parser.add_argument("--replicates", type=int, default=40, metavar="N", help="simulations, 40 by default")
    parser.add_argument("--select", action="store_true", help="replay the selection of modes, too")
    parser.add_argument("--seed", type=int, default=0, help="0 by default: the same seed gives the same numbers")
    add_outputs(parser, "write the modes with intervals that hold (.json, .csv, .uff), or an .html report")
    parser.set_defaults(run=run, frequencies=None, take=None, refuse=None, apart=False)


def run(options: argparse.Namespace) -> None:
    """Find the modes, certify them, write them where that is asked, and print how far each interval holds."""
    from modalscope.checking.certify import certify
    from modalscope.cli.output import check_outputs, write_outputs
    from modalscope.cli.process import progress

    check_outputs(options, options.files)
    result = _result(options)
    with progress("simulating") as show:
        found = certify(result, replicates=options.replicates, select=options.select, seed=options.seed, progress=show)
    source = ", ".join(map(str, options.files))
    written = write_outputs(options, replace(result, modes=found.modes), source, certificate=found)
    diagram = result.diagram
    say(f"{diagram.method} ({diagram.domain}), replayed at order {found.order}\n\n{found.table()}")
    for note in found.notes:
        say(f"  {note}")
    passed = bool(found.holds.all())
    say("\nall intervals hold" if passed else f"\nwith the intervals that hold:\n\n{found.modes.table()}")
    for line in written:
        say(line)


def _result(options: argparse.Namespace) -> Result:
    """Return the result of an analysis done again, or of data."""
    from modalscope.cli.identify import found_in
    from modalscope.cli.process import progress
    from modalscope.workflow.replay import replay

    if options.files[0].suffix.lower() != ".json":
        return found_in(options, options.files)
    with progress("identifying") as show:
        return replay(options.files[0], progress=show)
