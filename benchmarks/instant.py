"""Large work against the plain way to the same numbers, in one run: results compared first, then CPU seconds and memory.

Every case is done twice, by the way that is taken and by the exact or plain one that it stands for; the ratio of both is what counts,
for times drift with the machine.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from scipy.signal import correlate

import modalscope as ms
from benchmarks._works import ambient, lines, samples

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


def responses(outputs: int, inputs: int, count: int) -> ms.FrequencyResponse:
    """Return frequency responses of twenty modes."""
    data = lines(outputs, inputs, count, 80)
    return ms.FrequencyResponse(values=data["values"], frequencies=data["frequencies"], quantity="displacement")


def record(outputs: int, count: int) -> ms.Signals:
    """Return a record under white forces."""
    return ms.Signals(outputs=ambient(outputs, count)["outputs"], sampling_rate=1.0)


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
    many, wide = responses(16, 16, 1000), responses(300, 2, 300)
    square = ms.ImpulseResponse(values=samples(16, 16, 101, 101, 40)["values"], sampling_rate=1.0)
    short, channels = record(15, 20_000), record(8, 50_000)
    sized = {"method": "era", "block_rows": 100, "block_columns": 100}
    past = {"method": "ssi-data", "block_rows": 16, "block_columns": 16}

    def of_record() -> np.ndarray:
        return diagram(short, 60, **past)

    return [
        Case(
            "16 x 16 FRFs x 1000 lines, 40 orders",
            lambda: diagram(many),
            without("modalscope.identification.matrices.transfer._MIN_PRODUCT_ROWS", 10**9, lambda: diagram(many)),
        ),
        Case(
            "300 x 2 FRFs x 300 lines, 20 orders",
            lambda: diagram(wide, 40),
            lambda: diagram(wide, 40, factorization="dense"),
            np.inf,
        ),
        Case(
            "1600 x 1600 Hankel matrix, order 40",
            without(
                "modalscope.identification.fast.factorizations._EXACT_OPERATIONS",
                0,
                lambda: diagram(square, 40, **sized),
            ),
            lambda: diagram(square, 40, factorization="dense", **sized),
            np.inf,
        ),
        Case(
            "SSI-data, 15 channels x 20 000",
            of_record,
            without("modalscope.identification.matrices.projections.triangle_of", lambda _: None, of_record),
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


def main() -> None:
    """Run all of it."""
    for case in cases():
        compared(case)


if __name__ == "__main__":
    main()
