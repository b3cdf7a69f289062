"""What the README says runs after a plain install, in an empty folder, and prints what is printed there."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from tests.support import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", README, re.DOTALL | re.MULTILINE)
COMMANDS = next(text for kind, text in BLOCKS if not kind and "modalscope demo" in text).splitlines()


def test_its_first_screen_says_what_it_is_and_how_to_begin() -> None:
    head = README.split("## ")[0]
    assert len(head.split("```")[0].splitlines()) <= 10
    assert [" ".join(shlex.split(line, comments=True)[:2]) for line in COMMANDS] == [
        "pip install",
        "modalscope demo",
        "modalscope app",
        "modalscope identify",
    ]


def test_its_badges_say_what_the_project_holds_itself_to() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    badges = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "badges").glob("*.svg")}
    assert 'requires-python = ">=3.11"' in project
    assert "3.11 and later" in badges["python"]
    assert 'license = "BSD-3-Clause"' in project
    assert "BSD-3-Clause" in badges["licence"]
    assert "fail_under = 95" in project
    assert "95 % and more" in badges["coverage"]


@pytest.mark.slow
def test_its_demo_prints_what_stands_there(tmp_path: Path) -> None:
    shown = next(text for kind, text in BLOCKS if not kind and text.startswith("mode "))
    done = subprocess.run(
        [sys.executable, "-m", "modalscope", "demo"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert shown.strip("\n") in done.stdout
    table = re.findall(r"^ +\d+ +\d+\.\d.*$", done.stdout, re.MULTILINE)
    assert sum(not line.endswith(" -") for line in table) == 7
    assert max(map(len, [*table, *shown.splitlines()])) <= 100
    assert "Within the 95 % intervals: 7 of 7 published frequencies, 7 of 7 damping ratios." in done.stdout
    assert (tmp_path / "demo-report.html").stat().st_size > 100_000


@pytest.mark.slow
def test_its_commands_run_on_a_file_of_your_own(tmp_path: Path) -> None:
    ms.write(tmp_path / "test.uff", ms.datasets.load("beam_hammer").band(100, 500))
    words = shlex.split(COMMANDS[-1], comments=True)
    subprocess.run([sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (tmp_path / "report.html").stat().st_size > 100_000


@pytest.mark.slow
def test_its_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (program,) = [text for kind, text in BLOCKS if kind == "python"]
    names: dict[str, Any] = {}
    exec(compile(program, "README.md", "exec"), names)
    (said,) = re.findall(r"ms\.replay\(.*?\)", program)
    assert np.array_equal(eval(said, names).modes.poles, names["result"].modes.poles)
    assert (tmp_path / "modes.json").exists()
    assert (tmp_path / "report.html").exists()
