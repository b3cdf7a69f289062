"""What changes from one part of a record to another is found, and sound records of any kind are not named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import signal
from scipy.interpolate import CubicSpline

import modalscope as ms
from benchmarks.records.sound_records import ambient, oversampled, shaken, sound, struck
from modalscope.data import Signals
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.halves import changes, clocks, drifting
from modalscope.signals.doctor.records import too_short
from modalscope.signals.doctor.samples import overflows


def cable(record: Signals, rng: np.random.Generator) -> Signals:
    """A channel is nothing but its noise in the second half."""
    y = np.array(record.outputs)
    i, half = int(rng.integers(y.shape[1])), len(y) // 2
    y[half:, i] = 0.01 * y[:, i].std() * rng.standard_normal(len(y) - half)
    return replace(record, outputs=y)


def glued(record: Signals, rng: np.random.Generator) -> Signals:
    """The second half is of another structure, a random chain."""
    outputs, half = record.outputs.shape[1], record.samples // 2
    scale = (2 * np.pi * record.sampling_rate * rng.uniform(0.05, 0.2)) ** 2
    chain = ms.systems.chain(
        rng.uniform(0.5, 2, outputs), scale * rng.uniform(0.3, 1, outputs), damping_ratios=rng.uniform(0.005, 0.02)
    )
    other = chain.simulate(
        inputs="ambient",
        samples=half,
        sampling_rate=record.sampling_rate,
        quantity=record.quantity,
        noise=0.03,
        seed=int(rng.integers(1000)),
    )
    parts = [y / y.std() for y in (record.outputs[:half], other.outputs)]
    return replace(record, outputs=np.concatenate(parts))


def twice(record: Signals, rng: np.random.Generator) -> Signals:
    half = record.samples // 2
    return replace(record, outputs=np.concatenate([record.outputs[:half]] * 2))


def drifted(record: Signals, rng: np.random.Generator, rate: float = 200e-6) -> Signals:
    """A channel, or two of four, has a clock that is 200 millionths slow."""
    y, t = np.array(record.outputs), np.arange(record.samples)
    for i in rng.permutation(y.shape[1])[: 1 if y.shape[1] < 4 else 2]:
        y[:, i] = CubicSpline(t, y[:, i])(np.minimum(t * (1 - rate), t[-1]))
    return replace(record, outputs=y)


def late(record: Signals, rng: np.random.Generator) -> Signals:
    """A channel is of a recorder that began forty samples late."""
    y = np.array(record.outputs[40:])
    i = int(rng.integers(y.shape[1]))
    y[:, i] = record.outputs[:-40, i]
    return replace(record, outputs=y)


def wandering(record: Signals, rng: np.random.Generator) -> Signals:
    y = np.array(record.outputs)
    i, walk = int(rng.integers(y.shape[1])), np.cumsum(rng.standard_normal(len(y)))
    y[:, i] += 2 * y[:, i].std() * (walk - walk.mean()) / walk.std()
    return replace(record, outputs=y)


def loose(record: Signals, rng: np.random.Generator) -> Signals:
    """A sensor rattles: in half of all stretches of some seconds it moves by itself, twice as much."""
    y = np.array(record.outputs)
    i, size = int(rng.integers(y.shape[1])), int(3 * record.sampling_rate)
    for start in range(0, len(y) - size, 2 * size):
        y[start : start + size, i] = 2 * y[:, i].std() * rng.standard_normal(size)
    return replace(record, outputs=y)


CHANGES: dict[str, tuple[Callable[..., Signals], tuple[str, ...]]] = {
    "a cable breaks half-way": (cable, ("changed",)),
    "two structures in one file": (glued, ("changed",)),
    "one half twice": (twice, ("repeated",)),
    "clocks 200 millionths apart": (drifted, ("clock",)),
    "a recorder 40 samples late": (late, ("delay",)),
    "a sensor drifts": (wandering, ("drift",)),
    "a sensor rattles": (loose, ("noisy", "changed")),
}


@pytest.mark.parametrize("name", ["a cable breaks half-way", "clocks 200 millionths apart", "a sensor drifts"])
def test_the_channel_that_changes_is_named(name: str) -> None:
    spoil, kinds = CHANGES[name]
    record = ambient(2)
    spoilt = spoil(record, np.random.default_rng(3))
    moved = np.flatnonzero(np.any(spoilt.outputs != record.outputs, axis=0))
    assert changes(record, "ambient") == []
    found = changes(spoilt, "ambient")
    assert {f.kind for f in found} == set(kinds)
    assert {f.channels[0] for f in found} == {record.output_dofs[i] for i in moved}
    if name.startswith("clocks"):
        assert "200 millionths too slow" in found[0].reason


@pytest.mark.parametrize("name", ["two structures in one file", "one half twice"])
def test_a_record_of_two_tests_is_told_for_all_channels(name: str) -> None:
    spoil, kinds = CHANGES[name]
    (found,) = changes(spoil(ambient(2), np.random.default_rng(3)), "ambient")
    assert found.kind in kinds
    assert len(found.channels) > 1


def test_a_sweep_without_its_force_is_no_change_and_no_event() -> None:
    for samples, alone in ((6000, "changed"), (2500, "clock")):
        rate, force = 8.0, np.zeros((samples, 8))
        t = np.arange(samples) / rate
        force[:, 0] = signal.chirp(t, 0.2, t[-1], 0.48 * rate)
        chain = ms.systems.chain([1.0] * 8, [100.0] * 8, damping_ratios=[0.03] * 8)
        swept = chain.simulate(
            inputs=force, samples=samples, sampling_rate=rate, quantity="acceleration", noise=0.01, seed=1
        )
        record = Signals(outputs=swept.outputs, sampling_rate=rate)
        assert examine(record) == ()
        assert {f.kind for f in changes(record, "ambient")} == {alone}  # what it would be told of wind


def test_runs_that_are_the_same_are_named() -> None:
    record = shaken(0)
    (found,) = changes(ms.merge([record, shaken(4), record]), "random")
    assert "run 3 repeats run 1" in found.reason


@pytest.mark.parametrize(("rate", "told"), [(2e-6, False), (100e-6, True)])
def test_clocks_differ_by_what_the_record_resolves(rate: float, told: bool) -> None:
    assert bool(clocks(drifted(ambient(4), np.random.default_rng(0), rate))) is told


@pytest.mark.parametrize(("size", "told"), [(0.8, False), (1.2, True)])
def test_drift_is_most_of_the_power(size: float, told: bool) -> None:
    record = ambient(5)
    y = np.array(record.outputs)
    y[:, 1] += size * y[:, 1].std() * np.sqrt(2) * np.sin(2 * np.pi * 4 * np.arange(len(y)) / len(y))
    assert bool(drifting(replace(record, outputs=y))) is told


def test_records_sampled_far_beyond_their_modes_are_coherent() -> None:
    assert examine(oversampled(1)) == ()


def test_a_blow_that_rings_is_no_overflow() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(8000)
    y = 1e-3 * rng.standard_normal((8000, 2))
    y[100:] += (np.exp(-t / 30) * np.cos(2.9 * t))[:-100, None] * [1.0, 0.7]
    u = np.zeros((8000, 1))
    u[100:102, 0] = 1.0, -1.0
    record = Signals(outputs=y + 0.2 * np.sin(t / 5)[:, None], inputs=u, sampling_rate=1000.0)
    assert overflows(record, "impact") == []


@pytest.mark.parametrize(("frequency", "short"), [(0.4, False), (0.3, True)])
def test_what_is_narrower_than_any_resonance_makes_no_record_short(frequency: float, short: bool) -> None:
    rng = np.random.default_rng(0)
    t = np.arange(18_000) / 30
    size = np.exp(-0.5 * ((t - 200) / 250) ** 2)
    y = (size * np.sin(2 * np.pi * frequency * t))[:, None] * [1.0, 0.5] + 0.1 * rng.standard_normal((18_000, 2))
    record = Signals(outputs=y, sampling_rate=30.0)
    assert bool(too_short(record)) is short


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_found(name: str) -> None:
    spoil, kinds = CHANGES[name]
    assert any(f.kind in kinds for f in examine(spoil(ambient(2), np.random.default_rng(3))))


@pytest.mark.slow
def test_hits_are_sound() -> None:
    assert [examine(struck(k)) for k in range(4)] == [()] * 4


@pytest.mark.study("checks")
@pytest.mark.parametrize("name", CHANGES)
def test_changes_are_found_in_twenty_structures(name: str, study: Callable[[str, str], Any]) -> None:
    spoil, kinds = CHANGES[name]
    found = sum(any(f.kind in kinds for f in examine(spoil(ambient(k), np.random.default_rng(k)))) for k in range(20))
    table = study(f"fault: {name}", "20 ambient records of four structures, seeds 0 to 19")
    table.row("found, of 20", found, least=LEAST.get(name, 20))
    assert not table.missed


#: Of twenty so many are found where it is not all. In one structure of the four each channel shares one mode with the others: a delay is
#: not determined by the phase of one mode.
LEAST = {"a recorder 40 samples late": 15, "clocks 200 millionths apart": 19}


@pytest.mark.study("checks")
def test_two_hundred_sound_records(study: Callable[[str, str], Any]) -> None:
    found = {name: [f.kind for f in examine(record)] for name, record in sound(300, 40)}
    table = study(
        "sound records sampled far beyond their modes, struck, shaken, ambient",
        f"{len(found)} records, seeds from 300 on",
    )
    table.row("records with a finding", sum(map(bool, found.values())), most=2)
    assert not table.missed, {name: kinds for name, kinds in found.items() if kinds}
