"""Reads files in processes of their own and says how each ended: `python -m tests.io.apart FOLDER SECONDS`, a JSON line a file.

Each file is read by a copy of this process (fork), bounded by the system in memory and watched by the clock, so that a
reader that aborts, hangs or fills the memory is an answer and not the end of the test.
"""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import scipy.io  # noqa: F401 - loaded once, before the copies are made, as what follows

import modalscope.io as mio
from modalscope.data import DataError
from modalscope.io.analysis import read_analysis

with suppress(ModuleNotFoundError):  # an extra
    import h5py  # noqa: F401

#: What a reader may add to the memory of the process: 500 MB, or twenty times the file.
LEAST, TIMES = 500_000_000, 20


def read(path: Path) -> Any:
    """Read a file by its suffix; `.analysis.json` is an analysis."""
    return read_analysis(path) if path.name.endswith(".analysis.json") else mio.read(path)


def hidden(error: BaseException) -> BaseException | None:
    """Return what a DataError was made of, where that is a fault of a program or of the machine: no file is to blame for these."""
    cause = error.__cause__
    if isinstance(cause, DataError):
        return hidden(cause)
    return cause if isinstance(cause, TypeError | AttributeError | MemoryError) else None


def ending(path: Path) -> dict[str, Any]:
    """Return how reading a file ends: `read`, `DataError`, or the name of another exception, also of one that a DataError hides."""
    start = _processor()
    try:
        read(path)
        how, text = "read", ""
    except DataError as error:
        cause = hidden(error)
        how, text = "DataError" if cause is None else f"hidden {type(cause).__name__}", str(error)
    except BaseException as error:  # noqa: BLE001 - what else there is, is the question
        how, text = type(error).__name__, str(error)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return {"how": how, "text": text[:600], "seconds": _processor() - start, "memory": 1024 * max(used)}


def _processor() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def apart(path: Path, seconds: float) -> dict[str, Any]:
    """Return how reading a file ends in a process of its own."""
    into, out = os.pipe()
    child = os.fork()
    if not child:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + max(LEAST, TIMES * path.stat().st_size)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        os.write(out, json.dumps(ending(path)).encode())
        os._exit(0)
    os.close(out)
    ready = select.select([into], [], [], seconds)[0]
    answer = os.read(into, 1 << 16) if ready else b""
    if not ready:
        os.kill(child, signal.SIGKILL)
    os.close(into)
    status = os.waitpid(child, 0)[1]
    if answer:
        return {"name": path.name, **json.loads(answer)}
    return {
        "name": path.name,
        "how": "abort" if ready else "hang",
        "text": f"status {status}",
        "seconds": seconds,
        "memory": 0,
    }


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    for file in sorted(Path(sys.argv[1]).iterdir()):
        began = time.monotonic()
        print(
            json.dumps(
                apart(file, float(sys.argv[2])) | {"clock": time.monotonic() - began, "size": file.stat().st_size}
            )
        )
