"""Alarms: at the stated rate without a change, soon after one, with its time and what it did to which mode."""

from __future__ import annotations

import json

import numpy as np
import pytest

from modalscope.analysis.monitoring import Alarms, alarms
from modalscope.analysis.monitoring.change import _bounded
from modalscope.data import DataError
from tests.analysis.monitoring.test_weather import moved, tracks
from tests.analysis.monitoring.years import tracked

HALF = ("1970-01-01", "1970-03-10")


def chart(**given: object) -> Alarms:
    return alarms(tracked(3000, 3, **given), reference=HALF, deviations={"temperature": 0.3})  # type: ignore[arg-type]


def test_a_change_is_told_with_its_time_and_its_modes() -> None:
    """Two thousandths in the first and the third mode, which is 3 and 4 times what a single record scatters."""
    found = chart(shift=-2e-3, at=2500)
    (alarm,) = found.alarms
    true = 2500 * 3600
    assert 0 <= alarm.time - true < 48 * 3600
    assert alarm.interval[0] <= true <= alarm.interval[1]
    assert alarm.interval[1] - alarm.interval[0] < 72 * 3600
    assert {name[0] for name in alarm.tracks} == {"1", "3"}
    for name in alarm.tracks:
        assert abs(alarm.shifts[name] + 2e-3) < 4 * alarm.shifts_std[name] + 1e-4
    line = json.loads(json.dumps(alarm.to_dict()))
    assert line["alarm"] == str(np.datetime64(round(alarm.time), "s"))
    assert str(alarm) in found.table()


@pytest.mark.slow
def test_no_change_is_no_alarm_and_a_single_spoilt_record_is_none() -> None:
    sound = tracked(3000, 3)
    assert len(alarms(sound, reference=HALF, deviations={"temperature": 0.3})) == 0
    f = np.ones((1500, 3)) * moved(np.zeros(1500), 3)
    f[1300] *= 1.5
    found = alarms(tracks(f, none=np.zeros(1500)), reference=np.arange(1500) < 700)
    assert len(found) == 0
    assert found.novelty[1300] > 100


@pytest.mark.parametrize("kind", ["cusum", "t2"])
def test_the_other_charts_tell_a_large_change(kind: str) -> None:
    f = np.ones((1500, 3)) * moved(np.zeros(1500), 3)
    f[1200:] *= 1 - 6e-4
    found = alarms(tracks(f, none=np.zeros(1500)), reference=np.arange(1500) < 700, chart=kind)
    assert found.alarms[-1].change == 1200 * 3600


@pytest.mark.slow
def test_more_false_alarms_are_a_lower_limit() -> None:
    rare, often = (
        alarms(tracked(3000, 3), false_per_year=rate, reference=HALF).statistic.max() for rate in (0.5, 12.0)
    )
    assert often > 1.1 * rare


def test_records_count_as_usual_ones_at_most() -> None:
    """The length of 99 % of normal records: of one track 2.576 deviations."""
    z = np.array([[100.0, np.nan], [2.57, np.nan], [-3.0, 4.0]])
    assert _bounded(z)[0, 0] == pytest.approx(2.5758, abs=1e-3)
    assert _bounded(z)[1, 0] == 2.57
    assert np.linalg.norm(_bounded(z)[2]) == pytest.approx(3.0349, abs=1e-3)


def test_a_reference_of_too_few_records_is_refused() -> None:
    for count, fault in ((99, "99 are given"), (100, "")):
        record = tracks(moved(np.zeros(300)), none=np.zeros(300))
        if fault:
            with pytest.raises(DataError, match=fault):
                alarms(record, reference=np.arange(300) < count)
        else:
            assert len(alarms(record, reference=np.arange(300) < count)) == 0


def test_tracks_that_are_rare_are_left_out_and_said() -> None:
    f = np.hstack([moved(np.zeros(1000)), moved(np.zeros(1000), seed=1)])
    f[::2, 1], f[1, 1] = np.nan, np.nan
    found = alarms(tracks(f, none=np.zeros(1000)))
    assert len(found.explained.tracks) == 1
    assert any("left out: 2: 1 Hz" in note for note in found.notes)
    assert any("is taken for sound" in note for note in found.notes)


@pytest.mark.study("monitoring")
def test_false_alarms_of_fifty_years(study) -> None:  # type: ignore[no-untyped-def]
    """A year as the reference, a year judged; a slow disturbance that nobody measures, 5 % spoilt records."""
    for kind in ("ewma", "cusum"):
        counts = [
            len(alarms(tracked(2 * 8766, 2000 + seed), chart=kind, deviations={"temperature": 0.3}, seed=seed))
            for seed in range(50)
        ]
        table = study(f"50 years of features without damage, {kind}", "50 years, seeds 2000 to 2049")
        table.row("false alarms a year where one is stated", float(np.mean(counts)), least=0.6, most=1.5, form=".2f")


@pytest.mark.study("monitoring")
def test_delay_of_alarms(study) -> None:  # type: ignore[no-untyped-def]
    delays = []
    for seed in range(20):
        found = alarms(
            tracked(2 * 8766, 3000 + seed, shift=-1e-3, at=14000), deviations={"temperature": 0.3}, seed=seed
        )
        true = 14000 * 3600
        after = [alarm.time - true for alarm in found.alarms if alarm.time >= true]
        delays.append(after[0] / 3600 if after else np.inf)
    table = study("a thousandth in two of eight frequencies, ewma", "20 years, seeds 3000 to 3019")
    table.row("hours to the alarm, median", float(np.median(delays)), most=48.0, form=".0f")
    table.row("hours to the alarm, longest", float(np.max(delays)), form=".0f")
