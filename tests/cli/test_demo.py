"""The demo prints the beam's modes beside the published ones, within 100 columns, and writes a report."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from modalscope.cli import main

pytestmark = pytest.mark.slow


def test_the_demo_prints_published_values_beside_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = tmp_path / "beam.html"
    assert main(["demo", "-o", str(report)]) == 0
    said = capsys.readouterr().out.splitlines()
    table = [line for line in said if re.match(r" +\d+ +\d+\.\d", line)]
    assert sum(line.split()[-2:] != ["-", "-"] for line in table) == 7
    assert max(len(line) for line in [*table, *said[2:3]]) <= 100
    assert any(line.startswith("Within the 95 % intervals: 7 of 7 published frequencies") for line in said)
    assert report.stat().st_size > 100_000
