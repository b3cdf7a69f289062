"""modalscope info: what a file holds."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_file
from modalscope.cli.process import say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser("info", help="tell what a file holds, what is taken and how good it is")
    add_file(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print what a file holds, what was taken and left, and what is wrong with the data."""
    from modalscope.cli.reading import reading_options
    from modalscope.data import Geometry, ModalModel, StabilizationDiagram, StateSpace
    from modalscope.data.units import si_form
    from modalscope.doctor import examine
    from modalscope.io import survey

    told = survey(options.file, **reading_options(options, options.file))
    say(told)
    data = told.thing
    if isinstance(data, ModalModel):
        say(data.table())
        return
    if isinstance(data, Geometry | StateSpace | StabilizationDiagram):  # nothing was measured
        return
    measured, units = si_form(data)
    for note in units:
        say(f"units: {note}")
    findings = examine(measured)
    say("quality: nothing to report" if not findings else "quality:")
    for finding in findings:
        say(f"  {finding}")
