"""Records and responses of known structures, sound and spoilt: each fault at three strengths.

`python -m benchmarks.records.faulty_records` prints the table of docs/validation/spoilt-data.md: how far each fault moves the modes, in
standard deviations, and how often it is found.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import cont2discrete, lfilter

import modalscope as ms
from modalscope.data import DataError, FrequencyResponse, Signals
from modalscope.numerics.checks import Array
from modalscope.signals.doctor import examine
from modalscope.systems import chain5, close4, heavy4, iasc_asce, ring5

RATE, LINES = 40.0, np.arange(0.2, 9, 0.01)
Data = Signals | FrequencyResponse


class Fault(NamedTuple):
    """What is spoilt, how, at which strengths, and what it is called when it is found."""

    base: Callable[[int], Any]
    spoil: Callable[[Any, float, np.random.Generator], Any]
    strengths: tuple[float, float, float]
    kinds: tuple[str, ...]
    words: str


def ambient(seed: int) -> Signals:
    structure = (chain5, ring5, heavy4)[seed % 3]()
    quantity = ("acceleration", "velocity")[seed % 2]
    return structure.simulate(
        inputs="ambient", samples=24_000, sampling_rate=RATE, quantity=quantity, noise=0.01, seed=seed
    )


def shaken(seed: int) -> Signals:
    return chain5().simulate(samples=24_000, sampling_rate=RATE, quantity="acceleration", noise=0.01, seed=seed)


def hit(seed: int) -> Signals:
    rng = np.random.default_rng(seed)
    pulse = np.hanning(7)[1:-1]
    force = np.zeros((5, 6000, 1))
    for run in force:
        run[200:205, 0] = pulse * rng.uniform(0.5, 1.5)
    found = _damped().simulate(
        inputs=force, at=[0], sampling_rate=RATE, quantity="acceleration", noise=0.001, seed=seed
    )
    return replace(found, inputs=found.inputs + 1e-4 * rng.standard_normal(force.shape))


def _damped() -> Any:
    return ms.systems.chain([1.0] * 4, [900.0] * 4, damping_ratios=0.02)


def lines(seed: int) -> FrequencyResponse:
    quantity = ("displacement", "velocity", "acceleration")[seed % 3]
    return chain5().frequency_response(LINES, quantity=quantity, noise=0.01, seed=seed)


def outputs_of(record: Signals, change: Callable[[Array], None]) -> Signals:
    y = np.array(record.outputs)
    change(y)
    return replace(record, outputs=y)


def _channel(i: int, change: Callable[[Array], Array]) -> Callable[[Signals], Signals]:
    def changed(record: Signals) -> Signals:
        y = np.array(record.outputs)
        y[:, i] = change(y[:, i])
        return replace(record, outputs=y)

    return changed


def overflow(record: Signals, top: float, rng: np.random.Generator) -> Signals:
    limit = top * np.abs(record.outputs[:, 1]).max()
    return _channel(1, lambda y: (y + limit) % (2 * limit) - limit)(record)


def gap(record: Signals, count: float, rng: np.random.Generator) -> Signals:
    y = np.array(record.outputs)
    for k in rng.integers(2000, 20_000, 5):
        y[k : k + int(count)] = y[k]
    return replace(record, outputs=y)


def frozen(record: Signals, count: float, rng: np.random.Generator) -> Signals:
    y = np.array(record.outputs)
    for k in rng.integers(2000, 20_000, 5):
        y[k : k + int(count), 1] = y[k, 1]
    return replace(record, outputs=y)


def spikes(record: Signals, size: float, rng: np.random.Generator) -> Signals:
    y = np.array(record.outputs)
    y[rng.integers(100, 23_000, 10), 1] += size * y[:, 1].std()
    return replace(record, outputs=y)


def clipped(record: Signals, part: float, rng: np.random.Generator) -> Signals:
    limit = np.quantile(np.abs(record.outputs[:, 1]), 1 - part)
    return _channel(1, lambda y: np.clip(y, -limit, limit))(record)


def missing(record: Signals, times: float, rng: np.random.Generator) -> Signals:
    y = record.outputs
    for k in sorted(rng.integers(1000, 20_000, int(times)), reverse=True):
        y = np.delete(y, np.s_[k : k + 7], axis=0)
    return replace(record, outputs=y)


def late(record: Signals, samples: float, rng: np.random.Generator) -> Signals:
    def shifted(x: Array) -> Array:
        lines = np.arange(len(x) // 2 + 1) / len(x)
        return np.fft.irfft(np.fft.rfft(x) * np.exp(-2j * np.pi * lines * samples), n=len(x))

    return _channel(1, shifted)(record)


def dead(record: Signals, gain: float, rng: np.random.Generator) -> Signals:
    return _channel(1, lambda y: gain * y)(record)


def noisy(record: Signals, ratio: float, rng: np.random.Generator) -> Signals:
    return _channel(1, lambda y: y + ratio * y.std() * rng.standard_normal(y.size))(record)


def twice(record: Signals, gain: float, rng: np.random.Generator) -> Signals:
    y = np.array(record.outputs)
    y[:, 1] = gain * y[:, 0]
    return replace(record, outputs=y)


def transposed(record: Signals, count: float, rng: np.random.Generator) -> Signals:
    return Signals(outputs=record.outputs[: int(count)].T, sampling_rate=RATE)


def exchanged(record: Signals, noise: float, rng: np.random.Generator) -> Signals:
    y, u = np.array(record.outputs), np.array(record.inputs)
    y[:, 1], u[:, 0] = u[:, 0].copy(), y[:, 1].copy()
    y[:, 1] += noise * y[:, 1].std() * rng.standard_normal(len(y))
    return replace(record, outputs=y, inputs=u)


def turned(record: Signals, gain: float, rng: np.random.Generator) -> Signals:
    return _channel(1, lambda y: -gain * y)(record)


def relabelled(record: Signals, gain: float, rng: np.random.Generator) -> Signals:
    y = np.array(record.outputs)
    y[:, [1, 3]] = y[:, [3, 1]] * gain
    return replace(record, outputs=y)


def misnamed(response: FrequencyResponse, which: float, rng: np.random.Generator) -> FrequencyResponse:
    names = ["displacement", "velocity", "acceleration"]
    given = names[(names.index(response.quantity) + 1 + int(which) % 2) % 3]
    return replace(response, quantity=given)


def overloaded(record: Signals, part: float, rng: np.random.Generator) -> Signals:
    u = np.array(record.inputs)
    limit = part * u[2].max()
    u[2] = np.minimum(u[2], limit)
    return replace(record, inputs=u)


def double(record: Signals, size: float, rng: np.random.Generator) -> Signals:
    u = np.array(record.inputs)
    u[2, 240:245] += size * u[2, 200:205]
    second = _damped().simulate(inputs=u, at=[0], sampling_rate=RATE, quantity="acceleration", noise=0.001, seed=1)
    return replace(record, outputs=second.outputs, inputs=u)


def decibels(response: FrequencyResponse, unit: float, rng: np.random.Generator) -> FrequencyResponse:
    return replace(response, values=20 * np.log10(unit * np.abs(response.values)) + 0j)


def level_and_angle(response: FrequencyResponse, unit: float, rng: np.random.Generator) -> FrequencyResponse:
    H = unit * response.values
    return replace(response, values=20 * np.log10(np.abs(H)) + 1j * np.degrees(np.angle(H)))


def size_and_angle(response: FrequencyResponse, unit: float, rng: np.random.Generator) -> FrequencyResponse:
    H = unit * response.values
    return replace(response, values=np.abs(H) + 1j * np.angle(H))


def conjugate(response: FrequencyResponse, noise: float, rng: np.random.Generator) -> FrequencyResponse:
    H = response.values
    size = noise * np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2)
    scattered = size * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    return replace(response, values=np.conj(H) + scattered)


def outlier(response: FrequencyResponse, factor: float, rng: np.random.Generator) -> FrequencyResponse:
    H = np.array(response.values)
    H[rng.integers(50, len(H) - 50, 3)] *= factor
    return replace(response, values=H)


def no_wraps(response: FrequencyResponse, unit: float, rng: np.random.Generator) -> FrequencyResponse:
    return replace(response, values=np.abs(response.values) * np.exp(1j * np.degrees(np.angle(response.values))))


FAULTS: dict[str, Fault] = {
    "overflow": Fault(ambient, overflow, (0.95, 0.85, 0.7), ("overflow",), "wraps at this part of its range"),
    "gap": Fault(ambient, gap, (10, 40, 200), ("gap",), "five times so many samples held, all channels"),
    "frozen": Fault(ambient, frozen, (10, 40, 200), ("frozen",), "five times so many samples held, one channel"),
    "spikes": Fault(ambient, spikes, (2, 10, 50), ("spikes",), "ten of so many deviations"),
    "clipping": Fault(ambient, clipped, (0.0003, 0.003, 0.03), ("clipped",), "this part of the samples"),
    "missing samples": Fault(ambient, missing, (10, 50, 250), ("missing samples",), "so many times seven"),
    "delay": Fault(ambient, late, (0.1, 0.5, 2.0), ("delay",), "so many samples, one channel"),
    "dead": Fault(ambient, dead, (1e-7, 1e-9, 0.0), ("dead",), "times this gain"),
    "noise": Fault(ambient, noisy, (0.5, 2, 10), ("noisy",), "times its own RMS"),
    "duplicate": Fault(ambient, twice, (0.1, 1.0, -2.0), ("duplicate",), "times this gain"),
    "transposed": Fault(ambient, transposed, (100, 1000, 5000), ("transposed",), "so many samples"),
    "exchanged sides": Fault(shaken, exchanged, (0.5, 0.1, 0.0), ("exchanged",), "with noise of this part"),
    "turned": Fault(shaken, turned, (0.5, 1.0, 2.0), ("polarity",), "times this gain"),
    "exchanged outputs": Fault(shaken, relabelled, (0.8, 1.0, 1.2), ("swapped", "reciprocity"), "times this gain"),
    "wrong quantity": Fault(lines, misnamed, (0, 1, 2), ("wrong quantity", "polarity"), "another in turn"),
    "overload": Fault(hit, overloaded, (0.9, 0.7, 0.4), ("overload", "clipped"), "one hit cut at this part"),
    "double hit": Fault(hit, double, (0.12, 0.3, 1.0), ("double hit",), "a second of this part"),
    "dB": Fault(lines, decibels, (1.0, 1e3, 1e-3), ("no phase",), "in this unit"),
    "dB and degrees": Fault(lines, level_and_angle, (1.0, 1e3, 1e-3), ("no complex values",), "in this unit"),
    "magnitude and phase": Fault(lines, size_and_angle, (1.0, 1e3, 1e-3), ("no complex values",), "in this unit"),
    "conjugate": Fault(lines, conjugate, (0.3, 0.1, 0.0), ("conjugated",), "with noise of this part"),
    "lone lines": Fault(lines, outlier, (3.0, 10.0, 100.0), ("lone lines",), "three, times this factor"),
    "degrees for radians": Fault(lines, no_wraps, (1.0, 1.0, 1.0), ("no complex values", "conjugated"), "whatever the unit"),
}  # fmt: skip


#: Of ten records with the strongest fault so many are named, where it is not all.
FOUND: dict[str, int] = {}


def is_found(fault: Fault, seed: int, strength: float) -> bool:
    spoilt = fault.spoil(fault.base(seed), strength, np.random.default_rng(1000 + seed))
    return any(finding.kind in fault.kinds for finding in examine(spoilt))


def sound(first: int = 0) -> Iterator[tuple[str, Data]]:
    """Forty sound records: hits, shakers, bursts, sweeps, ambient ones and earthquakes; `first` is their first seed."""
    builds = (chain5, ring5, heavy4, close4, iasc_asce)
    for k in range(5):
        yield f"hits {k}", hit(100 + first + k)
    for k in range(5):
        yield f"shaker {k}", builds[k]().simulate(samples=20_000, sampling_rate=20.0, noise=0.02, seed=first + k)
    for k in range(10):
        rate = (20.0, 50.0, 100.0)[k % 3]
        quantity = ("acceleration", "velocity", "displacement")[k % 3]
        # ten decay times of the slowest mode and more
        given = {
            "samples": int(1000 * rate),
            "sampling_rate": rate,
            "noise": 0.05,
            "seed": first + k,
            "quantity": quantity,
        }
        yield f"ambient {k}", builds[k % 5]().simulate(inputs="ambient", **given)
    for k in range(5):
        rng = np.random.default_rng(first + k)
        u = np.zeros((4, 6000, 1))
        u[:, :1500] = rng.standard_normal((4, 1500, 1))
        yield f"burst {k}", _damped().simulate(inputs=u, at=[0], sampling_rate=RATE, noise=0.002, seed=first + k)
    for k in range(5):
        t = np.arange(12_000) / RATE
        u = np.sin(2 * np.pi * (0.5 * t + (8 + k) / (2 * t[-1]) * t**2)) * np.clip((t[-1] - 60 - t) / 5, 0, 1)
        yield (
            f"sweep {k}",
            _damped().simulate(inputs=u[:, None], at=[0], sampling_rate=RATE, noise=0.002, seed=first + k),
        )
    for k in range(10):
        yield f"earthquake {k}", earthquake(first + k)


def earthquake(seed: int) -> Signals:
    """The ground's acceleration (Kanai and Tajimi's filter of white noise, Saragoni and Hart's envelope) at the feet of a chain."""
    rng = np.random.default_rng(seed)
    t = np.arange(6000) / 100.0
    w, zeta = 2 * np.pi * rng.uniform(2, 4), 0.6
    b, a, _ = cont2discrete(([2 * zeta * w, w**2], [1, 2 * zeta * w, w**2]), 0.01, method="bilinear")
    strong = (t / 8) ** 2 * np.exp(-(t - 8) / 4)
    ground = strong * lfilter(b.ravel(), a, rng.standard_normal(t.size)) + 1e-4 * rng.standard_normal(t.size)
    masses = np.ones(4)
    chain = ms.systems.chain(masses, 2000 * masses, damping_ratios=0.03)
    pushed = chain.simulate(
        inputs=-ground[:, None] * masses, sampling_rate=100.0, quantity="acceleration", noise=0.002, seed=seed
    )
    total = pushed.outputs + ground[:, None]
    return Signals(outputs=total, inputs=ground[:, None], sampling_rate=100.0, quantities="acceleration")


