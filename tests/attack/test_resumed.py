"""What a stopped job left is damaged, exchanged or foreign: going on gives the result of undamaged files, or an error in words."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.monitoring import History, Store
from modalscope.data import DataError, StoredSignals
from modalscope.numerics.executors import working
from modalscope.signals.preprocess import stored_correlation
from tests.io.mutations import mutated

Damage = Callable[[Path, Path, np.random.Generator], None]

RECORD = ms.systems.chain5().simulate(inputs="ambient", samples=6000, sampling_rate=20.0, noise=0.02, seed=0)
LAGS = 40


class Held:
    """Rows of a record that is said to be in a file."""

    identity = "a file"

    def __init__(self, values: np.ndarray) -> None:
        self.values = values
        self.shape = values.shape

    def read(self, start: int, stop: int) -> np.ndarray:
        return self.values[start:stop]


class Stopped(Exception):
    pass


def stored(record: ms.Signals = RECORD) -> StoredSignals:
    return StoredSignals(rows=Held(np.array(record.outputs)), sampling_rate=record.sampling_rate)


def stopped(folder: Path, record: ms.Signals = RECORD, lags: int = LAGS) -> Path:
    """Return the file of partial sums that a stopped job leaves in a folder."""

    def stop(count: int, _: int) -> None:
        if count == 4:
            raise Stopped

    with pytest.raises(Stopped), working(progress=stop, save=folder):
        ms.estimate_correlation(stored(record), lags=lags)
    (kept,) = folder.iterdir()
    return kept


# ----------------------------------------------------------------------------------------------- to a file, another one beside


def mutate(file: Path, other: Path, rng: np.random.Generator) -> None:
    file.write_bytes(mutated(file.read_bytes(), rng)[1])


def exchange(file: Path, other: Path, rng: np.random.Generator) -> None:
    shutil.copy(other, file)


def mix(file: Path, other: Path, rng: np.random.Generator) -> None:
    """Put pages of the other file in."""
    data, foreign = bytearray(file.read_bytes()), other.read_bytes()
    size = int(rng.choice([64, 512, 4096]))
    start = int(rng.integers(min(len(data), len(foreign)) // size)) * size
    data[start : start + size] = foreign[start : start + size]
    file.write_bytes(data)


def cut(file: Path, other: Path, rng: np.random.Generator) -> None:
    data = file.read_bytes()
    file.write_bytes(data[: int(rng.integers(len(data)))])


def foreign(file: Path, other: Path, rng: np.random.Generator) -> None:
    """Put a file of another kind there."""
    [
        lambda: file.write_bytes(rng.bytes(int(rng.integers(9000)))),
        lambda: np.savez(file.with_suffix(".npz"), sums=np.ones(3), done=np.ones(3, bool)),
        lambda: file.write_text("time,a\n0,1\n"),
        lambda: file.write_bytes(b""),
        lambda: file.write_bytes(bytes(40) + file.read_bytes()),
    ][int(rng.integers(5))]()


def another(file: Path, other: Path, rng: np.random.Generator) -> None:
    """Put what is no file there, at its place or at that of a file that belongs to it."""
    place = [
        file,
        *(file.with_name(name) for name in (f"{file.stem}.lock", f"{file.name}-wal", f"{file.name}-journal")),
    ]
    path = place[int(rng.integers(len(place)))]
    path.unlink(missing_ok=True)
    [
        lambda: path.mkdir(),
        lambda: os.mkfifo(path),
        lambda: path.symlink_to("/dev/zero"),
        lambda: path.symlink_to(other),
        lambda: path.symlink_to(path.name),
        lambda: shutil.copy(other, path),
    ][int(rng.integers(6))]()


KINDS: tuple[Damage, ...] = (mutate, mutate, mutate, exchange, mix, cut, foreign, another)


# -------------------------------------------------------------------------------------------------------------------- sums


@pytest.fixture
def small_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_correlation, "_TASK_NUMBERS", 2000)


def sums_gone_on_from(tmp_path: Path, count: int, seed: int) -> dict[str, int]:
    """Return how often going on from damaged sums was refused, began anew, or went on."""
    wanted = ms.estimate_correlation(stored(), lags=LAGS).values
    other = replace(RECORD, outputs=RECORD.outputs[::-1] * 1.3)
    kept, beside = stopped(tmp_path / "sums"), stopped(tmp_path / "other", other)
    tally, told = {"refused": 0, "anew": 0, "gone on": 0}, list[str]()
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        folder = tmp_path / str(k)
        shutil.copytree(kept.parent, folder)
        damage = KINDS[k % len(KINDS)]
        damage(folder / kept.name, beside, rng)
        done: list[int] = []
        try:
            with working(progress=lambda n, _, done=done: done.append(n), save=folder):
                found = ms.estimate_correlation(stored(), lags=LAGS).values
        except DataError as error:
            told.append(str(error))
            tally["refused"] += 1
            continue
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max(), err_msg=damage.__name__)
        tally["anew" if done[0] == 1 else "gone on"] += 1
    assert all("partial sums" in text for text in told)
    assert tally["refused"] + tally["anew"] > count // 2
    return tally


@pytest.mark.usefixtures("small_tasks")
def test_sums_of_another_record_under_their_name_are_none(tmp_path: Path) -> None:
    wanted = ms.estimate_correlation(stored(), lags=LAGS).values
    kept = stopped(tmp_path / "a")
    shutil.copy(stopped(tmp_path / "b", replace(RECORD, outputs=2 * RECORD.outputs)), kept)
    with working(save=kept.parent):
        found = ms.estimate_correlation(stored(), lags=LAGS).values
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders")
@pytest.mark.usefixtures("small_tasks")
def test_damaged_sums_are_begun_anew_or_refused(tmp_path: Path) -> None:
    sums_gone_on_from(tmp_path, 24, seed=0)


# ------------------------------------------------------------------------------------------------------------------- stores


def filled(path: Path, seed: int) -> Path:
    """Return a store of 40 records of three modes with covariates."""
    rng = np.random.default_rng(seed)
    record = np.repeat(np.arange(40), 3)
    history = History(
        times=1.7e9 + 3600.0 * np.arange(40),
        record=record,
        frequencies=np.tile([1.0, 2.5, 4.0], 40) + 0.01 * rng.standard_normal(120),
        damping_ratios=0.01 + 0.001 * rng.random(120),
        frequencies_std=np.full(120, 0.003),
        shapes=rng.standard_normal((120, 6)) + 0j,
        output_dofs=tuple(f"{k}:+Z" for k in range(6)),
        covariates={"temperature": 10 + rng.standard_normal(40)},
    )
    with Store(path) as store:
        store.add_modes(history)
        store.add_covariates("wind", 1.7e9 + 1800.0 * np.arange(80), rng.random(80))
    return path


def what_it_says(path: Path) -> list[Any]:
    """Return all that a store says of its records."""
    with Store(path) as store:
        history = store.history()
        arrays = [history.times, history.record, history.shapes, history.covariates.get("wind")]
        arrays += [
            history.frequencies,
            history.damping_ratios,
            history.frequencies_std,
            history.covariates.get("temperature"),
        ]
        return [*(np.asarray(a).tobytes() for a in arrays), history.output_dofs, store.about(), store.records.tolist()]


def stores_opened(tmp_path: Path, count: int, seed: int) -> dict[str, int]:
    """Return how often damaged stores were refused, or said the same as before."""
    kept, beside = filled(tmp_path / "a.modes", 0), filled(tmp_path / "b.modes", 1)
    wanted, others = what_it_says(kept), [what_it_says(beside), what_it_says(tmp_path / "empty.modes")]
    tally, told = {"refused": 0, "the same": 0, "the other": 0}, list[str]()
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        folder = tmp_path / str(k)
        folder.mkdir()
        path = Path(shutil.copy(kept, folder / kept.name))
        damage = KINDS[k % len(KINDS)]
        damage(path, beside, rng)
        try:
            found = what_it_says(path)
        except DataError as error:
            told.append(str(error))
            tally["refused"] += 1
            continue
        whole = damage in (exchange, another, foreign)  # a whole store of other records is one, and so is an empty file
        assert found == wanted or (whole and found in others), f"{k} {damage.__name__}: said in silence"
        tally["the same" if found == wanted else "the other"] += 1
    assert all("store" in text for text in told)
    return tally


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes in folders")
def test_damaged_stores_say_the_same_or_are_refused(tmp_path: Path) -> None:
    stores_opened(tmp_path, 40, seed=0)


@pytest.mark.study("robustness")
@pytest.mark.usefixtures("small_tasks")
def test_two_hundred_damages_of_what_a_stopped_job_left(tmp_path: Path, study: Any) -> None:
    table = study("what a stopped job left, damaged", "200 damages of partial sums, 400 of stores, seed 1")
    for name, tally in (
        ("sums", sums_gone_on_from(tmp_path / "x", 200, 1)),
        ("stores", stores_opened(tmp_path, 400, 1)),
    ):
        for how, times in tally.items():
            table.row(f"{name}: {how}", times)
