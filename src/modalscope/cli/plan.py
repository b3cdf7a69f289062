"""modalscope plan: what a diagram will take before it starts."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_cell, add_choices, add_files
from modalscope.cli.process import say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "plan",
        help="tell what a diagram will take: the matrix, how it is factored, time and memory",
        description="Tell what the stabilization diagram of a file will take before it starts: nothing of its size is made.",
    )
    add_files(parser)
    add_cell(parser)
    add_choices(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the matrix, the ways of factoring it with time and memory, and which is taken."""
    from modalscope.cli.reading import parse_delays, parse_orders, read_test
    from modalscope.identification.plan import plan

    data, _ = read_test(options)
    way = {"band": options.band, "route": options.route, "exclude": options.exclude}
    way["delays"] = parse_delays(options.delays)
    say(str(plan(data, method=options.method, domain=options.domain, orders=parse_orders(options.orders), **way)))
