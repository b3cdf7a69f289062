"""Recompute published tables with this installation, value by value."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser


def add(parser: Parser) -> None:
    """Add no argument."""


def run(options: argparse.Namespace) -> None:
    """Print every published value with the computed one; a difference is an error."""
    from modalscope.checking.selfcheck import selfcheck
    from modalscope.data import DataError

    check = selfcheck()
    print(check.table())
    wrong = [value for value in check.values if not value.same]
    if wrong:
        first = f"the first in {wrong[0].table}: {wrong[0].computed:.8g}, not {wrong[0].published:g}"
        asked, differences = f"{len(check.values)} published values were recomputed", f"{len(wrong)} differ, {first}"
        raise DataError(asked, differences, "Check the versions of numpy and scipy, and report the difference.")
