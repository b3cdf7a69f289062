"""Uneven times: what is told of the clock, what resampling gives back, and what it refuses."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from benchmarks.exports.verdict import dead_ends
from modalscope.io import read, survey
from modalscope.io.columns.axis import nearly_even, parts_of_second, sampling_of
from modalscope.io.columns.clock import clock_of, resampled
from modalscope.signals.doctor.examine import examine
from tests.support import DATA, refused

RATE, COUNT = 200.0, 2000


def times(jitter: float = 0.0, drift: float = 0.0, gap: int = 0, seed: int = 0) -> np.ndarray:
    """Times of `COUNT` samples, jitter in steps, the rate drifting by so much over the record, samples missing in the middle."""
    k = np.arange(COUNT, dtype=float)
    k[COUNT // 3 :] += gap
    rng = np.random.default_rng(seed)
    return (k - drift * k**2 / (2 * COUNT) + jitter * rng.uniform(-1, 1, COUNT)) / RATE


def motion(t: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(2 * np.pi * 7.3 * t), np.cos(2 * np.pi * 11.9 * t + 1)], axis=1)


def table(path: Path, t: np.ndarray, y: np.ndarray, head: str = "time [s],a [g],b [g]") -> Path:
    np.savetxt(path, np.column_stack([t, y]), delimiter=",", header=head, comments="", fmt="%.9f")
    return path


@pytest.mark.parametrize("drift", [0.0, 2e-3])
@pytest.mark.parametrize("jitter", [0.05, 0.4])
def test_jitter_drift_and_gaps_are_told_apart(jitter: float, drift: float) -> None:
    found = clock_of(times(jitter, drift, gap=7))
    assert found.gaps == ((COUNT // 3, 7),)
    assert found.jitter == pytest.approx(jitter / np.sqrt(3), rel=0.1)
    assert found.drift == pytest.approx(-drift / 2, abs=3e-4 * jitter + 1e-5)


@pytest.mark.parametrize("drift", [0.0, 5e-3])
@pytest.mark.parametrize("jitter", [0.05, 0.3])
def test_an_uneven_record_is_resampled_by_itself_where_little_is_lost(
    tmp_path: Path, jitter: float, drift: float
) -> None:
    t = times(jitter, drift)
    found = survey(table(tmp_path / "a.csv", t, motion(t)))
    record = found.thing
    grid = t[0] + np.arange(record.samples) / record.sampling_rate
    np.testing.assert_allclose(record.outputs[3:-3], motion(grid)[3:-3], atol=3e-3)
    assert any("times are uneven" in note and "% of the motion" in note for note in found.notes)


def test_of_a_record_with_a_gap_the_longest_stretch_is_taken(tmp_path: Path) -> None:
    t = times(0.1, gap=40)
    path = table(tmp_path / "a.csv", t, motion(t))
    with pytest.raises(ms.DataError, match="resample='auto'"):  # a third of the rows would be lost
        read(path)
    found = survey(path, resample="auto")
    assert found.thing.samples == pytest.approx(COUNT - COUNT // 3, abs=4)
    assert any(f"rows {COUNT // 3 + 1}-{COUNT} of {COUNT} were taken" in note for note in found.notes)


def test_motion_near_half_the_rate_is_not_resampled_unless_it_is_asked(tmp_path: Path) -> None:
    t = times(0.3)
    path = table(tmp_path / "a.csv", t, np.random.default_rng(1).standard_normal((COUNT, 2)))
    with pytest.raises(ms.DataError, match="resample='auto'"):
        read(path)
    found = survey(path, resample="auto")
    assert any("not known" in note for note in found.notes)
    with pytest.raises(ms.DataError, match="nothing stands between the samples"):
        read(path, resample=3 * RATE)


def test_even_records_are_resampled_when_it_is_asked(tmp_path: Path) -> None:
    t = times()
    path = table(tmp_path / "a.csv", t, motion(t))
    assert read(path).sampling_rate == RATE
    found = read(path, resample=150.0)
    assert found.sampling_rate == 150.0
    np.testing.assert_allclose(found.outputs, motion(np.arange(found.samples) / 150.0), atol=1e-3)


def test_splines_lose_what_their_order_says() -> None:
    t = np.arange(400) / 100.0
    for cycles in (0.05, 0.1, 0.15):
        y = np.sin(2 * np.pi * cycles * 100 * t)[:, None]
        uneven = t + 0.004 * np.sin(np.arange(400.0) ** 2)
        found, lost = resampled(uneven, np.sin(2 * np.pi * cycles * 100 * uneven)[:, None], 100.0)
        count = min(len(found), len(t))
        grid = uneven[0] + np.arange(count) / 100.0
        missed = np.sqrt(np.mean((found[5 : count - 5, 0] - np.sin(2 * np.pi * cycles * 100 * grid[5:-5])) ** 2))
        assert 0.2 < lost * np.std(y) / missed < 8


def test_values_that_hardly_vary_in_step_may_be_times() -> None:
    assert nearly_even(times(0.2, gap=5))
    assert not nearly_even(motion(times())[:, 0])


@pytest.mark.skipif(not (DATA / "footbridge").is_dir(), reason="the measured set footbridge is not there")
def test_the_clock_of_a_measured_wireless_node() -> None:
    found = survey(DATA / "footbridge" / "node_p1_000.CSV")
    assert found.thing.sampling_rate == pytest.approx(7194, abs=1)
    assert any("2 gaps with 232 samples missing" in note for note in found.notes)


# ------------------------------------------------------------------------------------------------- times without a unit


def counted(path: Path, t: np.ndarray, parts: float, head: str = "time,a [g],b [g]") -> Path:
    """A table whose times are whole parts of a second."""
    rows = zip(np.rint(t * parts).astype(np.int64), *motion(t).T, strict=True)
    path.write_text("\n".join([head, *(f"{k},{a:.6f},{b:.6f}" for k, a, b in rows)]) + "\n")
    return path


@pytest.mark.parametrize("start", [0.0, 1.7e9])
@pytest.mark.parametrize("parts", [1e3, 1e6])
def test_uneven_times_in_parts_of_a_second_are_resampled_as_such(tmp_path: Path, start: float, parts: float) -> None:
    white = np.random.default_rng(2).standard_normal((COUNT, 2))
    k = np.rint((start + times(0.3) - times(0.3)[0]) * parts).astype(np.int64)
    path = tmp_path / "a.csv"
    path.write_text(
        "\n".join(["time,a,b", *(f"{n},{a:.6f},{b:.6f}" for n, (a, b) in zip(k, white, strict=True))]) + "\n"
    )
    with pytest.raises(ms.DataError, match="resample='auto'"):
        read(path)
    found = survey(path, resample="auto")
    assert found.thing.sampling_rate == pytest.approx(RATE, rel=0.02)
    assert any({1e3: "milliseconds", 1e6: "microseconds"}[parts] in note for note in found.notes)


@pytest.mark.parametrize(
    "head", ["time_us,a,b", "micros,a,b", "Time (µs),a,b", "time[us],a,b", "elapsed microseconds,a,b"]
)
def test_names_and_units_of_microseconds(tmp_path: Path, head: str) -> None:
    found = survey(counted(tmp_path / "a.csv", times(), 1e6, head))
    assert found.thing.sampling_rate == RATE
    assert not any("have no unit" in note for note in found.notes)


def test_the_note_on_times_without_a_unit_names_the_way_out(tmp_path: Path) -> None:
    path = counted(tmp_path / "a.csv", times(), 1e6)
    found = survey(path)
    assert found.thing.sampling_rate == RATE
    assert any('taken as microseconds by their step of 5000 (else: --units "time=s")' in note for note in found.notes)
    assert read(path, units={"time": "s"}).sampling_rate == pytest.approx(RATE / 1e6)


@pytest.mark.parametrize(
    ("step", "rate", "parts"),
    [
        (2.0, None, 1.0), (2.01, None, 1e3), (200.0, None, 1e3), (201.0, None, 1e6), (2e5, None, 1e6), (2.01e5, None, 1e9),
        (2.1e8, None, 1.0), (10.0, 0.1, 1.0), (10.0, 100.0, 1e3), (10.0, 1e5, 1e6), (1.0, 1000.0, 1e3), (10.0, 77.0, 1.0),
    ],
)  # fmt: skip
def test_parts_of_a_second_by_the_step_or_by_the_rate(step: float, rate: float | None, parts: float) -> None:
    assert parts_of_second(step * np.arange(9.0), rate) == parts


def test_a_rate_in_the_header_says_what_times_count(tmp_path: Path) -> None:
    path = counted(tmp_path / "a.csv", times(), 1e3, "Sample rate:,200\ntime,a,b")
    assert read(path).sampling_rate == RATE
    assert read(counted(tmp_path / "b.csv", times(), 1e3), sampling_rate=RATE).sampling_rate == RATE


@pytest.mark.parametrize("per_period", [12, 16, 24])
def test_what_resampling_loses_falls_with_the_fourth_power_of_the_step(per_period: int) -> None:
    """Between even samples of a sine the splines' error is known; the estimate from every other sample tends to it, from above."""
    t = np.arange(2000.0)
    twice, lost = resampled(t, np.sin(2 * np.pi * t / per_period)[:, None], 2.0)
    between = twice[1::2, 0] - np.sin(2 * np.pi * (t[:-1] + 0.5) / per_period)
    assert 1 < lost / (np.sqrt(2) * np.std(between[20:-20])) < 1.4


