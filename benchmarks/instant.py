"""Large work against the plain way to the same numbers, in one run: results compared first, then CPU seconds and memory.

Every case is done twice, by the way that is taken and by the exact or plain one that it stands for; the ratio of both is what counts,
for times drift with the machine. At the end: how time and memory grow with the number of outputs and of samples.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from scipy.signal import correlate, lfilter

import modalscope as ms
from modalscope.model.poles import poles_from
from modalscope.preprocess.lag_sums import LagSum

#: Poles of both ways are equal to this.
EQUAL = 1e-8


class Case(NamedTuple):
    """One piece of work.

    Parameters
    ----------
    name : str
    ours, plain : callable
        Return what is compared.
    equal : float
        Largest relative difference; infinite where both ways are the same to the noise alone, which tests state.
    """

    name: str
    ours: Callable[[], Any]
    plain: Callable[[], Any]
    equal: float = EQUAL


def modes(outputs: int, inputs: int, count: int = 20) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return poles (rad/s at one sample a second), shapes and participation."""
    rng = np.random.default_rng(0)
    s = poles_from(np.sort(rng.uniform(0.03, 0.45, count)), rng.uniform(0.003, 0.02, count))
    return s, rng.standard_normal((outputs, count)), rng.standard_normal((count, inputs))


def noisy(values: np.ndarray, level: float = 0.01) -> np.ndarray:
    """Return values with noise 40 dB below their root mean square."""
    rng, size = np.random.default_rng(1), level * np.sqrt(np.mean(np.abs(values) ** 2))
    return values + size * rng.standard_normal(values.shape) * (1j if np.iscomplexobj(values) else 1)


def lines(outputs: int, inputs: int, count: int) -> ms.FrequencyResponse:
    """Return frequency responses."""
    s, C, B = modes(outputs, inputs)
    f = np.linspace(0.02, 0.48, count)
    x = 2j * np.pi * f[:, None]
    H = (C * (-1j / (x - s) + 1j / (x - s.conj()))[:, None]) @ B
    return ms.FrequencyResponse(values=noisy(H), frequencies=f, quantity="displacement")


def samples(outputs: int, inputs: int, count: int) -> ms.ImpulseResponse:
    """Return impulse responses."""
    s, C, B = modes(outputs, inputs)
    values = np.stack([2 * np.real((C * row) @ B) for row in np.exp(np.arange(count)[:, None] * s)])
    return ms.ImpulseResponse(values=noisy(values), sampling_rate=1.0)


def ambient(outputs: int, count: int) -> ms.Signals:
    """Return a record under white forces."""
    rng, (s, C, _) = np.random.default_rng(2), modes(outputs, 1, 10)
    z = np.exp(s)
    y = sum(
        np.outer(lfilter([0, 1], [1, -2 * a.real, abs(a) ** 2], rng.standard_normal(count)), c)
        for a, c in zip(z, C.T, strict=True)
    )
    return ms.Signals(outputs=noisy(np.asarray(y), 0.1), sampling_rate=1.0)


def diagram(data: Any, last: int = 80, **options: Any) -> np.ndarray:
    """Return the poles of all orders."""
    return ms.stabilize(data, orders=range(2, last + 1, 2), deviations=False, **options).poles


def without(name: str, value: Any, run: Callable[[], Any]) -> Callable[[], Any]:
    """Return work in which a choice is made otherwise."""

    def other() -> Any:
        with patch(name, value):
            return run()

    return other


def lagged(data: ms.Signals, lags: int) -> np.ndarray:
    """Return correlations pair by pair, each by transforms of the whole record."""
    y = data.outputs - data.outputs.mean(axis=0)
    n, channels = y.shape
    R = np.empty((lags, channels, channels))
    for i in range(channels):
        for j in range(channels):
            R[:, i, j] = correlate(y[:, i], y[:, j], method="fft")[n : n + lags] / (n - np.arange(1, lags + 1))
    return R


