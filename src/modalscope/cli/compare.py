"""modalscope compare: every method on one file."""

from __future__ import annotations

import argparse
from dataclasses import replace

from modalscope.cli.parser import Commands, add_choices, add_file, add_output
from modalscope.cli.process import say

__all__ = ["add", "run"]


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "compare",
        help="try every method on a file, and say which modes to trust",
        description="Identify a file by every method of the table; say what they agree on, where they differ and why.",
    )
    add_file(parser)
    parser.add_argument(
        "--methods",
        nargs="+",
        default=["all"],
        metavar="METHOD",
        help="rows or cells of the table, such as era alternate/s (default: all)",
    )
    add_choices(parser)
    add_output(parser, "write .json, .csv, .uff (the consensus) or an .html report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Identify a file by many methods, write the comparison where that is asked, and print what they agree on."""
    from modalscope.cli.output import check_output, is_page, write_modes, write_page
    from modalscope.cli.progress import progress
    from modalscope.cli.reading import parse_orders, read_responses
    from modalscope.comparing import compare

    orders = parse_orders(options.orders)
    check_output(options, options.file)
    data, told = read_responses(options, "methods compared")
    with progress("comparing") as show:
        found = compare(
            data,
            "all" if options.methods == ["all"] else options.methods,
            orders=orders,
            band=None if options.band is None else tuple(options.band),
            exclude=options.exclude,
            route=options.route,
            progress=show,
        )
    found = replace(found, notes=(*told, *found.notes))
    written = None
    if options.output is not None and is_page(options.output):
        written = write_page(options, found)
    elif options.output is not None:
        written = write_modes(options, found.modes, method="consensus", domain="all", orders=orders or ())
    for line in (*told, found.table(), *([written] if written else [])):
        say(line)
