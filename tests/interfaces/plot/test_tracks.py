"""Pictures of months: every mode is drawn once, in its track or in none."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.records.years import tracked, year
from modalscope import plot
from modalscope.analysis.monitoring import Alarms, alarms, explain, track
from modalscope.data import DataError
from modalscope.interfaces.plot.picture import Marks
from modalscope.interfaces.plot.tracks import chart_picture


def points(ax: object) -> int:
    return sum(len(line.get_xdata()) for line in ax.get_lines() if line.get_linestyle() == "None")  # type: ignore[attr-defined]


def test_every_mode_is_drawn_once() -> None:
    drawn = year(60, seed=1)
    ax = plot.tracks(track(drawn.history))
    assert points(ax) == drawn.history.frequencies.size
    assert ax.get_ylabel() == "frequency [Hz]"


def test_changes_are_drawn_against_a_covariate_that_is_there() -> None:
    found = explain(tracked(400, 0))
    ax = plot.against(found)
    assert points(ax) == 8 * 400
    assert ax.get_xlabel().startswith("temperature")
    with pytest.raises(DataError, match="there are only temperature"):
        plot.against(found, "wind")


@pytest.fixture(scope="module")
def found() -> Alarms:
    with pytest.MonkeyPatch.context() as patch:  # a limit that is known from fewer years will do for a picture
        patch.setattr("modalscope.analysis.monitoring.change._MOST", 300_000)
        return alarms(tracked(600, 3, shift=-2e-3, at=450), reference=("1970-01-01", "1970-01-16"))


def test_a_chart_shows_its_limit_and_its_alarms(found: Alarms) -> None:
    ax = plot.control_chart(found)
    assert points(ax) == 600
    assert np.isclose([line.get_ydata()[0] for line in ax.get_lines()], 1).any()
    assert len(found) == len([text for text in ax.texts if "1970-01" in text.get_text()]) == 1


def test_tracks_stand_below_the_chart_in_per_cent(found: Alarms) -> None:
    """Six of eight tracks, among them the two that fell by .2 %: each panel has all records of its track, on an axis of its own."""
    chart, *tracks = chart_picture(found).panels
    assert {name for alarm in found.alarms for name in alarm.tracks[:2]} <= {panel.title for panel in tracks}
    assert len(tracks) == 6
    reference, judged = (item for item in tracks[0].items if isinstance(item, Marks))
    assert len(reference.y) + len(judged.y) == 600
    assert np.nanmedian(np.asarray(judged.y)[-150:]) == pytest.approx(-0.2, abs=0.03)
    assert len({(panel.y.low, panel.y.high) for panel in tracks}) == 6
    assert [bool(panel.x.label) for panel in (chart, *tracks)] == [False] * 6 + [True]
