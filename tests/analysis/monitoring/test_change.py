"""Alarms: at the stated rate without a change, soon after one, with its time and what it did to which mode."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.records.years import SCATTER, SOUND, WEATHER, damaged, known, tracked
from modalscope.analysis.monitoring import Alarms, History, alarms, track
from modalscope.analysis.monitoring.change import _bounded
from modalscope.analysis.monitoring.history import assembled, rows_of
from modalscope.analysis.workflow.analyze import analyze
from modalscope.data import DataError
from modalscope.numerics.checks import IntArray
from modalscope.systems import Structure, modal_damping
from tests.analysis.monitoring.test_weather import moved, tracks

HALF = ("1970-01-01", "1970-01-17")


@pytest.fixture
def _few_years(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulate less to know a limit: a change that is far beyond it is told all the same."""
    monkeypatch.setattr("modalscope.analysis.monitoring.change._MOST", 300_000)


def chart(**given: object) -> Alarms:
    return alarms(tracked(600, 3, **given), reference=HALF, deviations={"temperature": 0.3})  # type: ignore[arg-type]


@pytest.mark.usefixtures("_few_years")
def test_a_change_is_told_with_its_time_and_its_modes() -> None:
    """Two thousandths in the first and the third mode, which is 3 and 4 times what a single record scatters."""
    found = chart(shift=-2e-3, at=480)
    (alarm,) = found.alarms
    true = 480 * 3600
    assert 0 <= alarm.time - true < 48 * 3600
    assert alarm.interval[0] <= true <= alarm.interval[1]
    assert alarm.interval[1] - alarm.interval[0] < 72 * 3600
    assert {name[0] for name in alarm.tracks[:2]} == {"1", "3"}
    for name in alarm.tracks[:2]:
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


@pytest.mark.usefixtures("_few_years")
def test_a_short_reference_has_a_provisional_test_and_a_shorter_one_is_refused() -> None:
    f = np.array([1.0, 2.0, 3.0]) * moved(np.zeros(200), 3)
    f[150:, 1] *= 1 - 1e-3
    f[130] *= 1.5
    record = tracks(f, none=np.zeros(200))
    for count in (20, 99):
        found = alarms(record, reference=np.arange(200) < count)
        (alarm,) = found.alarms
        assert 0 <= alarm.time / 3600 - 150 < 16
        assert alarm.tracks == ("2: 2 Hz",)
        assert found.chart == "step"
        assert "provisional" in found.notes[0]
    assert "provisional" not in str(alarms(record, reference=np.arange(200) < 100).notes)
    with pytest.raises(DataError, match="19 are given"):
        alarms(record, reference=np.arange(200) < 19)


@pytest.mark.slow
def test_a_mode_that_is_not_found_is_an_alarm_that_says_where_it_may_be() -> None:
    """Half of the later records have it elsewhere, with another damping; none has it at its place."""
    history, truth = damaged(400, 7)
    gone = (history.record >= 300) & (truth == 2)
    for kept, there in ((~gone, False), (np.ones(gone.size, bool), True)):
        f = np.where(gone, 1.7 * history.frequencies, history.frequencies)[kept]
        z = np.where(gone, 40 * history.damping_ratios, history.damping_ratios)[kept]
        less = History(
            times=history.times,
            record=history.record[kept],
            frequencies=f,
            damping_ratios=z,
            covariates=history.covariates,
        )
        (alarm,) = alarms(known(less, truth[kept], SCATTER * SOUND), reference=np.arange(400) < 250).alarms
        assert list(alarm.lost) == ["3: 3 Hz"] if not there else set(alarm.lost) <= {"3: 3 Hz"}
        assert 0 <= alarm.time / 3600 - 300 < 12
        assert alarm.interval[0] <= 3600 * 300 <= alarm.interval[1] + 3600 * 4
        if not there:
            assert np.isnan(alarm.lost["3: 3 Hz"])
            assert "3: 3 Hz is not found" in str(alarm)
            assert json.loads(json.dumps(alarm.to_dict()))["lost"] == {"3: 3 Hz": {"may_be_at": None}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("weather", "size", "modes"), [("steady", 0.1, 1), ("not measured", 0.02, 5), ("measured", 0.4, 5)]
)
def test_no_damage_is_too_large_to_be_told(weather: str, size: float, modes: int) -> None:
    history, _ = damaged(400, 5, at=300, size=size, modes=modes, weather=weather)
    first = alarms(track(history), reference=np.arange(400) < 240).alarms[0]
    assert 0 <= first.time / 3600 - 300 < 12
    assert -1.3 * size < first.shifts["1: 1.2 Hz"] < (-0.3 if weather == "not measured" else -0.7) * size


@pytest.mark.slow
def test_what_comes_later_changes_no_track_of_the_reference() -> None:
    sound, damage = (damaged(400, 5, at=300, size=size, modes=5) for size in (0, 0.2))
    found = [
        alarms(known(*each, SCATTER * SOUND), reference=np.arange(400) < 240).explained.tracks
        for each in (sound, damage)
    ]
    assert found[0].names == found[1].names
    assert np.array_equal(found[0].frequencies[:240], found[1].frequencies[:240], equal_nan=True)


@pytest.mark.slow
def test_tracks_that_are_rare_are_left_out_and_said() -> None:
    f = np.hstack([moved(np.zeros(1000)), moved(np.zeros(1000), seed=1)])
    f[::2, 1], f[1, 1] = np.nan, np.nan
    found = alarms(tracks(f, none=np.zeros(1000)))
    assert len(found.explained.tracks) == 1
    assert any("left out: 2: 1 Hz" in note for note in found.notes)
    assert any("is taken for sound" in note for note in found.notes)


