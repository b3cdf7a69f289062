"""Records that lie in a file: mapped, checked as they are read, never copied whole."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from modalscope import DataError, Signals, estimate_correlation

SAMPLES, CHANNELS = 1_000_000, 6


@pytest.fixture
def path(tmp_path: Path) -> Path:
    y = np.random.default_rng(0).standard_normal((SAMPLES, CHANNELS))
    np.save(tmp_path / "long.npy", y)
    return tmp_path / "long.npy"


def test_correlations_of_a_mapped_record_take_a_fraction_of_its_memory(path: Path) -> None:
    whole = estimate_correlation(Signals(outputs=np.load(path), sampling_rate=10.0), lags=50)
    tracemalloc.start()
    mapped = Signals(outputs=np.load(path, mmap_mode="r"), sampling_rate=10.0)
    found = estimate_correlation(mapped, lags=50)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.array_equal(found.values, whole.values)
    assert not mapped.outputs.flags.writeable
    # the blocks that are transformed together and their spectra, whatever the length of the record
    assert peak < 0.5 * 8 * SAMPLES * CHANNELS


def test_a_map_that_others_can_write_to_is_copied(path: Path) -> None:
    own = np.load(path, mmap_mode="r+")
    signals = Signals(outputs=own, sampling_rate=10.0)
    before = float(signals.outputs[0, 0])
    own[0, 0] += 1
    assert signals.outputs[0, 0] == before


def test_a_long_mapped_record_is_checked(path: Path) -> None:
    own = np.load(path, mmap_mode="r+")
    own[123_456, 2] = np.nan
    own.flush()
    with pytest.raises(DataError, match=r"1 of 6000000 values are NaN or infinite, the first at index \(123456, 2\)"):
        Signals(outputs=np.load(path, mmap_mode="r"), sampling_rate=10.0)
