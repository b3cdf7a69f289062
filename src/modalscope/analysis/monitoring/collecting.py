"""Identify files in this process, in several, or by the workers of a Dask scheduler: what `Store.add` and `collect` have in common."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

from modalscope.analysis.monitoring.entries import Entry, entry_of, time_of_file
from modalscope.io.formats import FORMATS
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import each, executor

#: Seconds that a file must stand still, before it counts as written, where its folder is added at once.
SETTLED = 2.0

#: Seconds that the time of a record may be ahead of the clock: a day, as names of files have the time of any zone.
_AHEAD_OF_CLOCK = 86_400.0

#: Records given to workers ahead of what they have done, for each of them: memory does not grow with the folder.
_AHEAD = 2


class Task(NamedTuple):
    """A file to identify, known by the SHA-256 of its content; `time`: seconds since 1970, None where its name or date says it.

    `seen`: as of `Entry`. `replaces`: whether a record of the file is stored, of what it held before.
    """

    path: Path
    sha256: str
    name: str
    time: float | None = None
    covariates: Mapping[str, float] | None = None
    seen: tuple[str, int, int] | None = None
    replaces: bool = False


def settled(folder: Path, seconds: float) -> tuple[list[Path], list[str]]:
    """Return the files of a folder that `read` knows and that have stood still for so long, and the names of the others.

    It waits for those that have changed just now. One whose date is ahead of the clock is never taken.
    """

    def look() -> dict[Path, tuple[int, int]]:
        found = {}
        for path in sorted(folder.rglob("*")):
            try:
                if path.is_file() and path.suffix.lower() in FORMATS:
                    state = path.stat()
                    found[path] = (state.st_size, state.st_mtime_ns)
            except OSError:  # gone meanwhile
                continue
        return found

    first = look()
    ages = [time.time() - changed * 1e-9 for _, changed in first.values()]
    if young := [seconds - age for age in ages if 0 <= age < seconds]:
        time.sleep(max(young))
    second, now = look(), time.time()
    same = [p for p, state in second.items() if first.get(p) == state and now - state[1] * 1e-9 >= seconds]
    late = {p for p, (_, changed) in second.items() if changed * 1e-9 > now + 1}
    return same, [p.name + " (its date is ahead of the clock)" * (p in late) for p in second if p not in same]


def identified(tasks: Sequence[Task], workers: int, options: Mapping[str, Any]) -> Iterator[Entry]:
    """Give the entries of files as they are done: by the scheduler that `working` names, else by this process or by several."""
    work = partial(_entry, options=dict(options))
    if executor().client is not None:
        yield from (entry for _, entry in each(work, tasks))
        return
    if workers == 1 or len(tasks) < 2:
        yield from map(work, tasks)
        return
    workers = min(workers, len(tasks), os.cpu_count() or 1)  # more would only wait for each other
    # not forked: a library's threads do not survive that
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent) as pool:
        under_way: set[Future[Entry]] = set()
        left = iter(tasks)
        try:
            while True:
                while len(under_way) < _AHEAD * workers and (task := next(left, None)) is not None:
                    under_way.add(pool.submit(work, task))
                if not under_way:
                    return
                done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        except BrokenProcessPool:
            found = "a worker was ended by the system"
            raise DataError(
                "the records could not all be identified", found, "Use fewer workers; what is done is stored."
            ) from None


def _end_with_parent() -> None:
    """End this process as soon as the one that started it has ended, however that was."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=wait, daemon=True).start()


def _entry(task: Task, options: Mapping[str, Any]) -> Entry:
    """Return the entry of one file."""
    try:
        when, origin = time_of_file(task.path) if task.time is None else (task.time, "given")
    except OSError as error:
        refused = f"the file is gone ({error.strerror})"
        return Entry(sha256=task.sha256, name=task.name, time=0.0, refused=refused, seen=task.seen)
    if origin != "given" and when > time.time() + _AHEAD_OF_CLOCK:
        said = datetime.fromtimestamp(when, UTC).strftime("%Y-%m-%d %H:%M")
        late = f"its time, {said} by the {origin}, is ahead of the clock"
        refused = f"{late}. Rename it or mend the clock, then try it again."
        return Entry(sha256=task.sha256, name=task.name, time=when, refused=refused, seen=task.seen)
    about: dict[str, Any] = {"name": task.name, "covariates": task.covariates, "origin": {"time": origin}}
    found = entry_of(task.path, sha=task.sha256, time=when, options=options, **about)
    return replace(found, seen=task.seen)
