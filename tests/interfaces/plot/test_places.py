"""The picture of places: every place once, sensors above and forces below where they act."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import DataError, Geometry
from modalscope.interfaces.plot.picture import Marks, Words
from modalscope.interfaces.plot.places import places_picture
from modalscope.systems import chain5
from tests.analysis.planning.planned import PLACES, structure

LINE = Geometry(nodes=tuple(map(str, range(1, PLACES + 1))), coordinates=[[0.1 * k, 0, 0] for k in range(PLACES)])


def test_sensors_and_forces_stand_on_either_side_of_their_nodes() -> None:
    found = ms.place(structure(8001).modes(), sensors=4, forces=2)
    (panel,) = places_picture(found, LINE).panels
    marks = {item.words: item for item in panel.items if isinstance(item, Marks) and item.words}
    texts = {
        text: y for item in panel.items if isinstance(item, Words) for text, y in zip(item.texts, item.y, strict=True)
    }
    assert {kind: len(item.x) for kind, item in marks.items()} == {"sensors": 4, "forces": 2}
    for number, label in enumerate(found.forces, 1):
        if label in found.sensors:  # one node, both sides
            above = f"{found.sensors.index(label) + 1}. {label}"
            assert texts[above] > texts[f"{number}. {label}"] or above == f"{number}. {label}"
    rest = next(item for item in panel.items if isinstance(item, Marks) and not item.words)
    foot = dict(zip(LINE.nodes, zip(rest.x, rest.y, strict=True), strict=True))
    for kind, labels, side in (("sensors", found.sensors, 1), ("forces", found.forces, -1)):
        for x, y, label in zip(marks[kind].x, marks[kind].y, labels, strict=True):
            at = foot[label.split(":")[0]]
            assert x == pytest.approx(at[0])
            assert side * (y - at[1]) > 0


def test_steps_are_drawn_by_their_numbers() -> None:
    result = ms.analyze(structure(8001).response([0, 2, 4], [0, 3], 1.0, 8001), orders=range(10, 31, 4))
    found = ms.next_measurement(result, ask="damping 2 %")
    (panel,) = places_picture(found, LINE).panels
    texts = {text for item in panel.items if isinstance(item, Words) for text in item.texts}
    assert {f"{k}. {step.place}" for k, step in enumerate(found.steps, 1) if step.kind != "longer"} <= texts


def test_nothing_to_place_is_a_sentence_and_other_nodes_are_refused() -> None:
    result = ms.analyze(chain5().impulse_response(300, noise=0.01, seed=0))
    assert "No place" in places_picture(ms.next_measurement(result, ask="damping 90 %"), LINE).words
    found = ms.place(structure(8001).modes(), sensors=2)
    with pytest.raises(DataError, match="has none of the channels"):
        places_picture(found, Geometry(nodes=("a", "b"), coordinates=np.eye(2, 3)))
    assert ms.plot.places(found, LINE).get_title(loc="left")
