"""Impulse responses of a million outputs in a Zarr folder: modes, and the shapes of all outputs in another. CPU seconds, peak memory.

    python -m benchmarks.full_field 1000000

The folder (2 inputs x 600 samples, in single precision 4.8 GB for a million) is made beside the temporary files by a process of its own.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import modalscope as ms
from benchmarks._works import modes

INPUTS, SAMPLES, MODES, PIECE = 2, 600, 20, 2000
ORDERS = range(2, 61, 2)


def make(path: str, outputs: int) -> None:
    """Write responses with noise 40 dB below them, some outputs after the other."""
    import zarr

    s, _, B = modes(1, INPUTS, MODES)
    decay = np.exp(np.arange(SAMPLES)[:, None] * s)[:, None, :] * B.T  # (N, m, n)
    flat = np.hstack([2 * decay.real.reshape(-1, MODES), -2 * decay.imag.reshape(-1, MODES)])
    rng, group = np.random.default_rng(3), zarr.open_group(path, mode="w")
    shape, chunks = (SAMPLES, outputs, INPUTS), (SAMPLES, PIECE, INPUTS)
    array = group.create_array("values", shape=shape, chunks=chunks, dtype="f4", compressors=None)
    size = float(np.sqrt(np.sum(flat**2) / len(flat)))
    for start in range(0, outputs, PIECE):
        count = min(PIECE, outputs - start)
        C = rng.standard_normal((2 * MODES, count), dtype=np.float32)
        values = flat.astype(np.float32) @ C
        values += np.float32(0.01 * size) * rng.standard_normal(values.shape, dtype=np.float32)
        array[:, start : start + count] = values.reshape(SAMPLES, INPUTS, count).transpose(0, 2, 1)
    group.attrs.update({"sampling_rate": 1.0, "kind": "free decay"})


def main(outputs: int) -> None:
    """Make, identify, write, and compare with what the responses were made of."""
    with tempfile.TemporaryDirectory() as there:
        source, target = Path(there) / "responses.zarr", Path(there) / "shapes.zarr"
        child = get_context("spawn").Process(target=make, args=(str(source), outputs))
        child.start()
        child.join()
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        stored, start = ms.read(source, stored=True), time.process_time()
        diagram = ms.stabilize(stored, method="era", orders=ORDERS, deviations=False)
        middle = time.process_time()
        last = np.flatnonzero(diagram.order_of_pole == ORDERS[-1])
        s = modes(1, INPUTS, MODES)[0]
        index = last[np.abs(diagram.poles[last][:, None] - s).argmin(axis=0)]
        found = ms.ModalModel(
            poles=diagram.poles[index], shapes=diagram.shapes[:, index], participation=diagram.participation[index]
        )
        field = ms.full_field(found, stored, target)
        end, peak = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    worst = np.max(np.abs(found.poles / s - 1))
    print(f"{outputs:,} outputs x {INPUTS} x {SAMPLES}: diagram {middle - start:.1f} s, shapes {end - middle:.1f} s")
    print(
        f"  peak {peak:.0f} MB, {before:.0f} before; fit error {field.fit_error:.5f}; poles off by {worst:.1e} at most"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50_000)
