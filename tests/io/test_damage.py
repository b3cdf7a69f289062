"""What is wrong with a file is told as damage; what is wrong with the program or the machine is not."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.data import DataError
from modalscope.io.contents import damage_as_error
from tests.io import corpus
from tests.io.apart import ending, hidden

DOCUMENTS = ("a.analysis.json", "diagram.json", "modes.json", "state-space.json")
OTHERS = (None, 3, "x", [], {}, [3], {"a": 1}, True, [None], [[1, 2], [3]])


@pytest.mark.parametrize("error", [TypeError("ours"), AttributeError("ours"), MemoryError()])
def test_an_error_of_ours_and_low_memory_are_no_damage(error: Exception) -> None:
    with pytest.raises(type(error)), damage_as_error("a.csv"):
        raise error


def test_what_a_damaged_file_raised_stays_beside_the_sentence() -> None:
    cause = ValueError("cut off")
    with pytest.raises(DataError, match=r"a\.csv: it is damaged") as refused, damage_as_error("a.csv"):
        raise cause
    assert refused.value.__cause__ is cause


def test_a_machine_without_memory_is_told_as_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise MemoryError

    np.savez(tmp_path / "a.npz", values=np.ones((4, 1, 1)), sampling_rate=1.0)
    monkeypatch.setattr("modalscope.io.npz.contents_from_arrays", full)
    with pytest.raises(DataError, match="needs more memory than there is"):
        mio.read(tmp_path / "a.npz")


def test_what_a_data_error_hides_is_found() -> None:
    """The attack fails where it is anything but what damaged files raise."""
    told = DataError("a", "b", "c")
    assert hidden(told) is None
    told.__cause__ = ValueError()
    assert hidden(told) is None
    told.__cause__ = cause = MemoryError()
    assert hidden(told) is cause
    outer = DataError("a", "b", "c")
    outer.__cause__ = told
    assert hidden(outer) is cause


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Give the way to every value of a document; of lists to the first two."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


def altered(document: Any, path: tuple[Any, ...], value: Any) -> Iterator[Any]:
    """Give a document with another value at a place, and one without it."""
    if not path:
        yield value
        return
    for drop in (False, True):
        other = inner = copy.deepcopy(document)
        for key in path[:-1]:
            inner = inner[key]
        if drop:
            del inner[path[-1]]
        else:
            inner[path[-1]] = value
        yield other


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_value_of_another_kind_in_a_document_is_refused_or_read(name: str, tmp_path: Path) -> None:
    """Another one at every place; `make attack` damages letters, which hardly ever make a list of a number."""
    corpus.write(tmp_path)
    document = json.loads((tmp_path / name).read_text("utf-8"))
    ways = list(places(document))
    for k in range(min(len(ways), 60)):
        way = ways[k * len(ways) // min(len(ways), 60)]
        for other in altered(document, way, OTHERS[k % len(OTHERS)]):
            (tmp_path / name).write_text(json.dumps(other), "utf-8")
            assert ending(tmp_path / name)["how"] in ("read", "DataError"), (way, other)
