"""How time and memory grow with outputs, samples and orders: each size in a process of its own; exponents, and pictures in build/bench."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

import modalscope as ms
from arena.child import peak
from benchmarks._works import PLACE, Data, ambient, lines, samples

#: Runs of one size: the least time counts.
_RUNS = 3


class Growth(NamedTuple):
    """One kind of work over sizes.

    Parameters
    ----------
    name, of : str
        What is done; what grows.
    work : callable
        Does it once.
    sizes : tuple of int
    data : callable
        Makes the arrays of a size.
    """

    name: str
    of: str
    work: Callable[[Data], object]
    sizes: tuple[int, ...]
    data: Callable[[int], Data]


def era(data: Data) -> object:
    """ERA with sizes of its own choice."""
    response = ms.ImpulseResponse(values=data["values"], sampling_rate=1.0)
    return ms.identify(response, method="era", order=int(data["order"]), deviations=False)


def every_order(data: Data) -> object:
    """A diagram of frequency responses up to an order."""
    response = ms.FrequencyResponse(values=data["values"], frequencies=data["frequencies"], quantity="displacement")
    return ms.stabilize(response, orders=range(2, int(data["order"]) + 1, 2), deviations=False)


def correlations(data: Data) -> object:
    """Correlations of a record with itself."""
    record = ms.Signals(outputs=data["outputs"], sampling_rate=1.0)
    return ms.estimate_correlation(record, lags=int(data["lags"]))


def once(work: Callable[[Data], object], data: Data) -> tuple[float, float]:
    """Return CPU seconds of one run, and megabytes at the peak above what there was before, where the system tells."""
    before, start = peak(), time.process_time()
    work(data)
    return time.process_time() - start, peak() - before


GROWTHS = (
    Growth(
        "ERA, 2 inputs, 300 samples, order 40",
        "outputs",
        era,
        (300, 1000, 3000, 10_000),
        lambda n: samples(n, 2, 150, 150, 40),
    ),
    Growth(
        "correlations of 16 channels, 200 lags",
        "samples",
        correlations,
        (30_000, 100_000, 300_000, 1_000_000),
        lambda n: ambient(16, n),
    ),
    Growth(
        "diagram of 10 x 2 responses, 1000 lines",
        "largest order",
        every_order,
        (20, 40, 80),
        lambda n: lines(10, 2, 1000, n),
    ),
)


def measured(growth: Growth) -> tuple[list[float], list[float]]:
    """Return CPU seconds and megabytes above the data, size by size."""
    seconds, peaks = [], []
    for size in growth.sizes:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as child:
            runs = [child.submit(once, growth.work, growth.data(size)).result() for _ in range(_RUNS)]
        seconds.append(min(run[0] for run in runs))
        peaks.append(runs[0][1])
    return seconds, peaks


def exponent(sizes: tuple[int, ...], values: list[float]) -> float:
    """Return the slope over the last step, in logarithms."""
    return float(np.log(values[-1] / values[-2]) / np.log(sizes[-1] / sizes[-2]))


def drawn(found: list[tuple[Growth, list[float], list[float]]]) -> None:
    """Draw times and memory of all kinds beside each other."""
    with mpl.rc_context({"font.size": 9}):
        figure, panels = plt.subplots(1, len(found), figsize=(11, 3.4), layout="constrained")
        for axes, (growth, seconds, peaks) in zip(panels, found, strict=True):
            beside = axes.twinx()
            axes.loglog(growth.sizes, seconds, "o-", color="C0")
            beside.loglog(growth.sizes, np.maximum(peaks, 1), "s--", color="C1")
            axes.set(xlabel=growth.of, title=f"{growth.name}\ntime ~ {growth.of}^{exponent(growth.sizes, seconds):.2f}")
            axes.set_ylabel("CPU seconds", color="C0")
            beside.set_ylabel("MB above the data", color="C1")
            axes.grid(alpha=0.2)
            axes.set_xticks(growth.sizes, [f"{size:,}" for size in growth.sizes], minor=False)
            axes.set_xticks([], minor=True)
            beside.set_ylim(1, 10 * max(peaks))
        figure.savefig(PLACE / "growth.png", dpi=90)


def main() -> None:
    """Print sizes, times and exponents, and draw them."""
    PLACE.mkdir(parents=True, exist_ok=True)
    found = []
    for growth in GROWTHS:
        seconds, peaks = measured(growth)
        found.append((growth, seconds, peaks))
        told = "; ".join(f"{n:,} {t:.3g} s {m:.0f} MB" for n, t, m in zip(growth.sizes, seconds, peaks, strict=True))
        print(f"{growth.name}, by {growth.of}: {told}; exponent {exponent(growth.sizes, seconds):.2f}", flush=True)
    drawn(found)
    print(PLACE / "growth.png")


if __name__ == "__main__":
    main()
