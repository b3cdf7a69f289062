"""The benchmarks against other programs: what they ask for is there, and results are compared as they say."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks._published import commit_of, table
from benchmarks.against import page
from benchmarks.jobs import HEADER, STAGES, Outcome, looked_up, row_of
from benchmarks.peers import pairs, works
from benchmarks.peers.child import loaded, poles_of
from benchmarks.peers.install import PEERS

PROGRAMS = Path(pairs.__file__).parent / "programs"


def functions(program: str) -> set[str]:
    tree = ast.parse((PROGRAMS / f"{program}_.py").read_text())
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("work", works.WORKS, ids=lambda work: work.name)
def test_every_program_has_the_function_that_a_work_asks_of_it(work: works.Work) -> None:
    for program, function, own, _ in work.peers:
        assert program in PEERS
        assert function in functions(program)
        assert own in functions("modalscope")


def test_the_plain_way_and_ours_give_the_same_poles() -> None:
    data = {name: np.asarray(value) for name, value in works.samples(3, 2, 12, 12, 6).items()}
    ours, plain = (poles_of(loaded(str(PROGRAMS / f"{name}_.py")).era(data)) for name in ("modalscope", "scipy"))
    assert pairs.nearest(ours, plain) < works.SAME
    assert pairs.nearest(ours, 1.001 * plain) == pytest.approx(1e-3, rel=1e-6)


def test_the_page_keeps_the_rows_of_works_that_were_not_done() -> None:
    first, second = (f"| {work.name} | {work.peers[0][0]}, {work.peers[0][1]} |" for work in works.WORKS[:2])
    before = page([f"{first} 1 |", f"{second} 1 |"], [], "2026-01-01 | a |").splitlines()
    after = page(
        [f"{second} 2 |", f"| {works.WORKS[0].name} | scipy: left out, it is not installed |"],
        before,
        "2026-02-01 | b |",
    )
    assert after.splitlines()[:-2] == before[:-2]
    assert after.splitlines()[-2:] == [f"{first} 1 | 2026-01-01 | a |", f"{second} 2 | 2026-02-01 | b |"]


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


@pytest.mark.slow
def test_two_processes_work_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pairs, "python_of", lambda program: Path(sys.executable))
    monkeypatch.setattr(pairs, "_PAIRS", 2)
    np.savez(tmp_path / "data.npz", **works.samples(3, 2, 12, 12, 6))
    with (
        pairs.Child("scipy", "era", tmp_path / "data.npz") as one,
        pairs.Child("scipy", "era", tmp_path / "data.npz") as other,
    ):
        found = pairs.paired(one, other)
    assert found.difference == 0
    assert found.ratio > 0
    with pytest.raises(RuntimeError, match="failed"), pairs.Child("scipy", "nothing", tmp_path / "data.npz"):
        pass


def _replaced() -> list[str]:
    """Return what the benchmark of large work puts something else in the place of."""
    tree = ast.parse((PROGRAMS.parents[1] / "instant.py").read_text())
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
