"""The documents say what is there: files that they name, floors as they are written, and examples that run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support import ROOT
from tools import floors

DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])

#: Paths of files, from the top or from the package, and of folders of the package.
NAMED = re.compile(r"`((?:[\w.-]+/)+(?:[\w-]+\.(?:py|md|toml|uff|csv))?)`")


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_file_that_a_document_names_is_there(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    places = {name: [ROOT / name, ROOT / "src" / "modalscope" / name] for name in NAMED.findall(text)}
    links = re.findall(r"\]\(([^)#]+)\)", text)
    places |= {link: [document.parent / link] for link in links if not link.startswith(("http", "generated/"))}
    assert [name for name, where in places.items() if not any(place.exists() for place in where)] == []


def test_a_stranger_finds_the_file_of_a_task() -> None:
    rows = re.findall(r"^\| ((?:add|change) [^|]*?) \| ([^|]*) \|", read("CONTRIBUTING.md"), re.MULTILINE)
    files = {task: re.findall(r"`((?:src|docs)/[\w/.]+)`", cell) for task, cell in rows}
    assert len(files) >= 10
    assert [
        task for task, named in files.items() if not named or not all((ROOT / one).is_file() for one in named)
    ] == []


@pytest.mark.parametrize("name", floors.DRAWINGS)
def test_the_floors_are_drawn_as_they_are_written(name: str) -> None:
    drawing = floors.DRAWINGS[name](read("pyproject.toml"))
    assert floors.redrawn(read(name), drawing) == read(name), "say: make architecture"


def test_every_package_is_on_a_floor_that_says_what_happens_there() -> None:
    drawn = list(floors.layers("modalscope", read("pyproject.toml")))
    packages = {path.parent.name for path in (ROOT / "src" / "modalscope").glob("*/__init__.py")}
    assert {name for layer in drawn for name in layer.names} == packages
    assert all(note for layer in drawn for note in layer.notes)


@pytest.mark.slow
def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    program = re.findall(r"^```python\n(.*?)^```", read("README.md"), re.DOTALL | re.MULTILINE)
    names: dict[str, object] = {}
    # a band of four modes: other tests run the whole one
    exec(compile(program[0].replace("(100, 4500)", "(100, 1000)"), "README.md", "exec"), names)
    assert (tmp_path / "modes.json").exists()
    assert {"modes", "diagram", "model"} <= names.keys()


def test_the_readme_says_what_it_is_before_the_tenth_line_and_shows_a_command() -> None:
    head = read("README.md").split("```")
    assert head[0].count("\n") <= 10
    assert head[1].strip().startswith("modalscope identify examples/")
