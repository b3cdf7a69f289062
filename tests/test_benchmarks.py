"""The benchmarks: what they ask for is there, and their tables keep what was not measured."""

from __future__ import annotations

import ast
import importlib
import subprocess
from pathlib import Path

import pytest

from benchmarks import instant
from benchmarks._published import commit_of, table
from benchmarks.jobs import HEADER, STAGES, Outcome, looked_up, row_of


def test_a_row_of_a_table_is_named_by_its_first_cells() -> None:
    before = table(
        ("job", "CPU s"), ["| laser, 1 | 2 |", "| laser | 3 |", "| gone | 4 |"], [], [("laser",), ("laser, 1",)]
    )
    assert before.splitlines()[2:] == ["| laser | 3 |", "| laser, 1 | 2 |"]
    after = table(("job", "CPU s"), ["| laser | 5 |"], before.splitlines(), [("laser, 1",), ("laser",)])
    assert after.splitlines()[2:] == ["| laser, 1 | 2 |", "| laser | 5 |"]


def test_a_job_names_the_commit_of_the_folder_that_it_is_measured_beside(tmp_path: Path) -> None:
    assert commit_of(tmp_path) == "no checkout"
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b.c"]
    for words in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "first"]):
        subprocess.run([*git, *words], check=True)
    commit = commit_of(tmp_path)
    assert len(commit) >= 4
    spent = Outcome({"identification": 2.0}, {"identification": 100.0}, 1000, 1000, "here")
    row = dict(zip(HEADER, row_of("job", spent, spent._replace(commit=commit)), strict=True))
    assert (row["before, commit"], row["commit"]) == (commit, "here")


def _replaced() -> list[str]:
    """Return what the benchmark of large work puts something else in the place of."""
    tree = ast.parse(Path(instant.__file__).read_text())
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) == "without"]
    return [ast.literal_eval(call.args[0]) for call in calls]


@pytest.mark.parametrize("name", _replaced())
def test_what_the_plain_way_replaces_is_there(name: str) -> None:
    module, _, own = name.rpartition(".")
    assert hasattr(importlib.import_module(module), own)


@pytest.mark.parametrize("place", [place for places in STAGES.values() for place in places])
def test_the_stages_of_a_job_are_functions_of_the_program(place: str) -> None:
    module, name = looked_up(place)
    assert callable(getattr(module, name))
