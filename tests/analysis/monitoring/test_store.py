"""A store: each record once, whole or not at all; what is no store, or damaged, is refused."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.monitoring import Alarm, History, Store
from modalscope.data import DataError, ModalModel
from modalscope.systems import chain5

CHAIN = chain5()


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store(tmp_path / "a.modes") as made:
        yield made


def modes(shift: float = 0.0) -> ModalModel:
    return ModalModel(
        poles=[-1 + (100 + shift) * 1j, -2 + 200j, -3.0],
        shapes=[[1.0, 1.0, 1.0], [1j, -1.0, 0.0]],
        frequencies_std=[0.1, np.nan, np.nan],
        output_dofs=["a", "b"],
    )


def test_modes_come_back_to_the_last_bit_without_poles_that_do_not_oscillate(store: Store) -> None:
    assert store.add_modes(modes(), time="2026-06-01T00:00", name="first", covariates={"temperature": 3.5})
    back = store.history()
    assert back.frequencies.tolist() == modes().frequencies[:2].tolist()
    assert back.shapes.tolist() == modes().shapes[:, :2].T.tolist()
    assert back.frequencies_std[0] == 0.1
    assert np.isnan(back.frequencies_std[1])
    assert back.covariates["temperature"].tolist() == [3.5]
    assert (back.names, str(back.times[0])) == (("first",), "2026-06-01T00:00:00.000")


def test_records_come_back_by_time_with_the_channels_that_each_has(store: Store) -> None:
    store.add_modes(modes().select(outputs=["b"]), time="2026-06-02T00:00")
    store.add_modes(modes(), time="2026-06-01T00:00")
    back = store.history()
    assert str(back.times[0]).startswith("2026-06-01")
    assert back.output_dofs == ("a", "b")
    assert np.isnan(back.shapes[:, 0]).tolist() == [False, False, True, True]


def test_what_is_added_twice_is_stored_once(store: Store) -> None:
    assert [store.add_modes(modes(), time=0.0) for _ in range(2)] == [True, False]
    assert not store.add_modes(store.history())
    assert store.add_modes(modes(), time=1.0)
    assert len(store) == 2


def test_a_history_goes_in_whole(store: Store) -> None:
    """All of its records, though the first is new already."""
    history = History(times=np.arange(5.0), record=[0, 0, 3], frequencies=[1.0, 2.0, 1.1])
    assert store.add_modes(history)
    assert (len(store), store.history().record.tolist()) == (5, [0, 0, 3])


def test_a_record_is_identified_and_stored_with_all_that_repeats_it(store: Store) -> None:
    record = CHAIN.impulse_response(200, noise=0.01, seed=0)
    assert store.add(record, time="2026-06-01", method="era", orders=range(2, 17, 2))
    assert not store.add(record, time="2026-06-01", method="era", orders=range(2, 17, 2))
    found = store.history()
    assert np.allclose(found.frequencies, CHAIN.modes().frequencies, rtol=1e-2)
    assert np.isfinite(found.frequencies_std).all()
    (about,) = store.about()
    assert about["provenance"]["analysis"]["method"] == "era"
    assert about["settings"][0]["block_rows"] > 0


def test_data_without_a_time_are_refused(store: Store) -> None:
    for add in (store.add, store.add_modes):
        with pytest.raises(DataError, match=r"this time is not known.*\nGive time"):
            add(modes())


def test_a_record_that_cannot_be_used_is_listed_with_the_reason(store: Store, tmp_path: Path) -> None:
    path = tmp_path / "20260601_1200.csv"
    path.write_text("no numbers\n")
    assert store.add(path)
    assert not store.add(path)
    ((_, name, state, why),) = store.records
    assert (name, state, len(store), len(store.history())) == (path.name, "refused", 0, 0)
    assert "numbers" in why


def test_covariates_are_taken_at_the_times_of_records_and_not_across_gaps(store: Store) -> None:
    store.add_modes(History(times=[1800, 9000, 90000], record=[], frequencies=[]))
    store.add_covariates("t", [0, 3600, 7200, 10800, 180000], [0.0, 2.0, np.nan, 4.0, 5.0])
    assert np.allclose(store.history().covariates["t"], [1.0, 3.5, np.nan], equal_nan=True)


def test_several_read_while_one_writes(store: Store) -> None:
    store.add_modes(modes(), time=0)
    with Store(store.path) as reader:
        assert len(reader) == 1
        store.add_modes(modes(), time=1)
        assert len(reader) == 2


def test_modes_become_a_table(store: Store) -> None:
    pytest.importorskip("pandas")
    store.add_modes(modes(), time="2026-06-01T00:00", name="first")
    table = store.to_pandas()
    assert list(table)[2:] == ["frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std"]
    assert table.frequency_hz[0] == pytest.approx(15.9, abs=0.1)


def test_a_closed_store_says_so(store: Store) -> None:
    store.close()
    with pytest.raises(DataError, match="it is closed"):
        store.history()


def test_other_files_are_no_stores(tmp_path: Path) -> None:
    text, other, later = (tmp_path / name for name in ("text", "other", "later"))
    text.write_text("modes of a bridge, a long text that is no database " * 20)
    for path in (other, later):
        file = sqlite3.connect(path)
        file.execute("CREATE TABLE a (b)")
        file.close()
    Store(tmp_path / "whole").close()
    later.write_bytes((tmp_path / "whole").read_bytes())
    file = sqlite3.connect(later)
    file.execute("PRAGMA user_version = 2")
    file.close()
    for path, fault in ((text, "no store, or damaged"), (other, "another program"), (later, "layout 2")):
        with pytest.raises(DataError, match=fault):
            Store(path)
    with pytest.raises(DataError, match="its folder is not there"):
        Store(tmp_path / "nowhere" / "a.modes")


def test_a_store_from_a_stranger_runs_nothing(tmp_path: Path) -> None:
    """A trigger would be run by the next record that is stored."""
    Store(tmp_path / "a").close()
    file = sqlite3.connect(tmp_path / "a")
    file.execute("CREATE TRIGGER t AFTER INSERT ON record BEGIN DELETE FROM record; END")
    file.close()
    with pytest.raises(DataError, match="it holds what no store does: t"):
        Store(tmp_path / "a")


def test_damaged_shapes_are_refused(store: Store) -> None:
    store.add_modes(modes(), time=0)
    file = sqlite3.connect(store.path)
    file.execute("UPDATE mode SET shape = substr(shape, 2)")
    file.commit()
    with pytest.raises(DataError, match="not as it was written"):
        store.history()
    file.execute("UPDATE record SET provenance = '{}'")  # as of 0.2.0, without a seal
    file.commit()
    file.close()
    with pytest.raises(DataError, match="no store, or damaged"):
        store.history()


def test_a_store_damaged_anywhere_answers_or_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.modes"
    with Store(path) as store:
        for k in range(40):
            store.add_modes(modes(k), time=k)
    whole = path.read_bytes()
    draw = np.random.default_rng(0)
    answers = set()
    for _ in range(60):
        spoilt = bytearray(whole)
        at = int(draw.integers(len(spoilt) - 64))
        spoilt[at : at + 64] = draw.bytes(64)
        path.write_bytes(spoilt)
        try:
            with Store(path) as store:
                store.history()
            answers.add("answered")
        except DataError:
            answers.add("refused")
    assert answers == {"answered", "refused"}


WORK = """
import sys
import numpy as np
from modalscope.analysis.monitoring import History, Store
with Store(sys.argv[1]) as store:
    print("open", flush=True)
    for k in range(400):
        store.add_modes(History(times=[k], record=[0] * 8, frequencies=np.arange(1.0, 9) + k))
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no kill -9")
@pytest.mark.parametrize(
    "times", [pytest.param(1, marks=pytest.mark.slow), pytest.param(50, marks=pytest.mark.study("robustness"))]
)
def test_nothing_is_lost_or_twice_when_it_is_killed(tmp_path: Path, times: int) -> None:
    path = tmp_path / "a.modes"
    draw, before = np.random.default_rng(1), 0
    for _ in range(times):
        work = subprocess.Popen([sys.executable, "-c", WORK, str(path)], stdout=subprocess.PIPE)
        assert work.stdout is not None
        assert work.stdout.readline() == b"open\n"
        time.sleep(draw.uniform(0.02, 0.15))
        os.kill(work.pid, signal.SIGKILL)
        work.wait()
        work.stdout.close()
        with Store(path) as store:
            found = store.history()
        # what stood there stands, nothing twice, and each record with all its modes
        assert len(found) >= before
        assert found.seconds.tolist() == list(range(len(found)))
        assert found.frequencies.tolist() == [f + k for k in range(len(found)) for f in range(1, 9)]
        before = len(found)
    assert before > 0


