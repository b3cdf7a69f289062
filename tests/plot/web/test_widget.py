"""A widget holds a result as one blob, whose head says what is in it."""

from __future__ import annotations

import json

import pytest

import modalscope as ms
from modalscope.plot.web.alive import alive_blob, front_end
from tests.plot import examples
from tests.support import refused


def test_a_result_is_one_blob_with_its_modes_poles_and_channels() -> None:
    modes, diagram = examples.modes(), examples.diagram()
    blob = alive_blob(modes, diagram)
    head = json.loads(blob[4 : 4 + int.from_bytes(blob[:4], "little")])
    shapes = {entry["name"]: entry["shape"] for entry in head["arrays"]}
    assert [mode["frequency"] for mode in head["modes"]] == pytest.approx(list(modes.frequencies))
    assert shapes["frequency"] == [len(diagram.poles)]
    assert shapes["measured_real"][:2] == list(diagram.response.values.shape[1:])
    assert shapes["mac"] == [len(modes)] * 2


def test_a_widget_is_of_a_result_alone() -> None:
    refused("Give a result", ms.widget, 3)


def test_a_widget_carries_the_front_end() -> None:
    pytest.importorskip("anywidget", reason="the extra `notebook` is not installed")
    if front_end("widget.js") is None:
        pytest.skip("the front end of the page is not built: make page")
    made = ms.widget((examples.modes(), examples.diagram()))
    assert made.blob == alive_blob(examples.modes(), examples.diagram())
    made.chosen = 1
    assert made.chosen == 1
