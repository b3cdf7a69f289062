"""A reader of a vendor's files and a method of its own, for modalscope."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import modalscope as ms


def read(path: Path) -> ms.Signals:
    """Return the record of a file: a line with the rate, then a line a sample."""
    rate, *rows = path.read_text().split("\n")
    values = np.array([[float(cell) for cell in row.split()] for row in rows if row])
    return ms.Signals(outputs=values, sampling_rate=float(rate), source_path=path)


#: The row `era` in time under another name, with sixteen block rows.
SHORT_ERA = replace(
    ms.methods("era")[0],
    name="short-era",
    common="ERA with 16 block rows",
    known_as=(),
    aliases=("vendor-era",),
    fixed={"block_rows": 16},
)
