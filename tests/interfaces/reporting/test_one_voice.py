"""Terminal, page, report, notebook and files show the same numbers and words of one result."""

from __future__ import annotations

import csv
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import Note
from modalscope.data.indicators import mpc, mpd
from modalscope.interfaces.app.steps import result_head
from modalscope.interfaces.cli.identify import _print
from modalscope.interfaces.plot.web.alive import alive_blob, drawing_of
from modalscope.interfaces.plot.web.modes import modes_blob
from modalscope.interfaces.plot.web.verdict import notes_that_matter, verdict_of_result
from modalscope.selection.judging.description import HEADS, described
from modalscope.selection.judging.grades import grades
from modalscope.systems import chain5


@pytest.fixture(scope="module")
def result() -> ms.Result:
    """Return a result with repeatability, with grades of two kinds, and with shapes that are alike: two sensors see five modes."""
    data = chain5().frequency_response(np.linspace(0.3, 7.5, 300), noise=0.03, seed=1).select(outputs=["1:+X", "2:+X"])
    return ms.analyze(data, orders=range(8, 25, 4))


def _shown(result: ms.Result) -> list[dict[str, str]]:
    return [each.to_dict() for each in described(result.modes)]


def _head(blob: bytes) -> Any:
    return json.loads(blob[4 : 4 + int.from_bytes(blob[:4], "little")])


