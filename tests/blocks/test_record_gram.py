"""Products of the columns of records on lines, without the columns: those of the columns themselves."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.blocks.records import RunColumns, record_lines
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from tests.blocks.test_record_lines import runs_of
from tests.support import random_system


@pytest.mark.parametrize("domain", ["z", "s"])
@pytest.mark.parametrize("band", [None, (0.1, 0.2)])
@pytest.mark.parametrize("degree", [2, 9])
def test_sums_over_few_points_are_those_over_all_lines(
    domain: str, band: tuple[float, float] | None, degree: int
) -> None:
    """Two runs, an input that only one of them has: to rounding, of columns brought to length one."""
    rng = np.random.default_rng(degree)
    ss = random_system(rng, outputs=3, inputs=2, modes=3)
    records, _ = runs_of(ss, "white", rng, (3000, 2400))
    spectra = record_spectra(records, band)
    matrix = record_lines(spectra if domain == "z" else spectra.continuous(), domain=domain, block_rows=degree)
    for own in matrix.spans:
        columns = RunColumns(matrix, own)
        found = columns.gram()
        assert found is not None
        each = np.concatenate([rows for _, rows in columns.rows()])
        size = np.linalg.norm(each, axis=0)
        assert np.allclose(found / np.outer(size, size), (each / size).T @ (each / size), rtol=0, atol=1e-11)


def test_few_lines_are_left_to_their_columns() -> None:
    rng = np.random.default_rng(0)
    records, _ = runs_of(random_system(rng, outputs=3, inputs=1, modes=2), "white", rng, (120,))
    matrix = record_lines(record_spectra(Records(runs=records.runs)), domain="z", block_rows=8)
    assert RunColumns(matrix, matrix.spans[0]).gram() is None
