"""Columns of a table that are read as a free decay, from its release on."""

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5

DECAY = chain5().free_decay(400, displacement=[1, 0, 0.5, 0, -1])


def written(folder: Path, *before: str) -> Path:
    """A table with 40 rows of rest before the release, and more columns before the decay."""
    values = np.vstack([np.zeros((40, 4)), DECAY.values[:, :, 0]])
    times = np.arange(len(values)) / DECAY.sampling_rate
    names = ",".join(["t [s]", *before, *(f"d{k} [mm]" for k in range(1, 5))])
    held = np.column_stack([times, *(0 * times for _ in before), 1000 * values])
    np.savetxt(folder / "decay.csv", held, delimiter=",", header=names, comments="", fmt="%.17g")
    return folder / "decay.csv"


def test_it_begins_with_the_first_row_that_is_taken(tmp_path):
    found = ms.read(written(tmp_path), rows="41-", columns="time=1,decay=2-")
    assert isinstance(found, ms.ImpulseResponse)
    assert (found.kind, found.input_dofs, found.quantity) == ("free decay", ("start",), "displacement")
    assert found.output_dofs == ("d1", "d2", "d3", "d4")
    np.testing.assert_allclose(found.in_si().values, DECAY.values, rtol=1e-12, atol=1e-15)
    modes = ms.identify(found, order=10).modes
    np.testing.assert_allclose(modes.frequencies, chain5().modes().frequencies, rtol=1e-6)


def test_columns_that_are_not_named_are_left(tmp_path):
    found = ms.read(written(tmp_path, "F [N]"), rows="41-", columns="time=1,decay=3-4")
    assert found.output_dofs == ("d1", "d2")


def test_a_force_is_refused(tmp_path):
    path = written(tmp_path, "F [N]")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    table[10:14, 1] = (2.0, 9.0, 4.0, 0.3)  # a hit, gone in row 14
    np.savetxt(path, table, delimiter=",", header="t [s],F [N],d1 [mm],d2 [mm],d3 [mm],d4 [mm]", comments="")
    with pytest.raises(ms.DataError, match=r"(?s)F would be a force.*rows='14-', columns='time=1,decay=3-6'"):
        ms.read(path, columns="time=1,in=2,decay=3-")
    assert ms.read(path, rows="14-", columns="time=1,decay=3-6").kind == "free decay"
