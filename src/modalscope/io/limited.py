"""Run a program that reads a file within limits of time and memory: `python limited.py PACKAGE SECONDS BYTES PROGRAM ARGUMENTS...`.

It runs in a Python of its own, and imports nothing of modalscope. What the package takes for itself is not bounded.
"""

from __future__ import annotations

import runpy
import sys
from importlib import import_module
from pathlib import Path

#: Bytes of memory that Python and a package take, where the system does not say.
_BYTES_OF_PROGRAM = 1_000_000_000


def bound(seconds: int, memory: int) -> None:
    """Let the system end this process where it takes too much: some systems can."""
    try:
        import resource
    except ImportError:  # Windows: the parent waits a while and ends it
        return
    status = Path("/proc/self/statm")
    program = int(status.read_text().split()[0]) * resource.getpagesize() if status.exists() else _BYTES_OF_PROGRAM
    limits = {resource.RLIMIT_CPU: seconds, resource.RLIMIT_AS: program + memory, resource.RLIMIT_CORE: 0}
    for kind, most in limits.items():
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _spent() -> int:
    """Return the whole seconds of processor time that this process took so far."""
    from time import process_time

    return int(process_time()) + 1


if __name__ == "__main__":
    import_module(sys.argv[1])
    bound(_spent() + int(sys.argv[2]), int(sys.argv[3]))
    sys.argv = sys.argv[4:]
    runpy.run_path(sys.argv[0], run_name="__main__")