SIZES = (0.003, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)


@pytest.mark.study("monitoring")
@pytest.mark.parametrize(("weather", "shapes"), [*((w, True) for w in WEATHER), ("steady", False)])
def test_alarms_come_no_later_as_damage_grows(weather: str, shapes: bool, study) -> None:  # type: ignore[no-untyped-def]
    """Hourly records: ten days as the reference, damage after another two and a half.

    No test of a mean of known size, whose false alarms are a year apart, finds a change in fewer than ln(8766) / (sum of squares of the
    change in deviations / 2) records on average (G. Lorden, "Procedures for reacting to a change in distribution", 1971).
    """
    seeds = range(4000, 4001)
    words = "" if shapes else ", without shapes"
    table = study(f"5 modes, damage after 300 hourly records, weather {weather}{words}", "seed 4000")
    sound = [len(_alarms(*damaged(480, seed, weather=weather, shapes=shapes)).alarms) for seed in seeds]
    table.row("alarms without damage in a week", sound, most=1)
    for modes, name in ((1, "one mode"), (2, "two modes"), (5, "all modes")):
        before = np.inf
        for size in SIZES:
            delays = []
            for seed in seeds:
                history, truth = damaged(480, seed, at=300, size=size, modes=modes, weather=weather, shapes=shapes)
                times = [a.time / 3600 - 299 for a in _alarms(history, truth).alarms if a.time / 3600 >= 300]
                delays.append(min(times, default=np.inf))
            delay = float(np.median(delays))
            bound = max(np.log(8766) / (modes * (size / SCATTER) ** 2 / 2), 1.0)
            later = "" if delay <= before + 2 else ", LATER than of less"
            told = f"{delay:.0f}; the bound of any test of a mean {bound:.1f}{later}"
            table.row(f"records to the alarm, {100 * size:g} % of {name}", told)
            assert not later, told
            assert np.isfinite(delay), told
            before = min(before, delay)


def _alarms(history: History, truth: IntArray) -> Alarms:
    return alarms(track(history), reference=np.arange(len(history)) < 240)


@pytest.mark.study("monitoring")
@pytest.mark.parametrize(
    ("weather", "years", "follow"), [("steady", 200, False), ("not measured", 60, False), ("steady", 6, True)]
)
def test_false_alarms_of_two_hundred_years(
    weather: str, years: int, follow: bool, study: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Records of six hours: 1000 as the reference, a year judged. Most years have the true tracks, which saves the time of following."""
    if not follow:
        monkeypatch.setattr("modalscope.analysis.monitoring.change.followed", lambda tracks, _: tracks)
    counts = []
    for seed in range(5000, 5000 + years):
        history, truth = damaged(2461, seed, weather=weather, hours=6.0)
        counts.append(len(alarms(known(history, truth, SCATTER * SOUND), reference=np.arange(2461) < 1000, seed=seed)))
    words = ", followed" if follow else ""
    table = study(f"{years} years without damage, weather {weather}{words}", f"{years} years, seeds from 5000")
    most = 1.2 if years > 50 else 3.0
    table.row("false alarms a year where one is stated", float(np.mean(counts)), most=most, form=".2f")


def _building(draw: np.random.Generator) -> Callable[[float, float], Structure]:
    """Return a building of 4 to 7 storeys by the part of its stiffness that a storey has lost, and what all of it is multiplied by."""
    count = int(draw.integers(4, 8))
    mass, k = draw.uniform(0.8, 1.2, count), 1500 * draw.uniform(0.8, 1.2, count) * np.linspace(1.5, 1, count)
    hurt, ratios = np.arange(count) == draw.integers(count), draw.uniform(0.008, 0.02, count)

    def of(loss: float, warm: float) -> Structure:
        q = warm * k * (1 - loss * hurt)
        K = np.diag(q + np.append(q[1:], 0)) - np.diag(q[1:], 1) - np.diag(q[1:], -1)
        return Structure(mass=np.diag(mass), stiffness=K, damping=modal_damping(np.diag(mass), K, ratios), inputs=(0,))

    return of


@pytest.mark.study("monitoring")
def test_a_storey_that_loses_a_tenth_of_its_stiffness_within_sixty_records(study) -> None:  # type: ignore[no-untyped-def]
    """Responses with 30 % noise, analyzed one by one; stiffness scatters by .4 %. Forty are the reference: a provisional test."""
    delays, false = [], []
    for seed in range(10):
        draw = np.random.default_rng([68, seed])
        of, warm = _building(draw), 1 + 0.004 * draw.standard_normal(60)
        rate = 2.6 * float(of(0, 1).modes().frequencies.max())
        for loss in (0.0, 0.1):
            rows = [
                rows_of(
                    analyze(
                        of(loss * (k >= 40), warm[k]).impulse_response(300, sampling_rate=rate, noise=0.3, seed=k)
                    ).modes
                )
                for k in range(60)
            ]
            history = assembled(rows, 3600.0 * np.arange(60), [str(k) for k in range(60)])
            found = alarms(track(history), reference=np.arange(60) < 40).alarms
            after = [alarm.time / 3600 - 39 for alarm in found if loss and alarm.time / 3600 >= 40]
            delays += [min(after, default=np.inf)] if loss else []
            false.append(len(found) - len(after[:1]))
    table = study(
        "60 hourly records of buildings of 4 to 7 storeys, the last 20 with a storey that lost 10 %",
        "10 buildings, seeds 0 to 9",
    )
    table.row("records to the alarm, median", float(np.median(delays)), most=8.0, form=".0f")
    table.row("records to the alarm, longest", float(np.max(delays)), most=12.0, form=".0f")
    table.row("other alarms, in 20 times 60 records", sum(false), most=1)


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
