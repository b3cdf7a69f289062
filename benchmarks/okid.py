"""OKID and ERA, record to poles, against modred's OKID and ERA on the same machine in the same run.

Four outputs, two inputs, ten modes, 4000 samples under white forces with 40 dB of noise. Both read 100 Markov parameters. CPU seconds,
best of three, and the worst frequency error, median over five systems.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import modred
import numpy as np

import modalscope as ms

SYSTEMS, SAMPLES, PARAMETERS, STATES = 5, 4000, 100, 20


def system(rng: np.random.Generator) -> ms.StateSpace:
    """Return a sampled model of ten modes of .2 to 5 % damping between .03 and .45 of the sampling rate."""
    f = 0.03 + 0.42 * (np.arange(10) + rng.uniform(0.2, 0.8, 10)) / 10
    zeta = np.exp(rng.uniform(np.log(0.002), np.log(0.05), 10))
    s = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    A = np.zeros((STATES, STATES))
    for k, z in enumerate(np.exp(s)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, z.imag], [-z.imag, z.real]]
    B, C = rng.standard_normal((STATES, 2)), rng.standard_normal((4, STATES))
    return ms.StateSpace(A=A, B=B, C=C, D=rng.standard_normal((4, 2)), dt=1.0)


def record(model: ms.StateSpace, rng: np.random.Generator) -> ms.Signals:
    """Return 4000 samples under white forces, 40 dB of noise on every output."""
    u = rng.standard_normal((SAMPLES, 2))
    y = model.simulate(u)
    y = y + 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    return ms.Signals(outputs=y, inputs=u, sampling_rate=1.0)


def ours(data: ms.Signals) -> np.ndarray:
    """Return the frequencies by estimate_markov and identify."""
    response = ms.estimate_markov(data, samples=PARAMETERS)
    found = ms.identify(response, method="era", order=STATES)
    return found.modes.frequencies


def theirs(data: ms.Signals) -> np.ndarray:
    """Return the frequencies by modred; its parameters are as many as it is asked for, the direct term first."""
    markovs = modred.OKID(data.inputs.T.copy(), data.outputs.T.copy(), PARAMETERS)
    A, _, _ = modred.compute_ERA_model(markovs[1:], STATES)
    z = np.linalg.eigvals(np.asarray(A))
    s = np.log(z.astype(complex))
    return np.asarray(np.abs(s[s.imag > 0]) / 2 / np.pi)


def best(run: Callable[[ms.Signals], np.ndarray], data: ms.Signals) -> tuple[float, np.ndarray]:
    """Return the least CPU time of three runs, and the frequencies."""
    times, found = [], np.zeros(0)
    for _ in range(3):
        start = time.process_time()
        found = run(data)
        times.append(time.process_time() - start)
    return min(times), found


def main() -> None:
    rng = np.random.default_rng(0)
    rows: dict[str, list[tuple[float, float]]] = {"modalscope": [], "modred": []}
    for _ in range(SYSTEMS):
        model = system(rng)
        data = record(model, rng)
        s = model.continuous_poles
        truth = np.abs(s[s.imag > 0]) / 2 / np.pi
        for name, run in (("modalscope", ours), ("modred", theirs)):
            seconds, found = best(run, data)
            worst = max(np.min(np.abs(found - f)) / f for f in truth) if found.size else np.nan
            rows[name].append((seconds, worst))
    print(f"{SAMPLES} samples, 4 outputs, 2 inputs, {STATES} states, {PARAMETERS} Markov parameters, 40 dB")
    for name, pairs in rows.items():
        seconds, worst = np.median(pairs, axis=0)
        print(f"  {name:11s} {seconds:6.3f} s   worst frequency error {worst:.1e}")
    ratio = np.median([a[0] / b[0] for a, b in zip(rows["modalscope"], rows["modred"], strict=True)])
    print(f"  paired ratio of CPU times {ratio:.2f} (target: at most 1)")


if __name__ == "__main__":
    main()
