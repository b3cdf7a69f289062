"""A store: each record once, whole or not at all; what is no store, or damaged, is refused."""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from modalscope.data import DataError, ModalModel
from modalscope.monitoring import History, Store
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
    ((name, why),) = store.refused()
    assert (name, len(store), len(store.history())) == (path.name, 0, 0)
    assert "numbers" in why


def test_covariates_are_taken_at_the_times_of_records_and_not_across_gaps(store: Store) -> None:
    store.add_modes(History(times=[1800, 9000, 90000], record=[], frequencies=[]))
    store.add_covariates([0, 3600, 7200, 10800, 180000], {"t": [0.0, 2.0, np.nan, 4.0, 5.0]})
    assert np.allclose(store.history().covariates["t"], [1.0, 3.5, np.nan], equal_nan=True)


def test_several_read_while_one_writes(store: Store) -> None:
    store.add_modes(modes(), time=0)
    with Store(store.path) as reader:
        assert len(reader) == 1
        store.add_modes(modes(), time=1)
        assert len(reader) == 2


def test_tables_are_written(store: Store, tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    store.add_modes(modes(), time="2026-06-01T00:00", name="first")
    store.export(tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines()
    assert lines[0] == "time,record,frequency_hz,damping_ratio,frequency_std_hz,damping_ratio_std"
    assert lines[1].startswith("2026-06-01,first,15.9")
    with pytest.raises(DataError, match=r"\.csv or \.parquet"):
        store.export(tmp_path / "a.txt")


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
    for path, fault in ((text, "no store, or damaged"), (other, "another program"), (later, "layout is 2")):
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
    with pytest.raises(DataError, match="its tables were changed: t"):
        Store(tmp_path / "a")


def test_damaged_shapes_are_refused(store: Store) -> None:
    store.add_modes(modes(), time=0)
    file = sqlite3.connect(store.path)
    file.execute("UPDATE mode SET shape = substr(shape, 2)")
    file.commit()
    file.close()
    with pytest.raises(DataError, match="shapes or numbers are damaged"):
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
from modalscope.monitoring import History, Store
with Store(sys.argv[1]) as store:
    print("open", flush=True)
    for k in range(400):
        store.add_modes(History(times=[k], record=[0] * 8, frequencies=np.arange(1.0, 9) + k))
"""


def _killed(path: Path, times: int) -> None:
    """Kill a process that stores as it works, and look at what is left."""
    draw, before = np.random.default_rng(1), 0
    for _ in range(times):
        work = subprocess.Popen([sys.executable, "-c", WORK, str(path)], stdout=subprocess.PIPE)
        assert work.stdout is not None
        assert work.stdout.readline() == b"open\n"
        time.sleep(draw.uniform(0.01, 0.05))
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


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no kill -9")
def test_nothing_is_lost_or_twice_when_it_is_killed(tmp_path: Path) -> None:
    _killed(tmp_path / "a.modes", 1)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no kill -9")
def test_nothing_is_lost_or_twice_when_it_is_killed_fifty_times(tmp_path: Path) -> None:
    _killed(tmp_path / "a.modes", 50)
