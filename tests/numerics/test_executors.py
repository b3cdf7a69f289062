"""Sums of a stored record by processes of a Dask cluster: the numbers of one process, even when a worker is killed."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import _result, each, working

distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install 'modalscope[cluster]'")
h5py = pytest.importorskip("h5py")

RATE, LAGS = 50.0, 40

#: Sums in another order differ by rounding alone.
EQUAL = 1e-10

pytestmark = pytest.mark.filterwarnings("ignore")  # of the cluster's own sockets and event loops


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    record = ms.systems.chain5().simulate(inputs="ambient", duration=300.0, sampling_rate=RATE, seed=2)
    made = tmp_path_factory.mktemp("stored") / "long.h5"
    with h5py.File(made, "w") as file:
        file["outputs"], file["sampling_rate"] = record.outputs, RATE
    return made


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1", silence_logs=50
    ) as made:
        yield made


@pytest.mark.slow
def test_workers_give_the_numbers_of_one_process(path: Path, cluster: Any) -> None:
    settings: dict[str, Any] = {"band": (0.2, 12.0), "orders": [10, 12], "deviations": False}
    expected = ms.stabilize(ms.read(path), **settings)
    told: list[tuple[int, int]] = []
    with distributed.Client(cluster) as client, pytest.MonkeyPatch.context() as patched:
        patched.setattr("modalscope.data.stored._MIN_RECORDS_IN_MEMORY", 10**9)
        alone = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
        with working(client, progress=lambda *at: told.append(at)):
            shared = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
        found = ms.stabilize(ms.read(path, stored=True), client=client, **settings)
    assert np.abs(shared - alone).max() < EQUAL * np.abs(alone).max()
    assert told == [(k + 1, 20) for k in range(20)]
    np.testing.assert_allclose(found.frequencies, expected.frequencies, rtol=1e-6)


@pytest.mark.slow
def test_a_killed_worker_costs_its_own_tasks(path: Path, cluster: Any) -> None:
    alone = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
    told: list[int] = []
    with distributed.Client(cluster) as client:
        victim = next(iter(client.run(os.getpid).values()))

        def kill_one(done: int, of: int) -> None:
            told.append(done)
            if done == 3:
                os.kill(victim, signal.SIGKILL)

        with working(client, progress=kill_one):
            shared = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
    assert told == list(range(1, 21))  # nobody's work was done twice
    assert np.abs(shared - alone).max() < EQUAL * np.abs(alone).max()


def _ends_its_worker(task: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return task


@pytest.mark.slow
def test_work_that_ends_its_workers_is_said_in_words(cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)
    with (
        distributed.Client(cluster) as client,
        working(client),
        pytest.raises(DataError, match=r"one stretch ended every worker that took it, the last of them tcp://"),
    ):
        list(each(_ends_its_worker, [1]))


def test_a_scheduler_without_workers_is_said_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    from modalscope.interfaces.cli.identify import _client

    with (
        distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1", silence_logs=50) as empty,
        ExitStack() as held,
    ):
        _client(empty.scheduler_address, held)
    assert f"waiting for one: dask worker {empty.scheduler_address}" in capsys.readouterr().err


@pytest.mark.slow
def test_a_scheduler_that_is_gone_is_said_in_words() -> None:
    class Gone:
        def result(self) -> None:
            raise CancelledError

    with pytest.raises(DataError, match=r"(?s)the scheduler is gone.*the same folder it goes on"):
        _result(Gone())


@pytest.mark.slow
def test_the_command_gives_the_work_to_a_scheduler(path: Path, cluster: Any, tmp_path: Path) -> None:
    from modalscope.interfaces.cli import main

    modes = tmp_path / "modes.json"
    choices = ["--band", "0.2", "12", "--orders", "8:14:2", "--no-refine", "--resume", str(tmp_path / "sums")]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("modalscope.data.stored._MIN_RECORDS_IN_MEMORY", 10**9)
        patched.setattr("modalscope.io.stored._PARTS_OF_MEMORY", 10**9)
        assert main(["identify", str(path), *choices, "--scheduler", cluster.scheduler_address, "-o", str(modes)]) == 0
    assert len(ms.read(modes)) >= 3
    assert not list((tmp_path / "sums").iterdir())  # all was done


@pytest.mark.slow
def test_what_is_no_scheduler_is_said(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from modalscope.interfaces.cli import main

    with pytest.raises(DataError, match="a Dask client"):
        ms.stabilize(ms.read(path), client="tcp://here:1")
    assert main(["identify", str(path), "--scheduler", "local:none"]) == 2
    assert "no number of processes" in capsys.readouterr().err
