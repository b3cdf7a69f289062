"""The short form of `make attack`: damaged files of every suffix and wrong values for every public name."""

from __future__ import annotations

import sys

import pytest

from tests.attack import harness
from tests.test_every_argument import SLOW


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the watch over processes is that of Linux")
def test_damaged_files_of_every_suffix_are_read_or_refused() -> None:
    assert harness.files(1000, seed=51) == []


@pytest.mark.slow
def test_wrong_values_are_answered_in_words() -> None:
    assert harness.values(300, seed=51, leave=SLOW) == []
