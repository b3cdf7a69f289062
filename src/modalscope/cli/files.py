"""Commands on files: info, convert, simulate; and the table of methods."""

from __future__ import annotations

import argparse
from typing import Any

from modalscope.cli.reading import left_out, read_data, reading_options
from modalscope.model.checks import (
    DataError,
    check_choice,
    check_count,
)

__all__ = ["KINDS", "convert", "info", "methods", "simulate"]

#: What `simulate` can write.
KINDS = ("frf", "impulse", "records", "ambient")


def info(options: argparse.Namespace) -> None:
    """Print what a file holds, what was taken and left, and what is wrong with the data."""
    from modalscope.io import survey
    from modalscope.model import Geometry, ModalModel, StabilizationDiagram
    from modalscope.preprocess import examine

    told = survey(options.file, **reading_options(options))
    print(told)
    data = told.thing
    if isinstance(data, ModalModel):
        print(data.table())
        return
    if isinstance(data, Geometry | StabilizationDiagram):  # nothing was measured
        return
    findings = examine(data)
    print("quality: nothing to report" if not findings else "quality:")
    for finding in findings:
        print(f"  {finding}")


def convert(options: argparse.Namespace) -> None:
    """Read one format and write another."""
    from modalscope.io import describe, write

    data = read_data(options, options.input)
    write(options.output, data)
    print(f"written: {options.output}, {describe(data)}{left_out(options.output, data)}")


def methods(_: argparse.Namespace) -> None:
    """Print the table of methods."""
    from modalscope.identification.table import methods as table

    rows = [("method", "domain", "realization", "report", "known as")]
    rows += [(m.name, m.domain, m.realization, m.section, "; ".join(m.known_as)) for m in table()]
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    for row in rows:
        print("  ".join([*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4]]).rstrip())


def simulate(options: argparse.Namespace) -> None:
    """Write a simulated test of a structure of the catalog, or list them."""
    from modalscope import systems
    from modalscope.io import describe, write

    if options.system == "list":
        for name, make in systems.catalog().items():
            print(f"{name:15s} {(make.__doc__ or '').strip().splitlines()[0]}")
        return
    structure = systems.build(options.system)
    if options.output is None:
        raise DataError(
            f"simulating {options.system} was asked",
            "there is no file to write it to",
            "Add -o FILE, for instance -o test.npz.",
        )
    data = _simulated(structure, options)
    write(options.output, data)
    print(f"written: {options.output}, {describe(data)}")


def _simulated(structure: Any, options: argparse.Namespace) -> Any:
    """Return a simulated test whose band and rate hold all modes of the structure."""
    import numpy as np

    check_choice("kind", options.kind, KINDS)
    if options.samples is not None:
        check_count("--samples", options.samples, least=2)
    f = structure.modes().frequencies
    # a fraction of each channel's root mean square
    noise = None if options.noise is None else 10 ** (-options.noise / 20)
    if options.kind == "frf":
        lines = np.linspace(f.min() / 4, 1.25 * f.max(), options.samples or 1000)
        return structure.frequency_response(lines, quantity=options.quantity, noise=noise, seed=options.seed)
    rate = max(1 / structure.dt if structure.dt else 0.0, 2.56 * f.max())
    if options.kind == "impulse":
        samples = options.samples or 2000
        return structure.impulse_response(
            samples, sampling_rate=rate, quantity=options.quantity, noise=noise, seed=options.seed
        )
    return structure.simulate(
        inputs="ambient" if options.kind == "ambient" else "white",
        samples=options.samples or 20_000,
        sampling_rate=rate,
        quantity=options.quantity,
        noise=noise or 0.0,
        seed=options.seed,
    )
