"""Run worker processes: one for each open document, and a started one for the next."""

from __future__ import annotations

import asyncio
import multiprocessing
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any, Protocol


def main(pipe: Connection) -> None:
    """Serve the pipe in the worker process; only there the numerical libraries are loaded."""
    from modalscope.interfaces.app.worker import main as serve

    serve(pipe)


#: Receives the messages of a process: (kind, number of the job or question, payload); the last is "ended" with the exit code.
Hear = Callable[[str, int, Any], None]


class WorkerProcess:
    """One process and the pipe to it; its messages arrive in the event loop of the server."""

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

    @property
    def alive(self) -> bool:
        """Whether the process runs; one that the system ended may not have said so yet."""
        return self.process.is_alive()

    def assign(self, hear: Hear) -> None:
        """Set the receiver of the messages."""
        self._hear = hear
        while self._early:
            hear(*self._early.pop(0))

    def send(self, *command: Any) -> None:
        """Send a command; a process that has ended reports that itself."""
        with suppress(OSError, ValueError):
            self._pipe.send(command)

    def end(self) -> None:
        """End the process and ignore its messages."""
        self._hear, self._ended = None, True
        self.process.kill()

    def _listen(self, pipe: Connection) -> None:
        # the pipe is closed by who reads it: its number could be that of the next process's while a message is half read
        with pipe, suppress(EOFError, OSError):
            while True:
                self._call(pipe.recv())
        self.process.join()
        self._call(("ended", 0, self.process.exitcode))

    def _call(self, message: tuple[str, int, Any]) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._receive, message)

    def _receive(self, message: tuple[str, int, Any]) -> None:
        if self._hear is not None:
            self._hear(*message)
        elif not self._ended:
            self._early.append(message)


class Owner(Protocol):
    """The owner of a process, a document."""

    @property
    def resting(self) -> bool:
        """Whether its process is idle."""

    def rest(self) -> None:
        """End its process until the next job."""

    def start(self) -> None:
        """Start its job."""


class ProcessPool:
    """All processes of a server: at their maximum number an idle one is ended for the next owner, else that owner waits.

    `spare`: whether a started process waits for the next document.
    """

    def __init__(self, most: int, spare: bool = True) -> None:
        self._most, self._spare = most, spare
        self._warm: WorkerProcess | None = None
        self._owners: dict[WorkerProcess, Owner] = {}
        self._waiting: list[Owner] = []

    def warm_up(self) -> None:
        """Start a spare process, if there is none."""
        if self._warm is None and self._spare:
            self._warm = WorkerProcess(asyncio.get_running_loop())

    def take(self, owner: Owner) -> WorkerProcess | None:
        """Return a process and start the next spare; None if all are busy: the owner is started when one becomes idle."""
        self.leave(owner)
        if not self._room():
            self._waiting.append(owner)
            return None
        warm, self._warm = self._warm, None
        if warm is not None and not warm.alive:
            warm.end()
            warm = None
        worker = warm or WorkerProcess(asyncio.get_running_loop())
        self._owners[worker] = owner
        self.warm_up()
        return worker

    def leave(self, owner: Owner) -> bool:
        """Remove an owner from the queue, and return whether it waited."""
        waited = owner in self._waiting
        if waited:
            self._waiting.remove(owner)
        return waited

    def _room(self) -> bool:
        """Return whether another process may start; the first idle one is ended for it."""
        if len(self._owners) >= self._most:
            resting = next((owner for owner in self._owners.values() if owner.resting), None)
            if resting is not None:
                resting.rest()
        return len(self._owners) < self._most

    def next(self) -> None:
        """Start the first owner that waits, after the current callback."""
        with suppress(RuntimeError):  # the loop is closed
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
        """End all processes."""
        for worker in (*self._owners, *([self._warm] if self._warm else [])):
            worker.end()
        self._owners, self._warm, self._waiting = {}, None, []
