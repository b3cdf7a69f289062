"""Lines of machines are told from resonances, at constant speed and where it wanders; random vibration has none."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.signals.preprocess.harmonics import (
    HARMONIC,
    _chance,
    _unsteadiness,
    find_lines,
    harmonic_notes,
    shaft_orders,
)
from tests.selection.judging.ambient_records import beside_a_machine, random_structure


@pytest.mark.slow
@pytest.mark.parametrize("wander", [0, 0.003])
def test_three_orders_of_a_shaft_are_found_and_nothing_else(wander: float) -> None:
    machine = beside_a_machine(102, wander)
    notes = harmonic_notes(find_lines(machine.record))
    assert {note.kind for note in notes} == {HARMONIC}
    # the mean of a wandering frequency is known to a part of its spread
    assert np.allclose([note.numbers["frequency_hz"] for note in notes], machine.lines, rtol=0.001)
    assert [note.numbers["order"] for note in notes] == [1, 2, 3]
    spread = np.array([note.numbers["spread_hz"] for note in notes]) / machine.lines
    assert np.all(spread < 0.001) if wander == 0 else np.allclose(spread, wander, rtol=0.3)


@pytest.mark.slow
def test_random_vibration_of_lightly_damped_structures_has_no_line() -> None:
    assert not [seed for seed in range(6) if find_lines(random_structure(seed).record(1.3, seed))]


def test_the_level_of_a_line_is_its_part_of_the_power() -> None:
    t = np.arange(40_000) / 50
    hum = np.sin(2 * np.pi * 12.3 * t)
    y = np.random.default_rng(0).standard_normal((t.size, 2)) + np.outer(hum, [2.0, 1.0])
    (line,) = find_lines(Signals(outputs=y, sampling_rate=50.0))
    assert np.isclose(line.frequency, 12.3, rtol=1e-4)
    # power 2 + .5 beside 1 + 1; the band holds a hundredth of the noise
    assert np.isclose(line.level, np.sqrt(2.5 / 4.5), rtol=0.02)
    assert find_lines(Signals(outputs=y, sampling_rate=50.0), (1.0, 5.0)) == ()


def test_orders_are_multiples_of_the_lowest_line() -> None:
    assert shaft_orders(np.array([10.0, 20.01, 33.0])) == [1, 2, None]
    assert shaft_orders(np.array([10.0])) == [None]
    assert shaft_orders(np.array([10.0, 17.0])) == [None, None]


def test_mains_are_named() -> None:
    t = np.arange(60_000) / 200
    y = np.random.default_rng(0).standard_normal((t.size, 1)) + np.sin(2 * np.pi * 50.02 * t)[:, None]
    (note,) = harmonic_notes(find_lines(Signals(outputs=y, sampling_rate=200.0)))
    assert "mains" in str(note)


@pytest.mark.parametrize("count", [4, 10])
def test_the_chance_of_steady_random_vibration_is_uniform(count: int) -> None:
    """Bartlett's correction: without it a chance of 1 % were one of .8 and of .55 % for 4 and 10 values."""
    rng = np.random.default_rng(0)
    parts = rng.standard_normal((2, 100_000, count))
    g = np.sort(_unsteadiness(parts[0] + 1j * parts[1]))
    for share in (0.01, 0.1, 0.5):
        four_deviations = 4 * np.sqrt(share * (1 - share) / g.size)
        assert abs(_chance(g[int(share * g.size)], count) - share) < four_deviations
