"""Identify a file by every method, and report which modes to trust.

All methods of the table are run; the output states where they agree, where they differ, and the likely causes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from modalscope.cli.parser import Parser, add_choices, add_files, add_orders, add_outputs
from modalscope.cli.process import remark, say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    methods = "rows or cells of the table, such as era alternate/s (default: all)"
    parser.add_argument("--methods", nargs="+", default=["all"], metavar="METHOD", help=methods)
    add_orders(parser)
    add_choices(parser)
    replicates = "certify the intervals by this many simulations (see certify)"
    parser.add_argument("--replicates", type=int, default=0, metavar="N", help=replicates)
    add_outputs(parser, "write .json, .csv, .uff (the consensus) or an .html report")


def run(options: argparse.Namespace) -> None:
    """Identify a file by many methods, write the outputs and print the comparison."""
    from modalscope.cli.output import check_outputs, write_outputs
    from modalscope.cli.process import progress
    from modalscope.cli.reading import choices, parse_orders, read_test
    from modalscope.comparing import compare

    orders = parse_orders(options.orders)
    check_outputs(options, options.files)
    data, notes = read_test(options)
    with progress("comparing") as show:
        comparison = compare(
            data,
            "all" if options.methods == ["all"] else options.methods,
            orders=orders,
            progress=show,
            replicates=options.replicates,
            **choices(options),
        )
    comparison = replace(comparison, notes=(*notes, *comparison.notes))
    written = write_outputs(options, comparison, method="consensus", domain="all", orders=orders or ())
    remark(*notes)
    hint = () if options.verbose or options.quiet else ("\n-v prints the values of every method",)
    say(comparison.table(each=options.verbose), *hint, *written)
