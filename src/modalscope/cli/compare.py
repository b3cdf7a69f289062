"""modalscope compare: every method on one file."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from modalscope.cli.parser import Commands, add_choices, add_files, add_outputs
from modalscope.cli.process import remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "compare",
        help="try every method on a file, and say which modes to trust",
        description="Identify a file by every method of the table; say what they agree on, where they differ and why.",
    )
    add_files(parser)
    parser.add_argument(
        "--methods",
        nargs="+",
        default=["all"],
        metavar="METHOD",
        help="rows or cells of the table, such as era alternate/s (default: all)",
    )
    add_choices(parser)
    parser.add_argument(
        "--replicates",
        type=int,
        default=0,
        metavar="N",
        help="certify the intervals by so many simulations (see certify)",
    )
    add_outputs(parser, "write .json, .csv, .uff (the consensus) or an .html report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Identify a file by many methods, write the comparison where that is asked, and print what they agree on."""
    from modalscope.cli.output import check_outputs, write_outputs
    from modalscope.cli.process import progress
    from modalscope.cli.reading import parse_delays, parse_orders, read_test
    from modalscope.comparing import compare

    orders = parse_orders(options.orders)
    check_outputs(options, options.files)
    data, told = read_test(options)
    with progress("comparing") as show:
        found = compare(
            data,
            "all" if options.methods == ["all"] else options.methods,
            orders=orders,
            band=None if options.band is None else tuple(options.band),
            exclude=options.exclude,
            route=options.route,
            delays=parse_delays(options.delays),
            progress=show,
            replicates=options.replicates,
        )
    found = replace(found, notes=(*told, *found.notes))
    beside: dict[str, Any] = {"method": "consensus", "domain": "all", "orders": orders or ()}
    written = write_outputs(options, found, ", ".join(map(str, options.files)), **beside)
    for note in told:
        remark(note)
    hint = () if options.verbose or options.quiet else ("\nwhat every method says of every mode: -v",)
    for line in (found.table(each=options.verbose), *hint, *written):
        say(line)
