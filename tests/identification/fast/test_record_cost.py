"""What records on lines will take is said before, and refused where the machine has not as much."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.identification.fast import record_cost as cost
from tests.support import random_system, refused


def record(samples: int = 600) -> ms.Signals:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((samples, 1))
    y = random_system(rng, outputs=3, inputs=1, modes=2).simulate(u)
    return ms.Signals(outputs=y, inputs=u, sampling_rate=1.0)


def test_the_result_says_what_was_predicted() -> None:
    found = ms.identify(record(), order=4, block_rows=9)
    (note,) = [note for note in found.notes if note.kind == "cost"]
    assert "50 columns on 299 lines: less than a second" in note.text
    assert note.numbers["bytes"] == 16 * 299 * 4 + 4 * 8 * 50**2 + 32e6


@pytest.mark.parametrize("there", [32.1e6, 32.04e6, 32e6])
def test_more_memory_than_there_is_is_refused_in_words(monkeypatch: pytest.MonkeyPatch, there: float) -> None:
    """Before the transform where that is too much already, else before the factor."""
    monkeypatch.setattr(cost, "_memory", lambda: there)
    if there == 32.1e6:
        assert ms.identify(record(), order=4, block_rows=9).order == 4
    else:
        refused("the machine has 32 MB", ms.identify, record(), order=4, block_rows=9)


def test_a_machine_that_does_not_tell_refuses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cost, "_memory", lambda: None)
    assert ms.identify(record(), order=4).order == 4
