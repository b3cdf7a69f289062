"""Blobs hold what went in, each array where a browser can lay a view on it."""

from __future__ import annotations

import json

import numpy as np

from modalscope.interfaces.plot.web.blob import pack, plain


def test_arrays_come_back_by_their_place_and_type() -> None:
    given = {
        "a": np.arange(5),
        "b": np.linspace(0, 1, 7).reshape(7, 1),
        "c": np.array([True, False]),
        "d": np.zeros((0, 3)),
    }
    blob = pack({"x": np.nan, "y": [1.5, np.inf]}, given, exact=("b",))
    length = int.from_bytes(blob[:4], "little")
    head = json.loads(blob[4 : 4 + length])
    assert (head["x"], head["y"]) == (None, [1.5, None])
    assert (4 + length) % 8 == 0
    for entry, (name, values) in zip(head["arrays"], given.items(), strict=True):
        assert entry["name"] == name
        assert entry["at"] % 8 == 0
        kind = {"i4": "<i4", "f8": "<f8", "f4": "<f4", "u1": "|u1"}[entry["type"]]
        found = np.frombuffer(blob, kind, int(np.prod(entry["shape"])), 4 + length + entry["at"]).reshape(
            entry["shape"]
        )
        np.testing.assert_array_equal(found, values)


def test_json_holds_no_number_that_is_none() -> None:
    assert plain({"a": (np.float64("nan"), np.int64(3)), 5: {"b": np.array([1.0])}, "c": object}) == {
        "a": [None, 3],
        "5": {"b": [1.0]},
        "c": "<class 'object'>",
    }
