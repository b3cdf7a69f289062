"""No small file fills the memory or holds a reader up, and what was lifted may be read."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.data import DataError, Signals
from modalscope.io import limits
from modalscope.io.limits import Room, room
from tests.support import ROOT, refused

#: Reading a bomb may take sixteen times what three million steps of Python take (about four seconds of an idle processor), and 500 MB or
#: twenty times the file; those whose arrays may take eighty times it are too small for that.
LOOPS, LEAST, TIMES = 16, 500_000_000, 20


def a_loop() -> float:
    """Return the seconds of the processor for three million steps."""
    start, total = time.process_time(), 0
    for step in range(3_000_000):
        total += step * step
    return time.process_time() - start


@pytest.fixture
def unlimited():
    yield mio.set_max_memory
    mio.set_max_memory(None)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the bounds are those of Linux")
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5", ".csv", ".txt", ".json", ".uff"])
def test_every_bomb_is_answered_in_time_and_within_the_memory(tmp_path, suffix):
    from tests.io.packed_bombs import BOMBS  # seconds

    made = [name for name in BOMBS if Path(name).suffix == suffix]
    for name in made:
        BOMBS[name](tmp_path / name)
    command = [sys.executable, "-W", "error", "-m", "tests.io.apart", str(tmp_path), "20"]
    loops = [a_loop(), a_loop()]  # the clock of a processor changes: the slowest of loops before and after
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(answers) == len(made) > 0
    bad = [a for a in answers if a["how"] not in ("read", "DataError")]
    most = LOOPS * max(*loops, a_loop(), a_loop(), a_loop())
    bad += [a for a in answers if a["seconds"] > most or a["memory"] > max(LEAST, TIMES * a["size"])]
    assert not bad


def test_what_a_bound_refuses_is_read_when_it_is_lifted(tmp_path, unlimited):
    record = Signals(outputs=np.zeros((1000, 1)), sampling_rate=1.0)
    for suffix in (".npz", ".h5", ".mat", ".csv"):
        path = tmp_path / f"a{suffix}"
        mio.write(path, record)
        unlimited(10_000)  # a quarter of it may be arrays, and there are 8000 bytes of them
        error = refused(": ", mio.read, path)
        assert "--max-memory" in error.change
        unlimited(10**9)
        assert mio.read(path).samples == 1000
        unlimited(None)
        assert mio.read(path).samples == 1000


def test_a_text_that_takes_longer_than_its_size_allows_is_refused_and_read_when_that_is_lifted(
    tmp_path, monkeypatch, unlimited
):
    path = tmp_path / "a.csv"
    path.write_text("t,a\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(9000)))
    monkeypatch.setattr(limits, "_MIN_SECONDS", 0.0)
    monkeypatch.setattr(limits, "_BYTES_BY_SECOND", 1e4)  # 8 s
    assert mio.read(path).samples == 9000
    monkeypatch.setattr(limits, "_BYTES_BY_SECOND", 1e12)
    refused("takes more of the processor than a file of", mio.read, path)
    unlimited(10**9)
    assert mio.read(path).samples == 9000


@pytest.mark.parametrize("size", [0, -1, 1.5, True, "8GB"])
def test_a_bound_is_a_number_of_bytes(size):
    refused("a limit of memory", mio.set_max_memory, size)


def test_arrays_take_five_to_twenty_times_the_file_as_the_machine_has_memory_and_a_quarter_of_the_least(monkeypatch):
    assert room("a", 1).left == 125_000_000
    for left, times in ((10**9, 5), (32 * 10**9, 8), (10**12, 20)):
        monkeypatch.setattr(limits, "allowed_memory", lambda left=left: left)
        assert room("a", 10**9).left == times * 10**9


def test_numbers_are_weighed_as_what_they_become():
    space = Room(where="a", size=1, most=100, left=100)
    space.array("outputs", np.dtype("i1"), 12)  # eight bytes each
    assert space.left == 4
    with pytest.raises(
        DataError,
        match="with b its arrays take 104 bytes of memory or more; those of a file of 1 bytes may take 100 bytes",
    ):
        space.array("b", np.dtype("f4"), 1)


def test_a_nearly_empty_matrix_is_refused_and_a_full_one_is_not(unlimited):
    space = room("a", 1)
    space.square("they", 10**8, 10**8)
    space.square("they", 250_000, 1)
    refused("they make a matrix of 1000000 entries", space.square, "they", 10**6, 10_000)
    unlimited(10**9)
    room("a", 1).square("they", 10**6, 10_000)
