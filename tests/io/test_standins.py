"""Small files of the kinds that strangers' files and bug reports showed (shared data): each is read as its truth says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.sources import opened
from tests.support import DATA, measured, refused, stored_list

pytestmark = pytest.mark.skipif(not (DATA / "standins").is_dir(), reason="the stand-ins are not there")

#: What each is by its truth: rows, outputs, inputs, and the rate of a record. A dead force, a start of 16 ms and first lines a million
#: times the rest are left out.
RECORDS = {
    "camera_stack": (900, 20, 0, 100.0), "dead_force": (5000, 1, 0, 1000.0), "dead_tail": (12000, 2, 0, 100.0),
    "decay_multiples": (10000, 1, 0, 1000.0), "drive_voltage": (2048, 1, 1, 512.0), "knet_ew": (6003, 1, 0, 100.0),
    "knet_txt": (6003, 1, 0, 100.0), "late_start": (11400, 3, 0, 100.0), "line_by_line": (400, 9, 0, 85.0),
    "lvm_slow_channels": (20000, 2, 0, 1000.0), "matlab_objects": (20000, 3, 1, 1000.0), "one_frame_lost": (900, 2, 0, 90.0),
    "quoted_rows": (500, 1, 0, 100.0), "repeated_hits": (24000, 1, 1, 12000.0), "sine_input": (1000, 1, 1, 1.0),
    "slow_extras": (2048, 2, 1, 512.0), "start_glitch": (19968, 6, 0, 2000.0), "stray_cells_csv": (4000, 3, 0, 67.6),
    "tdms_late_channel": (29838, 3, 0, 50.0), "two_counters": (1200, 2, 0, 28.88), "two_poles": (1000, 1, 1, 1.0),
    "uff58_uneven_double": (6000, 1, 0, 20.0), "velocity_decay": (20000, 1, 0, 1000.0), "walking": (10080, 9, 0, 1 / 0.0028),
    "weak_hit": (96000, 1, 1, 48000.0), "wrapped_txt_other": (9599, 1, 0, 40.0),
}  # fmt: skip
LINES = {
    "analyser_mat": (801, 3, 1), "headless_lines": (2995, 1, 5), "lines_missing": (1598, 1, 3), "listed_units": (401, 2, 1),
    "names_of_responses": (401, 3, 1), "responses_below_each_other": (401, 2, 1), "units_between_names": (801, 3, 1),
    "weak_first_points": (4400, 5, 1),
}  # fmt: skip
#: Those whose files say no rate, and are asked for it.
ASKED = {"camera_stack": 100.0, "quoted_rows": 100.0}
#: Modes that are not found: no noise, and one shape for all three outputs.
MISSING = {"matlab_objects": [41.0]}


def _files(name: str) -> tuple[list[Path], dict[str, Any]]:
    truth = json.loads(measured("standins", name, "truth.json").read_text())
    return [measured("standins", name, file) for file in truth["files"]], truth


def _read(name: str) -> Any:
    if name == "tdms_late_channel":
        pytest.importorskip("nptdms")
    files, _ = _files(name)
    if name in ASKED:
        refused("sampling_rate=HZ", opened, files, {})
        return opened(files, {"sampling_rate": ASKED[name]})[0]
    return opened(files if len(files) > 1 else files[0], {})[0]


def test_every_folder_is_judged() -> None:
    assert {path.name for path in (DATA / "standins").iterdir() if path.is_dir()} == {*RECORDS, *LINES, "analyser_text"}


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDS)
def test_a_record_is_read_as_its_truth_says(name: str) -> None:
    rows, outputs, inputs, rate = RECORDS[name]
    found = _read(name)
    assert isinstance(found, ms.Signals)
    assert (len(found.output_dofs), len(found.input_dofs)) == (outputs, inputs)
    if rate:
        assert (found.samples, found.sampling_rate) == (rows, pytest.approx(rate, rel=1e-4))


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_responses_are_read_as_their_truth_says(name: str) -> None:
    found = _read(name)
    assert isinstance(found, ms.FrequencyResponse)
    assert found.values.shape == LINES[name]


def test_a_sensor_that_was_left_in_volts_is_named_with_two_ways_out() -> None:
    files, _ = _files("analyser_text")
    refused(r"(?s)others not: M12 .*units={.*quantity='acceleration'", opened, files, {})
    assert opened(files, {"quantity": "acceleration"})[0].quantity == "acceleration"


@pytest.mark.parametrize("name", [*RECORDS, *LINES])
def test_the_modes_of_its_truth_are_in_its_list(name: str) -> None:
    """In the list that stands: that it is the one found is held by `tests/test_results.py`, and of a few by `make results`."""
    _, truth = _files(name)
    found = np.array(stored_list(f"standins, {name}").get("f", ()))
    for frequency, zeta in truth.get("modes") or ():
        if frequency in MISSING.get(name, ()) or zeta > 0.05:  # a mode that dies within the first samples
            continue
        width = max(4 * zeta * frequency, 0.02 * frequency)
        assert np.min(np.abs(found - frequency), initial=np.inf) <= width


@pytest.mark.slow
def test_the_mode_of_a_list_that_differs_from_processor_to_processor_is_found() -> None:
    """`make results` alone holds such a list."""
    (file,), truth = _files("decay_multiples")
    ((frequency, _),) = truth["modes"]
    assert np.min(np.abs(ms.analyze(file).modes.frequencies - frequency)) < 0.02 * frequency
