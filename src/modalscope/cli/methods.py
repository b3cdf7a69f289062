"""Print the table of methods."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser


def add(parser: Parser) -> None:
    """Add no argument."""


def run(_: argparse.Namespace) -> None:
    """Print the table of methods."""
    from modalscope.data.shown import text_table
    from modalscope.identification.table import methods

    rows = [("name", "method", "domain", "realization", "report", "known as")]
    rows += [(m.common, m.name, m.domain, m.realization, m.section, "; ".join(m.known_as)) for m in methods()]
    print(text_table(rows, left=range(6)))
