"""modalscope report: a report on what was saved."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from modalscope.cli.parser import Commands, add_memory, add_outputs
from modalscope.cli.process import say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "report",
        help="write a report on a saved result: its analysis is done again on the same data",
        description="Write a report on a saved result (.json), its document (.analysis.json) or a stabilization diagram. A result is made "
        "again from the file of its data, which must not have changed.",
    )
    parser.add_argument("file", type=Path, help="a result that identify wrote as .json, a .analysis.json, or a diagram")
    parser.add_argument("--data", type=Path, nargs="+", metavar="FILE", help="the data, where they lie elsewhere now")
    parser.add_argument("--title", help="heading of the report")
    add_memory(parser)
    add_outputs(parser, "write .html")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Do a saved analysis again, and write its report."""
    from modalscope.cli.output import check_outputs, needed
    from modalscope.cli.process import progress
    from modalscope.io import set_max_memory
    from modalscope.reporting import report

    needed(options, "report.html")
    set_max_memory(options.max_memory)
    check_outputs(options, (options.file, *(options.data or ())), (".html", ".htm"))
    with progress("identifying") as show:
        thing = _saved(options, show)
    for path in options.outputs:
        report(thing, path, title=options.title, command=options.command_line)
        say(f"written: {path}")


def _saved(options: argparse.Namespace, show: Any) -> Any:
    """Return the diagram of a file, or the result of its analysis on the data."""
    from modalscope.data import DataError, StabilizationDiagram
    from modalscope.io import survey
    from modalscope.workflow.replay import replay

    try:
        thing = survey(options.file).thing
    except DataError:
        thing = None  # a document alone is no data: replay says what is wrong with it
    if isinstance(thing, StabilizationDiagram):
        return thing
    return replay(options.file, options.data, progress=show)
