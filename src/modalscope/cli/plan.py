"""Estimate the cost of a stabilization diagram: matrix, factorization, time and memory.

Nothing of the size of the data matrix is computed.
"""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser, add_choices, add_files, add_method, add_orders
from modalscope.cli.process import say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    add_method(parser)
    add_orders(parser)
    add_choices(parser)


def run(options: argparse.Namespace) -> None:
    """Print the matrix, the factorizations with time and memory, and which one is used."""
    from modalscope.cli.reading import choices, parse_orders, read_test
    from modalscope.identification.plan import plan

    data, _ = read_test(options)
    orders = parse_orders(options.orders)
    say(plan(data, method=options.method, domain=options.domain, orders=orders, **choices(options)))
