"""Choose the executor of sums over stored records: this process, other processes, or the workers of a Dask scheduler."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from modalscope.cli.process import complain, progress
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import working

#: By default Dask's workers return freed memory at once and request it again for the next transform; with these they keep it. Its monitors
#: run less often: at tasks of seconds the default intervals cost a tenth of a processor per process.
LOCAL_SETTINGS = {
    **{f"distributed.nanny.pre-spawn-environ.MALLOC_{name}_THRESHOLD_": 1_000_000_000 for name in ("TRIM", "MMAP")},
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.memory.monitor-interval": "2s",
}

#: Prefix of the address of processes on this machine.
_LOCAL_ADDRESS = "local"

#: Seconds that a scheduler has to answer.
_CONNECT_SECONDS = 20


@contextmanager
def workers_of(options: argparse.Namespace) -> Iterator[None]:
    """Use the executor of the command line while the block runs, and save partial sums if asked.

    `options`: with `scheduler` and `resume`, if the command has them.
    """
    address, save = getattr(options, "scheduler", None), getattr(options, "resume", None)
    with ExitStack() as stack:
        client = None if address is None else _client(address, stack)
        show = stack.enter_context(progress("summing", "stretch"))
        stack.enter_context(working(client, progress=show, save=save))
        yield


def _client(address: str, stack: ExitStack) -> Any:
    """Return a client of a scheduler; the stack closes it and the processes that were started for it."""
    from modalscope.numerics.extras import optional_package

    distributed = optional_package("--scheduler", "distributed", "cluster")
    if address.split(":")[0] == _LOCAL_ADDRESS:
        count = address.removeprefix(_LOCAL_ADDRESS).removeprefix(":")
        if count and not (count.isdecimal() and int(count)):
            raise _wrong(address, f"{count!r} is no number of processes")
        workers = {"n_workers": int(count)} if count else {}
        stack.enter_context(optional_package("--scheduler", "dask", "cluster").config.set(LOCAL_SETTINGS))
        address = stack.enter_context(
            distributed.LocalCluster(**workers, threads_per_worker=1, dashboard_address=None, silence_logs=40)
        )
    try:
        client = stack.enter_context(distributed.Client(address, timeout=_CONNECT_SECONDS))
        if not client.nthreads():
            complain(f"{address} has no worker yet; waiting for one: dask worker {address}")
        return client
    except (OSError, ValueError, TypeError) as error:
        raise _wrong(address, f"no scheduler answers there ({type(error).__name__}: {error})") from None


def _wrong(address: str, reason: str) -> DataError:
    remedy = "Give the address that `dask scheduler` prints, or local:4."
    return DataError(f"--scheduler {address} was asked", reason, remedy)
