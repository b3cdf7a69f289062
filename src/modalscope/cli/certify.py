"""Check the intervals of the modes by simulations of the same case.

The modes of a file are identified, the same case is simulated repeatedly, and the coverage of each interval is counted.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from modalscope.cli.parser import Parser, add_choices, add_files, add_method, add_orders, add_outputs
from modalscope.cli.process import say

if TYPE_CHECKING:
    from modalscope.data.results import Result


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    add_method(parser)
    add_orders(parser)
    add_choices(parser, bands=True)
    parser.add_argument("--no-refine", dest="refine", action="store_false", help="certify the values of the diagram")
    parser.add_argument("--replicates", type=int, default=40, metavar="N", help="number of simulations (default: 40)")
    parser.add_argument("--select", action="store_true", help="repeat the selection of modes in each simulation")
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulations (default: 0)")
    add_outputs(parser, "write the modes with corrected intervals (.json, .csv, .uff), or an .html report")
    parser.set_defaults(frequencies=None, take=None, refuse=None, apart=False)


def run(options: argparse.Namespace) -> None:
    """Identify the modes, certify their intervals, write the outputs and print the coverage."""
    from modalscope.checking.certify import certify
    from modalscope.cli.output import check_outputs, write_outputs
    from modalscope.cli.process import progress

    check_outputs(options, options.files)
    result = _result(options)
    with progress("simulating") as show:
        certificate = certify(
            result, replicates=options.replicates, select=options.select, seed=options.seed, progress=show
        )
    written = write_outputs(options, replace(result, modes=certificate.modes), certificate=certificate)
    diagram = result.diagram
    say(f"{diagram.method} ({diagram.domain}), simulated at order {certificate.order}\n\n{certificate.table()}")
    say(*(f"  {note}" for note in certificate.notes))
    passed = bool(certificate.holds.all())
    say("\nall intervals hold" if passed else f"\nwith corrected intervals:\n\n{certificate.modes.table()}", *written)


def _result(options: argparse.Namespace) -> Result:
    """Return the result of a saved analysis, repeated, or of data."""
    from modalscope.cli.identify import result_of
    from modalscope.cli.process import progress
    from modalscope.workflow.replay import replay

    if options.files[0].suffix.lower() != ".json":
        return result_of(options, options.files)
    with progress("identifying") as show:
        return replay(options.files[0], progress=show)