def moved(fault: Fault, seed: int, strength: float) -> float:
    """Return how far a fault moves the modes, in deviations: the largest of f, zeta and shapes; infinite where one is lost."""
    base = fault.base(seed)
    try:
        first = _modes(base)
        second = _modes(fault.spoil(base, strength, np.random.default_rng(1000 + seed)))
        pairs = ms.pair_modes(first, second, tolerance=0.3)
    except DataError:
        return np.inf
    if len(pairs.first) < len(first):
        return np.inf
    i, j = pairs.first, pairs.second
    far = [
        np.abs(second.frequencies[j] - first.frequencies[i]) / first.frequencies_std[i],
        np.abs(second.damping_ratios[j] - first.damping_ratios[i]) / first.damping_ratios_std[i],
    ]
    if first.output_dofs == second.output_dofs and first.shapes_std is not None:
        one, other = first.shapes[:, i], second.shapes[:, j]
        scale = np.sum(np.conj(other) * one, axis=0) / np.sum(np.abs(other) ** 2, axis=0)
        far.append((np.abs(scale * other - one) / np.maximum(first.shapes_std[:, i], 1e-300)).max(axis=0))
    return float(np.nanmax(np.array(far)))


def _modes(data: Data) -> ms.ModalModel:
    modes = ms.identify(data, order=12).modes
    return modes.take((modes.damping_ratios > 0) & (modes.damping_ratios < 0.3) & (modes.poles.imag > 0))


def table(records: int) -> None:
    for name, fault in FAULTS.items():
        cells = []
        for strength in fault.strengths:
            far = [moved(fault, seed, strength) for seed in range(min(records, 3))]
            count = sum(is_found(fault, seed, strength) for seed in range(records))
            middle = float(np.median(far))
            cells.append(f"{strength:g}: {'lost' if np.isinf(middle) else f'{middle:.1f}'}, {count}")
        print(f"| {name} | {fault.words} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    table(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
