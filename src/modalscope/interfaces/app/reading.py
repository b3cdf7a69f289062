"""Tell how much of the files of a test is read, as far as the system says where a process reads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

#: Where the system lists the open files of this process; others have no such place, and nothing is told there.
_OPEN_FILES = Path("/proc/self/fd")

#: Seconds between two looks.
_INTERVAL = 0.25


@contextmanager
def watched(paths: Sequence[str | Path], tell: Callable[[int, int], None]) -> Iterator[None]:
    """Call `tell` with the bytes read and those of all files while the block runs, from another thread."""
    sizes = {file: file.stat().st_size for file in (Path(path).resolve() for path in paths) if file.is_file()}
    stopped, total = Event(), sum(sizes.values())

    def look() -> None:
        seen = 0
        while not stopped.wait(_INTERVAL):
            seen = read_so_far(sizes) or (seen and total)
            if seen:
                tell(seen, total)

    thread = Thread(target=look, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


def read_so_far(sizes: dict[Path, int]) -> int | None:
    """Return the bytes that are read of files, which are read in this order; None where none is open."""
    with suppress(OSError):
        for link in _OPEN_FILES.iterdir():
            with suppress(OSError):
                path = link.readlink()
                if path in sizes:
                    before = list(sizes)[: list(sizes).index(path)]
                    return sum(sizes[name] for name in before) + os.lseek(int(link.name), 0, os.SEEK_CUR)
    return None
