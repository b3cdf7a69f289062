"""The report of a period: tracks, what moves them, the chart, and records that could not be used."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.monitoring import History, Store
from modalscope.reporting.months import months_sections


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Return 200 hours of two modes with the air's temperature, and a file that is no record."""
    hours, draw = np.arange(200), np.random.default_rng(0)
    air = {"<b>air": np.sin(hours / 9)}
    f = np.array([1.0, 2.0]) * (1 - 1e-3 * air["<b>air"][:, None] + 1e-4 * draw.standard_normal((200, 2)))
    made = Store(tmp_path / "a.modes")
    made.add_modes(History(times=3600 * hours, record=np.repeat(hours, 2), frequencies=f.ravel(), covariates=air))
    (tmp_path / "19700105_0030.csv").write_text("spoilt\n")
    made.add(tmp_path / "19700105_0030.csv")
    return made


def test_a_report_of_months_is_one_file_with_its_pictures_and_what_was_refused(store: Store, tmp_path: Path) -> None:
    text = ms.report(store, tmp_path / "a.html").read_text()
    assert text.count("data:image/png;base64,") == 3
    for words in ("200 used, 1 could not be used", "19700105_0030.csv", "1: 0.99", "Control chart", "&lt;b&gt;air"):
        assert words in text
    assert "<b>air" not in text
    store.close()


def test_where_there_is_no_chart_its_section_says_why(store: Store) -> None:
    sections = {each.anchor: each.body for each in months_sections(store, reference=(0, 3600 * 50))}
    assert "Give 100 records, or more" in sections["chart"]
    assert list(sections) == ["summary", "tracks", "chart", "refused"]
    store.close()
