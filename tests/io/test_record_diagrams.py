"""A diagram of records on lines keeps its records, whatever their runs: the modes are the same when it is read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.record_spectra import RecordSpectra


@pytest.fixture(scope="module")
def diagram() -> ms.StabilizationDiagram:
    chain = ms.systems.chain5()
    runs = [chain.simulate(samples=n, sampling_rate=20.0, noise=0.02, seed=n) for n in (900, 1100)]
    return ms.stabilize(runs, orders=range(2, 21, 2))


@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_a_diagram_of_records_is_read_as_it_was_written(
    tmp_path: Path, diagram: ms.StabilizationDiagram, suffix: str
) -> None:
    path = tmp_path / f"records{suffix}"
    ms.write(path, diagram)
    again = ms.read(path)
    assert isinstance(again.response, RecordSpectra)
    assert again.response.durations == (45.0, 55.0)
    assert again.response.output_dofs == diagram.response.output_dofs
    assert dict(again.settings.items()) == dict(diagram.settings.items())
    assert np.array_equal(ms.select(again).frequencies, ms.select(diagram).frequencies)
