"""A folder is watched: each file once, by its content; what cannot be used is listed, and the rest goes on."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.monitoring import Store, collect, read_covariates
from modalscope.analysis.monitoring.entries import time_of_file
from modalscope.data import DataError
from modalscope.systems import chain5

FEW = {"method": "era", "orders": range(2, 13, 2)}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder of two records and a file that is none, written an hour ago."""
    place = tmp_path / "records"
    (place / "later").mkdir(parents=True)
    for k, name in enumerate(("20260601_0000.npz", "later/20260601_0100.npz")):
        ms.write(place / name, chain5().impulse_response(150, noise=0.01, seed=k))
    (place / "20260601_0030.csv").write_text("spoilt\n")
    (place / "notes.md").write_text("no record")
    for path in place.rglob("*.*"):
        os.utime(path, (time.time() - 3600,) * 2)
    return place


def test_every_file_is_stored_once_or_listed_with_its_reason(folder: Path, tmp_path: Path) -> None:
    with Store(tmp_path / "a.modes") as store:
        first = collect(folder, store, options=FEW)
        assert (first.added, first.known, [name for name, _ in first.refused]) == (2, 0, ["20260601_0030.csv"])
        (folder / "20260601_0000.npz").rename(folder / "again_20260601_0000.npz")
        again = collect(folder, store, options=FEW)
        assert (again.added, again.known, again.refused) == (0, 3, ())
        assert store.forget_refused() == 1
        assert [name for name, _ in collect(folder, store, options=FEW).refused] == ["20260601_0030.csv"]
        assert [str(t)[11:16] for t in store.history().times] == ["00:00", "01:00"]


@pytest.mark.slow
def test_several_processes_store_the_same_as_one(folder: Path, tmp_path: Path) -> None:
    with Store(tmp_path / "a.modes") as one, Store(tmp_path / "b.modes") as two:
        collect(folder, one, options=FEW)
        collect(folder, two, jobs=2, options=FEW)
        assert one.history().frequencies.tolist() == two.history().frequencies.tolist()
        assert one.records.tolist() == two.records.tolist()


def test_a_file_that_is_being_written_waits(folder: Path, tmp_path: Path) -> None:
    grown, stop = folder / "20260601_0200.csv", threading.Event()

    def write() -> None:
        while not stop.is_set():
            with grown.open("a") as file:
                file.write("1,2\n")
            time.sleep(0.01)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        with Store(tmp_path / "a.modes") as store:
            assert collect(folder, store, settled=0.2, options=FEW).waiting == (grown.name,)
    finally:
        stop.set()
        writer.join()


def test_a_file_that_changed_replaces_its_record(folder: Path, tmp_path: Path) -> None:
    path, hour_ago = folder / "20260601_0000.npz", (time.time() - 3600,) * 2
    (folder / "copy_20260601_0100.npz").write_bytes((folder / "later/20260601_0100.npz").read_bytes())
    os.utime(folder / "copy_20260601_0100.npz", hour_ago)
    with Store(tmp_path / "a.modes") as store:
        assert collect(folder, store, options=FEW).replaced == ()
        for changed in (path, folder / "later/20260601_0100.npz"):
            ms.write(changed, chain5().impulse_response(150, noise=0.01, seed=10 + len(changed.parts)))
            os.utime(changed, hour_ago)
            found = collect(folder, store, options=FEW)
            assert (found.added, found.replaced) == (1, (changed.name,))
        # the copy still has what the second one had before
        assert sorted(name for name in store.records.file if name.endswith("npz")) == [
            "20260601_0000.npz",
            "20260601_0100.npz",
            "copy_20260601_0100.npz",
        ]
        assert len(store.history().frequencies) == 15


def test_times_ahead_of_the_clock_are_questioned(folder: Path, tmp_path: Path) -> None:
    (folder / "20260601_0000.npz").rename(folder / "20990601_0000.npz")
    os.utime(folder / "later/20260601_0100.npz", (time.time() + 500,) * 2)
    with Store(tmp_path / "a.modes") as store:
        found = collect(folder, store, settled=0, options=FEW)
    assert found.waiting == ("20260601_0100.npz (its date is ahead of the clock)",)
    assert any("2099-06-01 00:00 by the name of the file, is ahead of the clock" in why for _, why in found.refused)


POOL = """
import sys, time
from pathlib import Path
from modalscope.analysis.monitoring.collecting import Task, identified
if __name__ == "__main__":
    tasks = [Task(Path(sys.argv[1], f"{k}.csv"), str(k), str(k)) for k in range(40)]
    for entry in identified(tasks, 2, {}):
        print(entry.refused, flush=True)
        time.sleep(60)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are listed by Linux")
def test_workers_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    (tmp_path / "pool.py").write_text(POOL)
    with subprocess.Popen([sys.executable, str(tmp_path / "pool.py"), str(tmp_path)], stdout=subprocess.PIPE) as work:
        assert work.stdout is not None
        assert b"gone" in work.stdout.readline()
        workers = [int(k) for k in Path(f"/proc/{work.pid}/task/{work.pid}/children").read_text().split()]
        work.kill()
    assert len(workers) >= 2
    end = time.monotonic() + 10
    while any(_runs(pid) for pid in workers) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(_runs(pid) for pid in workers)


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_the_time_of_a_file_is_what_its_name_says(tmp_path: Path) -> None:
    for name in ("x_2026-06-01T12-30.csv", "x20260601_123000.csv", "2026.06.01 12.30.csv"):
        assert time_of_file(tmp_path / name) == (1780317000.0, "name of the file")
    odd = tmp_path / "20261301_1230.csv"
    odd.write_text("x")
    os.utime(odd, (5.0, 5.0))
    assert time_of_file(odd) == (5.0, "last change of the file")


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with Store(tmp_path / "a.modes") as store, pytest.raises(DataError, match="there is no such folder"):
        collect(tmp_path / "nowhere", store)
    with Store(tmp_path / "a.modes") as store, pytest.raises(DataError, match="there is no such folder"):
        collect("", store)


def test_a_record_that_makes_the_program_fail_is_listed_and_the_rest_goes_on(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(path: Path, **options: object) -> object:
        return 1 / 0 if path.name == "20260601_0000.npz" else ms.analyze(path, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("modalscope.analysis.monitoring.entries.analyze", failing)
    with Store(tmp_path / "a.modes") as store:
        found = collect(folder, store, options=FEW)
        assert found.added == 1
        assert ("20260601_0000.npz", "the program fails (ZeroDivisionError: division by zero)") in found.refused


def test_a_misspelt_option_refuses_no_record(folder: Path, tmp_path: Path) -> None:
    with Store(tmp_path / "a.modes") as store:
        with pytest.raises(DataError, match="did you mean 'method'"):
            collect(folder, store, options={"methd": "era"})
        assert store.records.size == 0


def test_covariates_are_read_with_either_sign(tmp_path: Path) -> None:
    path = tmp_path / "w.csv"
    path.write_text("time;temperature;wind\n2026-06-01 00:00:00Z;1,5;\n2026-06-01 01:00;2;3\n")
    times, values = read_covariates(path)
    assert np.diff(times)[0] == np.timedelta64(3600, "s")
    assert values["temperature"].tolist() == [1.5, 2.0]
    assert np.isnan(values["wind"][0])
    path.write_text("time,a\n1,2,3\n")
    with pytest.raises(DataError, match="lines of different length"):
        read_covariates(path)
