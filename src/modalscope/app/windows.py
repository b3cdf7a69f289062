"""The browser windows that look on a document."""

from __future__ import annotations

import asyncio
from typing import Any

from modalscope.model import DataError

__all__ = ["Windows"]

#: Messages that a window may be behind; then it is told to look again at all of it.
_BEHIND = 1000

_MISSED = {"type": "missed"}

Window = asyncio.Queue[dict[str, Any]]


class Windows:
    """All windows on one document; what one changes, all are told."""

    def __init__(self) -> None:
        self._open: set[Window] = set()

    def __len__(self) -> int:
        return len(self._open)

    def look(self, most: int) -> Window:
        """Return what a new window is told from now on.

        Parameters
        ----------
        most : int
            Windows at a time.
        """
        if len(self._open) >= most:
            raise DataError("another window was opened", f"{len(self._open)} look on already", "Close some.")
        window: Window = asyncio.Queue(maxsize=_BEHIND)
        self._open.add(window)
        return window

    def look_away(self, window: Window) -> None:
        """Tell a window nothing more."""
        self._open.discard(window)

    def tell(self, message: dict[str, Any]) -> None:
        """Tell every window; one that does not keep up is told to look again."""
        for window in self._open:
            if window.full():
                while not window.empty():
                    window.get_nowait()
                window.put_nowait(_MISSED)
            window.put_nowait(message)
