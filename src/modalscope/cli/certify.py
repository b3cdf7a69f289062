"""modalscope certify: whether the intervals of the modes hold."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from modalscope.cli.parser import Commands, add_choices, add_file, add_output
from modalscope.cli.process import say

if TYPE_CHECKING:
    from modalscope.model.result import Result

__all__ = ["add", "run"]


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "certify",
        help="try the intervals of the modes on simulations of this very case",
        description="Find the modes in a file, simulate that very case, and count how often the intervals hold.",
    )
    add_file(parser)
    parser.add_argument("--method", help="a row of the table (see: modalscope methods)")
    parser.add_argument("--domain", help="time, z or s")
    add_choices(parser)
    parser.add_argument("--no-refine", dest="refine", action="store_false", help="certify the values of the diagram")
    parser.add_argument("--replicates", type=int, default=40, metavar="N", help="simulations, 40 by default")
    parser.add_argument("--select", action="store_true", help="replay the selection of modes, too")
    parser.add_argument("--seed", type=int, default=0, help="0 by default: the same seed gives the same numbers")
    add_output(parser, "write the modes with intervals that hold (.json, .csv, .uff), or an .html report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Find the modes, certify them, write them where that is asked, and print how far each interval holds."""
    from modalscope.cli.output import check_output, is_page, write_page, write_result
    from modalscope.cli.progress import progress
    from modalscope.workflow.certify import certify

    check_output(options, options.file)
    with progress("identifying") as show:
        result = _result(options, show)
    with progress("simulating") as show:
        found = certify(result, replicates=options.replicates, select=options.select, seed=options.seed, progress=show)
    written = None
    if options.output is not None and is_page(options.output):
        written = write_page(options, result, certificate=found)
    elif options.output is not None:
        written = write_result(options, replace(result, modes=found.modes))
    diagram = result.diagram
    say(f"{diagram.method} ({diagram.domain}), replayed at order {found.order}\n\n{found.table()}")
    for note in found.notes:
        say(f"  {note}")
    say(f"\nwith the intervals that hold:\n\n{found.modes.table()}" if found.notes else "\nall intervals hold")
    if written:
        say(written)


def _result(options: argparse.Namespace, show: Any) -> Result:
    """Return the result of an analysis done again, or of data."""
    from modalscope.cli.reading import parse_orders, reading_options
    from modalscope.workflow.analyze import analyze
    from modalscope.workflow.replay import replay

    if options.file.suffix.lower() == ".json":
        return replay(options.file, progress=show)
    return analyze(
        options.file,
        method=options.method,
        domain=options.domain,
        orders=parse_orders(options.orders),
        reading=reading_options(options),
        progress=show,
        band=None if options.band is None else tuple(options.band),
        exclude=options.exclude,
        route=options.route,
        refine=options.refine,
    )
