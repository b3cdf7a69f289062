"""Reads damaged files by the thousand, in processes of their own: `python -m tests.io.fuzz FOLDER SEED FIRST STOP PLACE`.

The corpus lies in FOLDER. PLACE is a file in which the process keeps count, so that whoever started it knows what it was doing
when it ended. A reader that takes more than four seconds of the processor is ended by the system (SIGPROF); one that prints on stderr, or
takes more memory than it may, is a fault.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import mmap
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, cast

import numpy as np

from tests.io.apart import LEAST
from tests.io.mutations import mutated
from tests.support import ROOT

#: A reader that takes longer hangs, s.
SECONDS = 4.0

#: A reader that waits longer, s of the clock on a machine at work.
WAITS = 60

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
        with (self.folder / "stderr").open("ab") as said:
            self.process = subprocess.Popen(command, cwd=ROOT, stdout=self.output, stderr=said)

    def ended(self, tally: Tally) -> bool:
        """Wait a little; add what there is when all are read, go on behind a file that ended the process."""
        try:
            status = self.process.wait(0.2)
        except subprocess.TimeoutExpired:
            return False
        if status:
            index = int(self.counts[_INDEX])
            how = "hang" if status in (-signal.SIGPROF, -signal.SIGALRM) else "abort"
            said = (self.folder / "stderr").read_text(errors="replace")[-500:]
            tally.faults.append({"how": how, "index": index, "text": f"status {status} {said}"})
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


def damaged(corpus: list[Path], seed: int, index: int, place: Path) -> tuple[Path, str, Path]:
    """Write one damaged file, or a folder with one damaged file in it: what it was, the kind of the damage, its path."""
    rng = np.random.default_rng([seed, index])
    whole = corpus[int(rng.integers(len(corpus)))]
    path = place / f"damaged{''.join(whole.suffixes)}"
    if whole.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        shutil.copytree(whole, path)
        pieces = sorted(piece for piece in path.rglob("*") if piece.is_file())
        piece = pieces[int(rng.integers(len(pieces)))]
        kind, data = mutated(piece.read_bytes(), rng)
        piece.write_bytes(data)
    elif rng.integers(2) and zipfile.is_zipfile(whole):
        kind = _damaged_within(whole, path, rng)
    else:
        kind, data = mutated(whole.read_bytes(), rng)
        path.write_bytes(data)
    return whole, kind, path


def _damaged_within(whole: Path, path: Path, rng: np.random.Generator) -> str:
    """Write an archive with one member damaged, which its checksum does not show; return the kind of the damage."""
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        members = {name: old.read(name) for name in old.namelist()}
        full = [name for name, data in members.items() if data]
        chosen = full[int(rng.integers(len(full)))]
        kind, members[chosen] = mutated(members[chosen], rng)
        for name, data in members.items():
            new.writestr(name, data)
    return f"{kind} in {chosen}"


def work(corpus: Path, seed: int, first: int, stop: int, place: Path) -> None:
    """Read the damaged files of these numbers."""
    from modalscope.data import DataError
    from tests.io.apart import hidden, read

    read_in_copies()
    files = sorted(corpus.iterdir())
    whole = {file: read(file) for file in files}
    with (place / "counts").open("r+b") as file:
        counts = np.frombuffer(mmap.mmap(file.fileno(), 0), np.int64)
    taken, said = _memory(), os.fstat(2).st_size
    for index in range(first, stop):
        origin, kind, path = damaged(files, seed, index, place)
        counts[_INDEX] = index
        fault = {"index": index, "file": origin.name, "kind": kind}
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(WAITS)
        try:
            thing = read(path)
            counts[_INTACT if same(thing, whole[origin]) else _CHANGED] += 1
        except DataError as error:
            counts[_REFUSED] += 1
            if (cause := hidden(error)) is not None:
                how = f"hidden {type(cause).__name__}"
                print(json.dumps(fault | {"how": how, "text": f"{error}: {where(cause)}"}), flush=True)
        except Exception as error:  # noqa: BLE001 - what else there is, is the question
            print(json.dumps(fault | {"how": type(error).__name__, "text": where(error)}), flush=True)
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        if os.fstat(2).st_size > said:
            text = (place / "stderr").read_text(errors="replace")[-500:]
            print(json.dumps(fault | {"how": "stderr", "text": text}), flush=True)
            said = os.fstat(2).st_size
        if (now := _memory()) > taken + LEAST:
            print(json.dumps(fault | {"how": "memory", "text": f"{now - taken} bytes"}), flush=True)
            taken = now


def _memory() -> int:
    """Return the most memory that this process has had, bytes."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


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


def read_in_copies() -> None:
    """Do in a copy of this process what has a Python of its own: starting one for each file takes fifty times longer."""
    import h5py  # noqa: F401 - loaded once

    from modalscope.io import apart as programs, foreign, hdf5, hdf5_walk
    from modalscope.io.limited import bound

    def apart(path: Path, room: Any, streamed: str = "") -> list[str]:
        def answer(told: IO[bytes]) -> None:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            signal.setitimer(signal.ITIMER_PROF, 2.0)
            found: list[str] = []
            try:
                hdf5_walk.walk(str(path), room.left, streamed)
            except hdf5_walk.Refused as refused:
                found = [refused.fault, refused.remedy]
            told.write(json.dumps(found).encode())

        text = in_a_copy(answer)
        return json.loads(text) if text else ["the HDF5 library breaks off in it", "Copy it again."]

    def run_apart(package: str, room: Any, program: list[str]) -> tuple[str, bytes]:
        def answer(told: IO[bytes]) -> None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            warnings.resetwarnings()
            signal.setitimer(signal.ITIMER_PROF, 3.0)
            bound(int(time.process_time()) + 5, 8 * room.left)
            sys.stdout = cast(Any, SimpleNamespace(buffer=told))
            foreign._main(*program[1:])

        return "its reader fails or does not end", in_a_copy(answer)

    hdf5._apart, programs.run_apart = apart, run_apart
    for package in foreign._PACKAGES:
        with contextlib.suppress(ImportError):
            importlib.import_module(package)


def in_a_copy(answer: Callable[[IO[bytes]], None]) -> bytes:
    """Return what a copy of this process writes before it ends."""
    with tempfile.TemporaryFile() as told:
        child = os.fork()
        if not child:
            signal.alarm(30)
            try:
                answer(told)
                told.flush()
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        told.seek(0)
        return told.read()


if __name__ == "__main__":
    work(Path(sys.argv[1]), *map(int, sys.argv[2:5]), Path(sys.argv[5]))
