"""modalscope certify: whether the intervals of the modes hold."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_choices, add_file

__all__ = ["add", "run"]


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser(
        "certify",
        help="try the intervals of the modes on simulations of this very case",
        description="Find the modes in a file, simulate that very case, and count how often the intervals hold.",
    )
    add_file(parser)
    parser.add_argument("--method", help="a row of the table (see: modalscope methods)")
    parser.add_argument("--domain", help="time, z or s")
    add_choices(parser)
    parser.add_argument("--replicates", type=int, default=40, metavar="N", help="simulations, 40 by default")
    parser.add_argument("--select", action="store_true", help="replay the selection of modes, too")
    parser.add_argument("--seed", type=int, default=0, help="0 by default: the same seed gives the same numbers")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Find the modes, certify them, and print how far each interval holds."""
    from modalscope.cli.progress import progress
    from modalscope.cli.reading import parse_orders, reading_options
    from modalscope.workflow.analyze import analyze
    from modalscope.workflow.certify import certify
    from modalscope.workflow.replay import replay

    with progress("identifying") as show:
        if options.file.suffix.lower() == ".json":
            result = replay(options.file, progress=show)
        else:
            result = analyze(
                options.file,
                method=options.method,
                domain=options.domain,
                orders=parse_orders(options.orders),
                reading=reading_options(options),
                progress=show,
                band=None if options.band is None else tuple(options.band),
                exclude=options.exclude,
            )
    with progress("simulating") as show:
        found = certify(result, replicates=options.replicates, select=options.select, seed=options.seed, progress=show)
    diagram = result.diagram
    print(f"{diagram.method} ({diagram.domain}), replayed at order {found.order}\n\n{found.table()}")
    for note in found.notes:
        print(f"  {note}")
    print(f"\nwith the intervals that hold:\n\n{found.modes.table()}" if found.notes else "\nall intervals hold")
