"""The report of a period: tracks, what moves them, the chart, and records that could not be used."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.monitoring import History, Store, track
from modalscope.interfaces.reporting.months import months_sections
from modalscope.interfaces.reporting.track_view import track_view


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


@pytest.mark.slow
def test_a_report_of_months_is_one_file_with_its_pictures_and_what_was_refused(store: Store, tmp_path: Path) -> None:
    text = ms.report(store, tmp_path / "a.html").read_text()
    assert text.count('<svg class="chart"') == 3
    for words in ("200 used, 1 could not be used", "19700105_0030.csv", "1: 0.99", "Control chart", "&lt;b&gt;air"):
        assert words in text
    assert "<b>air" not in text
    store.close()


@pytest.mark.slow
def test_where_there_is_no_chart_its_section_says_why(store: Store) -> None:
    sections = {each.anchor: each.body for each in months_sections(store, reference=(0, 3600 * 10))}
    assert "Give 20 records, or more" in sections["chart"]
    assert list(sections) == ["summary", "tracks", "chart", "refused"]
    store.close()


def test_the_view_of_tracks_holds_what_it_draws_and_no_markup_of_a_stranger(tmp_path: Path) -> None:
    shapes = np.tile([2.0 + 0j, 1.0, -1.0], (12, 1))
    shapes[-1, 2] = np.nan
    history = History(
        times=3600 * np.arange(12),
        record=np.arange(12),
        frequencies=1 + 1e-3 * (np.arange(12) % 3),
        frequencies_std=np.full(12, 1e-3),
        shapes=shapes,
        output_dofs=("</script>a", "b", "c"),
    )
    text = track_view(track(history), np.array([1800.0]))
    (packed,) = re.findall(r'id="tracks-data">(.*?)</script>', text)
    assert "<" not in packed
    held = json.loads(packed)
    assert held["dofs"][0] == "</script>a"
    assert held["frequencies"][:3] == [[1.0], [1.001], [1.002]]
    assert held["shapes"][0] == [[1.0, 0.5, -0.5]]
    assert held["shapes"][-1] == [[1.0, 0.5, None]]
    assert held["refused"] == [1800.0]


@pytest.mark.slow
def test_a_click_shows_the_record_and_keys_go_through_time(store: Store, tmp_path: Path, browser: Any) -> None:
    path = ms.report(store, tmp_path / "a.html")
    page = browser.new_page(viewport={"width": 1000, "height": 1200})
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(path.as_uri())
    view = page.locator("#tracks-view")
    view.locator("canvas").focus()
    page.keyboard.press("ArrowRight")
    assert "1970-01-01 00:00 (UTC)" in view.locator(".record p").inner_text()
    page.keyboard.press("ArrowRight")
    assert "1970-01-01 01:00 (UTC)" in view.locator(".record p").inner_text()
    assert view.locator(".record tr").count() >= 3
    box = view.locator("canvas").bounding_box()
    page.mouse.click(box["x"] + box["width"] - 12, box["y"] + 12)  # far from any point: nothing is chosen
    assert view.locator(".record p").count() == 0
    view.locator("button").click()
    page.wait_for_timeout(500)
    assert view.locator("button").inner_text() == "stop"
    assert view.locator(".record p").count() == 1
    assert faults == []
    page.close()
    store.close()
