"""Identify a state-space model of one order, for control design."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Parser, add_choices, add_files, add_method, add_outputs
from modalscope.cli.process import explain, remark, say


def add(parser: Parser) -> None:
    """Add the arguments."""
    add_files(parser)
    parser.add_argument("--order", type=int, help="number of states (default: chosen by the data)")
    add_method(parser)
    add_choices(parser)
    add_outputs(parser, "write A, B, C, D as .mat, .npz, .h5 or .json")


def run(options: argparse.Namespace) -> None:
    """Identify a model, write it, and print its poles."""
    from modalscope.cli.output import check_outputs, require_output, write_outputs
    from modalscope.cli.reading import choices, read_test
    from modalscope.data.shown import summary_of
    from modalscope.identification.identify import identify

    require_output(options, "model.mat")
    check_outputs(options, options.files, (".mat", ".npz", ".h5", ".hdf5", ".json"))
    data, notes = read_test(options)
    identified = identify(data, method=options.method, domain=options.domain, order=options.order, **choices(options))
    written = write_outputs(options, identified.state_space, data={"file": ""})
    remark(*notes, *identified.notes)
    explain(", ".join(f"{name}={value!r}" for name, value in identified.settings.items()))
    say(
        f"{summary_of(identified.state_space)}; fit error {100 * identified.fit_error:.3g} %",
        identified.modes.table(),
        *written,
    )
