"""The structured route against scipy's thin SVD of the formed Hankel matrix, and all orders against one.

100 outputs x 3 inputs, 600 samples, 300 x 300 blocks, order 60, 40 dB. CPU seconds in pairs, ours and theirs in turn, with one
thread of the linear algebra library; memory above the data; orders 2 to 100 against order 100 alone. The targets are 15 times
less CPU, 60 MB, poles equal to 1e-8, and 1.6 times the time of one order with its eigenproblems.
"""

from __future__ import annotations

import resource
import time
import tracemalloc
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import scipy.linalg as sla

from modalscope import ImpulseResponse, identify
from modalscope.identification.pipeline import factor
from modalscope.identification.prepare import prepare
from modalscope.judging.stabilize import stabilize
from modalscope.model.poles import poles_from
from modalscope.systems import add_noise

OUTPUTS, INPUTS, SAMPLES, BLOCKS, ORDER, LARGEST = 100, 3, 600, 300, 60, 100
PAIRS = 3
SIZES = {"block_rows": BLOCKS, "block_columns": BLOCKS}

Result = TypeVar("Result")


def record(modes: int = 30) -> ImpulseResponse:
    """Return samples of thirty modes of .5 to 3 % damping with noise 40 dB below every channel."""
    rng = np.random.default_rng(0)
    s = poles_from(np.sort(rng.uniform(0.02, 0.45, modes)), rng.uniform(0.005, 0.03, modes))
    C, B = rng.standard_normal((OUTPUTS, modes)), rng.standard_normal((modes, INPUTS))
    decay = np.exp(s * np.arange(SAMPLES)[:, None])
    values = 2 * np.einsum("lj,kj,jm->klm", C, decay, B, optimize=True).real
    return add_noise(ImpulseResponse(values=values, sampling_rate=1.0, kind="dirac"), 0.01, 0)


def by_scipy(response: ImpulseResponse) -> np.ndarray:
    """Return A of order 60 by the thin singular value decomposition of H(0), built and decomposed as arrays."""
    Y = response.values
    H = [np.vstack([np.hstack(list(Y[i + k : i + k + BLOCKS])) for i in range(BLOCKS)]) for k in (0, 1)]
    P, d, Qt = sla.svd(H[0], full_matrices=False)
    root = np.sqrt(d[:ORDER])
    return np.asarray(P[:, :ORDER].T @ H[1] @ Qt[:ORDER].T / np.outer(root, root))


def by_structure(response: ImpulseResponse) -> np.ndarray:
    """Return the same through the table."""
    return factor(prepare(response, method="era", **SIZES), ORDER).triple(ORDER).A


def timed(run: Callable[[], Result]) -> tuple[float, Result]:
    """Return CPU seconds, and what was found."""
    start = time.process_time()
    found = run()
    return time.process_time() - start, found


def against_scipy(response: ImpulseResponse) -> None:
    """Print paired times, the difference of the poles, and the memory."""
    ratios = []
    for _ in range(PAIRS):
        ours, A = timed(lambda: by_structure(response))
        theirs, A0 = timed(lambda: by_scipy(response))
        ratios.append(theirs / ours)
        print(f"  structured {ours:6.2f} s   scipy {theirs:6.2f} s   ratio {theirs / ours:5.1f}")
    z, z0 = np.linalg.eigvals(A), np.linalg.eigvals(A0)
    difference = abs(z[:, None] - z0).min(axis=1).max()
    print(f"  ratio {np.median(ratios):.1f} (target 15); poles differ by {difference:.1e} (target 1e-8)")
    tracemalloc.start()
    by_structure(response)
    peak = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    print(f"  peak memory above the data {peak:.0f} MB (target 60)")


def all_orders(response: ImpulseResponse) -> None:
    """Print what fifty orders cost against one and its fifty eigenproblems, method by method."""
    orders = range(2, LARGEST + 1, 2)
    for method in ("era", "alternate", "least_squares"):
        ratios = []
        for _ in range(PAIRS):
            one, _ = timed(lambda m=method: identify(response, method=m, order=LARGEST, **SIZES))  # type: ignore[misc]
            every, _ = timed(lambda m=method: stabilize(response, method=m, orders=orders, **SIZES))  # type: ignore[misc]
            pipeline = factor(prepare(response, method=method, **SIZES), LARGEST)
            models = [pipeline.triple(n).A for n in orders]
            eigen, _ = timed(lambda found=models: [np.linalg.eig(A) for A in found])  # type: ignore[misc]
            ratios.append(every / (one + eigen))
        print(
            f"  {method:14s} orders 2 to {LARGEST}: {every:.2f} s, order {LARGEST} alone {one:.2f} s, "
            f"eigenproblems {eigen:.2f} s; ratio {np.median(ratios):.2f} (target 1.6)"
        )
    for method in ("prce",):
        every, _ = timed(lambda m=method: stabilize(response, method=m, orders=range(3, 100, 3), **SIZES))  # type: ignore[misc]
        one, _ = timed(lambda m=method: identify(response, method=m, order=99, **SIZES))  # type: ignore[misc]
        print(f"  {method:14s} orders 3 to 99: {every:.2f} s, order 99 alone {one:.2f} s")


def main() -> None:
    """Run all of it."""
    response = record()
    against_scipy(response)
    all_orders(response)
    print(
        f"  largest resident size, scipy's matrices included: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB"
    )


if __name__ == "__main__":
    main()
