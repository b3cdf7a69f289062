"""Ambient records of random chains, hands off, beside another program: figures of the README.

    python -m benchmarks.why [RECORDS]

Every record is given with its rate and nothing else. pyOMA2 runs SSI-cov with its defaults up to 40 states and its automatic clustering
"Kvaale", the best of its ten presets on the first six records; with its deviations, which take half a minute a record, on a fifth of the
records. A mode is right where its frequency is within 1 % of the truth. Intervals are 95 %: one holds where the truth lies in it.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from benchmarks.peers.install import PLACE, python_of
from modalscope.data.shown import text_table

__all__ = ["draw", "score"]

#: Relative distance of frequencies of a right mode.
_RIGHT = 0.01


def draw(seed: int) -> tuple[ms.Signals, ms.ModalModel]:
    """Return the ambient record of a random chain of four to seven masses, and its modes."""
    rng = np.random.default_rng([49, seed])
    n = int(rng.integers(4, 8))
    chain = ms.systems.chain(
        rng.uniform(0.7, 1.3, n), 400 * rng.lognormal(0, 0.3, n), damping_ratios=rng.uniform(0.005, 0.02, n)
    )
    modes = chain.modes()
    rate = float(rng.uniform(2.2, 5)) * modes.frequencies[-1]
    record = chain.simulate(
        inputs="ambient", duration=600 / modes.frequencies[0], sampling_rate=rate, noise=0.1, seed=seed
    )
    return record, modes


def score(truth: ms.ModalModel, found: dict[str, list[float]]) -> dict[str, int]:
    """Return how many modes are right, missed and wrong, and how many intervals hold of how many."""
    f, zeta = truth.frequencies, truth.damping_ratios
    own = np.asarray(found["frequencies"], float)
    pairs = [
        (int(abs(own / x - 1).argmin()), k) for k, x in enumerate(f) if own.size and abs(own / x - 1).min() < _RIGHT
    ]
    halves = {name: np.asarray(found[name], float) for name in ("frequency_halves", "damping_halves")}
    damping = np.asarray(found["damping_ratios"], float)
    known = [(j, k) for j, k in pairs if np.isfinite(halves["frequency_halves"][j] + halves["damping_halves"][j])]
    return {
        "modes": f.size,
        "right": len({j for j, _ in pairs}),
        "wrong": own.size - len({j for j, _ in pairs}),
        "intervals": len(known),
        "of frequency hold": sum(bool(abs(own[j] - f[k]) <= halves["frequency_halves"][j]) for j, k in known),
        "of damping hold": sum(bool(abs(damping[j] - zeta[k]) <= halves["damping_halves"][j]) for j, k in known),
    }


def _own(record: ms.Signals) -> dict[str, list[float]]:
    """Return what `analyze` finds with nothing set, with the half widths of its intervals."""
    modes = ms.analyze(record).modes
    ends = modes.interval(0.95)
    halves = {name: np.nan * np.ones(len(modes)) for name in ends}
    halves |= {name: (pair[:, 1] - pair[:, 0]) / 2 for name, pair in ends.items()}
    return {
        "frequencies": modes.frequencies.tolist(),
        "damping_ratios": modes.damping_ratios.tolist(),
        "frequency_halves": halves["frequency"].tolist(),
        "damping_halves": halves["damping_ratio"].tolist(),
    }


def _peer(python: Path, place: Path, *more: str) -> dict[str, list[float]] | None:
    """Return what pyOMA2 finds in a stored record, or None where it gives up."""
    program = Path(__file__).parent / "peers" / "programs" / "pyoma_2_automatic.py"
    done = subprocess.run([str(python), str(program), str(place), *more], capture_output=True, text=True, check=False)
    return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 and done.stdout else None


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    python = python_of("pyoma_2")
    place = PLACE / "why"
    place.mkdir(parents=True, exist_ok=True)
    totals: dict[str, dict[str, Any]] = {}
    for seed in range(count):
        record, truth = draw(seed)
        stored = place / f"{seed}.npz"
        np.savez(stored, outputs=record.outputs, sampling_rate=record.sampling_rate)
        start = time.process_time()
        results = {"modalscope": _own(record)}
        seconds = {"modalscope": time.process_time() - start}
        runs = {"pyOMA2": ()} | ({"pyOMA2, with deviations": ("deviations",)} if seed % 5 == 0 else {})
        for name, more in runs.items() if python is not None else ():
            given = _peer(python, stored, *more)
            results[name] = given or {key: [] for key in results["modalscope"]}
            seconds[name] = (given or {"seconds": [0.0]})["seconds"][0]
        for name, found in results.items():
            total = totals.setdefault(name, {"records": 0, "all right": 0})
            one = score(truth, found)
            total["records"] += 1
            total["all right"] += one["right"] == one["modes"] and not one["wrong"]
            for key, value in {**one, "CPU s": seconds[name]}.items():
                total[key] = total.get(key, 0) + value
    rows = [["program", *next(iter(totals.values()))]]
    rows += [[name, *(f"{value:.0f}" for value in total.values())] for name, total in totals.items()]
    print(text_table(rows, left=(0,)))


if __name__ == "__main__":
    main()
