"""Records that stay in their file give the numbers of records in memory, whoever sums, and however often a run is stopped."""

from __future__ import annotations

import contextlib
import gc
import shutil
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.stored import StoredSignals
from modalscope.numerics import sums as saved_sums
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import working
from modalscope.signals.doctor import examine
from modalscope.signals.preprocess import correlation_blocks, decimate, filter_band, stored_correlation
from modalscope.signals.preprocess.conditioning import settling

RATE, SAMPLES, CHANNELS = 50.0, 30_000, 4

#: Sums of so many products differ by rounding alone.
EQUAL = 1e-12


@dataclass(frozen=True)
class Held:
    """Rows in memory, which count how often they are read."""

    values: Any
    reads: list[tuple[int, int]] = field(default_factory=list)

    @property
    def shape(self) -> tuple[int, int]:
        return self.values.shape

    @property
    def identity(self) -> str:
        return f"held {self.values.sum()!r}"

    def read(self, start: int, stop: int) -> Any:
        self.reads.append((start, stop))
        return self.values[start:stop]


@pytest.fixture(scope="module")
def record() -> ms.Signals:
    made = ms.systems.chain5().simulate(inputs="ambient", duration=SAMPLES / RATE, sampling_rate=RATE, seed=3)
    drift = 1e3 + np.linspace(0, 5, made.samples)[:, None]  # a mean far above what is looked for
    return ms.Signals(outputs=made.outputs[:, :CHANNELS] / made.outputs.std() + drift, sampling_rate=RATE)


def stored(record: ms.Signals) -> StoredSignals:
    return StoredSignals(rows=Held(record.outputs), sampling_rate=record.sampling_rate)


@pytest.fixture
def small_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_correlation, "_TASK_NUMBERS", 3000)
    monkeypatch.setattr(stored_correlation, "_NUMBERS_IN_MEMORY", 2000)


def relative(a: Any, b: Any) -> float:
    return float(np.abs(np.asarray(a) - b).max() / np.abs(b).max())


@pytest.mark.usefixtures("small_tasks")
def test_correlations_are_those_of_the_record_in_memory(record: ms.Signals) -> None:
    level = ms.Signals(outputs=record.outputs - record.outputs.mean(axis=0), sampling_rate=RATE)
    for kwargs in ({"lags": 60}, {"lags": 60, "references": [2, 0]}):
        found = ms.estimate_correlation(stored(record), **kwargs)
        expected = ms.estimate_correlation(level, **kwargs)
        # what is measured stands 1e-3 of the mean above it: products of the mean would be 1e6 times as large
        assert relative(found.values, expected.values) < 1e-9
        assert relative(found.feedthrough, expected.feedthrough) < 1e-9
        assert found.kind == "correlation"
        assert found.input_dofs == expected.input_dofs


@pytest.mark.usefixtures("small_tasks")
def test_blocks_are_those_of_the_record_in_memory(record: ms.Signals) -> None:
    level = ms.Signals(outputs=record.outputs - record.outputs.mean(axis=0), sampling_rate=RATE)
    found, expected = (correlation_blocks(each, lags=40, blocks=7) for each in (stored(level), level))
    assert relative(found.sums, expected.sums) < EQUAL
    np.testing.assert_array_equal(found.pairs, expected.pairs)


@pytest.mark.usefixtures("small_tasks")
def test_the_record_is_read_once_for_correlations_and_deviations(record: ms.Signals) -> None:
    rows = Held(record.outputs)
    thing = StoredSignals(rows=rows, sampling_rate=RATE)
    ms.estimate_correlation(thing, lags=40)
    reads = len(rows.reads)
    correlation_blocks(thing, lags=40, blocks=20)
    assert len(rows.reads) == reads
    assert sum(stop - start for start, stop in rows.reads) < 1.3 * SAMPLES  # the opening, and lags beyond each stretch


@pytest.mark.parametrize("zero_phase", [False, True])
def test_a_filtered_stretch_is_that_of_the_whole(record: ms.Signals, zero_phase: bool) -> None:
    thing = stored(record)
    for found, expected in (
        (decimate(thing, 5, zero_phase=zero_phase), decimate(record, 5, zero_phase=zero_phase)),
        (filter_band(thing, 1.0, 4.0, zero_phase=zero_phase), filter_band(record, 1.0, 4.0, zero_phase=zero_phase)),
        (
            filter_band(decimate(thing, 2), 0.5, 3.0, zero_phase=zero_phase),
            filter_band(decimate(record, 2), 0.5, 3.0, zero_phase=zero_phase),
        ),
    ):
        assert (found.samples, found.sampling_rate) == (expected.samples, expected.sampling_rate)
        assert found.processing == expected.processing
        whole = expected.outputs
        for start, stop in ((0, 200), (1234, 1999), (found.samples - 77, found.samples), (0, found.samples)):
            # the mean is a thousand times what is left of it: rounding of the one is seen in the other
            assert np.abs(found.chunk(start, stop) - whole[start:stop]).max() < 1e-10 * np.abs(record.outputs).max()


