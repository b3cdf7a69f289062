"""Print the contents of a file, how they are interpreted, and their quality."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser, add_file
from modalscope.cli.process import say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_file(parser)


def run(options: argparse.Namespace) -> None:
    """Print the contents of a file, what was read and skipped, and the findings about the data."""
    from modalscope.cli.reading import reading_options
    from modalscope.data import Geometry, ModalModel, StabilizationDiagram, StateSpace
    from modalscope.data.units import si_form
    from modalscope.doctor import examine
    from modalscope.io import survey

    contents = survey(options.file, **reading_options(options, options.file))
    say(contents)
    data = contents.thing
    if isinstance(data, ModalModel):
        say(data.table())
        return
    if isinstance(data, Geometry | StateSpace | StabilizationDiagram):  # not measured
        return
    measured, units = si_form(data)
    findings = examine(measured)
    say(*(f"units: {note}" for note in units), "quality:" if findings else "quality: no data problem found")
    say(*(f"  {finding}" for finding in findings))