def test_of_records_that_follow_each_other_in_one_table_one_is_asked_for(tmp_path: Path) -> None:
    values = np.random.default_rng(5).standard_normal((900, 2))
    rows = "\n".join(f"{(k % 300) / 200:.4f},{a:.6f},{b:.6f}" for k, (a, b) in enumerate(values))
    path = tmp_path / "three.csv"
    path.write_text("Time (s),Force (N),Acc (g)\n" + rows)
    message = refused("begin anew in row 301: 3 records follow each other", ms.read, path).args[0]
    assert not dead_ends(path, message)
    assert np.allclose(ms.read(path, rows="301-600").outputs[:, 0], values[300:600, 1], atol=1e-6)


@pytest.mark.parametrize("rate", [100.0, 51.2, 128.0, 1024.0])
@pytest.mark.parametrize("start", [0.0, 0.37])
def test_whole_seconds_give_the_rate_by_the_samples_from_tick_to_tick(rate: float, start: float) -> None:
    whole = np.floor(start + np.arange(int(60 * rate)) / rate)
    assert sampling_of(whole).rate == rate


@pytest.mark.parametrize(("seconds", "asked"), [(10.5, True), (12.5, False)])
def test_whole_seconds_over_too_few_samples_leave_the_rate_open(tmp_path: Path, seconds: float, asked: bool) -> None:
    values = np.random.default_rng(6).standard_normal(int(100 * seconds))
    path = tmp_path / "a.csv"
    path.write_text("Time,Acc\n" + "".join(f"10:12:{10 + k // 100},{v:.5f}\n" for k, v in enumerate(values)))
    if asked:
        refused("the times in column 1, 'Time' .s. have too few digits", read, path)
    else:
        assert read(path).sampling_rate == 100


