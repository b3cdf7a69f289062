"""Data classes are frozen: nothing changes after they are made, and there is no dictionary in which it could."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import pickle
import pkgutil
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import modalscope.data
import modalscope.systems
from modalscope.data import Note
from tests.io import samples

#: Rows of a list, told apart by what they say and not by which object they are.
BY_CONTENT = {"Note", "Candidate", "Harmonic", "Sameness"}


def data_classes() -> dict[str, type]:
    found = {}
    for package in (modalscope.data, modalscope.systems):
        for info in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
            module = importlib.import_module(info.name)
            for thing in vars(module).values():
                if isinstance(thing, type) and dataclasses.is_dataclass(thing) and thing.__module__ == info.name:
                    found[thing.__name__] = thing
    return found


@pytest.mark.parametrize("name", data_classes())
def test_data_classes_are_frozen_and_have_no_dictionary(name: str) -> None:
    kind = data_classes()[name]
    assert kind.__dataclass_params__.frozen  # type: ignore[attr-defined]
    assert (kind.__eq__ is not object.__eq__) is (name in BY_CONTENT)
    assert all("__slots__" in vars(base) for base in kind.__mro__[:-1] if base.__module__.startswith("modalscope"))
    assert not hasattr(kind, "__dict__") or "__dict__" not in vars(kind)


@pytest.mark.parametrize("name", samples.EVERY)
def test_neither_fields_nor_arrays_can_be_changed(name: str) -> None:
    thing = samples.EVERY[name]()
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        with pytest.raises(AttributeError):
            setattr(thing, field.name, value)
        if isinstance(value, np.ndarray):
            with pytest.raises(ValueError, match="read-only"):
                value[...] = 0
    with pytest.raises((AttributeError, TypeError)):
        thing.new = Note("a")  # type: ignore[attr-defined]


def arrays_of(thing: Any) -> list[np.ndarray]:
    """Return the arrays of a data class, of those in it, and of mappings."""
    if isinstance(thing, np.ndarray):
        return [thing]
    inner = thing.values() if isinstance(thing, Mapping) else thing if isinstance(thing, tuple | list) else ()
    if dataclasses.is_dataclass(thing):
        inner = [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    return [array for each in inner for array in arrays_of(each)]


@pytest.mark.parametrize("name", samples.EVERY)
def test_copies_are_equal_and_as_locked_as_what_they_are_copies_of(name: str) -> None:
    thing = samples.EVERY[name]()
    before = arrays_of(thing)
    assert before
    for again in (pickle.loads(pickle.dumps(thing)), copy.deepcopy(thing), copy.copy(thing)):
        after = arrays_of(again)
        assert [array.flags.writeable for array in after] == [array.flags.writeable for array in before]
        assert all(map(np.array_equal, after, before)) or any(np.isnan(a).any() for a in before if a.dtype.kind == "f")
        assert repr(again) == repr(thing)
        assert (again == thing) is False  # by identity, without asking arrays whether they are true
