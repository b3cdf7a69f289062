"""Candidates and harmonics: told in words, and back from their entries in a file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from modalscope.data import DataError
from modalscope.data.notes import Candidate, Harmonic, rows_of

WEAK = Candidate(frequency=4.5, damping_ratio=0.02, gain=2.5, reason="seen in two orders", remedy="raise the orders")
SHAFT = Harmonic(frequency=25.0, order=2, level=0.1, evidence="no damping")


def test_entries_of_a_file_become_what_they_were() -> None:
    unknown = Candidate(frequency=5.0, damping_ratio=0.1)
    rows = json.loads(json.dumps([each.to_dict() for each in (WEAK, unknown)], allow_nan=False))
    assert rows[1] == {"frequency_hz": 5.0, "damping_ratio": 0.1, "gain": None, "reason": "", "remedy": ""}
    assert rows_of("left_out", Candidate, rows)[0] == WEAK
    assert np.isnan(rows_of("left_out", Candidate, rows)[1].gain)
    assert rows_of("harmonics", Harmonic, json.loads(json.dumps([SHAFT.to_dict()]))) == (SHAFT,)
    assert rows_of("harmonics", Harmonic, [{"frequency_hz": 25.0, "of a later version": 1}])[0].frequency == 25


def test_they_say_what_they_are() -> None:
    assert str(WEAK) == "4.5 Hz, 2 %: seen in two orders"
    assert str(SHAFT) == "25 Hz, order 2 of the shaft line: no damping"


@pytest.mark.parametrize(
    "make",
    [
        lambda: Candidate(frequency="4 Hz", damping_ratio=0.1),  # type: ignore[arg-type]
        lambda: Candidate(frequency=4.0, damping_ratio=np.nan),
        lambda: Candidate(frequency=4.0, damping_ratio=0.1, reason=3),  # type: ignore[arg-type]
        lambda: Harmonic(frequency=4.0, order=0),
        lambda: rows_of("left_out", Candidate, [SHAFT]),
        lambda: rows_of("left_out", Candidate, [{"damping_ratio": 0.1}]),
    ],
)
def test_what_is_neither_is_refused(make) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DataError):
        make()
