"""Commands that are killed at any moment, on a full disk, or with few descriptors: nothing half-written, nothing lost, no traceback."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import modalscope as ms
from modalscope.analysis.monitoring import Store
from modalscope.interfaces.cli import main

RUN = (sys.executable, "-m", "modalscope")

#: Bytes of a disk that is nearly full, and descriptors of a process that has few.
DISK, DESCRIPTORS = 1_000_000, 40

#: Records of the folder that is watched.
RECORDS = 8


def made(folder: Path) -> None:
    """Write a folder of records that is watched, and a response."""
    chain, before = ms.systems.chain5(), time.time() - 3600
    (folder / "records").mkdir()
    for k in range(RECORDS):
        path = folder / "records" / f"20260601_0{k}00.npz"
        ms.write(path, chain.impulse_response(150, noise=0.01, seed=k))
        os.utime(path, (before, before))
    ms.write(
        folder / "lines.npz", chain.frequency_response(np.linspace(0.2, 8, 120), quantity="acceleration", noise=0.01)
    )
    ms.write(
        folder / "long.npz", chain.simulate(inputs="ambient", samples=6000, sampling_rate=20.0, noise=0.02, seed=0)
    )


#: Words of commands, and what each writes.
COMMANDS: dict[str, tuple[list[str], str]] = {
    "watch": (["watch", "records", "--store", "a.modes", "--once", "--method", "era"], "a.modes"),
    "compare": (
        ["compare", "lines.npz", "--methods", "era", "lscf", "--orders", "8:12:2", "-o", "compared.html"],
        "compared.html",
    ),
    "certify": (
        ["certify", "lines.npz", "--replicates", "2", "--orders", "8:12:2", "-o", "certified.html"],
        "certified.html",
    ),
    "identify": (["identify", "long.npz", "-o", "modes.json", "--resume", "sums"], "modes.json"),
}


def half_written(path: Path) -> str:
    """Return what is wrong with a file, in words; an empty text: it is whole, or not there."""
    if not path.exists() or (path.suffix == ".modes" and not path.stat().st_size):  # a store before its tables
        return ""
    if path.suffix == ".modes":
        with Store(path) as store:
            counts = np.bincount(store.history().record, minlength=len(store))
        return "" if len(counts) == 0 or counts.min() > 0 else "a record without modes"
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        return "" if json.loads(text) else "it is empty"
    return "" if text.rstrip().endswith("</html>") else "it does not end"


def begun(words: list[str], folder: Path) -> int:
    """Start a command in a copy of this process, which has loaded what it needs: a Python of its own takes longer than the command."""
    child = os.fork()
    if child:
        return child
    try:
        os.chdir(folder)
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (1, 2):
            os.dup2(nothing, stream)
        os._exit(main(words))
    finally:
        os._exit(70)


def ended(child: int, seconds: float, folder: Path | None = None, changes: int = 0) -> int:
    """Return the status of a process that is killed after some seconds, or after so many changes of the files of a folder."""
    until, seen, left = time.monotonic() + seconds, None, changes + 1
    while not (done := os.waitpid(child, os.WNOHANG))[0]:
        if folder is not None and (now := _sizes(folder)) != seen:
            seen, left = now, left - 1
        if time.monotonic() > until or not left:
            os.kill(child, signal.SIGKILL)
            done = os.waitpid(child, 0)
            break
        time.sleep(3e-4)
    return os.waitstatus_to_exitcode(done[1])


def _sizes(folder: Path) -> list[tuple[str, int, int]]:
    found = []
    for path in folder.iterdir():
        with contextlib.suppress(FileNotFoundError):  # gone meanwhile
            state = path.stat()
            found.append((path.name, state.st_size, state.st_mtime_ns))
    return sorted(found)


@functools.cache
def whole() -> tuple[tempfile.TemporaryDirectory[str], dict[str, float]]:
    """Make the folder of all kills once, and run each command there to its end: how long each lasts."""
    place, lasts = tempfile.TemporaryDirectory(), dict[str, float]()
    made(Path(place.name))
    for name, (words, _) in COMMANDS.items():
        for _ in range(2):  # the second time all is loaded
            with copied(Path(place.name)) as folder:
                start = time.monotonic()
                assert ended(begun(words, folder), 120) == 0, f"{name} does not run"
                lasts[name] = time.monotonic() - start
    return place, lasts


@contextmanager
def copied(source: Path) -> Iterator[Path]:
    """Give a copy of a folder, times of files as they were."""
    with tempfile.TemporaryDirectory() as place:
        yield shutil.copytree(source, Path(place, "here"))


def kills(count: int, seed: int) -> list[str]:
    """Kill so many commands, and return what was left half-written, or lost.

    At any time before the end that they had alone, or, every second one, when so many changes of their folder were seen.
    """
    told, tally, draw = list[str](), Counter[str](), np.random.default_rng(seed)
    place, lasts = whole()
    for k in range(count):
        name = list(COMMANDS)[k % len(COMMANDS)]
        words, target = COMMANDS[name]
        with copied(Path(place.name)) as folder:
            child = begun(words, folder)
            if draw.random() < 0.5:
                ended(child, draw.uniform(0, 1.1) * lasts[name])
            else:
                ended(child, 120, folder, int(draw.integers(1, 3 * RECORDS if name == "watch" else 6)))
            fault = half_written(folder / target)
            there = (folder / target).exists()
            tally[f"{name}: {'something' if there else 'nothing'} written"] += 1
            if not fault and name == "watch" and there:
                status = ended(begun(words, folder), 120)
                with Store(folder / target) as store:
                    lost = len(store) != RECORDS
                    fault = f"{len(store)} of {RECORDS} records after going on, status {status}" if lost else ""
            if fault:
                told.append(f"kill {k} of seed {seed}, {name}: {fault}")
    print(f"{count} kills, seed {seed}: {dict(tally)}")
    return told


@contextmanager
def small_disk() -> Iterator[Path | None]:
    """Give a folder on a disk of a megabyte; None where this user may not make one."""
    with tempfile.TemporaryDirectory() as place:
        mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", place]
        if subprocess.run(mount, capture_output=True, check=False).returncode:
            yield None
            return
        try:
            yield Path(place)
        finally:
            subprocess.run(["umount", "-l", place], check=False)


def _few() -> None:
    resource.setrlimit(resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))


def want() -> list[str]:
    """Run the commands on a full disk and with few descriptors; return those that end in anything but an answer or words."""
    told, count = list[str](), 0
    with tempfile.TemporaryDirectory() as place, small_disk() as disk:
        folder = Path(place)
        made(folder)
        if disk is not None:
            (disk / "much").write_bytes(bytes(DISK - 20_000))
        runs = [(name, words, None, folder) for name, (words, _) in COMMANDS.items() if disk is not None]
        runs += [(name, words, _few, folder) for name, (words, _) in COMMANDS.items()]
        for name, words, limit, here in runs:
            own = list(words) if limit else [str(disk / w) if w in (COMMANDS[name][1], "sums") else w for w in words]  # type: ignore[operator]
            done = subprocess.run([*RUN, *own], cwd=here, capture_output=True, text=True, check=False, preexec_fn=limit)
            count += 1
            fault = "Traceback" in done.stderr or done.returncode not in (0, 1, 2, 3)
            left = Path(own[own.index("-o") + 1] if "-o" in own else own[own.index("--store") + 1])
            if fault or (not limit and half_written(here / left)):
                told.append(
                    f"{name}, {'few descriptors' if limit else 'full disk'}: status {done.returncode}, {done.stderr[-400:]}"
                )
    print(
        f"{count} commands in want{'' if disk is not None else ', none on a full disk: this user may not mount one'}: {len(told)} faults"
    )
    return told
