"""The stages of one analysis, in this process: what is told while it runs, what is kept, and what can be asked of it."""

from __future__ import annotations

import json
import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.workflow.sources import source_of_file
from modalscope.data import DataError
from modalscope.data.analysis import Analysis
from modalscope.interfaces.app.reading import read_so_far, watched
from modalscope.interfaces.app.steps import Stages, result_head
from modalscope.interfaces.app.worker import TASKS, against, compared_pictures, compared_view, error_parts
from tests.interfaces.app.server import until
from tests.support import refused

CHAIN = ms.systems.chain5()

#: Data of every kind that the page takes, and orders that are enough for each.
KINDS: dict[str, tuple[Any, tuple[int, ...]]] = {
    "lines": (
        CHAIN.frequency_response([0.2 + 0.04 * k for k in range(195)], noise=0.02, seed=0),
        tuple(range(2, 15, 2)),
    ),
    "samples": (CHAIN.impulse_response(300, noise=0.01, seed=0), tuple(range(2, 15, 2))),
    "records": (CHAIN.simulate(samples=600, sampling_rate=20.0), (8, 10, 12)),
    "ambient": (CHAIN.simulate(inputs="ambient", samples=4000, sampling_rate=20.0), tuple(range(8, 21, 4))),
}


def document_of(data: Any, folder: Path, **choices: Any) -> Analysis:
    path = folder / "data.npz"
    ms.write(path, data)
    return Analysis(files=(source_of_file(path, {}),), **choices)


class Run:
    """Stages, and what they told."""

    def __init__(self) -> None:
        self.told: list[tuple[str, Any]] = []
        self.stages = Stages(lambda kind, payload: self.told.append((kind, payload)))

    def run(self, document: Analysis, kept: bytes | None = None) -> None:
        self.told.clear()
        self.stages.run(document, kept, lambda: None)

    def names(self, kind: str) -> list[str]:
        return [
            payload[0] if isinstance(payload, tuple) else payload.get("stage", "")
            for k, payload in self.told
            if k == kind
        ]

    def head(self, name: str) -> Any:
        blob = next(payload[1] for kind, payload in reversed(self.told) if kind == "blob" and payload[0] == name)
        return json.loads(blob[4 : 4 + int.from_bytes(blob[:4], "little")])