def _cells(page: str) -> list[list[str]]:
    """Return the cells of the first table of a page, row by row, with its head."""
    table = re.search(r"<table>.*?</table>", page, re.DOTALL)
    assert table
    rows = re.findall(r"<tr>(.*?)</tr>", table[0], re.DOTALL)
    return [
        [html.unescape(re.sub(r"<[^>]+>", "", c)) for c in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", r)] for r in rows
    ]


@pytest.mark.parametrize("refine", [False, True])
def test_stored_indicators_of_shapes_are_those_of_the_reported_shapes(refine: bool) -> None:
    response = chain5().frequency_response(np.linspace(0.3, 7.5, 300), noise=0.03, seed=1)
    modes = ms.select(ms.stabilize(response, orders=[10, 12, 14, 16]))
    modes = ms.refine(response, modes) if refine else modes
    assert modes.indicators["mpc"] == pytest.approx(mpc(modes.shapes))
    assert modes.indicators["mpd"] == pytest.approx(mpd(modes.shapes))
    assert modes.indicators["mpc"].min() < 0.9999  # not trivially one


def test_the_description_says_what_the_modes_hold(result: ms.Result) -> None:
    modes, ends = result.modes, result.modes.interval(0.95)
    assert {each.word for each in grades(modes)} == {"good"}
    for j, each in enumerate(_shown(result)):
        assert float(each["frequency"]) == pytest.approx(modes.frequencies[j], rel=1e-4)
        assert float(each["damping"]) == pytest.approx(100 * modes.damping_ratios[j], abs=0.006)
        assert float(each["frequency_half"]) == pytest.approx(np.ptp(ends["frequency"][j]) / 2, rel=0.05)
        assert float(each["damping_half"]) == pytest.approx(100 * np.ptp(ends["damping_ratio"][j]) / 2, rel=0.07)
        assert float(each["mpc"]) == pytest.approx(mpc(modes.shapes)[j], abs=0.006)


def test_terminal_page_report_and_notebook_show_the_same_table(
    result: ms.Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = _shown(result)
    rows = [list(HEADS.values()), *(list(each.values()) for each in shown)]
    _print(result)
    printed = [
        re.split(r" {2,}", line.strip())
        for line in capsys.readouterr().out.splitlines()
        if re.match(r" *(mode|\d+)  ", line)
    ]
    assert printed == rows
    assert [row["shown"] for row in _head(modes_blob(result.modes, {}, result_head(result)))["modes"]] == shown
    assert [row["shown"] for row in _head(alive_blob(drawing_of(result.modes, *result.diagrams)))["modes"]] == shown
    page = ms.report(result, tmp_path / "r.html").read_text(encoding="utf-8")
    section = page.partition('<section id="modes">')[2]
    assert _cells(section) == rows
    assert _cells(result._repr_html_()) == rows
    assert _cells(result.modes._repr_html_()) == rows


def test_terminal_page_and_report_say_the_same_sentences(
    result: ms.Result, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verdict = verdict_of_result(result)
    assert verdict.warnings
    assert verdict.unexplained
    _print(result)
    printed = capsys.readouterr().out
    report = html.unescape(ms.report(result, tmp_path / "r.html").read_text(encoding="utf-8"))
    notebook = html.unescape(result._repr_html_())
    page, alive = result_head(result), _head(alive_blob(drawing_of(result.modes, *result.diagrams)))
    for sentence in (*verdict.warnings, *verdict.unexplained):
        assert sentence in printed
        assert sentence in report
        assert sentence in notebook
        for head in (page, alive):
            assert sentence in (*head["warnings"], *head["unexplained"])
    assert all(sentence in printed and sentence in report for sentence in verdict.graded)


def test_files_hold_intervals_grade_and_mpc_beside_the_standard_deviations(result: ms.Result, tmp_path: Path) -> None:
    modes, ends = result.modes, result.modes.interval(0.95)
    for suffix in (".json", ".csv"):
        ms.write(tmp_path / f"m{suffix}", result)
    with (tmp_path / "m.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    entries = json.loads((tmp_path / "m.json").read_text(encoding="utf-8"))["modes"]
    assert modes.frequencies_std is not None
    for j, (row, entry, grade) in enumerate(zip(rows, entries, grades(modes), strict=True)):
        assert (row["grade"], row["reason"]) == (entry["grade"], entry["grade_reason"]) == (grade.word, grade.reason)
        assert float(row["mpc"]) == entry["mpc"] == entry["indicators"]["mpc"] == mpc(modes.shapes)[j]
        assert float(row["frequency_std_hz"]) == entry["frequency_std_hz"] == modes.frequencies_std[j]
        low, high = (float(row[f"frequency_95_{end}_hz"]) for end in ("low", "high"))
        assert [low, high] == entry["interval_95"]["frequency_hz"] == ends["frequency"][j].tolist()
        low, high = (float(row[f"damping_ratio_95_{end}"]) for end in ("low", "high"))
        assert [low, high] == entry["interval_95"]["damping_ratio"] == ends["damping_ratio"][j].tolist()
    for suffix in (".json", ".csv"):
        again = ms.read(tmp_path / f"m{suffix}")
        assert isinstance(again, ms.ModalModel)
        assert [each.to_dict()["grade"] for each in described(again)] == [each["grade"] for each in _shown(result)]


def test_values_that_will_be_refined_are_preliminary(result: ms.Result) -> None:
    rows = _head(modes_blob(result.modes, {}, {}, preliminary=True))["modes"]
    assert {row["shown"]["grade"] for row in rows} == {"preliminary"}


@pytest.mark.parametrize(("count", "longest"), [(10, 100)])
def test_the_table_fits_a_terminal_whatever_the_reason(
    count: int, longest: int, capsys: pytest.CaptureFixture[str]
) -> None:
    modes = ms.ModalModel(
        poles=-1.0 + 1j * np.linspace(1e4, 6e4, count),
        shapes=np.ones((2, count)),
        frequencies_std=np.full(count, 1e-3),
        damping_ratios_std=np.full(count, 1e-7),
        shapes_std=np.full((2, count), 0.6),
    )
    from modalscope.interfaces.cli.process import narrowed

    assert max(map(len, narrowed(modes.table(), longest).splitlines())) <= longest
    assert "errors leave it a MAC of" in narrowed(modes.table(), longest)


@pytest.mark.parametrize(("scatter", "told"), [(0.04, 0), (0.06, 1)])
def test_a_scatter_of_channels_that_says_nothing_is_not_told(scatter: float, told: int) -> None:
    note = Note("shifts", {"by_output": scatter, "by_input": 0.01}, "Sensors disagree")
    assert [len(texts) for texts in notes_that_matter([note])] == [told, 1 - told]
