"""Who gets a process when there are no more: those that rest give theirs, and else one waits its turn."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from modalscope.interfaces.app import processes
from modalscope.interfaces.app.processes import ProcessPool


class WorkerProcess:
    """Stands in for a process."""

    alive = True

    def __init__(self, loop: Any) -> None:
        self.ended = False

    def end(self) -> None:
        self.ended = True


class Owner:
    def __init__(self, pool: ProcessPool) -> None:
        self.pool, self.worker, self.resting = pool, None, False
        self.start()

    worker: Any

    def start(self) -> None:
        self.worker = self.pool.take(self)

    def rest(self) -> None:
        self.pool.dismiss(self.worker)
        self.worker = None


def test_no_more_processes_than_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "WorkerProcess", WorkerProcess)

    async def story() -> None:
        few = ProcessPool(2, spare=False)
        first, second, third, fourth, fifth = (Owner(few) for _ in range(5))
        assert [bool(owner.worker) for owner in (first, second, third, fourth, fifth)] == [
            True,
            True,
            False,
            False,
            False,
        ]

        # who asks again keeps no second place; who leaves has none
        third.start()
        assert few.leave(fifth)
        assert not few.leave(fifth)

        # one that rests is ended for the next, and in the order of asking
        second.resting = True
        given = second.worker
        few.next()
        await asyncio.sleep(0)
        assert given.ended
        assert [bool(owner.worker) for owner in (first, second, third, fourth)] == [True, False, False, True]

        # one that ends makes room as well
        first.rest()
        await asyncio.sleep(0)
        assert third.worker
        few.close()
        assert third.worker.ended
        assert fourth.worker.ended

    asyncio.run(story())
