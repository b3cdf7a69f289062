"""modalscope simulate: a test of a known structure."""

from __future__ import annotations

import argparse

from modalscope.cli.parser import Commands, add_output
from modalscope.cli.process import say


def add(commands: Commands) -> None:
    """Add the command to the list."""
    parser = commands.add_parser("simulate", help="write a simulated test of a known structure")
    parser.add_argument("system", help="a structure of the catalog; 'list' prints their names")
    add_output(parser, "file to write")
    parser.add_argument("--kind", default="frf", help="frf, impulse, records or ambient (default: frf)")
    parser.add_argument(
        "--samples", type=int, help="samples or lines (default: 1000 lines, 2000 samples, 20000 of a record)"
    )
    parser.add_argument("--quantity", default="acceleration", help="displacement, velocity or acceleration (default)")
    parser.add_argument("--noise", type=float, metavar="DB", help="signal-to-noise ratio in dB; none by default")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise (default: 0)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write a simulated test of a structure of the catalog, or list them."""
    from modalscope import systems
    from modalscope.cli.output import check_output, write_data
    from modalscope.data import DataError
    from modalscope.systems.listing import trial

    if options.system == "list":
        for name, make in systems.catalog().items():
            say(f"{name:15s} {(make.__doc__ or '').strip().splitlines()[0]}")
        return
    structure = systems.build(options.system)
    if options.output is None:
        raise DataError(
            f"simulating {options.system} was asked",
            "there is no file to write it to",
            "Add -o FILE, for instance -o test.npz.",
        )
    check_output(options.output, (), options.force)
    data = trial(
        structure,
        options.kind,
        samples=options.samples,
        quantity=options.quantity,
        snr_db=options.noise,
        seed=options.seed,
    )
    say(write_data(options.output, data))
