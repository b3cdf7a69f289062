"""The short form of `make attack`: damaged files of every suffix and wrong values for every public name."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import DataError
from tests.attack import built, cut_off, harness, moved
from tests.extras.test_seismic import sac
from tests.io.apart import read
from tests.test_every_argument import SLOW

pytest.importorskip("h5py", reason="the extra `hdf5` is not installed")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the watch over processes is that of Linux")
def test_damaged_files_of_every_suffix_are_read_or_refused() -> None:
    assert harness.files(400, seed=51) == []


@pytest.mark.slow
def test_files_whose_fields_contradict_each_other_are_read_or_refused() -> None:
    assert built.files(100, seed=51) == []


@pytest.mark.slow
def test_a_test_told_otherwise_has_the_same_modes() -> None:
    assert moved.sets(8, seed=1) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits are those of Linux")
def test_commands_that_are_killed_or_in_want_leave_nothing_half_written() -> None:
    assert cut_off.want() + cut_off.kills(2, seed=0) == []


@pytest.mark.slow
def test_wrong_values_are_answered_in_words() -> None:
    assert harness.values(300, seed=51, leave=SLOW) == []


def test_poles_may_be_chosen_by_any_sequence() -> None:
    diagram = ms.stabilize(ms.systems.chain5().impulse_response(60, noise=0.01, seed=0), orders=[8, 10])
    for given, wanted in zip(diagram.deviations_at((1, 2, 3)), diagram.deviations_at(np.array([1, 2, 3])), strict=True):
        np.testing.assert_array_equal(given, wanted)


def test_numbers_beyond_all_measure_are_answered(tmp_path: Path) -> None:
    """What these attacks found: squares of numbers beyond 1e154, and signalling NaN."""
    path = tmp_path / "a.npy"
    times = np.arange(60) / 100 + np.arange(60) % 3 * 1e-4
    for size in (1e200, 1e-200):
        np.save(path, np.stack([times, size * np.sin(np.arange(60.0)), size * np.cos(np.arange(60.0))], axis=1))
        with contextlib.suppress(DataError):
            read(path)
    (tmp_path / "b.sac").write_bytes(sac(np.arange(200))[:-4] + b"\x01\x00\xa0\x7f")
    with contextlib.suppress(DataError):
        read(tmp_path / "b.sac")
