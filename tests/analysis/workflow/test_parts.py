"""Data whose band one ladder of orders does not hold: identified in parts by itself, and told as one result."""

from __future__ import annotations

import csv
from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.selection.judging.bands import SPLIT
from tests.studies import Study
from tests.support import BEAM


@pytest.fixture
def lines() -> ms.FrequencyResponse:
    return ms.systems.add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 800)), 0.01, 0)


@pytest.fixture
def whole_band_is_too_much(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_much(diagram: ms.StabilizationDiagram, modes: ms.ModalModel) -> bool:
        return diagram.settings.band is None

    monkeypatch.setattr("modalscope.analysis.workflow.bands.holds_too_little", too_much)


@pytest.mark.slow
@pytest.mark.usefixtures("whole_band_is_too_much")
def test_parts_give_the_modes_of_the_whole_in_one_diagram_and_one_line_says_so(lines: ms.FrequencyResponse) -> None:
    result = ms.analyze(lines)
    truth = ms.systems.chain5().modes()
    assert np.allclose(result.modes.frequencies, truth.frequencies, rtol=1e-3)
    assert np.allclose(result.modes.damping_ratios, truth.damping_ratios, rtol=0.05)
    assert len([note for note in result.notes if note.kind == SPLIT]) == 1
    assert result.diagram.response.count == lines.count
    assert np.array_equal(ms.replay(result.analysis, lines).modes.poles, result.modes.poles)


@pytest.mark.slow
@pytest.mark.usefixtures("whole_band_is_too_much")
def test_modes_are_refused_and_taken_in_the_part_that_they_lie_in(lines: ms.FrequencyResponse) -> None:
    every = ms.analyze(lines).modes
    less = ms.analyze(lines, refuse=every.frequencies[[0, 4]], take=[every.frequencies[0]]).modes
    assert np.allclose(less.frequencies, every.frequencies[:4], rtol=1e-4)


@pytest.mark.usefixtures("whole_band_is_too_much")
def test_with_orders_that_were_chosen_nothing_is_cut(lines: ms.FrequencyResponse) -> None:
    assert not [note for note in ms.analyze(lines, orders=range(2, 20, 2)).notes if note.kind == SPLIT]


@pytest.mark.slow
@pytest.mark.usefixtures("whole_band_is_too_much")
def test_a_certificate_of_parts_is_refused(lines: ms.FrequencyResponse) -> None:
    with pytest.raises(ms.DataError, match="bands one by one"):
        ms.certify(ms.analyze(lines))


@pytest.mark.study("bands")
def test_study_of_the_demo_file_with_nothing_set(study: Callable[[str, str], Study]) -> None:
    """From 1 Hz to 10 kHz: every published mode once, and those above."""
    table = study("measured beam, whole band of 1 Hz to 10 kHz", "1 file, examples/beam_hammer")
    result = ms.analyze(BEAM / "beam_hammer.uff")
    f, zeta = result.modes.frequencies, result.modes.damping_ratios
    with (BEAM / "published_modes.csv").open() as file:
        published = [(float(row["frequency_hz"]), float(row["damping_ratio"])) for row in csv.DictReader(file)]
    near = [np.flatnonzero(np.abs(f - place) < 0.002 * place) for place, _ in published]
    away = [abs(zeta[i[0]] / ratio - 1) for i, (_, ratio) in zip(near, published, strict=True) if i.size]
    others = [np.min(np.abs(f / place - 1)) for place in (1376.6, 5323.9, 6599.8, 7964.6, 9441.8)]
    table.row("modes within 0.2 % of each published frequency", [i.size for i in near], least=1, most=1)
    table.row("damping away from the published", 100 * np.array(away), most=20, unit=" %")
    table.row("five known modes that were not published: frequency away", 100 * np.array(others), most=0.1, unit=" %")
    assert not table.missed
