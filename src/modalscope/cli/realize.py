"""modalscope realize: a state-space model of a test."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_band, add_cell, add_files, add_outputs, add_part
from modalscope.cli.process import explain, remark, say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser("realize", help="identify a state-space model of one order, for control work")
    add_files(parser)
    parser.add_argument("--order", type=int, help="number of states; by default what the data show")
    add_cell(parser)
    add_band(parser)
    add_part(parser)
    add_outputs(parser, "write A, B, C, D as .mat, .npz, .h5 or .json")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Identify a model, write it, and print its poles."""
    from modalscope.cli.output import check_outputs, needed, write_outputs
    from modalscope.cli.reading import parse_delays, read_test
    from modalscope.data.shown import summary_of
    from modalscope.identification.identify import identify

    needed(options, "model.mat")
    check_outputs(options, options.files, (".mat", ".npz", ".h5", ".hdf5", ".json"))
    data, told = read_test(options)
    found = identify(
        data,
        method=options.method,
        domain=options.domain,
        order=options.order,
        band=None if options.band is None else tuple(options.band),
        exclude=options.exclude,
        route=options.route,
        delays=parse_delays(options.delays),
    )
    written = write_outputs(options, found.state_space, "")
    for note in (*told, *found.notes):
        remark(note)
    explain(", ".join(f"{name}={value!r}" for name, value in found.settings.items()))
    say(f"{summary_of(found.state_space)}; fit error {100 * found.fit_error:.3g} %")
    say(found.modes.table())
    for line in written:
        say(line)
