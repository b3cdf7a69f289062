"""Write a report on a saved result; its analysis is repeated on the same data.

The result is a .json file of identify, an .analysis.json document or a stabilization diagram. The data file must be unchanged.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from modalscope.cli.parser import Parser, add_geometry, add_outputs
from modalscope.cli.process import say


def add(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("file", type=Path, help="a result of identify (.json), an .analysis.json, or a diagram")
    parser.add_argument("--data", type=Path, nargs="+", metavar="FILE", help="the data files, if they were moved")
    parser.add_argument("--title", help="heading of the report")
    add_geometry(parser)
    add_outputs(parser, "write .html")


def run(options: argparse.Namespace) -> None:
    """Repeat a saved analysis, and write its report."""
    from modalscope.cli.output import check_outputs, require_output
    from modalscope.cli.process import progress
    from modalscope.io import set_max_memory
    from modalscope.reporting import report

    require_output(options, "report.html")
    set_max_memory(options.max_memory)
    check_outputs(options, (options.file, *(options.data or ())), (".html", ".htm"))
    with progress("identifying") as show:
        result = _saved(options, show)
    for path in options.outputs:
        report(result, path, title=options.title, command=options.command_line)
        say(f"written: {path}")


def _saved(options: argparse.Namespace, show: Any) -> Any:
    """Return the diagram of a file, or the result of its analysis on the data."""
    from modalscope.data import DataError, StabilizationDiagram
    from modalscope.io import survey
    from modalscope.workflow.replay import replay

    try:
        saved = survey(options.file).thing
    except DataError:
        saved = None  # a document alone contains no data: the error of `replay` says so
    return saved if isinstance(saved, StabilizationDiagram) else replay(options.file, options.data, progress=show)
