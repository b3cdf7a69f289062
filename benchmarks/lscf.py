"""LSCF: 50 frequency responses on 4000 lines, poles of every degree to 60, against sdypy-EMA on the same machine in the same run.

Both are given the same responses with one reference; ours also with two and three, which sdypy-EMA has no method for. Its order 60 gives
120 poles, the roots of a real polynomial of degree 120, so that our degrees 2, 4, ..., 120 are timed as well. CPU seconds, best of five.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
from sdypy import EMA

from modalscope import FrequencyResponse
from modalscope.blocks.fraction import fraction
from modalscope.realizations.fraction import fraction_companion

OUTPUTS, LINES, DEGREE, MODES = 50, 4000, 60, 10
FREQUENCIES = 0.5 * np.arange(1, LINES + 1)
POLES = 2 * np.pi * np.linspace(100, 1900, MODES) * (-0.005 + 1j)


def receptances(inputs: int) -> np.ndarray:
    """Return responses of ten modes of .5 % damping with noise 60 dB below, (lines, outputs, inputs)."""
    rng = np.random.default_rng(0)
    shapes, rows = rng.standard_normal((MODES, OUTPUTS, 1)), rng.standard_normal((MODES, 1, inputs))
    residues = 1j * shapes * rows
    w = 2j * np.pi * FREQUENCIES[:, None, None]
    H = sum(R / (w - s) + R.conj() / (w - s.conjugate()) for R, s in zip(residues, POLES, strict=True))
    noise = rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)
    return np.asarray(H + 1e-3 * np.sqrt(np.mean(np.abs(H) ** 2) / 2) * noise)


def ours(H: np.ndarray, step: int = 1) -> list[np.ndarray]:
    """Return the poles of degrees step, 2 step, ..., 60 step."""
    matrix = fraction(FrequencyResponse(values=H, frequencies=FREQUENCIES), degree=step * DEGREE)
    model = fraction_companion(matrix, matrix.factors)
    return [matrix.to_s(1 / np.linalg.eigvals(model.triple(step * p).A)) for p in range(1, DEGREE + 1)]


def theirs(H: np.ndarray) -> list[np.ndarray]:
    """Return the poles of every degree by sdypy-EMA."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = EMA.Model(H[:, :, 0].T.copy(), FREQUENCIES, lower=0.5, upper=2000, pol_order_high=DEGREE)
        model.get_poles(method="lscf", show_progress=False)
    return list(model.all_poles)


def best(run: Callable[[np.ndarray], list[np.ndarray]], H: np.ndarray) -> tuple[float, list[np.ndarray]]:
    """Return the least CPU time of five runs, and the poles."""
    found: list[np.ndarray] = []
    times = []
    for _ in range(5):
        start = time.process_time()
        found = run(H)
        times.append(time.process_time() - start)
    return min(times), found


def worst(found: list[np.ndarray]) -> float:
    """Return the largest relative distance from a true pole to the nearest of the highest degree."""
    return max(float(np.min(np.abs(found[-1] - s)) / abs(s)) for s in POLES)


def main() -> None:
    """Print the table; fail when we are slower."""
    H = receptances(1)
    mine, poles = best(ours, H)
    other, peers = best(theirs, H)
    print(f"{OUTPUTS} responses x {LINES} lines, every degree to {DEGREE}")
    print(f"  modalscope  1 reference            {mine:.3f} s   nearest poles within {worst(poles):.1e}")
    twice, more = best(partial(ours, step=2), H)
    print(f"  modalscope  1 reference, to 120    {twice:.3f} s   nearest poles within {worst(more):.1e}")
    print(f"  sdypy-EMA   1 reference            {other:.3f} s   nearest poles within {worst(peers):.1e}")
    for inputs in (2, 3):
        seconds, poles = best(ours, receptances(inputs))
        print(f"  modalscope  {inputs} references           {seconds:.3f} s   nearest poles within {worst(poles):.1e}")
    if max(mine, twice) > other:
        raise SystemExit("slower than sdypy-EMA")


if __name__ == "__main__":
    main()
