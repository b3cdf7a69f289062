"""Accumulate sums and triangular factors over chunks of data, with partial sums kept in files."""

from __future__ import annotations

import hashlib
import os
import time
from importlib import import_module
from pathlib import Path
from secrets import token_hex
from typing import IO, Self

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import BoolArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import as_refused, executor
from modalscope.numerics.resources import fetched, namespace


class TriangleSum:
    """Triangular factor R of rows that come in chunks, R'R = sum of chunk'chunk: exact, with nothing of the data's size kept.

    `columns`: length of a row.

    Examples
    --------
    >>> X = np.random.default_rng(0).standard_normal((50, 3))
    >>> total = TriangleSum(3)
    >>> for chunk in np.split(X, 5):
    ...     total.add(chunk)
    >>> R = total.finish()
    >>> bool(np.allclose(R.T @ R, X.T @ X)), R.shape
    (True, (3, 3))
    """

    def __init__(self, columns: int) -> None:
        self._R: RealArray = np.zeros((0, columns))

    def add(self, chunk: RealArray) -> None:
        """Take rows (k, columns) in."""
        stacked = np.asarray(np.vstack([self._R, chunk]), dtype=float)
        columns = stacked.shape[1]
        if len(stacked) >= columns:
            stacked = _triangle(stacked)
        self._R = stacked

    def merge(self, other: TriangleSum) -> None:
        """Take in the rows of another sum."""
        self.add(other._R)

    def finish(self) -> RealArray:
        """Return R, (at most columns, columns): fewer rows where fewer were added."""
        return self._R


def _triangle(rows: RealArray) -> RealArray:
    """Return R of Q R = rows, (columns, columns), computed where large products are."""
    placed, columns = executor().place(rows), rows.shape[1]
    if placed is not rows:
        return fetched(namespace(placed).linalg.qr(placed)[1])
    return np.asarray(sla.qr(rows, mode="r", overwrite_a=True, check_finite=False)[0], dtype=float)[:columns]


#: Files of unfinished sums, from which an interrupted run goes on, and temporary ones that are being written, or held
#: against a second run: what ends the process without an exception speaks of the first and takes the others away itself.
UNDER_WAY: set[Path] = set()
PENDING: set[Path] = set()

#: Minimum time between two writings: seconds, and multiples of the time that a writing takes.
_MIN_SECONDS_BETWEEN, _MIN_MULTIPLE_OF_WRITING = 10.0, 20.0

#: Bytes of the digest that a file begins with.
_DIGEST_BYTES = 32


class SavedSums:
    """Sums of blocks, and which tasks are in them; in a file, where a folder is given.

    `work`: all that decides the numbers: another work has a file of its own. `shape`: of the sums, blocks first.

    Examples
    --------
    >>> saved = SavedSums(None, "sums of nothing", (1, 2), tasks=3)
    >>> saved.add(2, 0, np.ones(2))
    >>> saved.done.tolist(), saved.sums.tolist()
    ([False, False, True], [[1.0, 1.0]])
    """

    def __init__(self, folder: Path | None, work: str, shape: tuple[int, ...], tasks: int) -> None:
        self.sums: RealArray = np.zeros(shape)
        self.done: BoolArray = np.zeros(tasks, dtype=bool)
        self._of = hashlib.sha256(f"{work} {shape} {tasks}".encode())
        self._path = None if folder is None else folder / f"sums-{self._of.hexdigest()[:24]}.npz"
        self._next = time.monotonic()  # the first task is kept as it ends
        self._kept = 0
        self._lock = None if self._path is None else _locked(self._path.with_suffix(".lock"))
        try:
            self._take_up()
        except BaseException:
            self.release()
            raise
        if self._path is not None:
            UNDER_WAY.add(self._path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def add(self, task: int, block: int, sums: RealArray) -> None:
        """Take in the sums of a task."""
        self.sums[block] += sums
        self.done[task] = True
        if time.monotonic() >= self._next:
            self.keep()

    def keep(self) -> None:
        """Write what there is, if it is more than was written."""
        if self._path is None or self._kept == self.done.sum():
            return
        began = time.monotonic()
        temporary = self._path.with_name(f".{self._path.stem}-{token_hex(4)}.npz")
        PENDING.add(temporary)
        try:
            with as_refused(self._path.parent):
                with temporary.open("wb+") as file:
                    file.write(bytes(_DIGEST_BYTES))
                    np.savez(file, sums=self.sums, done=self.done)
                    digest = self._digest(file)
                    file.seek(0)
                    file.write(digest)
                temporary.replace(self._path)
        finally:
            temporary.unlink(missing_ok=True)
            PENDING.discard(temporary)
        self._kept = int(self.done.sum())
        self._next = time.monotonic() + max(_MIN_SECONDS_BETWEEN, _MIN_MULTIPLE_OF_WRITING * (time.monotonic() - began))

    def forget(self) -> None:
        """Take the file away: all is done."""
        if self._path is not None:
            UNDER_WAY.discard(self._path)
            self._path.unlink(missing_ok=True)

    def release(self) -> None:
        """Let another run take the file up."""
        if self._lock is not None:
            path = Path(self._lock.name)
            path.unlink(missing_ok=True)
            PENDING.discard(path)
            self._lock.close()
            self._lock = None

    def _take_up(self) -> None:
        """Read what was kept; a file that is damaged or of other sums is none, and so is what is no file of this folder."""
        if self._path is None or self._path.is_symlink() or not self._path.is_file():
            return
        with as_refused(self._path.parent), self._path.open("rb") as file:
            if file.read(_DIGEST_BYTES) != self._digest(file):
                return
            file.seek(_DIGEST_BYTES)
            with np.load(file, allow_pickle=False) as kept:
                self.sums, self.done = kept["sums"], kept["done"]
        self._kept = int(self.done.sum())

    def _digest(self, file: IO[bytes]) -> bytes:
        """Return what tells that all after the digest itself is as it was written, and of these sums."""
        file.seek(_DIGEST_BYTES)
        digest = self._of.copy()
        while part := file.read(1 << 20):
            digest.update(part)
        return digest.digest()


def _locked(path: Path) -> IO[bytes]:
    """Return a file that is held while it is open, also against other processes, and let go with the process.

    Raises `DataError`: another run holds it.
    """
    # a link, or a pipe at which opening waits, is not ours
    only = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with as_refused(path.parent):
        file = open(path, "ab", opener=lambda name, flags: os.open(name, flags | only, 0o666))  # noqa: SIM115
    try:
        fcntl = import_module("fcntl")
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        asked, fault = f"partial sums in {str(path.parent)!r}:", "another run works on the same sums there"
        raise DataError(asked, fault, "Wait until it ends, or give another folder.") from None
    except (ImportError, OSError):  # Windows, and some file systems, have no such locks
        pass
    except BaseException:  # an interruption
        file.close()
        raise
    PENDING.add(path)
    return file
