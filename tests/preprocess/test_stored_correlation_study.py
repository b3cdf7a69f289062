"""Sixty-four channels of twenty million samples in Zarr: memory, processor time, the same numbers whoever sums and however often."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms
from modalscope.model.crew import working

zarr = pytest.importorskip("zarr")
dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

pytestmark = [pytest.mark.study, pytest.mark.filterwarnings("ignore")]

SAMPLES, CHANNELS, LAGS, RATE = 20_000_000, 64, 200, 100.0

#: What is asked: seconds of a processor, bytes, and what two workers may take beside one.
SECONDS, MEMORY, BESIDE = 90.0, 2e9, 1.15

#: Estimates in a process of their own, whose memory is known at the end.
ALONE = """
import resource, sys, time
import numpy as np
import modalscope as ms
record = ms.read(sys.argv[1], stored=True)
start = time.process_time()
values = ms.estimate_correlation(record, lags={lags}).values
seconds = time.process_time() - start
np.save(sys.argv[2], values)
print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made, rng = tmp_path_factory.mktemp("long") / "long.zarr", np.random.default_rng(0)
    group = zarr.open_group(made, mode="w")
    array = group.create_array(
        "outputs", shape=(SAMPLES, CHANNELS), chunks=(2**16, CHANNELS), dtype="f4", compressors=None
    )
    group.attrs["sampling_rate"] = RATE
    shapes, states = rng.standard_normal((3, CHANNELS)), [np.zeros(2) for _ in range(3)]
    poles = [np.exp(2 * np.pi * f * (-0.01 + 1j)) for f in (0.02, 0.05, 0.13)]
    for start in range(0, SAMPLES, 2**18):
        count = min(2**18, SAMPLES - start)
        motion = np.empty((count, 3))
        for k, z in enumerate(poles):
            filtered = lfilter([0, 1], [1, -2 * z.real, abs(z) ** 2], rng.standard_normal(count), zi=states[k])
            motion[:, k], states[k] = filtered
        array[start : start + count] = motion @ shapes + 0.3 * rng.standard_normal((count, CHANNELS))
    return made


@pytest.fixture(scope="module")
def alone(path: Path) -> tuple[Any, float, float]:
    values = path.with_name("alone.npy")
    done = subprocess.run(
        [sys.executable, "-c", ALONE.format(lags=LAGS), str(path), str(values)],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    seconds, memory = map(float, done.stdout.split())
    with values.open("rb") as file:
        return np.load(file), seconds, memory


def test_time_and_memory_of_one_process(alone: tuple[Any, float, float]) -> None:
    _, seconds, memory = alone
    print(f"{seconds:.1f} CPU s, {memory / 1e6:.0f} MB, load {os.getloadavg()[0]:.1f}")
    assert memory < MEMORY
    assert seconds < SECONDS


def test_two_workers_take_what_one_takes_and_one_may_be_killed(path: Path, alone: tuple[Any, float, float]) -> None:
    expected, seconds, _ = alone
    from modalscope.cli.workers import LOCAL_SETTINGS

    with (
        dask.config.set(LOCAL_SETTINGS),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        before = sum(client.run(time.process_time).values())
        with working(client):
            shared = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
        spent = sum(client.run(time.process_time).values()) - before
        print(f"{spent:.1f} CPU s of two workers, {seconds:.1f} of one")
        assert np.abs(shared - expected).max() < 1e-10 * np.abs(expected).max()
        victim = next(iter(client.run(os.getpid).values()))
        with working(client, progress=lambda done, of: os.kill(victim, signal.SIGKILL) if done == 5 else None):
            shared = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
        assert np.abs(shared - expected).max() < 1e-10 * np.abs(expected).max()
    assert spent < BESIDE * seconds


def test_a_run_that_was_stopped_goes_on(path: Path, alone: tuple[Any, float, float], tmp_path: Path) -> None:
    expected, told = alone[0], []

    def stop(done: int, of: int) -> None:
        told.append(done)
        if done == of // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), working(progress=stop, save=tmp_path):
        ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS)
    stopped = told[-1]
    with working(progress=lambda done, of: told.append(done), save=tmp_path):
        found = ms.estimate_correlation(ms.read(path, stored=True), lags=LAGS).values
    assert told == list(range(1, told[-1] + 1))
    assert stopped < told[-1]
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
