"""Whatever is computed of a measurement knows its file, so that nothing written takes the file's place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope import preprocess
from modalscope.data.channels import check_source
from modalscope.systems import chain5
from tests.support import refused

FILE, OTHER = Path("/data/a.uff"), Path("/data/b.uff")
CHAIN = chain5()
LINES = CHAIN.frequency_response(np.linspace(0.3, 7.5, 200), noise=0.01, seed=0)
RECORD = CHAIN.simulate(samples=1000, sampling_rate=20.0)
AMBIENT = CHAIN.simulate(inputs="ambient", samples=1000, sampling_rate=20.0)
MODES = CHAIN.modes()

#: What is measured, and what is computed of it.
COMPUTED: dict[str, tuple[Any, Callable[[Any], Any]]] = {
    "filtered": (RECORD, lambda data: preprocess.filter_band(data, 1, 5)),
    "frequency response": (RECORD, ms.estimate_frf),
    "local models": (RECORD, lambda data: ms.estimate_frf(data, estimator="lpm")),
    "Markov parameters": (RECORD, lambda data: ms.estimate_markov(data, observer_order=10)),
    "correlation": (AMBIENT, ms.estimate_correlation),
    "half spectra": (AMBIENT, lambda data: preprocess.half_spectra(ms.estimate_correlation(data))),
    "modes of records": (RECORD, lambda data: ms.analyze(data, orders=(4, 8, 10), route="records").modes),
    "modes of correlations": (AMBIENT, lambda data: ms.identify(data, order=10).modes),
    "residues": (LINES, lambda data: ms.fit_residues(data, MODES)),
    "dwell": (LINES, lambda data: ms.tuned_dwell(data).modes),
    "samples": (LINES.select(inputs=[0]), lambda data: data.as_quantity("velocity").band(1, 5)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPUTED)
def test_what_is_computed_of_data_knows_their_file(name: str) -> None:
    data, compute = COMPUTED[name]
    assert compute(replace(data, source_path=FILE)).source_path == FILE
    assert compute(data).source_path is None


@pytest.mark.parametrize(
    ("first", "second", "merge"),
    [
        (LINES.select(inputs=[0]), LINES.select(inputs=[1]), ms.merge),
        (RECORD, RECORD, ms.merge),
        (RECORD, replace(RECORD, outputs=RECORD.outputs[:900], inputs=RECORD.inputs[:900]), ms.merge),  # of other lengths
        (AMBIENT.select(outputs=[0, 1]), AMBIENT.select(outputs=[0, 2, 3]), ms.merge),  # setups
        (
            ms.estimate_correlation(AMBIENT.select(outputs=[0, 1]), references=AMBIENT.output_dofs[:1]),
            ms.estimate_correlation(AMBIENT.select(outputs=[0, 2, 3]), references=AMBIENT.output_dofs[:1]),
            preprocess.merge_setups,
        ),
        (MODES, MODES, lambda parts: ms.merge_bands(parts, [(0.1, 3), (3, 9)])),
    ],
    ids=["inputs", "runs", "runs of other lengths", "setups", "correlations of setups", "bands"],
)  # fmt: skip
def test_what_is_merged_knows_all_files(first: Any, second: Any, merge: Callable[[Any], Any]) -> None:
    parts = [replace(first, source_path=FILE), replace(second, source_path=OTHER)]
    assert merge(parts).source_path == (FILE, OTHER)
    assert merge([parts[0], replace(second, source_path=FILE)]).source_path == FILE


def test_none_of_several_files_is_overwritten(tmp_path: Path) -> None:
    files = [tmp_path / "1.npz", tmp_path / "2.npz"]
    for k, file in enumerate(files):
        ms.write(file, LINES.select(inputs=[k]))
    whole = ms.merge([ms.read(file) for file in files])
    for file in files:
        refused("never overwritten", ms.write, file, whole)
        refused("never overwritten", ms.write, file, ms.fit_residues(whole, MODES))


def test_a_source_is_a_name_or_names() -> None:
    assert check_source(None) is None
    assert check_source(()) is None
    assert check_source("a.npz") == Path("a.npz")
    refused("the name of a file", check_source, 3)