def test_a_filter_forgets_its_start_in_the_time_that_its_slowest_pole_takes() -> None:
    assert settling(np.array([[1.0, 0, 0, 1, -1.8, 0.9025], [1.0, 0, 0, 1, -0.5, 0]])) == np.ceil(
        np.log(1e-20) / np.log(0.95)
    )


@pytest.mark.usefixtures("small_tasks")
def test_a_run_that_is_stopped_goes_on(record: ms.Signals, tmp_path: Path) -> None:
    expected = ms.estimate_correlation(stored(record), lags=60).values

    class Stopped(Exception):
        pass

    done: list[int] = []

    def stop(count: int, _: int) -> None:
        done.append(count)
        if count == 12:
            raise Stopped

    with pytest.raises(Stopped), working(progress=stop, save=tmp_path):
        ms.estimate_correlation(stored(record), lags=60)
    assert len(list(tmp_path.iterdir())) == 1
    with working(progress=lambda count, of: done.append(count), save=tmp_path):
        # another work has another file
        ms.estimate_correlation(stored(record), lags=30)
        done.clear()
        found = ms.estimate_correlation(stored(record), lags=60).values
    assert done[0] == 13
    np.testing.assert_allclose(found, expected, rtol=0, atol=EQUAL * np.abs(expected).max())
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("small_tasks")
def test_a_run_that_is_killed_goes_on_from_what_was_kept(
    record: ms.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is written at the end of a process that is killed: what lies in the folder meanwhile is what is gone on from."""
    monkeypatch.setattr(saved_sums, "_MIN_SECONDS_BETWEEN", 0.0)
    monkeypatch.setattr(saved_sums, "_MIN_MULTIPLE_OF_WRITING", 0.0)
    done: list[int] = []

    def copied(count: int, of: int) -> None:
        done.append(count)
        if count == of // 2:
            shutil.copytree(tmp_path / "sums", tmp_path / "left")

    with working(progress=copied, save=tmp_path / "sums"):
        expected = ms.estimate_correlation(stored(record), lags=60).values
    of = done[-1]
    with working(progress=lambda count, _: done.append(count), save=tmp_path / "left"):
        found = ms.estimate_correlation(stored(record), lags=60).values
    assert done == [*range(1, of + 1), *range(of // 2 + 1, of + 1)]
    np.testing.assert_array_equal(found, expected)  # the same sums in the same order


@pytest.mark.usefixtures("small_tasks")
def test_the_first_task_is_kept_as_it_ends_and_a_second_run_in_the_folder_is_told(
    record: ms.Signals, tmp_path: Path
) -> None:
    kept: list[int] = []

    def look(count: int, _: int) -> None:
        kept.append(len(list(tmp_path.glob("sums-*.npz"))))
        if count == 2:
            with pytest.raises(DataError, match="another run works on the same sums there"), working(save=tmp_path):
                ms.estimate_correlation(stored(record), lags=60)

    with working(progress=look, save=tmp_path):
        ms.estimate_correlation(stored(record), lags=60)
    assert kept[0] == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("small_tasks")
def test_a_run_that_cannot_save_at_its_end_lets_the_sums_go(record: ms.Signals, tmp_path: Path) -> None:
    def exchange(count: int, _: int) -> None:
        if count == 2:
            (kept,) = tmp_path.glob("sums-*.npz")
            kept.unlink()
            kept.mkdir()

    with (
        pytest.raises(DataError, match="the system refuses: is a directory"),
        working(progress=exchange, save=tmp_path),
    ):
        ms.estimate_correlation(stored(record), lags=60)
    assert [path.suffix for path in tmp_path.iterdir()] == [".npz"]  # no lock: it is closed and gone


@pytest.mark.parametrize("place", ["import_module", "SavedSums._take_up"])
def test_an_interruption_leaves_no_lock_open(place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the lock is taken, and while kept sums are read."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"modalscope.numerics.sums.{place}", interrupt)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", ResourceWarning)
        with contextlib.suppress(KeyboardInterrupt):
            saved_sums.SavedSums(tmp_path, "sums of nothing", (1, 2), tasks=3)
        gc.collect()
    assert not told


@pytest.mark.usefixtures("small_tasks")
def test_sums_of_another_content_are_not_gone_on_from(record: ms.Signals, tmp_path: Path) -> None:
    """Size, date and name of a file may stay where its samples change."""
    done: list[int] = []

    def stop(count: int, _: int) -> None:
        done.append(count)
        if len(done) == 3:
            raise KeyboardInterrupt

    other = replace(record, outputs=record.outputs * (1 + 1e-9))
    assert stored(other).fingerprint != stored(record).fingerprint == stored(record).fingerprint
    with pytest.raises(KeyboardInterrupt), working(progress=stop, save=tmp_path):
        ms.estimate_correlation(stored(record), lags=60)
    with working(progress=stop, save=tmp_path):
        ms.estimate_correlation(stored(other), lags=60)
    assert done[3] == 1


@pytest.mark.usefixtures("small_tasks")
def test_a_damaged_file_of_sums_is_none(record: ms.Signals, tmp_path: Path) -> None:
    def stop(count: int, _: int) -> None:
        if count == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), working(progress=stop, save=tmp_path):
        ms.estimate_correlation(stored(record), lags=60)
    (kept,) = tmp_path.iterdir()
    whole = kept.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole[:100] + b"x" * 50 + whole[150:]):
        kept.write_bytes(damaged)
        done: list[int] = []
        with working(progress=lambda count, of, done=done: done.append(count), save=tmp_path):
            ms.estimate_correlation(stored(record), lags=60)
        assert done[0] == 1


def test_nan_is_found_where_it_is_read(record: ms.Signals) -> None:
    values = np.array(record.outputs)
    values[20_011, 2] = np.nan
    thing = StoredSignals(rows=Held(values), sampling_rate=RATE)
    with pytest.raises(DataError, match=r"from sample 0 on.*\(20011, 2\)"):
        ms.estimate_correlation(thing, lags=50)


def test_modes_are_those_of_the_record_in_memory(record: ms.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modalscope.data.stored._MIN_RECORDS_IN_MEMORY", 10**9)  # it stays where it is stored
    settings = {"band": (0.2, 12.0), "orders": range(2, 31, 2)}
    found, expected = (ms.stabilize(each, **settings) for each in (stored(record), record))
    np.testing.assert_allclose(found.frequencies, expected.frequencies, rtol=1e-6)
    np.testing.assert_allclose(found.frequencies_std, expected.frequencies_std, rtol=1e-4)
    modes, other = ms.select(found), ms.select(expected)
    np.testing.assert_allclose(modes.frequencies, other.frequencies, rtol=1e-6)


def test_a_record_that_stays_where_it_is_stored_is_not_refined_and_says_so(
    record: ms.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("modalscope.data.stored._MIN_RECORDS_IN_MEMORY", 10**9)
    settings = {"band": (0.2, 12.0), "orders": range(2, 31, 2)}
    told = [note.text for note in ms.analyze(stored(record), **settings).modes.notes if note.kind == "not refined"]
    assert told == ["Not refined: the record is too large to hold all of its lines in memory"]


@pytest.mark.slow
def test_a_short_record_is_taken_into_memory(record: ms.Signals) -> None:
    found = ms.stabilize(stored(record), orders=range(2, 21, 2), method="ssi-data")
    assert len(ms.select(found)) > 0
    assert examine(stored(record)) == examine(record)


def test_what_needs_all_of_it_says_so(record: ms.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    thing = stored(record)
    np.testing.assert_array_equal(thing.load().outputs, record.outputs)
    assert thing.select(outputs=[1]).load().outputs.shape == (SAMPLES, 1)
    monkeypatch.setattr("modalscope.numerics.resources._allowed", 1_000_000)
    with pytest.raises(DataError, match="a record of 30000 samples in memory"):
        thing.load()
    with pytest.raises(DataError, match="correlations of 4 channels with 4 references over 2000 lags"):
        ms.estimate_correlation(thing)
    with pytest.raises(DataError, match="a stored record has no windowed estimate"):
        ms.estimate_correlation(thing, lags=20, window="hann")
    with pytest.raises(DataError, match="expected Signals"):
        ms.preprocess.detrend(thing)
    monkeypatch.setattr("modalscope.data.stored._MIN_RECORDS_IN_MEMORY", 10**9)
    with pytest.raises(DataError, match="it needs records without inputs"):
        ms.stabilize(thing.select(outputs=[0]), method="ssi-data", band=(0.2, 12.0))