def cases() -> list[Case]:
    """Return what is done."""
    many, wide, square = lines(16, 16, 1000), lines(300, 2, 300), samples(16, 16, 202)
    record, channels = ambient(15, 20_000), ambient(8, 50_000)
    sized = {"method": "era", "block_rows": 100, "block_columns": 100}
    past = {"method": "ssi-data", "block_rows": 16, "block_columns": 16}

    def of_record() -> np.ndarray:
        return diagram(record, 60, **past)

    return [
        Case(
            "16 x 16 FRFs x 1000 lines, 40 orders",
            lambda: diagram(many),
            without("modalscope.blocks.transfer._MANY_ROWS", 10**9, lambda: diagram(many)),
        ),
        Case(
            "300 x 2 FRFs x 300 lines, 20 orders",
            lambda: diagram(wide, 40),
            lambda: diagram(wide, 40, factorization="dense"),
            np.inf,
        ),
        Case(
            "1600 x 1600 Hankel matrix, order 40",
            without("modalscope.blocks.costs._PATIENCE", 0, lambda: diagram(square, 40, **sized)),
            lambda: diagram(square, 40, factorization="dense", **sized),
            np.inf,
        ),
        Case(
            "SSI-data, 15 channels x 20 000",
            of_record,
            without("modalscope.blocks.projection.triangle_of", lambda _: None, of_record),
        ),
        Case(
            "correlations 8 x 8, 50 000 samples",
            lambda: ms.estimate_correlation(channels, lags=200).values,
            lambda: lagged(channels, 200),
            1e-10,
        ),
    ]


def spent(run: Callable[[], Any]) -> tuple[float, float, Any]:
    """Return CPU seconds, peak megabytes and what was found."""
    tracemalloc.start()
    start = time.process_time()
    found = run()
    seconds = time.process_time() - start
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    return seconds, peak, found


def compared(case: Case) -> None:
    """Print one line; stop where both ways do not give the same."""
    ours, memory, found = spent(case.ours)
    plain, room, expected = spent(case.plain)
    alike = found.shape == expected.shape
    difference = np.max(np.abs(found - expected)) / np.max(np.abs(expected)) if alike else np.nan
    told = f"{ours:6.2f} s {memory:5.0f} MB   plain {plain:6.2f} s {room:5.0f} MB   {plain / ours:5.1f} x"
    print(f"  {case.name:38s} {told}   {f'differ {difference:.0e}' if np.isfinite(case.equal) else ''}", flush=True)
    if np.isfinite(case.equal) and not difference <= case.equal:
        raise SystemExit(f"{case.name}: both ways differ by {difference:.1e}")


def growth(name: str, sizes: list[int], work: Callable[[int], Callable[[], Any]]) -> None:
    """Print times by size, and the exponent over the last step."""
    times = []
    for size in sizes:
        run = work(size)
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    exponent = np.log(times[-1] / times[-2]) / np.log(sizes[-1] / sizes[-2])
    told = ", ".join(f"{size:,} {seconds:.2f} s" for size, seconds in zip(sizes, times, strict=True))
    print(f"  {name}: {told}; exponent {exponent:.2f}")


def by_outputs(outputs: int) -> Callable[[], Any]:
    """Return ERA of so many outputs."""
    data = samples(outputs, 2, 300)
    return lambda: ms.identify(data, method="era", order=40, deviations=False)


def by_samples(count: int) -> Callable[[], Any]:
    """Return the lagged sums of so many samples."""
    y = np.random.default_rng(0).standard_normal((count, 16))

    def run() -> None:
        total = LagSum(16, range(16), 200)
        total.add(y)

    return run


def main() -> None:
    """Run all of it."""
    for case in cases():
        compared(case)
    growth("ERA by outputs", [300, 3000, 20_000], by_outputs)
    growth("correlations by samples", [10_000, 50_000, 250_000], by_samples)


if __name__ == "__main__":
    main()
