"""The documents say what is there: files that they name, floors as they are written, and examples that run."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from modalscope import select, stabilize
from modalscope.systems import chain5
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


def test_what_makes_a_mode_weak_is_decided_in_the_file_that_contributors_are_sent_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The bound there, for a chance of 1e-300 in place of 1e-3, leaves out the weak modes of noisy responses, and those alone."""
    (row,) = [line for line in (ROOT / "CONTRIBUTING.md").read_text().splitlines() if "what makes a mode weak" in line]
    file = re.findall(r"`src/([\w/]+)\.py`", row)[0]
    clean = chain5().state_space().frequency_response(np.linspace(0.2, 6.0, 300))
    noise = np.random.default_rng(1).standard_normal((2, *clean.values.shape)) * 0.01 * np.abs(clean.values).max()
    diagram = stabilize(replace(clean, values=clean.values + noise[0] + 1j * noise[1]), orders=range(2, 21, 2))
    strong, every = 1, len(select(diagram))
    monkeypatch.setattr(import_module(file.replace("/", ".")), "_CHANCE_OF_ANY", 1e-300)
    assert strong <= len(select(diagram)) < every
