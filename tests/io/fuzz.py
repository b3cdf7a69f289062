"""Reads damaged files by the thousand, in processes of their own: `python -m tests.io.fuzz FOLDER SEED FIRST STOP PLACE`.

The corpus lies in FOLDER. PLACE is a file in which the process keeps count, so that whoever started it knows what it was doing
when it ended. A reader that takes more than four seconds of the processor is ended by the system (SIGPROF).
"""

from __future__ import annotations

import json
import mmap
import os
import resource
import select
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.io.mutations import mutated
from tests.support import ROOT

#: A reader that takes longer hangs, s.
SECONDS = 4.0

#: With so many processes ended before their time no further one is started: all would be.
MANY = 50

#: Where the count stands in its file: the mutation that is being read, and how the earlier ones ended.
_INDEX, _REFUSED, _INTACT, _CHANGED = range(4)


@dataclass
class Tally:
    """How many damaged files were refused, read as they were, or read as something else; and what must not be."""

    refused: int = 0
    intact: int = 0
    changed: int = 0
    faults: list[dict[str, Any]] = field(default_factory=list)

    def __str__(self) -> str:
        kinds = Counter(fault["how"] for fault in self.faults)
        return f"{self.refused} refused, {self.intact} intact, {self.changed} changed, {dict(kinds) or 'no fault'}"


# ------------------------------------------------------------------------------------------------------ who starts them


def run(folder: Path, corpus: Path, count: int, *, workers: int = 2, seed: int = 0) -> Tally:
    """Read `count` damaged files with so many processes, and start another one where one ends before its time."""
    tally = Tally()
    ends = [count * k // workers for k in range(workers + 1)]
    running = [_Worker(folder / str(k), corpus, seed, ends[k], ends[k + 1]) for k in range(workers)]
    while running:
        running = [worker for worker in running if not worker.ended(tally)]
    return tally


class _Worker:
    def __init__(self, folder: Path, corpus: Path, seed: int, first: int, stop: int) -> None:
        folder.mkdir()
        self.folder, self.corpus, self.seed, self.stop = folder, corpus, seed, stop
        self.counts = np.memmap(folder / "counts", np.int64, "w+", shape=(4,))
        self.output = (folder / "faults").open("w+b")
        self.start(first)

    def start(self, first: int) -> None:
        numbers = map(str, (self.seed, first, self.stop))
        command = [sys.executable, "-W", "error", "-m", "tests.io.fuzz", str(self.corpus), *numbers, str(self.folder)]
        self.process = subprocess.Popen(command, cwd=ROOT, stdout=self.output)

    def ended(self, tally: Tally) -> bool:
        """Wait a little; add what there is when all are read, go on behind a file that ended the process."""
        try:
            status = self.process.wait(0.2)
        except subprocess.TimeoutExpired:
            return False
        if status:
            index = int(self.counts[_INDEX])
            how = "hang" if status == -signal.SIGPROF else "abort"
            tally.faults.append({"how": how, "index": index, "text": f"status {status}"})
            if index + 1 < self.stop and len(tally.faults) < MANY:
                self.start(index + 1)
                return False
        tally.refused += int(self.counts[_REFUSED])
        tally.intact += int(self.counts[_INTACT])
        tally.changed += int(self.counts[_CHANGED])
        self.output.seek(0)
        tally.faults += [json.loads(line) for line in self.output.read().decode().splitlines()]
        self.output.close()
        return True


# ------------------------------------------------------------------------------------------------------- what they do


def damaged(corpus: list[Path], seed: int, index: int) -> tuple[Path, str, bytes]:
    """Return one damaged file: what it was, the kind of the damage, its bytes."""
    rng = np.random.default_rng([seed, index])
    whole = corpus[int(rng.integers(len(corpus)))]
    return whole, *mutated(whole.read_bytes(), rng)


def work(corpus: Path, seed: int, first: int, stop: int, place: Path) -> None:
    """Read the damaged files of these numbers."""
    from modalscope.data import DataError
    from tests.io.apart import read

    walk_in_a_copy()
    files = sorted(corpus.iterdir())
    whole = {file: read(file) for file in files}
    with (place / "counts").open("r+b") as file:
        counts = np.frombuffer(mmap.mmap(file.fileno(), 0), np.int64)
    for index in range(first, stop):
        origin, kind, data = damaged(files, seed, index)
        path = place / f"damaged{''.join(origin.suffixes)}"
        path.write_bytes(data)
        counts[_INDEX] = index
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            thing = read(path)
            counts[_INTACT if same(thing, whole[origin]) else _CHANGED] += 1
        except DataError:
            counts[_REFUSED] += 1
        except Exception as error:  # noqa: BLE001 - what else there is, is the question
            fault = {
                "how": type(error).__name__,
                "index": index,
                "file": origin.name,
                "kind": kind,
                "text": where(error),
            }
            print(json.dumps(fault), flush=True)
        signal.setitimer(signal.ITIMER_PROF, 0)


def where(error: BaseException) -> str:
    """Return what an exception says, and the line that raised it."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}" if trace else ""
    return f"{str(error)[:200]} ({place})"


def same(a: Any, b: Any) -> bool:
    """Equal to the last bit; where they were read from does not count."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    if is_dataclass(a):
        names = [f.name for f in fields(a) if f.name != "source_path"]
        return type(a) is type(b) and all(same(getattr(a, name), getattr(b, name)) for name in names)
    return type(a) is type(b) and bool(a == b or (a != a and b != b))


def walk_in_a_copy() -> None:
    """Walk through HDF5 files in a copy of this process: a Python of its own for each takes fifty times longer."""
    import h5py  # noqa: F401 - loaded once

    from modalscope.io import hdf5, hdf5_walk

    def apart(path: Path, room: Any, streamed: str = "") -> list[str]:
        def answer(into: int) -> None:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            signal.setitimer(signal.ITIMER_PROF, 2.0)
            found: list[str] = []
            try:
                hdf5_walk.walk(str(path), room.left, streamed)
            except hdf5_walk.Refused as refused:
                found = [refused.fault, refused.remedy]
            os.write(into, json.dumps(found).encode())

        text = in_a_copy(answer)
        return json.loads(text) if text else ["the HDF5 library breaks off in it", "Copy it again."]

    hdf5._apart = apart


def in_a_copy(answer: Callable[[int], None]) -> bytes:
    """Return what a copy of this process writes before it ends."""
    out, into = os.pipe()
    child = os.fork()
    if not child:
        try:
            answer(into)
        finally:
            os._exit(0)
    os.close(into)
    text = os.read(out, 1 << 16) if select.select([out], [], [], 30)[0] else b""
    os.close(out)
    os.waitpid(child, 0)
    return text


if __name__ == "__main__":
    work(Path(sys.argv[1]), *map(int, sys.argv[2:5]), Path(sys.argv[5]))
