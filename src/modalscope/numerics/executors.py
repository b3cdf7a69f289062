"""Execute tasks in this process or on Dask workers, report progress, and keep partial results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from modalscope.numerics.arguments import named
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import Device, device_named

Task = TypeVar("Task")
Done = TypeVar("Done")
Progress = Callable[[int, int], None]

#: Tasks queued for every thread of the workers: enough to keep all busy, few enough that results do not accumulate.
_TASKS_PER_THREAD = 2


@dataclass(frozen=True, eq=False, slots=True)
class Executor:
    """Where tasks are executed, and what is reported and kept.

    `client`: of a Dask scheduler; without it this process does everything. `progress`: called with (tasks done, tasks in all). `folder`:
    where what is done is kept, so that a stopped run resumes. `device`: where large products are computed; without it by NumPy.
    """

    client: Any = None
    progress: Progress | None = None
    folder: Path | None = None
    device: Device | None = None

    def place(self, array: Any) -> Any:
        """Return an array where large products are computed: itself, where that is NumPy."""
        return array if self.device is None else self.device.place(array)


_LOCAL = Executor()
_executor: ContextVar[Executor | None] = ContextVar("executor", default=None)


def executor() -> Executor:
    """Return the executor in force."""
    return _executor.get() or _LOCAL


@named()
@contextmanager
def working(
    client: Any = None, *, progress: Progress | None = None, save: str | Path | None = None, device: str | None = None
) -> Iterator[None]:
    """Choose where long sums over a record and large products are computed, and how their progress is reported and kept.

    Within the block, what is not given stays as it was outside.

    Parameters
    ----------
    client : distributed.Client, optional
        Its workers share the tasks; each reads its own part of the record, so that they must see the file by the same name.
    progress : callable, optional
        Called with (tasks done, tasks in all).
    save : path, optional
        A folder for partial sums: the same work, started again, goes on where it was stopped.
    device : {"cpu", "cuda"}, optional
        Where Gram matrices, cross spectra, triangular factors and products with data matrices are computed: by PyTorch on the processor
        or on a graphics card (extra `torch`); by NumPy without it. Workers of a client compute by NumPy.

    Raises
    ------
    DataError
        No client of a Dask scheduler; a folder that cannot be made; a device that is not there.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> record = chain5().simulate(inputs="ambient", duration=60.0, sampling_rate=20.0)
    >>> with working(progress=print):
    ...     pass  # estimate_correlation of a stored record tells here how far it is
    """
    if client is not None and not all(hasattr(client, name) for name in ("submit", "cancel", "nthreads")):
        have = f"it is {type(client).__name__}"
        raise DataError("client needs to be a Dask client", have, "Give distributed.Client(address).")
    outer = executor()
    token = _executor.set(
        Executor(
            outer.client if client is None else client,
            outer.progress if progress is None else progress,
            outer.folder if save is None else _folder(save),
            outer.device if device is None else device_named(device),
        )
    )
    try:
        yield
    finally:
        _executor.reset(token)


def _folder(path: str | Path) -> Path:
    folder = Path(path)
    with as_refused(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextmanager
def as_refused(folder: Path) -> Iterator[None]:
    """Turn what the system refuses in a folder of partial sums into a `DataError`."""
    try:
        yield
    except OSError as error:
        asked, fault = f"partial sums in {str(folder)!r}:", (error.strerror or str(error)).lower()
        raise DataError(asked, f"the system refuses: {fault}", "Choose a folder that you may write to.") from None


def each(work: Callable[[Task], Done], tasks: Sequence[Task]) -> Iterator[tuple[Task, Done]]:
    """Yield every task with what came of it, in the order in which they end.

    Tasks of a worker that dies are executed again by others.

    `work`: A function of a module, or a partial of one: it is sent to the workers.
    """
    if executor().client is None:
        for task in tasks:
            yield task, work(task)
        return
    yield from _by_workers(executor().client, work, tasks)


def _by_workers(client: Any, work: Callable[[Task], Done], tasks: Sequence[Task]) -> Iterator[tuple[Task, Done]]:
    """Yield what the workers of a scheduler give: a few tasks wait for each, the others are handed out as these end."""
    as_completed = import_module("distributed").as_completed
    remaining, handed = iter(tasks), {}

    def hand_out(count: int) -> list[Any]:
        futures = []
        for task in islice(remaining, count):
            future = client.submit(work, task, pure=False)
            handed[future] = task
            futures.append(future)
        return futures

    threads = sum(int(count) for count in client.nthreads().values())
    ended = as_completed(hand_out(_TASKS_PER_THREAD * max(threads, 1)))
    try:
        for future in ended:
            result = _result(future)
            task = handed.pop(future)
            yield task, result
            for more in hand_out(1):
                ended.add(more)
    finally:
        client.cancel(list(handed))


def _result(future: Any) -> Any:
    """Return what a worker found; that the work ends its workers, or that the scheduler is gone, is said in words."""
    distributed = import_module("distributed")
    asked = "sums by the workers of a scheduler:"
    try:
        return future.result()
    except distributed.scheduler.KilledWorker as error:
        fault = f"one stretch ended every worker that took it, the last of them {error.last_worker.address}"
        remedy = "Give the workers more memory (`dask worker --memory-limit`) or use fewer lags; their logs say how they ended."
        raise DataError(asked, fault, remedy) from None
    except CancelledError:
        remedy = "Start it and the work again: with the same folder it goes on from the saved sums."
        raise DataError(asked, "the scheduler is gone, or has stopped the work", remedy) from None
