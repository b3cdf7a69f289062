"""The head of a report to a customer: what is told first, and what cannot be one."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.interfaces.reporting.header import header_of, header_of_remarks, header_sections
from tests.interfaces.plot import examples
from tests.support import refused

TEXT = """
title = "Beam <b>one</b>"
project = "P-7"
test_date = 2024-05-17
conclusion = "All is well.\\n\\nTwo modes need a look."
[[sensors]]
channel = "1:+Z"
serial = "7"
[[sensors]]
channel = "2:+Z"
calibrated = 2024-01-09
place = "tip"
"""


def test_a_header_is_told_first_with_its_sensors_and_the_conclusion(tmp_path: Path) -> None:
    path = tmp_path / "head.toml"
    path.write_text(TEXT)
    page = ms.report((examples.modes(), examples.diagram()), tmp_path / "r.html", header=path).read_text()
    anchors = re.findall(r'<section id="(\w+)"', page)
    assert anchors[:3] == ["test", "conclusion", "summary"]
    assert "<h1>Beam &lt;b&gt;one&lt;/b&gt;</h1>" in page
    for words in (
        "<dt>project</dt><dd>P-7</dd>",
        "<dt>test date</dt><dd>2024-05-17</dd>",
        "<p>Two modes need a look.</p>",
    ):
        assert words in page
    heads = re.findall(r"<th[^>]*>([^<]*)</th>", page.partition('id="test"')[2].partition("</table>")[0])
    assert heads == ["channel", "serial", "calibrated", "place"]  # what no sensor has is no column
    given = ms.report((examples.modes(), examples.diagram()), tmp_path / "r.html", header={"project": "P-7"}, title="A")
    assert "<h1>A</h1>" in given.read_text()


def test_remarks_and_names_of_an_analysis_are_told_in_its_report(tmp_path: Path) -> None:
    result = ms.analyze(examples.response(), orders=range(8, 13, 2), refine=False)
    told = {
        "remarks": ("project: Bridge 7", "rain"),
        "names": {f"{result.modes.frequencies[1]:.6g}": "first <torsion>"},
    }
    result = replace(result, analysis=replace(result.analysis, **told))
    page = ms.report(result, tmp_path / "r.html").read_text()
    assert "<dt>project</dt><dd>Bridge 7</dd>" in page
    assert page.count("first &lt;torsion&gt;") == 1
    assert "Bridge 7" not in ms.report(result, tmp_path / "r.html", header={}).read_text().partition('id="repeat"')[0]


def test_without_entries_there_is_no_head() -> None:
    assert not list(header_sections(header_of(None)))
    assert [section.anchor for section in header_sections({"date": date(2024, 1, 1)})] == ["test"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("project = ", "Write lines such as"),
        (f"project = {'[' * 5000}", "Write lines such as"),
        ("sensors = 3", "sensors of a header are tables"),
        ("sensors = [1]", "tables"),
    ],
)
def test_what_is_no_header_is_said(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    refused(words, header_of, path)
    refused("no such file", header_of, tmp_path / "none.toml")


@pytest.mark.slow
def test_the_terminal_takes_a_header_for_its_reports(tmp_path: Path) -> None:
    data, head, page = tmp_path / "d.npz", tmp_path / "head.toml", tmp_path / "r.html"
    ms.write(data, examples.response())
    head.write_text(TEXT)
    assert main(["identify", str(data), "--orders", "8:14:2", "-q", "-o", str(page), "--header", str(head)]) == 0
    assert "<dt>project</dt><dd>P-7</dd>" in page.read_text()


def test_sensors_that_are_typed_on_the_page_are_a_line_each() -> None:
    header = header_of_remarks(["sensors: 1:+Z, accelerometer, 1234\n2:+Z, accelerometer", "conclusion: Fit for use."])
    assert header["sensors"] == [
        {"channel": "1:+Z", "sensor": "accelerometer", "serial": "1234"},
        {"channel": "2:+Z", "sensor": "accelerometer"},
    ]
    assert [section.anchor for section in header_sections(header)] == ["test", "conclusion"]
