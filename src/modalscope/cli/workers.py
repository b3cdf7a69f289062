"""Choose who sums over stored records: this process, other processes, or the workers of a Dask scheduler."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from modalscope.cli.process import complain, progress
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import working

#: Dask's workers give memory back at once, and are given it again for the next transform: these keep it. And every process of Dask looks at
#: itself many times a second, which beside tasks of seconds tells nothing and takes a tenth of a second of a processor each second.
LOCAL_SETTINGS = {
    **{f"distributed.nanny.pre-spawn-environ.MALLOC_{name}_THRESHOLD_": 1_000_000_000 for name in ("TRIM", "MMAP")},
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "2s",
}

#: What begins the address of processes of this machine, and seconds that a scheduler has to answer.
_LOCAL, _SECONDS = "local", 20


@contextmanager
def workers_of(options: argparse.Namespace) -> Iterator[None]:
    """Let the workers named on the command line share the work while the block runs; partial sums are kept where that is asked.

    `options`: with `scheduler` and `resume`, where the command takes them.
    """
    address, save = getattr(options, "scheduler", None), getattr(options, "resume", None)
    with ExitStack() as held:
        client = None if address is None else _client(address, held)
        show = held.enter_context(progress("summing", "stretch"))
        held.enter_context(working(client, progress=show, save=save))
        yield


def _client(address: str, held: ExitStack) -> Any:
    """Return a client of a scheduler, which is closed at the end, and so are processes that were started for it."""
    from modalscope.numerics.extras import optional_package

    distributed = optional_package("--scheduler", "distributed", "cluster")
    if address.split(":")[0] == _LOCAL:
        count = address.removeprefix(_LOCAL).removeprefix(":")
        if count and not (count.isdecimal() and int(count)):
            raise _wrong(address, f"{count!r} is no number of processes")
        workers = {"n_workers": int(count)} if count else {}
        held.enter_context(optional_package("--scheduler", "dask", "cluster").config.set(LOCAL_SETTINGS))
        address = held.enter_context(
            distributed.LocalCluster(**workers, threads_per_worker=1, dashboard_address=None, silence_logs=40)
        )
    try:
        client = held.enter_context(distributed.Client(address, timeout=_SECONDS))
        if not client.nthreads():
            complain(f"no worker has joined {address} yet; waiting for one: dask worker {address}")
        return client
    except (OSError, ValueError, TypeError) as error:
        raise _wrong(address, f"no scheduler answers there ({type(error).__name__}: {error})") from None


def _wrong(address: str, found: str) -> DataError:
    return DataError(
        f"--scheduler {address} was asked", found, "Give the address that `dask scheduler` prints, or local:4."
    )
