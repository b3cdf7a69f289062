"""Pictures of data before there are modes: points, coherence, driving points, reciprocity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.plot.measured import measured_pictures
from modalscope.interfaces.plot.picture import Areas, Line, Marks
from modalscope.systems import chain5

CHAIN = chain5()
POINTS = CHAIN.modes().output_dofs
LINES = CHAIN.frequency_response(np.linspace(0.3, 7.5, 400), outputs=list(POINTS), inputs=list(POINTS[:2]))


def test_a_driving_point_gives_energy_to_the_structure_and_a_reversed_one_takes_it() -> None:
    told = {}
    for sign in (1.0, -1.0):
        values = LINES.values * np.array([sign, *[1.0] * (len(POINTS) - 1)])[:, None]
        (panel,) = measured_pictures(replace(LINES, values=values))["driving"].panels
        told[sign] = [item.words for item in panel.items if isinstance(item, Line)]
    assert told[1.0] == [f"{POINTS[0]}: 100 %", f"{POINTS[1]}: 100 %"]
    assert told[-1.0] == [f"{POINTS[0]}: 0 %", f"{POINTS[1]}: 100 %"]


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_the_phase_of_a_driving_point_lies_in_the_half_turn_of_its_quantity(quantity: str) -> None:
    lines = CHAIN.frequency_response(LINES.frequencies, outputs=[POINTS[0]], inputs=[POINTS[0]], quantity=quantity)
    (panel,) = measured_pictures(lines)["driving"].panels
    (allowed,) = [item for item in panel.items if isinstance(item, Areas)]
    low, high = allowed.corners[0, :, 1].min(), allowed.corners[0, :, 1].max()
    assert high - low == 180
    phase = np.concatenate([np.asarray(item.y) for item in panel.items if isinstance(item, Line)])
    assert low - 1e-6 <= phase.min() < phase.max() <= high + 1e-6


def test_reciprocal_responses_are_equal_and_a_louder_one_is_told() -> None:
    aside = measured_pictures(LINES)["reciprocity"].panels[0].aside
    assert float(aside.split()[2]) < 1e-6
    values = LINES.values.copy()
    values[:, 1, 0] *= 1.21
    spoilt = measured_pictures(replace(LINES, values=values))["reciprocity"].panels[0].aside
    assert float(spoilt.split()[2]) == pytest.approx(100 * 0.21 / np.sqrt(1.21), rel=1e-2)


def test_points_are_counted_by_their_coherence_and_those_without_a_channel_are_told() -> None:
    nodes = [label.partition(":")[0] for label in POINTS]
    geometry = ms.Geometry(nodes=[*nodes, "far"], coordinates=[[k, 0, 0] for k in range(len(nodes) + 1)])
    coherence = np.ones((400, len(POINTS))) * np.array([0.95, 0.89, 0.71, 0.69, *[1.0] * (len(POINTS) - 4)])
    pictures = measured_pictures(replace(LINES, geometry=geometry, coherence=coherence))
    assert list(pictures) == ["points", "coherence", "driving", "reciprocity"]
    marks = [item for item in pictures["points"].panels[0].items if isinstance(item, Marks)]
    assert {mark.words: len(mark.x) for mark in marks if mark.words} == {
        "not measured": 1,
        f"coherence from 0.9 ({len(POINTS) - 3})": len(POINTS) - 3,
        "from 0.7 (2)": 2,
        "below 0.7 (1)": 1,
        "driven (2)": 2,
    }


def test_the_points_of_a_roving_hammer_are_those_of_its_forces() -> None:
    nodes = [label.partition(":")[0] for label in POINTS]
    geometry = ms.Geometry(nodes=nodes, coordinates=[[k, 0, 0] for k in range(len(nodes))])
    roving = CHAIN.frequency_response(LINES.frequencies, outputs=list(POINTS[:1]), inputs=list(POINTS))
    coherence = np.ones((400, 1, len(POINTS))) * np.array([0.5, *[1.0] * (len(POINTS) - 1)])
    marks = measured_pictures(replace(roving, geometry=geometry, coherence=coherence))["points"].panels[0].items
    told = {mark.words: len(mark.x) for mark in marks if isinstance(mark, Marks) and mark.words}
    assert told == {f"coherence from 0.9 ({len(POINTS) - 1})": len(POINTS) - 1, "below 0.7 (1)": 1, "sensors (1)": 1}


def test_the_darkness_of_the_coherence_of_all_channels_is_what_a_force_does_not_explain() -> None:
    coherence = np.ones((400, len(POINTS)))
    coherence[100:200, 2] = 0.4
    (shades,) = measured_pictures(replace(LINES, coherence=coherence))["coherence"].panels[0].items
    assert isinstance(shades, Areas)
    middle = shades.corners.mean(axis=1)
    assert middle[:, 1] == pytest.approx(2)
    f = LINES.frequencies
    assert f[99] <= middle[:, 0].min() < middle[:, 0].max() <= f[201]
    assert np.max(shades.strength) == pytest.approx(0.6)


def test_ambient_records_and_records_with_forces() -> None:
    ambient = CHAIN.simulate(inputs="ambient", samples=800, sampling_rate=20.0)
    assert list(measured_pictures(ambient)) == ["points"]
    assert measured_pictures(replace(ambient, geometry=None)) == {}
    record = CHAIN.simulate(samples=4000, sampling_rate=20.0, noise=0.05, seed=0)
    assert "coherence" in measured_pictures(record)
