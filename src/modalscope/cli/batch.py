"""modalscope identify --each: many tests of one structure, and one table of their modes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from modalscope.cli.identify import found_in
from modalscope.cli.output import check_output
from modalscope.cli.process import complain, remark, say
from modalscope.cli.reading import read_modes
from modalscope.io import write
from modalscope.modal.pairing import pair_modes
from modalscope.model import DataError, ModalModel
from modalscope.model.checks import RealArray

__all__ = ["run_each", "table_of"]


def run_each(options: argparse.Namespace) -> None:
    """Identify every file by itself; print the modes of all, paired with those of the first that has any.

    An output names the files to write: `-o results.json` gives results_NAME.json for every NAME. A file that cannot be used is
    named, and the others are done all the same.
    """
    reference = None if options.reference is None else read_modes(options, options.reference)
    places = {
        path: [out.with_name(f"{out.stem}_{path.stem}{out.suffix}") for out in options.outputs]
        for path in options.files
    }
    written = [place for each in places.values() for place in each]
    for place in written:
        check_output(place, options.files, options.force)
        if written.count(place) > 1:
            raise DataError(
                f"a file for each of {len(places)} tests was asked",
                f"{place.name} would be that of several",
                "Give the tests names of their own, or identify them one by one.",
            )
    found: list[tuple[str, ModalModel]] = []
    failed = []
    for path in options.files:
        try:
            result = found_in(options, [path])
        except DataError as error:
            complain(f"{path}: {error}")
            failed.append(path)
            continue
        for place in places[path]:
            write(place, result)
            remark(f"written: {place}")
        found.append((path.name, result.modes))
    if found:
        say(table_of(found, reference))
    if failed:
        raise DataError(
            f"modes in {len(options.files)} files were asked",
            f"{len(failed)} of them cannot be used: {', '.join(path.name for path in failed)}",
            "What is wrong with each stands above.",
        )


def table_of(found: Sequence[tuple[str, ModalModel]], reference: ModalModel | None = None) -> str:
    """Return frequencies and damping ratios of several tests, a column a test, a row a mode of the reference.

    Parameters
    ----------
    found : sequence of (name, ModalModel)
    reference : ModalModel, optional
        By default the first test that has modes.
    """
    first = next((modes for _, modes in found if len(modes)), None) if reference is None else reference
    if first is None:
        return "no mode stands out of any file"
    columns, others = [], []
    frequencies = np.full((len(found), len(first)), np.nan)
    for k, (name, modes) in enumerate(found):
        cells = [name, *["-"] * len(first)]
        pairs = pair_modes(first, modes)
        for i, j in zip(pairs.first, pairs.second, strict=True):
            cells[i + 1] = f"{modes.frequencies[j]:.4f} Hz {100 * modes.damping_ratios[j]:.3f} %"
        frequencies[k, pairs.first] = modes.frequencies[pairs.second]
        columns.append(cells)
        alone = ", ".join(f"{f:.4f} Hz" for f in modes.frequencies[pairs.alone[1]])
        others += [f"only in {name}: {alone}"] if alone else []
    if reference is not None:
        own = [f"{f:.4f} Hz {100 * z:.3f} %" for f, z in zip(first.frequencies, first.damping_ratios, strict=True)]
        columns.insert(0, ["reference", *own])
    columns.insert(0, ["mode", *(str(i + 1) for i in range(len(first)))])
    widths = [max(map(len, column)) for column in columns]
    rows = ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in zip(*columns, strict=True)]
    scatter = [_scatter(f[np.isfinite(f)]) for f in frequencies.T]
    rows = [rows[0] + "   scatter of f", *(f"{row}   {text}" for row, text in zip(rows[1:], scatter, strict=True))]
    return "\n".join([*rows, *others])


def _scatter(f: RealArray) -> str:
    return f"{100 * f.std(ddof=1) / f.mean():.3f} %" if f.size > 1 else "-"
