"""Damaged files of every format: refused by a DataError, or read; never another exception, a hang or the end of the process."""

from __future__ import annotations

import sys

import pytest

from tests.attack.harness import whole_files
from tests.io import fuzz

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the watch over processes is that of Linux")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corpus")
    whole_files(folder)
    return folder


@pytest.mark.slow
def test_two_thousand_damaged_files_are_refused_or_read(tmp_path, whole):
    tally = fuzz.run(tmp_path, whole, 2000, workers=1)
    assert not tally.faults
    assert tally.refused + tally.intact + tally.changed == 2000


@pytest.mark.study("robustness")
def test_a_hundred_thousand_damaged_files_are_refused_or_read(tmp_path, whole, study):
    """17 minutes of a core."""
    tally = fuzz.run(tmp_path, whole, 100_000, seed=1)
    table = study("damaged files of every format", "100 000 files, seed 1")
    table.row("refused", tally.refused)
    table.row("read as they were", tally.intact)
    table.row("read as something else", tally.changed)
    table.row("another exception, a hang or the end of the process", len(tally.faults), most=0)
    assert not tally.faults
