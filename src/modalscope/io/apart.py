"""Run a program of this package that reads a file of a stranger in a process of its own, within limits."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from modalscope.io import limited
from modalscope.io.limits import Room

#: Limits by package: seconds and bytes of the file a second, of processor time and of the clock, which other programs delay; and the arrays
#: that are in memory at once: of HDF5 one read, a chunk of it packed, and one inflated; packages in Python copy more.
LIMITS = {
    "h5py": ((2, 50_000_000), (20, 10_000_000), 3),
    "meshio": ((4, 1_000_000), (20, 500_000), 8),
    "nptdms": ((4, 5_000_000), (20, 2_000_000), 8),
    "asammdf": ((4, 5_000_000), (20, 2_000_000), 8),
    "xarray": ((10, 5_000_000), (60, 2_000_000), 8),
    "openpyxl": ((10, 100_000), (60, 40_000), 8),
}


def python() -> str:
    """Return the program that runs this Python; none where Python is a part of another program."""
    program = sys.executable or ""
    return program if Path(program).stem.lower().startswith(("python", "pypy")) else ""


def run_apart(package: str, room: Room, program: Sequence[str]) -> tuple[str, bytes]:
    """Return how a program failed, empty where it did not, and what it wrote.

    `package`: the one that reads the file, loaded before the limits hold. `room`: that of the file. `program`: its file and arguments.
    """
    processor, clock, copies = LIMITS[package]
    seconds, most = (first + room.size // rate for first, rate in (processor, clock))
    command = [python(), "-P", "-S", "-B", limited.__file__, package, str(seconds), str(copies * room.left), *program]
    folders = os.pathsep.join(folder for folder in sys.path if folder)
    # a thread is much memory
    environment = os.environ | {"PYTHONPATH": folders, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, stdin=subprocess.DEVNULL, timeout=most, check=False
        )
    except subprocess.TimeoutExpired:
        return f"its reader did not end within {most} s", b""
    return f"its reader fails or does not end (status {done.returncode})" if done.returncode else "", done.stdout
