"""Limits of memory and threads, and the device on which large products are computed.

Identification solves hundreds of small problems. Threads of the linear algebra library only wait for each other there: on two
busy cores they made the same work take ten times as long. The limit holds while a verb runs and is taken back after it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, wraps
from mmap import mmap
from pathlib import Path
from threading import Lock
from typing import Any, ParamSpec, TypeVar

import numpy as np
import scipy.fft
from threadpoolctl import ThreadpoolController

from modalscope.numerics.checks import Array
from modalscope.numerics.errors import DataError, check_choice, optional_package

#: What may be asked for: PyTorch on the processor, or on a graphics card.
DEVICES = ("cpu", "cuda")


@dataclass(frozen=True, eq=False, slots=True)
class Device:
    """A place for arrays of PyTorch.

    `name`: as PyTorch has it.
    """

    name: str
    torch: Any

    def place(self, array: Any) -> Any:
        """Return an array there: a copy, unless it is there already."""
        if isinstance(array, np.ndarray):
            return self.torch.tensor(np.ascontiguousarray(array), device=self.name)
        return array


def device_named(name: str | None) -> Device | None:
    """Return the place that is asked for; None is NumPy.

    Raises `DataError`: PyTorch is not installed, or has no graphics card.
    """
    if name is None:
        return None
    check_choice("device", name, DEVICES)
    torch = optional_package(f"device={name!r}", "torch", "torch")
    optional_package(f"device={name!r}", "array_api_compat", "torch")
    if name == "cuda" and not torch.cuda.is_available():
        raise DataError("device='cuda':", "PyTorch finds no graphics card", "Use device='cpu' or none.")
    return Device(name, torch)


def namespace(array: Any) -> Any:
    """Return the functions that belong to an array, as the array API has them.

    Examples
    --------
    >>> namespace(np.zeros(3)) is np
    True
    """
    if isinstance(array, np.ndarray):
        return np
    return optional_package("an array of PyTorch", "array_api_compat", "torch").array_namespace(array)


def transforms(array: Any) -> Any:
    """Return the Fourier transforms that belong to an array."""
    return scipy.fft if isinstance(array, np.ndarray) else namespace(array).fft


def fetched(array: Any) -> Array:
    """Return an array of NumPy, from wherever it is."""
    return array if isinstance(array, np.ndarray) else np.asarray(array.cpu().numpy())


#: Memory that is assumed where the system does not report what is free.
_DEFAULT_MEMORY_BYTES = 4_000_000_000

#: Memory that work may always use, so that the same data give the same numbers on a busy machine.
_MIN_MEMORY_BYTES = 500_000_000

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
        free = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        try:
            free = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        except (AttributeError, ValueError, OSError):
            free = _DEFAULT_MEMORY_BYTES
    return max(free * 3 // 4, _MIN_MEMORY_BYTES)


def check_fits(what: str, size: float, change: str) -> None:
    """Raise, before it starts, when work would take more memory than it may.

    `what`: the work, in words. `size`: bytes. `change`: what to change.
    """
    most = allowed_memory()
    if size > most:
        raise DataError(f"{what}:", f"it takes about {in_words(size)} of memory, of {in_words(most)}", change)


def in_words(size: float) -> str:
    """Return bytes in words.

    Examples
    --------
    >>> in_words(1234), in_words(5.6e6), in_words(7.89e10)
    ('1 kB', '6 MB', '78.9 GB')
    """
    small = f"{size:.0f} bytes" if size < 1e3 else f"{size / 1e3:.0f} kB"
    large = f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"
    return small if size < 1e6 else large


def scratch(numbers: int, dtype: Any = float) -> Any:
    """Return zeros for work on long records, which the system takes back with the last reference to them: a heap keeps what is freed.

    Examples
    --------
    >>> scratch(3)
    array([0., 0., 0.])
    """
    size = np.dtype(dtype).itemsize * numbers
    return np.frombuffer(mmap(-1, size), dtype) if size else np.zeros(0, dtype)


P = ParamSpec("P")
R = TypeVar("R")


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    """Find the libraries once, with the one that scipy brings for itself."""
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


class _Users:
    """How many calls want one thread at the moment: the first sets the limit, the last takes it back."""

    def __init__(self) -> None:
        self._lock, self._count = Lock(), 0
        self._limit: Any = None

    def enter(self) -> None:
        with self._lock:
            if self._count == 0:
                _free_control()
                self._limit = _controller().limit(limits=1, user_api="blas")
            self._count += 1

    def leave(self) -> None:
        with self._lock:
            self._count -= 1
            if self._count == 0:
                _free_control()
                self._limit.restore_original_limits()
                _free_control()


def _free_control() -> None:
    """Let any thread set the number: threadpoolctl leaves it to the thread that set it first, which need not be the last to end."""
    for library in _controller().lib_controllers:
        clear = getattr(library, "clear_controlling_thread", None)
        if clear is not None:
            clear(force=True)


_USERS = _Users()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Hold the linear algebra library at one thread; calls may overlap and lie inside each other, the number before comes back."""
    _USERS.enter()
    try:
        yield
    finally:
        _USERS.leave()


def one_thread(verb: Callable[P, R]) -> Callable[P, R]:
    """Run a function with one thread of the linear algebra library; see `single_threaded`."""

    @wraps(verb)
    def run(*args: P.args, **kwargs: P.kwargs) -> R:
        with single_threaded():
            return verb(*args, **kwargs)

    return run
