"""Sixty-four channels of twenty million samples in Zarr: memory, processor time, the same numbers whoever sums and however often."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.records.long_job import LAGS
from tests.studies import Study
from tests.support import ROOT

zarr = pytest.importorskip("zarr")
psutil = pytest.importorskip("psutil", reason="Dask is not installed: pip install 'modalscope[cluster]'")
pytest.importorskip("distributed")

pytestmark = pytest.mark.study("resources")

FULL, CHANNELS, RATE = 20_000_000, 64, 100.0

#: Fewer samples, for a look at the study itself, are said in the environment, and by the table.
SAMPLES = int(os.environ.get("MODALSCOPE_LONG", FULL))

#: What is asked: seconds of a processor, bytes, what two workers may take beside one worker, and how equal sums in another order are.
SECONDS, MEMORY, BESIDE, EQUAL = 90.0, 2e9, 1.15, 1e-10

ALONE, ONE, TWO, KILLED = (
    "one process",
    "one worker of Dask",
    "two workers of Dask",
    "two, one of them killed at a third",
)
STOPPED = {
    signal.SIGINT: "one process, Ctrl-C at a half and resumed",
    signal.SIGTERM: "one process, SIGTERM at a half and resumed",
    signal.SIGKILL: "one process, SIGKILL at a half and resumed",
}


@dataclass(frozen=True)
class Run:
    """What a process and all that it started took, and what it found."""

    status: int
    seconds: float
    largest: float
    together: float
    told: list[int]
    values: np.ndarray | None


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
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
    yield made
    shutil.rmtree(made)  # five gigabytes


def heard() -> None:
    """Let Ctrl-C end a program: where tests run in the background, a shell has told them to ignore it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def all_at_once(process: subprocess.Popen[str], most: list[float]) -> None:
    """Keep the largest sum of what a process and those that it started hold, pages that they share counted once."""
    while process.returncode is None:
        held = 0
        try:
            for each in (top := psutil.Process(process.pid), *top.children(recursive=True)):
                held += each.memory_full_info().pss
        except psutil.Error:
            pass
        most[0] = max(most[0], held)
        time.sleep(0.5)


def run(path: Path, *options: object, at: Callable[[int, int], int | None] = lambda done, of: None) -> Run:
    """Sum in a process of its own; `at` says with which signal it is stopped when so many stretches are done."""
    values = path.with_name("values.npz")
    values.unlink(missing_ok=True)
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.records.long_job", str(path), str(values), *map(str, options)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=heard,
    )
    assert process.stdout is not None
    told, most = [], [0.0]
    watch = threading.Thread(target=all_at_once, args=(process, most))
    watch.start()
    with process.stdout as lines:
        for line in lines:
            done, of = map(int, line.split())
            told.append(done)
            if (number := at(done, of)) is not None:
                process.send_signal(number)
    _, status, used = os.wait4(process.pid, 0)  # of all processes that it has waited for, too
    process.returncode = os.waitstatus_to_exitcode(status)
    watch.join()
    found = None
    if values.exists():
        with np.load(values) as file:
            found = np.concatenate([file["feedthrough"][None], file["values"]])
    return Run(process.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, most[0], told, found)


def record(
    begun: Callable[[str, str], Study], label: str, runs: list[Run], expected: np.ndarray, seconds: float | None = None
) -> None:
    """Record what the runs took, and by how much the numbers differ from those of one process, relative to the largest."""
    found = runs[-1].values
    assert found is not None
    differ = float(np.abs(found - expected).max() / np.abs(expected).max())
    table = begun(f"correlation of {CHANNELS} channels x {SAMPLES} samples, {label}", "1 record, seed 0")
    table.row("CPU s of all processes", sum(r.seconds for r in runs), most=seconds, form=".1f")
    table.row("largest process, MB", max(r.largest for r in runs) / 1e6, form=".0f")
    together = max(r.together for r in runs) / 1e6
    table.row("all processes at once, MB", together, most=MEMORY / 1e6 if label in (ALONE, TWO) else None, form=".0f")
    table.row("relative difference of values", differ, most=EQUAL, form=".0e")
    assert not table.missed


@pytest.fixture(scope="module")
def alone(path: Path) -> Run:
    return run(path)


def test_one_process_takes_ninety_seconds_and_two_gigabytes_at_most(
    alone: Run, study: Callable[[str, str], Study]
) -> None:
    assert alone.status == 0
    assert alone.values is not None
    assert alone.values.shape == (LAGS + 1, CHANNELS, CHANNELS)
    record(study, ALONE, [alone], alone.values, SECONDS)


def test_two_workers_take_what_one_takes_and_find_the_same(
    path: Path, alone: Run, study: Callable[[str, str], Study]
) -> None:
    one, two = (run(path, "--workers", count) for count in (1, 2))
    assert alone.values is not None
    record(study, ONE, [one], alone.values)
    # of fewer samples the start of two processes is the larger part
    record(study, TWO, [two], alone.values, BESIDE * one.seconds if SAMPLES == FULL else None)


def test_a_killed_worker_costs_what_it_had_in_hand(path: Path, alone: Run, study: Callable[[str, str], Study]) -> None:
    assert alone.values is not None
    killed = run(path, "--workers", 2, "--kill")
    record(study, KILLED, [killed], alone.values)
    assert killed.told == alone.told  # nobody's work is counted twice


@pytest.mark.parametrize("number", STOPPED, ids=lambda number: number.name)
def test_a_run_that_was_stopped_goes_on(
    path: Path, alone: Run, tmp_path: Path, number: signal.Signals, study: Callable[[str, str], Study]
) -> None:
    """SIGTERM and SIGKILL leave no time to write: what was kept last, seconds ago, is gone on from."""
    assert alone.values is not None
    first = run(path, "--save", tmp_path, at=lambda done, of: number if done == of // 2 else None)
    assert first.status != 0
    assert first.values is None
    second = run(path, "--save", tmp_path)
    assert 1 < second.told[0] <= first.told[-1] + 1
    assert second.told[-1] == alone.told[-1]
    record(study, STOPPED[number], [first, second], alone.values)
    assert not list(tmp_path.iterdir())
