"""Keep the open documents: their steps with undo, the process that computes each, and the windows that show it."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

from modalscope.app.actions import acted, diagrams_key
from modalscope.app.guard import Limits
from modalscope.app.processes import ProcessPool, WorkerProcess
from modalscope.data import DataError
from modalscope.data.analysis import Analysis
from modalscope.io.analysis import analysis_to

# ------------------------------------------------------------------------------------------------------------- windows
# The browser windows that look on a document.

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

        `most`: windows at a time.
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


# ---------------------------------------------------------------------------------------------------------------- opened


@dataclass(eq=False)
class OpenDocument:
    """One open document.

    `key`: its name in addresses. `name`: what it is called. `history`: every step. `place`: which step counts now. `edition`: counts
    every change: a window that saw another one is told so. `blobs`: what was found last.
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

    # -------------------------------------------------------------------------------------------------- the document
    def act(self, action: str, given: dict[str, Any], edition: int | None) -> None:
        """Do something to the document, and compute what follows from it.

        `action`: one of `actions.ACTIONS`, "undo", "redo" or "again". `edition`: what the window saw.
        """
        if edition is not None and edition != self.edition:
            raise DataError(
                "a change was asked",
                "the document was changed in another window meanwhile",
                "Look at it as it is now, and do it again if it is still wanted.",
            )
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
        self.windows.tell(self.state())

    def state(self) -> dict[str, Any]:
        """Return all that a window needs to know."""
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

    # ------------------------------------------------------------------------------------------------------ the work
    def start(self) -> None:
        """Compute the document as it is now; a sweep that it makes useless is stopped."""
        document, key = self.document, diagrams_key(self.document)
        self.failed = None
        self.job += 1
        if self._worker is None and not self._hire():
            self.stage = {"stage": "waiting"}
            return
        assert self._worker is not None
        useless = self._busy and self._swept != key
        self._busy, self._swept = True, key
        self.stage = {"stage": "waiting"}
        self._worker.send("work", self.job, analysis_to(document), self._kept.get(key))
        self._expect(self.limits.patience if useless else self.limits.seconds, self._replace if useless else self._late)

    def cancel(self) -> None:
        """Stop what is computed or waits for it: between two orders, or by ending the process."""
        if self.pool.leave(self):
            self._stop_hard()
        if self._worker is None or not (self._busy or self._asked):
            return
        self.job += 1
        self._worker.send("cancel", self.job)
        self._expect(self.limits.patience, self._stop_hard)

    def _late(self) -> None:
        self._stop_hard()
        found = f"it took more than {self.limits.seconds / 3600:g} hours"
        self._fail("the analysis was computed", found, "Choose a band, or fewer orders.")

    def _stop_hard(self) -> None:
        self._dismiss()
        self._on_stopped()
        for number in list(self._asked):
            self._answer(
                number, (False, {"asked": "this was asked", "found": "it was stopped", "change": "Ask again."})
            )

    def _on_stopped(self, _: None = None) -> None:
        self._free()
        self.stage = {"stage": "stopped"}
        self.windows.tell({"type": "stage", **self.stage})

    def _free(self) -> None:
        """Have nothing to compute any more; others may need the process."""
        self._busy = False
        self._expect(None)
        self.pool.next()

    def _replace(self) -> None:
        """Start the newest job in another process: the one that has it did not stop in time."""
        self._dismiss()
        self.start()

    def _hire(self) -> bool:
        """Whether there is a process; where there is none yet the pool starts this document when there is."""
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
        """Whether its process has nothing to do."""
        return self._worker is not None and not self._busy and not self._asked

    def rest(self) -> None:
        """Give the process back; what it found stays."""
        self._dismiss()
        self._expect(None)

    def close(self) -> None:
        """End all, and tell the windows."""
        self.pool.leave(self)
        self.rest()
        self.windows.tell({"type": "closed"})

    def _expect(self, seconds: float | None, then: Any = None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None if seconds is None else asyncio.get_running_loop().call_later(seconds, then)

    # --------------------------------------------------------------------------------------------- what the work says
    def _hear(self, kind: str, number: int, payload: Any) -> None:
        if kind == "answer":
            self._answer(number, payload)
        elif kind == "ended":
            self._ended(payload)
        elif kind == "keep":
            self._keep(*payload)
        elif number == self.job:
            if kind in ("stage", "cut") and self._busy:  # a job that has begun has all its time
                self._expect(self.limits.seconds, self._late)
            getattr(self, f"_on_{kind}")(payload)

    def _on_stage(self, payload: dict[str, Any]) -> None:
        self.stage = payload
        if payload["stage"] == "factoring":
            self.cuts = []
        self.windows.tell({"type": "stage", **payload})

    def _on_cut(self, payload: dict[str, Any]) -> None:
        if payload["again"]:
            self.cuts = []
        self.cuts.append(payload)
        self.stage = {"stage": "sweeping", "done": payload["done"], "total": payload["total"]}
        self.windows.tell({"type": "cut", **payload})

    def _on_blob(self, payload: tuple[str, bytes]) -> None:
        name, blob = payload
        self._count += 1
        self.blobs[name] = (self._count, blob)
        self.windows.tell({"type": "blob", "name": name, "number": self._count})

    def _on_asked(self, payload: dict[str, Any]) -> None:
        self.windows.tell({"type": "asked", **payload})

    def _on_done(self, _: None) -> None:
        self._free()
        self.stage = {"stage": "done"}
        self.windows.tell({"type": "stage", **self.stage})

    def _on_failed(self, payload: dict[str, Any]) -> None:
        self._free()
        self.stage, self.failed = {"stage": "failed"}, payload
        self.windows.tell({"type": "failed", **payload})

    def _fail(self, asked: str, found: str, change: str) -> None:
        self._on_failed({"asked": asked, "found": found, "change": change})

    def _ended(self, code: int | None) -> None:
        """Say why a process ended by itself; the document stays, and the next change starts another."""
        self._dismiss()
        why = f"signal {-code}" if code is not None and code < 0 else f"exit status {code}"
        found = f"its process ended ({why}): often the memory of the machine did not suffice"
        change = "Nothing that was chosen is lost. Say: again, or choose a band, fewer orders or channels."
        self._fail("the analysis was computed", found, change)
        for number in list(self._asked):
            self._answer(number, (False, self.failed))

    def _keep(self, key: str, stage: bytes) -> None:
        self._kept[key] = stage
        self._kept.move_to_end(key)
        while self._kept and sum(map(len, self._kept.values())) > self.limits.kept:
            self._kept.popitem(last=False)

    async def ask(self, what: str, **given: Any) -> Any:
        """Return what a finished analysis answers; it is computed first where that is still to be done.

        `what`: one of `tasks.TASKS`.
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
            good, found = await answer
        finally:
            self._asked.pop(number, None)
        if not good:
            raise DataError(found["asked"], found["found"], found["change"], found.get("text"))
        return found

    def _answer(self, number: int, payload: Any) -> None:
        _, answer = self._asked.pop(number, (None, None))
        if answer is not None and not answer.done():
            answer.set_result(payload)
        self.pool.next()
