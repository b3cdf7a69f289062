"""Run worker processes: one for each open document, and a warm one for the next."""

from __future__ import annotations

import asyncio
import multiprocessing
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any, Protocol

# --------------------------------------------------------------------------------------------------------------- child
# Where a process of its own begins: what computes is loaded there, not in the server.


def main(pipe: Connection) -> None:
    """Load all that computes, and serve the pipe."""
    from modalscope.app.worker import main as serve

    serve(pipe)


# ---------------------------------------------------------------------------------------------------------------- pool

#: Takes what a process sends: (kind, job or number of a question, payload); "ended" with the exit code is the last.
Hear = Callable[[str, int, Any], None]


class WorkerProcess:
    """One process and the pipe to it; what it sends is heard in the server's loop.

    `loop`: of the server.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        context = multiprocessing.get_context("spawn")
        self._loop, self._hear = loop, None
        self._pipe, theirs = context.Pipe()
        self.process = context.Process(target=main, args=(theirs,), daemon=True, name="modalscope")
        self.process.start()
        theirs.close()
        self._early: list[tuple[str, int, Any]] = []
        self._ended = False
        Thread(target=self._listen, args=(self._pipe,), daemon=True).start()

    _hear: Hear | None

    def assign(self, hear: Hear) -> None:
        """Let somebody hear what the process sends."""
        self._hear = hear
        while self._early:
            hear(*self._early.pop(0))

    def send(self, *command: Any) -> None:
        """Send a command; a process that has ended says so by itself."""
        with suppress(OSError, ValueError):
            self._pipe.send(command)

    def end(self) -> None:
        """End the process; nothing of it is heard any more."""
        self._hear, self._ended = None, True
        self.process.kill()
        with suppress(OSError):
            self._pipe.close()

    def _listen(self, pipe: Connection) -> None:
        with suppress(EOFError, OSError, TypeError):  # TypeError: the pipe was closed while it was read
            while True:
                self._call(pipe.recv())
        self.process.join()
        self._call(("ended", 0, self.process.exitcode))

    def _call(self, told: tuple[str, int, Any]) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._heard, told)

    def _heard(self, told: tuple[str, int, Any]) -> None:
        if self._hear is not None:
            self._hear(*told)
        elif not self._ended:
            self._early.append(told)


class Owner(Protocol):
    """Whose process it is."""

    @property
    def resting(self) -> bool:
        """Whether its process waits for work."""

    def rest(self) -> None:
        """End its process until it has work again."""

    def start(self) -> None:
        """Give it a process."""


class ProcessPool:
    """All processes of a server: where there are as many as may be one that rests is ended, and else the next owner waits its turn.

    `spare`: whether one waits, warm, for the next document.
    """

    def __init__(self, most: int, spare: bool = True) -> None:
        self._most, self._spare = most, spare
        self._warm: WorkerProcess | None = None
        self._owners: dict[WorkerProcess, Owner] = {}
        self._waiting: list[Owner] = []

    def warm_up(self) -> None:
        """Start a process that waits, if none does."""
        if self._warm is None and self._spare:
            self._warm = WorkerProcess(asyncio.get_running_loop())

    def take(self, owner: Owner) -> WorkerProcess | None:
        """Return a process, and let the next warm up; None where all have work: the owner is started when one has done with it."""
        self.leave(owner)
        if not self._room():
            self._waiting.append(owner)
            return None
        worker, self._warm = self._warm or WorkerProcess(asyncio.get_running_loop()), None
        self._owners[worker] = owner
        self.warm_up()
        return worker

    def leave(self, owner: Owner) -> bool:
        """Wait no longer; say whether it waited."""
        waited = owner in self._waiting
        if waited:
            self._waiting.remove(owner)
        return waited

    def _room(self) -> bool:
        """Whether another process may be; the first that rests is ended for it."""
        if len(self._owners) >= self._most:
            resting = next((owner for owner in self._owners.values() if owner.resting), None)
            if resting is not None:
                resting.rest()
        return len(self._owners) < self._most

    def next(self) -> None:
        """Start who waits, as soon as what goes on is done."""
        with suppress(RuntimeError):  # the loop is closed: nobody waits
            asyncio.get_running_loop().call_soon(self._next)

    def _next(self) -> None:
        if self._waiting and self._room():
            self._waiting[0].start()

    def dismiss(self, worker: WorkerProcess) -> None:
        """End a process."""
        self._owners.pop(worker, None)
        worker.end()
        self.next()

    def close(self) -> None:
        """End them all."""
        for worker in (*self._owners, *([self._warm] if self._warm else [])):
            worker.end()
        self._owners, self._warm, self._waiting = {}, None, []
