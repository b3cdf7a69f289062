"""Lines of machines go from a record and the structure stays."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.model import Signals
from modalscope.preprocess import remove_harmonics
from modalscope.preprocess.harmonics import find_lines
from tests.judging.ambient_records import beside_a_machine
from tests.support import refused, relative


@pytest.mark.parametrize(("wander", "stays"), [(0, 0.08), (0.003, 0.2)])
def test_what_stays_of_lines_is_little(wander: float, stays: float) -> None:
    machine = beside_a_machine(101, wander)
    truth = machine.structure.record(1.2, 102).outputs
    cleaned = remove_harmonics(machine.record)
    assert relative(machine.record.outputs, truth) > 1
    # a line that does not wander goes but for the random vibration in its band
    assert relative(cleaned.outputs, truth) < stays
    assert "harmonics at" in cleaned.processing[-1]


def test_only_the_lines_that_are_named_go() -> None:
    t = np.arange(40_000) / 50
    y = np.random.default_rng(0).standard_normal((t.size, 2))
    both = y + 2 * np.sin(2 * np.pi * 12 * t)[:, None] + 2 * np.sin(2 * np.pi * 17 * t)[:, None]
    cleaned = remove_harmonics(Signals(outputs=both, sampling_rate=50.0), [17.0])
    assert [round(line.frequency, 2) for line in find_lines(cleaned)] == [12.0]


def test_a_record_without_lines_is_returned_as_it_is() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((5000, 2)), sampling_rate=50.0)
    assert remove_harmonics(record) is record


def test_a_line_that_no_run_holds_is_refused() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((5000, 2)), sampling_rate=50.0)
    refused("a harmonic at 30 Hz", remove_harmonics, record, [30.0])
