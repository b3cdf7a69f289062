"""modalscope selfcheck: whether this installation gives published numbers again."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "selfcheck",
        help="recompute published tables with this installation",
        description="Recompute the published tables that come with the package, value by value.",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print every published value beside the computed one; what differs is an error."""
    from modalscope.checking.selfcheck import selfcheck
    from modalscope.data import DataError

    found = selfcheck()
    print(found.table())
    wrong = [value for value in found.values if not value.same]
    if wrong:
        raise DataError(
            f"{len(found.values)} published values were recomputed",
            f"{len(wrong)} differ, the first in {wrong[0].table}: {wrong[0].computed:.8g}, not {wrong[0].published:g}",
            "Check the versions of numpy and scipy, and report it.",
        )
