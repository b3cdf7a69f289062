"""Two programs in turn at the same work: poles compared first, then CPU seconds in pairs, and memory."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from pathlib import Path
from statistics import median
from types import TracebackType
from typing import NamedTuple

import numpy as np

from benchmarks.peers.install import python_of

__all__ = ["Child", "Measured", "nearest", "paired"]

_HERE = Path(__file__).parent

#: One thread of the linear algebra libraries, for everybody.
_ALONE = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL", "NUMBA")} | {"MPLBACKEND": "Agg"}

#: Pairs at most, and CPU seconds after which no other is begun.
_PAIRS, _ENOUGH = 5, 5.0


class Run(NamedTuple):
    """One run: CPU seconds, megabytes at the peak above the data, poles."""

    seconds: float
    peak: float
    poles: np.ndarray


class Measured(NamedTuple):
    """Two programs at one piece of work.

    Parameters
    ----------
    ours, theirs : float
        Median CPU seconds.
    ratio : float
        Median of theirs over ours, pair by pair.
    our_peak, their_peak : float
        Megabytes above the data.
    difference : float
        Largest relative distance from a pole that is looked for to the nearest one found.
    """

    ours: float
    theirs: float
    ratio: float
    our_peak: float
    their_peak: float
    difference: float


class Child:
    """A program in a process of its own that works when it is told to.

    Parameters
    ----------
    program, function : str
    data : path
    """

    def __init__(self, program: str, function: str, data: Path) -> None:
        python = python_of(program)
        if python is None:
            raise RuntimeError(f"{program} is not installed")
        script = _HERE / "programs" / f"{program}_.py"
        self.name = f"{program}.{function}"
        self._said = tempfile.TemporaryFile("w+")  # noqa: SIM115 - a pipe that nobody reads would stop who writes
        self._process = subprocess.Popen(
            [str(python.absolute()), str(_HERE / "child.py"), str(script), function, str(data)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            text=True,
            env=os.environ | _ALONE,
        )

    def __enter__(self) -> Child:
        try:
            self._answer()
        except RuntimeError:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()
        self._said.close()

    def _answer(self) -> dict[str, object]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._said.seek(0)
            raise RuntimeError(f"{self.name} failed: {(self._said.read().strip().splitlines() or ['?'])[-1]}")
        return dict(json.loads(line))

    def run(self) -> Run:
        """Work once."""
        assert self._process.stdin is not None
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        answer = self._answer()
        poles = np.array(answer["poles"], dtype=float).reshape(-1, 2)
        return Run(float(str(answer["seconds"])), float(str(answer["peak"])), poles[:, 0] + 1j * poles[:, 1])


def nearest(sought: np.ndarray, found: np.ndarray) -> float:
    """Return the largest relative distance from a pole that is looked for to the nearest one that was found."""
    return max((float(np.min(np.abs(found - z)) / abs(z)) for z in sought), default=np.inf)


def paired(ours: Child, theirs: Child, truth: np.ndarray | None = None) -> Measured:
    """Let both work in turn, A B A B ..., the first run of each for the poles and the memory alone where runs are short.

    Parameters
    ----------
    ours, theirs : Child
    truth : array, optional
        Poles that both must find; without them theirs must find ours.
    """
    a, b = ours.run(), theirs.run()
    difference = nearest(a.poles, b.poles) if truth is None else max(nearest(truth, a.poles), nearest(truth, b.poles))
    pairs = [(ours.run().seconds, b.seconds)] if b.seconds > _ENOUGH / 2 else []
    while not pairs or (len(pairs) < _PAIRS and sum(map(sum, pairs)) + sum(pairs[-1]) < _ENOUGH):
        pairs.append((ours.run().seconds, theirs.run().seconds))
    times = np.array(pairs)
    return Measured(
        *(float(x) for x in np.median(times, axis=0)),
        median(float(y / x) for x, y in pairs),
        a.peak,
        b.peak,
        difference,
    )
