"""All orders against one: what a diagram of orders 2 to 100 costs above the largest order alone and its fifty eigenproblems.

100 outputs x 3 inputs, 600 samples, 300 x 300 blocks, 40 dB; CPU seconds in pairs, method by method.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks._works import samples
from modalscope import ImpulseResponse, identify
from modalscope.identification.diagrams import stabilize
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import prepare

OUTPUTS, INPUTS, BLOCKS, LARGEST = 100, 3, 300, 100
PAIRS = 3
SIZES = {"block_rows": BLOCKS, "block_columns": BLOCKS}
ORDERS = range(2, LARGEST + 1, 2)


def timed(run: Callable[[], Any]) -> float:
    """Return CPU seconds."""
    start = time.process_time()
    run()
    return time.process_time() - start


def pair(response: ImpulseResponse, method: str) -> tuple[float, float, float, float]:
    """Return the seconds of all orders, of the largest alone, of all eigenproblems, and of the factors, which all orders share."""
    one = timed(lambda: identify(response, method=method, order=LARGEST, deviations=False, **SIZES))
    every = timed(lambda: stabilize(response, method=method, orders=ORDERS, deviations=False, **SIZES))
    shared = timed(lambda: factor(prepare(response, method=method, **SIZES), LARGEST))
    pipeline = factor(prepare(response, method=method, **SIZES), LARGEST)
    models = [pipeline.triple(n).A for n in ORDERS]
    return every, one, timed(lambda: [np.linalg.eig(A) for A in models]), shared


def main() -> None:
    """Print a line a method."""
    response = ImpulseResponse(values=samples(OUTPUTS, INPUTS, BLOCKS, BLOCKS, 60)["values"], sampling_rate=1.0)
    for method in ("era", "alternate", "least_squares"):
        found = np.array([pair(response, method) for _ in range(PAIRS)])
        every, one, eigen, shared = np.median(found, axis=0)
        ratio = np.median(found[:, 0] / (found[:, 1] + found[:, 2]))
        more, factoring = 1e3 * (every - eigen) / len(ORDERS), 1e3 * shared / len(ORDERS)
        print(
            f"  {method:14s} orders 2 to {LARGEST}: {every:.2f} s, order {LARGEST} alone {one:.2f} s, "
            f"eigenproblems {eigen:.2f} s; ratio {ratio:.2f} (goal 1.6), {more:.1f} ms an order above its eigenproblem, "
            f"{factoring:.1f} of them the factors",
            flush=True,
        )


if __name__ == "__main__":
    main()
