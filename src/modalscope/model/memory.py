"""How much memory work may take: what was set for the process, or what the machine has left."""

from __future__ import annotations

import os
from mmap import mmap
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.model.errors import DataError

__all__ = ["allowed_memory", "check_fits", "in_words", "scratch", "set_allowed_memory"]

#: Where the system does not say what it has left.
_UNKNOWN = 4_000_000_000

#: What work may take at any time: the same data give the same numbers, on a machine that is busy, too.
_ALWAYS = 500_000_000

_allowed: int | None = None


def set_allowed_memory(size: int | None) -> None:
    """Set what work may take, in bytes, for the whole process; None for what the machine has left."""
    global _allowed
    _allowed = size


def allowed_memory() -> int:
    """Return what work may take, in bytes: as it was set, or three quarters of what the machine has left.

    Never less than half a gigabyte where nothing was set: how problems of usual size are solved does not depend on what else runs.
    """
    if _allowed is not None:
        return _allowed
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        left = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        try:
            left = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        except (AttributeError, ValueError, OSError):
            left = _UNKNOWN
    return max(left * 3 // 4, _ALWAYS)


def check_fits(what: str, size: float, change: str) -> None:
    """Raise, before it starts, when work would take more memory than it may.

    Parameters
    ----------
    what : str
        The work, in words.
    size : float
        Bytes.
    change : str
        What to change.
    """
    most = allowed_memory()
    if size > most:
        raise DataError(
            f"{what} was asked", f"it takes about {in_words(size)} of memory, and {in_words(most)} are there", change
        )


def in_words(size: float) -> str:
    """Return bytes in words.

    Examples
    --------
    >>> in_words(1234), in_words(5.6e6), in_words(7.89e10)
    ('1 kB', '6 MB', '78.9 GB')
    """
    if size < 1e6:
        return f"{size / 1e3:.0f} kB"
    return f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"


def scratch(numbers: int, dtype: Any = float) -> Any:
    """Return zeros for work on long records, which the system takes back with the last reference to them: a heap keeps what is freed.

    Parameters
    ----------
    numbers : int
    dtype : dtype

    Examples
    --------
    >>> scratch(3)
    array([0., 0., 0.])
    """
    size = np.dtype(dtype).itemsize * numbers
    return np.frombuffer(mmap(-1, size), dtype) if size else np.zeros(0, dtype)
