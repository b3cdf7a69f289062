"""Correlations of a long record as a process of its own, which a study measures, stops and takes up again.

`python -m benchmarks.records.long_job RECORD VALUES` writes the correlations; every stretch that is summed is a line on stdout.
"""

from __future__ import annotations

import argparse
import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from modalscope.numerics.executors import working

#: Lags of the correlations.
LAGS = 200


@contextmanager
def workers(count: int) -> Iterator[Any]:
    """Processes of Dask as the command line starts them for `--scheduler local:N`; none for none."""
    if not count:
        yield None
        return
    import dask
    import distributed

    from modalscope.interfaces.cli.identify import LOCAL_SETTINGS

    with (
        dask.config.set(LOCAL_SETTINGS),
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("record", type=Path)
    parser.add_argument("values", type=Path)
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--kill", action="store_true", help="a worker dies when a third of the work is done")
    parser.add_argument("--save", type=Path)
    given = parser.parse_args()
    with workers(given.workers) as client, ExitStack() as held:
        victim = next(iter(client.run(os.getpid).values())) if given.kill else None

        def told(done: int, of: int) -> None:
            print(done, of, flush=True)
            if victim is not None and done == of // 3:
                os.kill(victim, signal.SIGKILL)

        held.enter_context(working(client, progress=told, save=given.save))
        found = ms.estimate_correlation(ms.read(given.record, stored=True), lags=LAGS)
        np.savez(given.values, values=found.values, feedthrough=found.feedthrough)


if __name__ == "__main__":
    main()
