"""Damaged files of every format: refused by a DataError, or read; never another exception, a hang or the end of the process."""

from __future__ import annotations

import sys
import time

import pytest

from tests.io import corpus, fuzz

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the watch over processes is that of Linux")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("corpus")
    corpus.write(folder)
    return folder


def test_two_thousand_damaged_files_are_refused_or_read(tmp_path, whole):
    tally = fuzz.run(tmp_path, whole, 2000, workers=1)
    assert not tally.faults
    assert tally.refused + tally.intact + tally.changed == 2000


@pytest.mark.study
def test_a_hundred_thousand_damaged_files_are_refused_or_read(tmp_path, whole):
    """Measured: 80 678 refused, 13 939 as they were, 5383 as something else (formats without checksums); no fault. 17 minutes of a core."""
    start = time.monotonic()
    tally = fuzz.run(tmp_path, whole, 100_000, seed=1)
    print(f"\n{tally}; {time.monotonic() - start:.0f} s")
    assert not tally.faults
