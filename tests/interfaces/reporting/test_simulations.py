"""Report on a state-space model: measured against simulated outputs, its response with its band, and what was tried."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from tests.extras.test_wnsf import record, structure


@pytest.fixture(scope="module")
def data() -> ms.Signals:
    return record(structure(1), 0, 0.3, 0.01, samples=1200)


def test_a_report_of_a_model_says_what_it_explains_and_how_sure_it_is(data: ms.Signals, tmp_path: Path) -> None:
    model = ms.realize(data, order=6, method="n4sid")
    text = ms.report(model, tmp_path / "model.html", data=data).read_text()
    assert re.findall(r'<section id="(\w+)"', text) == ["model", "simulation", "response", "tried"]
    assert "6 states, 1 input, 2 outputs" in text
    assert "95 % of it" in text
    assert "on what was held out" in text
    simulated, response = re.findall(r"<figure>.*?</figure>", text, re.DOTALL)
    assert simulated.count('stroke="var(--ink)"') == 1 + 2 + 1  # the key, two outputs, one of them from near
    assert response.count("stroke-dasharray") == 1 + 2


def test_a_model_without_directions_has_a_response_alone(data: ms.Signals, tmp_path: Path) -> None:
    text = ms.report(structure(1), tmp_path / "model.html", data=data).read_text()
    assert "95 % of it" not in text
    assert 'id="tried"' not in text


def test_without_a_record_the_report_of_a_model_says_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(ms.DataError, match="data of a report on a model"):
        ms.report(structure(1), tmp_path / "model.html")


def test_realize_writes_the_report_beside_the_model(data: ms.Signals, tmp_path: Path) -> None:
    source, page, stored = (tmp_path / name for name in ("record.npz", "model.html", "model.mat"))
    ms.write(source, data)
    assert main(["realize", str(source), "--order", "6", "--method", "n4sid", "-o", str(page), "-o", str(stored)]) == 0
    assert "modalscope realize" in page.read_text()
    assert ms.read(stored).order == 6


def test_deviations_of_a_response_are_refused_where_there_are_none() -> None:
    model = ms.realize(structure(1).impulse_response(200), order=6)
    with pytest.raises(ms.DataError, match="no covariance"):
        model.frequency_response_std(np.array([0.1]))
