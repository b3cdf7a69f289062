"""modalscope compare: every method on one file."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Commands, add_choices, add_file

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
    parser.add_argument("-o", "--output", type=Path, help="write .json, .csv, .uff (the consensus) or an .html report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Identify a file by many methods, print what they agree on, and write the comparison where that is asked."""
    from modalscope.cli.output import check_output, is_page, write_modes, write_page
    from modalscope.cli.progress import progress
    from modalscope.cli.reading import parse_orders, read_responses
    from modalscope.comparing import compare

    orders = parse_orders(options.orders)
    check_output(options.output)
    data = read_responses(options, "methods compared")
    with progress("comparing") as show:
        found = compare(
            data,
            "all" if options.methods == ["all"] else options.methods,
            orders=orders,
            band=None if options.band is None else tuple(options.band),
            exclude=options.exclude,
            progress=show,
        )
    print(found.table())
    if options.output is None:
        return
    if is_page(options.output):
        write_page(options, found)
    else:
        write_modes(options, found.modes, method="consensus", domain="all", orders=orders or ())
