"""Files are read in several threads at once, as the page does."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

import modalscope as ms

THREADS, READS, ROWS = 8, 64, 2000


@pytest.fixture
def restless() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def table(folder: Path) -> Path:
    rows = "".join(f"{k / 100},{k % 7}\n" for k in range(ROWS))
    (folder / "x.txt").write_text("Time [s],a [g]\n" + rows)
    return folder / "x.txt"


def sound(folder: Path) -> Path:
    wavfile.write(folder / "x.wav", 1000, np.arange(ROWS, dtype=np.int16))
    return folder / "x.wav"


@pytest.mark.slow
@pytest.mark.parametrize("make", [table, sound])
@pytest.mark.usefixtures("restless")
def test_filters_of_warnings_are_as_before(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    path = make(tmp_path)
    warnings.resetwarnings()  # pytest puts its own back
    with ThreadPoolExecutor(THREADS) as pool:
        samples = set(pool.map(lambda _: ms.read(path).samples, range(READS)))
    assert samples == {ROWS}
    assert not warnings.filters


def test_tables_are_read_without_a_change_of_filters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def changed(*_: object, **__: object) -> None:
        raise AssertionError

    path = table(tmp_path)
    monkeypatch.setattr(warnings, "catch_warnings", changed)
    assert ms.read(path).samples == ROWS
