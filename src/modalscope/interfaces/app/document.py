"""Manage an open document: its history with undo, the process that computes it, and the windows that show it."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

from modalscope.data import DataError
from modalscope.data.analysis import Analysis
from modalscope.interfaces.app.actions import acted, diagrams_key
from modalscope.interfaces.app.guard import Limits
from modalscope.interfaces.app.processes import ProcessPool, WorkerProcess
from modalscope.io.analysis import analysis_to

#: Messages that wait for a window at most; one that falls behind is asked to reload the document.
_MAX_QUEUE = 1000

Window = asyncio.Queue[dict[str, Any]]


class Windows:
    """The browser windows of one document; all receive every change."""

    def __init__(self) -> None:
        self._open: set[Window] = set()

    def __len__(self) -> int:
        return len(self._open)

    def add(self, most: int) -> Window:
        """Return the message queue of a new window, if there are fewer than `most`."""
        if len(self._open) >= most:
            raise DataError(f"a document opens in at most {most} windows", f"{len(self._open)} are open", "Close some.")
        window: Window = asyncio.Queue(maxsize=_MAX_QUEUE)
        self._open.add(window)
        return window

    def remove(self, window: Window) -> None:
        """Remove a window."""
        self._open.discard(window)

    def send(self, message: dict[str, Any]) -> None:
        """Send a message to every window; one whose queue is full is asked to reload."""
        for window in self._open:
            if window.full():
                while not window.empty():
                    window.get_nowait()
                window.put_nowait({"type": "missed"})
            window.put_nowait(message)


@dataclass(eq=False)
class OpenDocument:
    """One open document.

    `key`: its name in addresses. `name`: its title. `history`: all steps. `place`: the current step. `edition`: number of changes, which
    detects an outdated window. `blobs`: the latest results.
    """

    key: str
    name: str
    history: list[Analysis]
    pool: ProcessPool
    limits: Limits
    place: int = 0
    edition: int = 0
    blobs: dict[str, tuple[int, bytes]] = field(default_factory=dict)
    stage: dict[str, Any] = field(default_factory=lambda: {"stage": "idle"})
    failed: dict[str, Any] | None = None
    cuts: list[dict[str, Any]] = field(default_factory=list)
    job: int = 0
    windows: Windows = field(default_factory=Windows)
    _worker: WorkerProcess | None = None
    _busy: bool = False
    _swept: str = ""
    _count: int = 0
    _timer: asyncio.TimerHandle | None = None
    _kept: OrderedDict[str, bytes] = field(default_factory=OrderedDict)
    _asked: dict[int, tuple[tuple[Any, ...], asyncio.Future[Any]]] = field(default_factory=dict)

    @property
    def document(self) -> Analysis:
        """The document as it is now."""
        return self.history[self.place]

    def act(self, action: str, given: dict[str, Any], edition: int | None) -> None:
        """Apply an action to the document, and compute the result.

        `action`: one of `actions.ACTIONS`, "undo", "redo" or "again". `edition`: that of the window.
        """
        if edition is not None and edition != self.edition:
            remedy = "Look at the document as it is now, and repeat the change if it is still needed."
            raise DataError("a change:", "the document was changed in another window", remedy)
        if action == "undo":
            self.place = max(self.place - 1, 0)
        elif action == "redo":
            self.place = min(self.place + 1, len(self.history) - 1)
        elif action != "again":
            new = acted(self.document, action, given)
            del self.history[self.place + 1 :]
            self.history.append(new)
            del self.history[: -self.limits.history]
            self.place = len(self.history) - 1
        self.edition += 1
        self.start()
        self.windows.send(self.state())

    def state(self) -> dict[str, Any]:
        """Return the state that a window shows."""
        return {
            "type": "document",
            "key": self.key,
            "name": self.name,
            "document": analysis_to(self.document),
            "edition": self.edition,
            "undo": self.place > 0,
            "redo": self.place < len(self.history) - 1,
            "blobs": {name: number for name, (number, _) in self.blobs.items()},
            "stage": self.stage,
            "failed": self.failed,
        }

    def start(self) -> None:
        """Compute the document; stop a sweep whose diagrams are outdated."""
        key = diagrams_key(self.document)
        self.failed, self.stage = None, {"stage": "waiting"}
        self.job += 1
        if self._worker is not None and not self._worker.alive:
            self._dismiss()
        if self._worker is None and not self._hire():
            return
        assert self._worker is not None
        outdated = self._busy and self._swept != key
        self._busy, self._swept = True, key
        self._worker.send("work", self.job, analysis_to(self.document), self._kept.get(key))
        limits = self.limits
        self._expect(limits.patience if outdated else limits.seconds, self._replace if outdated else self._late)

    def cancel(self) -> None:
        """Stop the computation: between two orders, or by ending the process."""
        if self.pool.leave(self):
            self._stop_hard()
        if self._worker is None or not (self._busy or self._asked):
            return
        self.job += 1
        self._worker.send("cancel", self.job)
        self._expect(self.limits.patience, self._stop_hard)

    def _late(self) -> None:
        self._stop_hard()
        self._fail(f"it took more than {self.limits.seconds / 3600:g} hours", "Choose a band, or fewer orders.")

    def _stop_hard(self) -> None:
        self._dismiss()
        self._end("stopped")
        self._refuse({"asked": "an answer:", "found": "the computation was stopped", "change": "Ask again."})

    def _refuse(self, reason: dict[str, Any] | None) -> None:
        """Answer all open questions with the reason why they have no answer."""
        for number in list(self._asked):
            self._answer(number, (False, reason))

    def _end(self, stage: str) -> None:
        """Say that the job is done, or stopped."""
        self._free()
        self._on_stage({"stage": stage})

    def _free(self) -> None:
        """Mark the process as idle, so that other documents may use it."""
        self._busy = False
        self._expect(None)
        self.pool.next()

    def _replace(self) -> None:
        """Start the latest job in another process: the present one did not stop in time."""
        self._dismiss()
        self.start()

    def _hire(self) -> bool:
        """Request a process and return whether there is one; else the pool starts this document later."""
        self._worker = self.pool.take(self)
        if self._worker is not None:
            self._worker.assign(self._hear)
            for command, _ in self._asked.values():
                self._worker.send(*command)
        return self._worker is not None

    def _dismiss(self) -> None:
        if self._worker is not None:
            self.pool.dismiss(self._worker)
        self._worker, self._busy = None, False

    @property
    def resting(self) -> bool:
        """Whether its process is idle."""
        return self._worker is not None and not self._busy and not self._asked

    def rest(self) -> None:
        """End the process and keep its results."""
        self._dismiss()
        self._expect(None)

    def close(self) -> None:
        """End the process and close the windows."""
        self.pool.leave(self)
        self.rest()
        self.windows.send({"type": "closed"})

    def _expect(self, seconds: float | None, then: Any = None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None if seconds is None else asyncio.get_running_loop().call_later(seconds, then)

    def _hear(self, kind: str, number: int, payload: Any) -> None:
        if kind == "answer":
            self._answer(number, payload)
        elif kind == "ended":
            self._ended(payload)
        elif kind == "keep":
            self._keep(*payload)
        elif number == self.job and kind in ("done", "stopped"):
            self._end(kind)
        elif number == self.job:
            if kind in ("stage", "cut") and self._busy:  # the time limit starts with the job
                self._expect(self.limits.seconds, self._late)
            getattr(self, f"_on_{kind}")(payload)

    def _on_stage(self, payload: dict[str, Any]) -> None:
        self.stage = payload
        if payload["stage"] == "factoring":
            self.cuts = []
        self.windows.send({"type": "stage", **payload})

    def _on_cut(self, payload: dict[str, Any]) -> None:
        if payload["again"]:
            self.cuts = []
        self.cuts.append(payload)
        self.stage = {"stage": "sweeping", "done": payload["done"], "total": payload["total"]}
        self.windows.send({"type": "cut", **payload})

    def _on_blob(self, payload: tuple[str, bytes]) -> None:
        name, blob = payload
        self._count += 1
        self.blobs[name] = (self._count, blob)
        self.windows.send({"type": "blob", "name": name, "number": self._count})

    def _on_asked(self, payload: dict[str, Any]) -> None:
        self.windows.send({"type": "asked", **payload})

    def _on_failed(self, payload: dict[str, Any]) -> None:
        self._free()
        self.stage, self.failed = {"stage": "failed"}, payload
        self.windows.send({"type": "failed", **payload})

    def _fail(self, reason: str, remedy: str) -> None:
        self._on_failed({"asked": "the analysis:", "found": reason, "change": remedy})

    def _ended(self, code: int | None) -> None:
        """Report that the process ended by itself; the next change of the document starts another."""
        self._dismiss()
        status = f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"
        reason = f"its process ended ({status}){', probably out of memory' if code in (-9, 137) else ''}"
        self._fail(reason, "All choices are kept. Press again, or choose a band, fewer orders or channels.")
        self._refuse(self.failed)

    def _keep(self, key: str, stage: bytes) -> None:
        self._kept[key] = stage
        self._kept.move_to_end(key)
        while self._kept and sum(map(len, self._kept.values())) > self.limits.kept:
            self._kept.popitem(last=False)

    async def ask(self, what: str, **given: Any) -> Any:
        """Return the answer of a finished analysis, which is computed first if needed.

        `what`: one of `worker.TASKS`.
        """
        self._count += 1
        number, answer = self._count, asyncio.get_running_loop().create_future()
        command = ("ask", number, what, given)
        self._asked[number] = (command, answer)
        if self._worker is None:
            self.start()
        else:
            self._worker.send(*command)
        try:
            good, result = await answer
        finally:
            self._asked.pop(number, None)
        if not good:
            raise DataError(result["asked"], result["found"], result["change"], result.get("text"))
        return result

    def _answer(self, number: int, payload: Any) -> None:
        _, answer = self._asked.pop(number, (None, None))
        if answer is not None and not answer.done():
            answer.set_result(payload)
        self.pool.next()
