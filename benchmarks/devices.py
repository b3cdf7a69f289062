"""Large products by NumPy, and by PyTorch on the processor and on a graphics card where there is one: results compared, then times.

CPU seconds of one thread for the processor; a card is timed by the clock, for it works beside the processor.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import modalscope as ms
from modalscope.identification.fast.block_hankel import BlockHankel
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import LargeMatrix
from modalscope.numerics.resources import DEVICES, device_named
from modalscope.numerics.sums import TriangleSum
from modalscope.signals.preprocess.stored_correlation import LagSum

#: Results are equal to this.
EQUAL = 1e-9


def kernels() -> dict[str, Callable[[], Any]]:
    """Return what is done."""
    rng = np.random.default_rng(0)
    y, run, X = rng.standard_normal((600, 100, 3)), rng.standard_normal((40_000, 16)), rng.standard_normal((900, 80))
    tall, whole = rng.standard_normal((8000, 400)), rng.standard_normal((4000, 1000))

    def triangle() -> Any:
        total = TriangleSum(400)
        total.add(tall)
        return np.abs(total.finish())

    def lags() -> Any:
        total = LagSum(16, range(16), 200)
        total.add(run)
        return total.finish()

    return {
        "Gram matrix, 300 x 300 blocks of 100 x 3": lambda: BlockHankel(y, 300, 300).gram(),
        "the same matrix times 80 columns": lambda: BlockHankel(y, 300, 300).times(X),
        "triangle of 8000 x 400": triangle,
        "correlations 16 x 16, 40 000 samples": lags,
        "Gram matrix of 4000 x 1000": lambda: LargeMatrix(whole).gram(),
    }


def there() -> list[str]:
    """Return the devices that are there, and say which are not."""
    found = []
    for name in DEVICES:
        try:
            device_named(name)
            found.append(name)
        except DataError as error:
            print(f"  left out {name}: {error.found}")
    return found


def best(run: Callable[[], Any], clock: Callable[[], float]) -> tuple[float, Any]:
    """Return the shortest of three times, and what was computed."""
    run()
    times = []
    for _ in range(3):
        start = clock()
        found = run()
        times.append(clock() - start)
    return min(times), found


def main() -> None:
    """Print a line a kernel."""
    names = there()
    for what, run in kernels().items():
        seconds, expected = best(run, time.process_time)
        told = f"numpy {seconds:6.3f} s"
        for name in names:
            with ms.working(device=name):
                seconds, found = best(run, time.perf_counter if name == "cuda" else time.process_time)
            difference = np.max(np.abs(found - expected)) / np.max(np.abs(expected))
            if difference > EQUAL:
                raise SystemExit(f"{what}: {name} differs by {difference:.1e}")
            told += f"   torch {name} {seconds:6.3f} s (differs {difference:.0e})"
        print(f"  {what:42s} {told}", flush=True)


if __name__ == "__main__":
    main()