@pytest.fixture
def months(store: Store) -> Store:
    """Return 240 hours of two modes, of which the first falls by 1 % at the 180th, with the air's temperature."""
    draw = np.random.default_rng(0)
    for hour in range(240):
        f = np.array([1.0, 2.0]) * (1 - 1e-4 * np.sin(hour / 9) + 2e-4 * draw.standard_normal(2))
        f[0] *= 0.99 if hour >= 180 else 1
        poles = 2 * np.pi * f * (-0.01 + 1j)
        store.add_modes(3600.0 * hour, ModalModel(poles=poles, shapes=np.eye(2), output_dofs=["a", "b"]))
    return store


@pytest.mark.slow
def test_a_store_gives_tracks_what_moves_them_and_alarms(months: Store) -> None:
    hours = np.arange(240)
    tracks = months.tracks()
    assert (len(tracks), tracks.frequencies.shape, tracks.shapes.shape) == (2, (240, 2), (240, 2, 2))
    assert tracks.times.tolist() == (3600.0 * hours).tolist()
    assert np.allclose(tracks.damping_ratios, 0.01, rtol=1e-3)
    assert np.abs(tracks.shapes[0].diagonal()).tolist() == [1, 1]
    assert tracks.probability.shape == tracks.frequencies_std.shape == (240, 2)
    assert np.nanmin(tracks.probability) > 0.99
    months.add_covariates("air", 3600.0 * np.arange(-1, 241), np.sin(np.arange(-1, 241) / 9))
    given = {"air": np.sin(hours / 9)}
    told = tracks.explained(given, during=(0, 3600 * 150))
    assert told.coefficients[1, 1] == pytest.approx(-1e-4, abs=4 * told.coefficients_std[1, 1])
    assert told.residual.shape == (240, 2)
    for found in (months.alarms(1.0, (0, 3600 * 150), given), months.alarms(reference=(0, 3600 * 150))):
        (alarm,) = found
        assert alarm.interval[0] <= 3600 * 180 <= alarm.interval[1]
        assert 0 <= alarm.time - 3600 * 180 < 3600 * 10
        assert alarm.tracks[0].startswith("1:")
        assert alarm.text == str(alarm)
        assert alarm.statistic > 1