def ran(kind: str, folder: Path, **choices: Any) -> Run:
    """Return what ran through on data of a kind."""
    data, orders = KINDS[kind]
    run = Run()
    run.run(document_of(data, folder, orders=orders, **choices))
    return run


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return a finished run, for tests that only ask it."""
    return ran("lines", tmp_path_factory.mktemp("finished"))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_data_is_shown_and_gives_the_modes_of_replay(kind: str, tmp_path: Path) -> None:
    data, orders = KINDS[kind]
    document = document_of(data, tmp_path, orders=orders)
    run = Run()
    run.run(document)
    again = ms.replay(document)
    assert [m["frequency"] for m in run.head("modes")["modes"]] == list(again.modes.frequencies)
    cuts = [payload for k, payload in run.told if k == "cut"]
    assert [cut["order"] for cut in cuts] == list(again.diagram.orders)
    shown = [(f, z) for cut in cuts for f, z in zip(cut["frequency"], cut["damping"], strict=True)]
    assert shown == list(zip(again.diagram.frequencies, again.diagram.damping_ratios, strict=True))
    assert run.head("overview")["span"][1] > 7
    assert run.head("poles")["orders"] == list(again.diagram.orders)
    assert TASKS["channel"](run.stages, None, 0, 0)[:4] != b""
    assert "ms.analyze(" in result_head(run.stages.finished())["script"]


def test_a_choice_by_hand_sweeps_nothing_again_and_a_new_process_starts_from_what_is_kept(tmp_path: Path) -> None:
    data, orders = KINDS["lines"]
    document = document_of(data, tmp_path, orders=orders)
    run = Run()
    run.run(document)
    assert run.names("stage") == ["reading", "examining", "factoring", "selecting", "refining"]
    kept = next(payload for kind, payload in run.told if kind == "keep")
    first = run.stages.finished().modes.frequencies
    chosen = Analysis(files=document.files, orders=orders, refused=(float(first[0]),))
    run.run(chosen)
    assert run.names("stage") == ["selecting", "refining"]
    other = Run()
    other.run(chosen, kept[1])
    assert other.names("stage") == ["reading", "examining", "selecting", "refining"]
    assert (other.stages.finished().modes.poles == run.stages.finished().modes.poles).all()
    assert len(pickle.loads(kept[1])) == 1


def lines_of(blob: bytes, name: str = "lines") -> Any:
    """Return the lines of a blob."""
    begin = 4 + int.from_bytes(blob[:4], "little")
    (found,) = (array for array in json.loads(blob[4:begin])["arrays"] if array["name"] == name)
    return np.frombuffer(blob, "<f8", found["shape"][0], begin + found["at"])


def test_bands_that_overlap_are_shown_one_behind_the_other(tmp_path: Path) -> None:
    path = tmp_path / "record.npz"
    ms.write(path, KINDS["ambient"][0])
    run = Run()
    run.run(Analysis(files=(source_of_file(path, {}),), orders=(8, 12, 16), bands=((0.4, 3.4), (3.4, 7.5))))
    assert run.head("poles")["bands"] == [[0.4, 3.4], [3.4, 7.5]]
    poles = blob_of(run, "poles")
    for lines in (
        lines_of(TASKS["channel"](run.stages, None, 0, 0)),
        lines_of(poles, "cmif_lines"),
        lines_of(poles, "spectra_lines"),
    ):
        assert np.all(np.diff(lines) > 0)
        assert 0.4 <= lines[0] < lines[-1] <= 7.5


def blob_of(run: Run, name: str) -> bytes:
    return next(payload[1] for kind, payload in reversed(run.told) if kind == "blob" and payload[0] == name)  # type: ignore[no-any-return]


@pytest.mark.slow
def test_two_bands_are_shown_together(tmp_path: Path) -> None:
    run = ran("lines", tmp_path, bands=((0.3, 3.4), (3.4, 7.5)))
    assert len(run.head("poles")["bands"]) == 2
    assert len(run.head("modes")["modes"]) == 5
    assert np.max(run.head("modes")["fits"]) < 0.2
    assert np.all(np.diff(lines_of(TASKS["channel"](run.stages, None, 0, 0))) > 0)
    report = TASKS["export"](run.stages, None, ".html", str(tmp_path / "a.html")).read_text(encoding="utf-8")
    for band in run.head("poles")["bands"]:
        assert f"Measured and rebuilt responses, {band[0]:.4g} to {band[1]:.4g} Hz</h2>" in report
    assert len(set(re.findall(r'<section id="([^"]+)"', report))) == report.count("<section id=")


@pytest.mark.slow
def test_a_state_space_model_is_exported_as_the_command_line_writes_it(tmp_path: Path) -> None:
    run = ran("records", tmp_path, bands=((0.5, 7.0),))
    model = ms.realize(ms.read(tmp_path / "data.npz"), band=(0.5, 7.0))
    for suffix in (".model.mat", ".model.json"):
        written = ms.read(TASKS["export"](run.stages, None, suffix, str(tmp_path / f"a{suffix}")))
        for name in "ABCD":
            np.testing.assert_allclose(getattr(written, name), getattr(model, name), rtol=1e-12, atol=1e-12)


def test_what_was_stopped_between_two_orders_has_no_result(tmp_path: Path) -> None:
    data, orders = KINDS["lines"]
    run = Run()

    def enough() -> None:
        if any(kind == "cut" for kind, _ in run.told):
            raise InterruptedError

    with pytest.raises(InterruptedError):
        run.stages.run(document_of(data, tmp_path, orders=orders), None, enough)
    assert len([kind for kind, _ in run.told if kind == "cut"]) == 1
    refused("was stopped or failed", run.stages.finished)
    run.run(document_of(data, tmp_path, orders=orders))
    for suffix in (".json", ".csv", ".uff", ".analysis.json"):
        assert TASKS["export"](run.stages, None, suffix, str(tmp_path / f"a{suffix}")).stat().st_size
    refused("'.exe' is unknown", TASKS["export"], run.stages, None, ".exe", str(tmp_path / "a.exe"))
    refused("there are 4 outputs", TASKS["channel"], run.stages, None, 9, 0)


def test_a_comparison_is_rows_methods_and_pictures() -> None:
    found = ms.compare(KINDS["samples"][0], ["era/time", "least_squares/time"], orders=range(4, 13, 4))
    view = compared_view(found)
    head, *rows = view["rows"]
    at = head.index("f [Hz]")
    assert [float(row[at]) for row in rows] == pytest.approx([group.frequency for group in found.groups], rel=1e-5)
    assert len(view["methods"]) == 2
    pictures = compared_pictures(found)
    assert list(pictures) == ["map", "deviations"]
    run = Run()
    refused("there is none", TASKS["picture"], run.stages, None, "map")
    run.stages.pictures |= pictures
    head = TASKS["picture"](run.stages, None, "map")
    assert b"Map of methods" in head[: 4 + int.from_bytes(head[:4], "little")]


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system does not say where a process reads")
def test_what_is_read_of_several_files_is_told_while_they_are_read(tmp_path: Path) -> None:
    files = [tmp_path / name for name in "ab"]
    for file in files:
        file.write_bytes(bytes(1000))
    seen: list[tuple[int, int]] = []
    with watched(files, lambda done, total: seen.append((done, total))), files[1].open("rb") as second:
        second.seek(300)
        until(lambda: len(seen) > 1)
    assert set(seen) == {(1300, 2000)}
    told = len(seen)
    assert read_so_far(dict.fromkeys(files, 1000)) is None
    assert len(seen) == told


@pytest.mark.parametrize(
    "error", [DataError("a", "b", "c"), MemoryError(), OSError(2, "No such file"), ZeroDivisionError("x")]
)
def test_every_error_is_told_in_three_parts(error: Exception) -> None:
    assert all(error_parts(error)[part] for part in ("asked", "found", "change"))


def test_modes_are_compared_with_those_of_a_file(finished: Run, tmp_path: Path) -> None:
    modes = finished.stages.finished().modes
    ms.write(tmp_path / "other.json", modes.take([0, 2]))
    answer = against(finished.stages, lambda done, total: None, str(tmp_path / "other.json"))
    np.testing.assert_allclose(answer["mac"], ms.mac(modes.shapes, modes.shapes[:, [0, 2]]))
    assert answer["frequencies"] == pytest.approx(modes.frequencies[[0, 2]])
    ms.write(tmp_path / "data.npz", KINDS["lines"][0])
    refused("holds FrequencyResponse", against, finished.stages, lambda done, total: None, str(tmp_path / "data.npz"))


def unpacked(blob: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    length = int.from_bytes(blob[:4], "little")
    head = json.loads(blob[4 : 4 + length])
    kinds = {"f4": "<f4", "f8": "<f8"}
    arrays = {
        each["name"]: np.frombuffer(blob, kinds[each["type"]], int(np.prod(each["shape"])), 4 + length + each["at"])
        for each in head["arrays"]
    }
    return head, arrays


def test_the_sum_of_all_channels_is_that_of_their_magnitudes(finished: Run) -> None:
    head, arrays = unpacked(TASKS["channel"](finished.stages, None))
    assert (head["all"], head["output"]) == (True, "")
    measured = finished.stages.finished().diagrams[0].response.values
    np.testing.assert_allclose(arrays["measured_real"], np.abs(measured).sum(axis=(1, 2)), rtol=1e-5)
    assert not arrays["measured_imag"].any()


def test_the_pictures_of_the_data_are_made_as_soon_as_they_are_read(finished: Run) -> None:
    refused("not read", TASKS["measured"], Run().stages, None)
    names = TASKS["measured"](finished.stages, None)
    assert names
    assert all(TASKS["picture"](finished.stages, None, name) for name in names)


def test_findings_come_before_there_are_modes_and_types_and_remarks_are_exported(tmp_path: Path) -> None:
    run = Run()
    data, orders = KINDS["lines"]
    document = document_of(data, tmp_path, orders=orders)
    run.run(document)
    assert isinstance(run.head("overview")["findings"], list)
    first = run.stages.finished().modes.frequencies[0]
    run.run(replace(document, names={f"{first:.6g}": "first bending; wing tips"}))
    table = TASKS["export"](run.stages, None, ".csv", str(tmp_path / "a.csv")).read_text(encoding="utf-8").splitlines()
    rows = [dict(zip(table[0].split(","), line.split(","), strict=False)) for line in table[1:]]
    assert (rows[0]["type"], rows[0]["remark"], rows[1]["type"]) == ("first bending", "wing tips", "")
    assert len(ms.read(tmp_path / "a.csv")) == len(rows)
