"""Write a simulated test of a known structure."""

from __future__ import annotations

import argparse
from pathlib import Path

from modalscope.cli.parser import Parser, add_force
from modalscope.cli.process import say


def add(parser: Parser) -> None:
    """Add the arguments."""
    parser.add_argument("system", help="a structure of the catalog; 'list' prints the catalog")
    parser.add_argument("-o", "--output", type=Path, help="file to write")
    add_force(parser)
    parser.add_argument("--kind", default="frf", help="frf, impulse, records or ambient (default: frf)")
    samples = "samples or lines (default: 1000 lines, 2000 samples, 20000 samples of a record)"
    parser.add_argument("--samples", type=int, help=samples)
    parser.add_argument("--quantity", default="acceleration", help="displacement, velocity or acceleration (default)")
    parser.add_argument("--noise", type=float, metavar="DB", help="signal-to-noise ratio in dB (default: no noise)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise (default: 0)")


def run(options: argparse.Namespace) -> None:
    """Write a simulated test of a structure of the catalog, or print the catalog."""
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
        raise DataError(f"simulating {options.system} was asked", "no output file was given", "Add -o test.npz.")
    check_output(options.output, (), options.force)
    size = {"samples": options.samples, "quantity": options.quantity}
    data = trial(structure, options.kind, **size, snr_db=options.noise, seed=options.seed)
    say(write_data(options.output, data))
