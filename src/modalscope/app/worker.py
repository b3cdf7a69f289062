"""Run the process that computes one document: it receives commands by a pipe and sends back what it finds."""

from __future__ import annotations

from collections import deque
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from modalscope.app.steps import Stages
from modalscope.app.tasks import TASKS
from modalscope.data import DataError
from modalscope.io.analysis import analysis_from


class _Newer(Exception):
    """The job is left for what came after it."""


class _Worker:
    """Takes one command after the other; looks between two orders whether a newer one waits."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._waiting = pipe, deque[tuple[Any, ...]]()
        self._job = 0
        self._stages = Stages(self.tell)

    def tell(self, kind: str, payload: Any) -> None:
        """Send something of the present job."""
        self._pipe.send((kind, self._job, payload))

    def serve(self) -> None:
        """Work until the pipe is closed."""
        while True:
            if not self._waiting:
                self._waiting.append(self._pipe.recv())
            self._collect()
            jobs = [command for command in self._waiting if command[0] in ("work", "cancel")]
            if jobs:  # the newest document counts; questions are answered on it
                self._waiting = deque(command for command in self._waiting if command[0] == "ask")
                self._work(jobs[-1])
            else:
                self._answer(*self._waiting.popleft()[1:])

    def _collect(self) -> None:
        while self._pipe.poll():
            self._waiting.append(self._pipe.recv())

    def _check(self) -> None:
        self._collect()
        if any(command[0] in ("work", "cancel") for command in self._waiting):
            raise _Newer

    def _work(self, command: tuple[Any, ...]) -> None:
        kind, self._job, *rest = command
        if kind == "cancel":
            self.tell("stopped", None)
            return
        entries, kept = rest
        try:
            self._stages.run(analysis_from(entries), kept, self._check)
        except _Newer:
            self.tell("stopped", None)
        except Exception as error:  # noqa: BLE001 - a job ends, whatever is wrong; the page shows it
            self.tell("failed", told(error))
        else:
            self.tell("done", None)

    def _answer(self, number: int, what: str, given: dict[str, Any]) -> None:
        def progress(done: int, total: int) -> None:
            self.tell("asked", {"what": what, "done": done, "total": total})
            self._collect()
            if any(command[0] == "cancel" for command in self._waiting):
                raise _Newer

        try:
            answer = TASKS[what](self._stages, progress, **given)
        except _Newer:
            self._pipe.send(("answer", number, (False, _STOPPED)))
        except Exception as error:  # noqa: BLE001 - as above
            self._pipe.send(("answer", number, (False, told(error))))
        else:
            self._pipe.send(("answer", number, (True, str(answer) if isinstance(answer, Path) else answer)))


_STOPPED = {"asked": "this was asked", "found": "it was stopped", "change": "Ask again when you want it."}


def told(error: BaseException) -> dict[str, str]:
    """Return the three parts of an error: what was asked, what there is, what to change.

    Examples
    --------
    >>> told(MemoryError())["change"]
    'Give fewer orders, channels, lines or samples.'
    """
    if isinstance(error, DataError):
        return {"asked": error.asked, "found": error.found, "change": error.change, "text": str(error)}
    if isinstance(error, MemoryError):
        found = "the memory of this machine does not suffice"
        return {
            "asked": "this was computed",
            "found": found,
            "change": "Give fewer orders, channels, lines or samples.",
        }
    if isinstance(error, OSError):
        found = f"the system refuses: {(error.strerror or str(error)).lower()}"
        return {"asked": "a file was read or written", "found": found, "change": "Look whether it is still there."}
    found = f"the program has a fault here ({type(error).__name__}: {str(error)[:200]})"
    return {"asked": "this was computed", "found": found, "change": "Try other settings, and please tell us of it."}


def main(pipe: Connection) -> None:
    """Serve a pipe until it is closed; an interrupt from the terminal is the server's business."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        _Worker(pipe).serve()
    except (EOFError, OSError):  # the server is gone
        return