def test_an_alarm_is_told_once_whoever_asks(store: Store) -> None:
    alarm = Alarm(time=5e5, change=4e5, interval=(3e5, 5e5), statistic=2.0, shifts={}, shifts_std={})
    assert store.tell(alarm)
    with Store(store.path) as again:
        assert not again.tell(replace(alarm, time=5e5 + 3600 * 40))
        assert again.tell(replace(alarm, time=5e5 + 3600 * 60))
    assert store.records.size == 0


@pytest.mark.slow
def test_covariates_of_refused_records_may_be_given_too(months: Store, tmp_path: Path) -> None:
    (tmp_path / "19700105_0030.csv").write_text("spoilt\n")
    months.add(tmp_path / "19700105_0030.csv")
    assert len(months.records) == 241
    given = {"air": np.insert(np.sin(np.arange(240) / 9), 97, 50.0)}
    (alarm,) = months.alarms(reference=(0, 3600 * 150), covariates=given)
    assert alarm.interval[0] <= 3600 * 180 <= alarm.interval[1]
    with pytest.raises(DataError, match="one value per record"):
        months.alarms(reference=(0, 3600 * 150), covariates={"air": np.zeros(239)})


def test_files_are_added_once_with_their_times_and_what_was_measured(store: Store, tmp_path: Path) -> None:
    for k in range(3):
        ms.write(tmp_path / f"{k}.npz", CHAIN.impulse_response(150, noise=0.01, seed=k))
    (tmp_path / "spoilt.csv").write_text("no numbers\n")
    files = [tmp_path / "2.npz", tmp_path / "spoilt.csv", tmp_path / "0.npz"]
    few = {"method": "era", "orders": range(2, 13, 2)}
    assert store.add(files, 1, [7200.0, 3600.0, 0.0], {"air": [1.0, 2.0, 3.0]}, **few) == 3
    assert store.add(files, times=[7200.0, 3600.0, 0.0], **few) == 0
    records = store.records
    assert [(r.time, r.file, r.state) for r in records] == [
        (0.0, "0.npz", "used"),
        (3600.0, "spoilt.csv", "refused"),
        (7200.0, "2.npz", "used"),
    ]
    assert "numbers" in records.reason[1]
    assert records["reason"][0] == ""
    assert store.history().covariates["air"].tolist() == [3.0, 1.0]
    for path in tmp_path.glob("*.*"):
        os.utime(path, (3600.0, 3600.0))
    assert store.add(tmp_path, **few) == 1
    assert store.add((path for path in files), **few) == 0
    assert store.add([]) == 0
    with pytest.raises(DataError, match=r"times.*one per file"):
        store.add(files, times=[0.0])
    with pytest.raises(DataError, match=r"air.*one value per file"):
        store.add(files, covariates={"air": [1.0]})
    with pytest.raises(DataError, match="there is no such file"):
        store.add([*files, tmp_path / "nowhere.csv"])


def test_records_become_a_table(months: Store) -> None:
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(months.records)
    assert list(table) == ["time", "file", "state", "reason"]
    assert len(table) == 240


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders")
@pytest.mark.parametrize("end", ["", "-wal", "-journal", "-shm"])
def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path: Path, end: str) -> None:
    os.mkfifo(tmp_path / f"a{end}")
    with pytest.raises(DataError, match="is no file"):
        Store(tmp_path / "a")
