"""Rows that sensors write in turn, or below each other, and clocks that lost a frame, drift, or count coarsely."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import survey

RATE, ROWS = 100.0, 800
K = np.arange(ROWS)


def _motion(t: np.ndarray, k: int) -> np.ndarray:
    return np.asarray(k * np.sin(8 * np.pi * t) * np.exp(-0.1 * t) + 0.3 * np.cos(12 * np.pi * t + k))


def _write(path: Path, head: str, rows: list[str]) -> Path:
    path.write_text("\n".join([*([head] if head else []), *rows]) + "\n")
    return path


@pytest.mark.parametrize("form", ["time,node,acc (g)|{t:.6f},Node{s},{y:.6f}", "|Node{s}\t{t:.6f}\t{y:.6f}"])
def test_boards_that_write_in_turn_are_channels_on_one_clock(form: str, tmp_path: Path) -> None:
    head, _, row = form.partition("|")
    # three boards, a third of a step apart
    rows = [
        row.format(s=s, t=t, y=_motion(t, s)) for k in K for s in (1, 2, 3) if (t := k / RATE + (s - 1) / RATE / 3) >= 0
    ]
    found = ms.read(_write(tmp_path / "a.txt", head, rows))
    assert (found.output_dofs, found.sampling_rate) == (("Node1", "Node2", "Node3"), RATE)
    t = 2 / RATE / 3 + np.arange(found.samples) / RATE  # the last board begins last
    wanted = np.stack([_motion(t, s) for s in (1, 2, 3)], 1)
    np.testing.assert_allclose(found.outputs[10:-10], wanted[10:-10], atol=1e-3)


def test_a_clock_in_milliseconds_with_a_pause_needs_no_rate(tmp_path: Path) -> None:
    rows, pause = [], 0.0
    for k in K:
        pause += 0.2 * (k == 500)
        rows += [
            f"{1.65e12 + round(1e3 * (k / RATE + pause + s / 300)):.0f},S{s}:,{_motion(k / RATE + pause + s / 300, 1):.4f},{s}.5"
            for s in (0, 1)
        ]
    found = survey(_write(tmp_path / "a.csv", "", rows))
    assert found.thing.output_dofs == ("S0 1", "S0 2", "S1 1", "S1 2")
    assert found.thing.sampling_rate == pytest.approx(RATE, rel=2e-3)
    assert any("the longest stretch without a gap" in note for note in found.notes)


def test_sensors_below_each_other_and_numbers_of_sensors(tmp_path: Path) -> None:
    below = [f"{k / RATE:.2f},S{s},{_motion(k / RATE, s):.5f}" for s in (1, 2) for k in K]
    found = ms.read(_write(tmp_path / "a.csv", "Time (s),Sensor,Acc (m/s2)", below))
    np.testing.assert_allclose(found.outputs, np.stack([_motion(K / RATE, s) for s in (1, 2)], 1), atol=1e-5)
    numbers = [f"{k / RATE:.2f},{s},{_motion(k / RATE, s):.5f}" for k in K for s in (7, 9)]
    assert ms.read(_write(tmp_path / "b.csv", "time (s),id,a", numbers)).output_dofs == ("7", "9")


def test_text_that_names_no_sensors_parts_nothing(tmp_path: Path) -> None:
    runs = [f"{k / RATE:.2f},run{s},{_motion(k / RATE, s):.5f}" for s in (1, 2) for k in K]
    with pytest.raises(ms.DataError, match="2 records follow each other"):
        ms.read(_write(tmp_path / "a.csv", "Time (s),Run,Acc (m/s2)", runs))
    states = [f"{k / RATE:.2f},{_motion(k / RATE, 1):.5f},{'ok' if k % 5 else 'late'}" for k in K]
    assert ms.read(_write(tmp_path / "b.csv", "Time (s),Acc,State", states)).outputs.shape == (ROWS, 1)


def _recorded(path: Path, times: np.ndarray, at: np.ndarray) -> Path:
    noise = 0.01 * np.random.default_rng(1).standard_normal((2, at.size))
    return _write(
        path,
        "time (s),a,b",
        [
            f"{t:.6f},{_motion(x, 1) + p:.5f},{_motion(x, 2) + q:.5f}"
            for t, x, p, q in zip(times, at, *noise, strict=True)
        ],
    )


@pytest.mark.parametrize("lost", [[300], [100, 400, 650], [500, 501]])
def test_few_lost_frames_are_filled_and_said(lost: list[int], tmp_path: Path) -> None:
    at = np.delete(K / RATE, lost)
    found = survey(_recorded(tmp_path / "a.csv", at, at))
    assert found.thing.samples == ROWS
    assert any("resampled to 100 Hz" in note for note in found.notes)
    np.testing.assert_allclose(found.thing.outputs[:, 0], _motion(K / RATE, 1), atol=0.08)


def test_where_the_samples_go_on_the_clock_alone_skipped(tmp_path: Path) -> None:
    times = K / RATE + (K >= 300) / RATE
    found = survey(_recorded(tmp_path / "a.csv", times, K / RATE))
    assert found.thing.samples == ROWS
    assert any("the samples go on evenly" in note for note in found.notes)


def test_many_lost_frames_are_asked_about(tmp_path: Path) -> None:
    at = np.delete(K / RATE, np.arange(300, 320))
    with pytest.raises(ms.DataError, match="rows='"):
        ms.read(_recorded(tmp_path / "a.csv", at, at))


def test_a_slow_drift_of_three_steps_is_followed(tmp_path: Path) -> None:
    at = (K + 3 * (K / ROWS) ** 2) / RATE
    found = ms.read(_recorded(tmp_path / "a.csv", at, at))
    assert found.sampling_rate == pytest.approx(RATE, rel=5e-3)


def test_two_samples_are_too_few_and_it_is_said(tmp_path: Path) -> None:
    with pytest.raises(ms.DataError, match="2 samples are too few"):
        ms.read(_write(tmp_path / "a.csv", "time (s),a", ["0,1", "1,2"]))