@pytest.mark.parametrize("rate", [100.0, 10000.0])
@pytest.mark.parametrize("rows", [300, 317, 341])
def test_times_printed_to_their_step_are_no_coarse_clock(rate: float, rows: int) -> None:
    printed = np.array([float(f"{1615716753.0 + k / rate:.6f}") for k in range(rows)])
    assert sampling_of(printed).doubt < 1e-3 * rate
    assert sampling_of(np.round(np.arange(rows) / rate, 8)).doubt < 1e-6 * rate


def exactly(path: Path, t: np.ndarray, y: np.ndarray) -> Path:
    """Write a table with all digits."""
    np.savetxt(path, np.column_stack([t, y]), delimiter=",", header="time [s],a [g],b [g]", comments="")
    return path


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("factor", "last"), [(1e200, 0.0), (1e-300, 0.0), (1.0, 1e30), (1.0, 1e300)])
def test_times_beyond_all_measure_are_answered_without_a_warning(tmp_path: Path, factor: float, last: float) -> None:
    t = times(jitter=0.1) * factor
    t[-1] += last
    with contextlib.suppress(ms.DataError):
        ms.read(exactly(tmp_path / "a.csv", t, motion(times())))


@pytest.mark.filterwarnings("error")
def test_values_beyond_all_measure_are_resampled_without_a_warning(tmp_path: Path) -> None:
    even = ms.read(exactly(tmp_path / "a.csv", times(jitter=0.1), motion(times())), resample="auto")
    huge = ms.read(exactly(tmp_path / "b.csv", times(jitter=0.1), 1e306 * motion(times())), resample="auto")
    np.testing.assert_allclose(huge.outputs / 1e306, even.outputs, rtol=1e-5, atol=1e-9)


def test_a_clipped_record_stays_flat_when_it_is_resampled_and_is_told(tmp_path: Path) -> None:
    t = times(jitter=0.05)
    y = np.clip(1.5 * motion(t), -1, 1)  # three samples and more at the limit, at every peak
    found = survey(table(tmp_path / "a.csv", t, y))
    assert any("times are uneven" in note for note in found.notes)
    assert np.abs(found.thing.outputs).max() == 1
    assert {finding.kind for finding in examine(found.thing)} >= {"clipped"}
    free, _ = resampled(t, 1.5 * motion(t), RATE)
    assert np.abs(free).max() <= 1.5 + 1e-4


@pytest.mark.parametrize("digits", [2, 3])
def test_times_of_a_fixed_number_of_digits_are_even_though_they_lose_decimals(digits: int) -> None:
    k = np.arange(3600)
    printed = np.array([f"{value:.{digits}e}" for value in k * 2.5e-4]).astype(
        float
    )  # a spreadsheet's 2.50E-04 ... 8.99E-01
    assert sampling_of(printed).rate == pytest.approx(4000, rel=1e-3)
    printed[1000:] += 0.05
    with pytest.raises(ms.DataError, match="leave the even grid"):
        sampling_of(printed)
