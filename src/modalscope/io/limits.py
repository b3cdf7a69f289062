"""Bound the memory and the time that reading a file may take.

A file states how many numbers it holds, and packed ones may be many in few bytes. Before anything of that size is made it is weighed
here: reading may take 500 MB, or twenty times the file where that is more, or up to eighty times where the machine has that memory left.
The arrays alone may take a quarter, for they are inflated, joined and checked at the same time. What is weighed, and every few lines of a
text, is also asked of the processor's time: a minute, or two seconds for each megabyte where that is more. `set_max_memory` lifts both
bounds for the whole process.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import thread_time
from typing import Any

import numpy as np

from modalscope.data import DataError
from modalscope.io.contents import unreadable
from modalscope.numerics.checks import Array
from modalscope.numerics.resources import allowed_memory, in_words, set_allowed_memory

#: Bytes that reading may take at least, by size of the file, and by size where the machine has them left: the counts of a converter that
#: scatter by one are packed to a twentieth of the doubles that they become (16 bits each, deflated), those that scatter by 30 to a seventh.
_MIN_BYTES, _BYTES_BY_SIZE, _BYTES_BY_PACKED_SIZE = 500_000_000, 20, 80
#: Seconds of the processor that reading may take at least, and bytes for each: tables with dates and times in two columns, the slowest, are
#: read at .8 MB a second.
_MIN_SECONDS, _BYTES_BY_SECOND = 60.0, 500_000
#: Copies of the arrays in memory at once: inflated, joined and locked ones.
_COPIES = 4
#: Bytes of a number (double precision at least), of a text (a Python object), and of a bracket and an entry of JSON.
_NUMBER, _TEXT, _BRACKET, _ENTRY = 8, 64, 72, 32
#: Channels or named arrays in a file, more than any test has.
MOST_PARTS = 100_000
#: Entries of a matrix for each that the file holds, at most; and entries of a matrix that may be empty.
_MAX_ENTRIES_BY_HELD, _MAX_EMPTY_ENTRIES = 8, 250_000

_max_memory: int | None = None


def set_max_memory(size: int | None) -> None:
    """Set what reading one file may take of the memory, and what work on it may take, for the whole process.

    Parameters
    ----------
    size : int or None
        Bytes; None for what holds otherwise: 500 MB, or 20 times the file, or up to 80 times where the machine has them left.

    Raises
    ------
    DataError
        No whole number above zero.

    Examples
    --------
    >>> set_max_memory(8_000_000_000)
    >>> set_max_memory(None)
    """
    global _max_memory
    if size is not None and (isinstance(size, bool) or not isinstance(size, int) or size < 1):
        raise DataError(
            "a limit of memory needs whole bytes above zero", f"it is {size!r}", "Give whole bytes above zero, or None."
        )
    _max_memory = size
    set_allowed_memory(size)


def raise_the_limit(arrays: int = 0) -> str:
    """Return what a user does who trusts a file: whole gigabytes, as many as the machine has left or as the arrays need.

    `arrays`: their bytes.
    """
    size = max(allowed_memory() // 10**9, -(-_COPIES * arrays // 10**9), 1)
    return f"If you trust the file, raise the limit: --max-memory {size}GB"


@dataclass(slots=True)
class Room:
    """The memory and the time that one file may take.

    `size`: its bytes on the disk. `most`: bytes that its arrays may take; `left`: those that they may still take. `ends`: until which
    processor time of this thread it is read.
    """

    where: str
    size: int
    most: int
    left: int
    ends: float = np.inf

    def in_time(self) -> None:
        """Refuse to go on with a file that has taken more of the processor than one of its size may."""
        if thread_time() > self.ends:
            fault = f"reading it takes more of the processor than a file of {in_words(self.size)} may"
            raise unreadable(self.where, fault, raise_the_limit())

    def take(self, what: str, count: int) -> None:
        """Use up so many bytes, or raise a `DataError` that names what asked for them."""
        self.in_time()
        if count > self.left:
            need, sizes = self.most - self.left + count, f"{in_words(self.size)} may take {in_words(self.most)}"
            fault = f"with {what} its arrays take {in_words(need)} of memory or more; those of a file of {sizes}"
            raise unreadable(self.where, fault, raise_the_limit(need))
        self.left -= count

    def array(self, name: str, dtype: np.dtype[Any], count: int) -> None:
        """Take the room of an array: of what its numbers or texts become."""
        size = _TEXT + dtype.itemsize if dtype.kind in "USO" else max(_NUMBER, dtype.itemsize)
        # the indices of a geometry become lists of names
        self.take(name, count * (size + (_TEXT if name.startswith("geometry_") else 0)))

    def texts(self, name: str, texts: list[str]) -> Array:
        """Return texts as an array, in which each takes the width of the longest."""
        self.take(name, 4 * len(texts) * max(map(len, texts), default=0))
        return np.array(texts, dtype=np.str_)

    def parts(self, what: str, count: int, most: int = MOST_PARTS) -> None:
        """Refuse more parts than anybody has."""
        if count > most and _max_memory is None:
            raise unreadable(self.where, f"it has {count} {what}, and at most {most} are expected", raise_the_limit())

    def square(self, what: str, cells: int, held: int) -> None:
        """Refuse a matrix that is nearly empty: it grows with the square of what the file holds."""
        if cells > max(_MAX_EMPTY_ENTRIES, _MAX_ENTRIES_BY_HELD * held) and _max_memory is None:
            fault = f"{what} make a matrix of {cells} entries, of which the file holds {held}"
            raise unreadable(self.where, fault, f"Export the channels that belong together. {raise_the_limit()}")

    def json(self, what: str, text: str) -> None:
        """Take the room of what JSON text becomes as lists, mappings and numbers."""
        brackets = text.count("[") + text.count("{")
        self.take(what, _BRACKET * brackets + _ENTRY * text.count(","))


def room(where: str, size: int) -> Room:
    """Return the room that a file of this size may take.

    `size`: bytes of the file on the disk.

    Examples
    --------
    >>> room("a.npz", 1000).left
    125000000
    """
    memory = max(_MIN_BYTES, _BYTES_BY_SIZE * size, min(_BYTES_BY_PACKED_SIZE * size, allowed_memory()))
    most = (_max_memory or memory) // _COPIES
    ends = np.inf if _max_memory else thread_time() + max(_MIN_SECONDS, size / _BYTES_BY_SECOND)
    return Room(where, size, most, most, ends)
