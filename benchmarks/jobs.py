"""Ten jobs of a user: `modalscope identify FILE -o report.html`, from the start of the program to the report on disk.

    python -m benchmarks.jobs [WORD] [--before FOLDER] [--page]

Each runs in a process of its own. Its CPU seconds are told by stage, those of imports apart wherever they happen; memory is the largest
of the process in each stage, its start included. WORD: jobs with this word in their name. `--before`: another checkout, whose CPU seconds
and memory stand beside; both run in turns.
`--page` writes the table into docs/validation.
"""

from __future__ import annotations

import argparse
import builtins
import importlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks._published import commit_of, table, today

ROOT = Path(__file__).parents[1]

#: Where data and reports lie, and the page.
_PLACE, _PAGE = ROOT / "build" / "bench" / "jobs", ROOT / "docs" / "validation" / "jobs.md"


# ------------------------------------------------------------------------------------------------------------- the data


def _model(outputs: int, inputs: int, modes: int, top: float, seed: int) -> Any:
    """Return a continuous model of accelerations: modes from 3 % of `top` (Hz) up, smooth shapes with a random part."""
    import modalscope as ms

    rng = np.random.default_rng(seed)
    w, zeta = 2 * np.pi * np.sort(rng.uniform(0.03 * top, top, modes)), rng.uniform(0.005, 0.02, modes)
    place = (np.arange(outputs) + 0.5) / outputs
    phi = np.sin(np.pi / 2 * np.outer(place, np.arange(1, modes + 1)) + rng.uniform(0, 3, modes))
    phi += 0.1 * rng.standard_normal(phi.shape)
    driven = phi[rng.choice(outputs, inputs, replace=inputs > outputs)]
    A = np.block([[np.zeros((modes, modes)), np.eye(modes)], [-np.diag(w**2), -2 * np.diag(zeta * w)]])
    return ms.StateSpace(A=A, B=np.vstack([0 * driven.T, driven.T]), C=phi @ A[modes:], D=phi @ driven.T)


def _record(outputs: int, inputs: int, modes: int, rate: float, samples: int, noise: float = 0.02) -> dict[str, Any]:
    """Return a record under white forces held between samples; with `inputs` zero of six forces that nobody measured."""
    rng = np.random.default_rng(1)
    u = rng.standard_normal((samples, inputs or 6))
    y = _model(outputs, inputs or 6, modes, 0.35 * rate, 0).to_discrete(1 / rate).simulate(u)
    y += noise * y.std(axis=0) * rng.standard_normal(y.shape)
    return {"outputs": y, "sampling_rate": rate} | ({"inputs": u} if inputs else {})


def _lines(outputs: int, inputs: int, modes: int, lines: int) -> dict[str, Any]:
    """Return frequency responses with noise of 1 % of the largest."""
    rng, f = np.random.default_rng(1), np.linspace(0.5, 400, lines)
    H = _model(outputs, inputs, modes, 380, 0).frequency_response(f).values
    noise = rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)
    return {"values": H + 0.01 * np.sqrt(np.mean(np.abs(H) ** 2)) * noise, "frequencies": f}


def _stored(name: str, arrays: dict[str, Any]) -> list[Path]:
    np.savez(_PLACE / f"{name}.npz", **arrays)
    return [_PLACE / f"{name}.npz"]


def _phone() -> list[Path]:
    """Return a table as telephones write it: time and three accelerations."""
    record = _record(3, 0, 4, 100.0, 30_000)
    path = _PLACE / "phone.csv"
    columns = np.column_stack([np.arange(30_000) / 100, record["outputs"]])
    names = [f"Acceleration {axis} (m/s^2)" for axis in "xyz"]
    np.savetxt(path, columns, delimiter=",", header=",".join(["Time (s)", *names]), comments="", fmt="%.6g")
    return [path]


def _tower() -> list[Path]:
    """Return fifteen setups of five minutes: two sensors stay, two rove."""
    rng, found = np.random.default_rng(2), []
    model = _model(32, 6, 8, 4.2, 0).to_discrete(1 / 12)
    for setup in range(15):
        rows = [15, 31, *([k for k in range(32) if k not in (15, 31)][2 * setup : 2 * setup + 2])]
        y = model.simulate(rng.standard_normal((10_800, 6)))[:, rows]
        y += 0.05 * y.std(axis=0) * rng.standard_normal(y.shape)
        labels = np.array([f"{row + 1}z+" for row in rows])
        found += _stored(f"tower{setup}", {"outputs": y, "sampling_rate": 12.0, "output_dofs": labels})
    return found


#: Name of a job -> its files.
JOBS: dict[str, Callable[[], list[Path]]] = {
    "phone, 3 x 30 000 samples": _phone,
    "hammer, 30 x 3 x 2000 lines": lambda: _stored("hammer", _lines(30, 3, 15, 2000)),
    "beam, 7 x 6 x 9999 lines, measured": lambda: [ROOT / "examples" / "beam_hammer" / "beam_hammer.uff"],
    "records, 28 x 2 x 60 000": lambda: _stored("records", _record(28, 2, 15, 256.0, 60_000)),
    "ambient, 15 x 60 000": lambda: _stored("ambient", _record(15, 0, 10, 20.0, 60_000, 0.1)),
    "ambient, 15 channels, 1 h at 100 Hz": lambda: _stored("hour", _record(15, 0, 10, 100.0, 360_000, 0.1)),
    "tower of 15 setups": _tower,
    "laser, 1000 points x 1600 lines": lambda: _stored("laser", _lines(1000, 1, 15, 1600)),
    "vibration test, 200 x 2, 5 minutes": lambda: _stored("gvt5", _record(200, 2, 24, 256.0, 76_800)),
    "vibration test, 200 x 2, 20 minutes": lambda: _stored("gvt20", _record(200, 2, 24, 256.0, 307_200)),
}


# ----------------------------------------------------------------------------------------------------------- the child

#: Stage -> functions that it consists of, where they are looked up. Of stages within each other the inner one counts.
STAGES = {
    "reading": ("analysis.workflow.analyze.opened",),
    "doctor": ("signals.doctor.examine_record.examine_record", "signals.doctor.examine.examine_response"),
    "identification": ("analysis.workflow.analyze.looked_at", "analysis.workflow.analyze.modes_chosen"),
    "deviations": (
        "selection.likelihood.refined.spread_of",
        "selection.likelihood.refine_setups.deviations",
        "analysis.workflow.ambient_lines.line_shapes",
        "selection.likelihood.deviations.deviations_of",
    ),
    "report": ("interfaces.cli.output.write_outputs",),
}


def looked_up(place: str) -> tuple[Any, str]:
    """Return the module of a function of a stage, and its name there."""
    where, _, name = place.rpartition(".")
    return importlib.import_module(f"modalscope.{where}"), name


class _Clock:
    """CPU seconds and largest memory of stages; the innermost one runs."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.memory: dict[str, float] = defaultdict(float)
        self._running, self._since = ["other"], 0.0

    def turn(self) -> None:
        """Add what ran since the last turn to the running stage."""
        now, stage = time.process_time(), self._running[-1]
        status = Path("/proc/self/status").read_text()
        self.seconds[stage] += now - self._since
        if stage != "imports":
            peak = next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]
            self.memory[stage] = max(self.memory[stage], int(peak) / 1e3)
            Path("/proc/self/clear_refs").write_text("5")  # the largest memory counts from here
        self._since = time.process_time()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Let a stage run."""
        self.turn()
        self._running.append(name)
        try:
            yield
        finally:
            self.turn()
            self._running.pop()

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that counts for a stage; what imports within imports counts once."""

        def run(*arguments: Any, **options: Any) -> Any:
            if name == "imports" and self._running[-1] == name:
                return function(*arguments, **options)
            with self.stage(name):
                return function(*arguments, **options)

        return run


def _child(files: Sequence[str], report: str) -> None:
    """Run the command with its stages timed, and print them as JSON."""
    clock = _Clock()
    plain = builtins.__import__

    def loaded(
        name: str, *rest: Any, **options: Any
    ) -> Any:  # of names that are there already, most of all, nothing is loaded
        there = name in sys.modules and not (rest[2:3] or options.get("fromlist"))
        return (plain if there else timed)(name, *rest, **options)

    timed = clock.timed("imports", plain)
    with clock.stage("imports"):
        from modalscope.interfaces.cli import main
    for stage, places in STAGES.items():
        for place in places:
            with suppress(ImportError, AttributeError):  # another checkout may have it elsewhere: it counts as other
                with clock.stage("imports"):
                    module, name = looked_up(place)
                setattr(module, name, clock.timed(stage, getattr(module, name)))
    builtins.__import__ = loaded
    importlib.import_module = clock.timed("imports", importlib.import_module)
    sys.stdout = sys.stderr
    if main(["identify", *files, "-o", report, "--force"]):
        raise SystemExit("the command failed")
    clock.turn()
    print(json.dumps({"seconds": clock.seconds, "memory": clock.memory}), file=sys.__stdout__)


# ---------------------------------------------------------------------------------------------------------- the table


class Outcome(NamedTuple):
    """What a job took: CPU seconds and largest memory (MB) by stage, bytes of the report, bytes of the data; and the commit."""

    seconds: dict[str, float]
    memory: dict[str, float]
    report: int
    data: int
    commit: str


def ran(files: Sequence[Path], source: Path = ROOT) -> Outcome:
    """Return what `identify` of files takes in a process of its own, with the package of a checkout."""
    report = _PLACE / "report.html"
    environment = os.environ | {
        "PYTHONPATH": f"{source / 'src'}:{ROOT}",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONDONTWRITEBYTECODE": "",
        "PYTHONPYCACHEPREFIX": str(ROOT / ".venv" / "pycache"),
    }
    command = [sys.executable, "-m", "benchmarks.jobs", "--child", str(report), *map(str, files)]
    done = subprocess.run(
        command, cwd=_PLACE, env=environment, stdout=subprocess.PIPE, text=True, check=True, stderr=subprocess.DEVNULL
    )
    told = json.loads(done.stdout.splitlines()[-1])
    size = sum(path.stat().st_size for path in files)
    return Outcome(told["seconds"], told["memory"], report.stat().st_size, size, commit_of(source))


#: Columns of the table.
_COLUMNS = ("imports", "reading", "doctor", "identification", "deviations", "report", "other")


def row_of(name: str, found: Outcome, before: Outcome | None = None) -> list[str]:
    """Return a row of the table."""
    earlier = ["", "", ""]
    if before is not None:
        earlier = [f"{sum(before.seconds.values()):.1f}", f"{max(before.memory.values()):.0f}", before.commit]
    whole, highest = sum(found.seconds.values()), max(found.memory, key=lambda stage: found.memory[stage])
    share = (found.seconds.get("identification", 0) + found.seconds.get("deviations", 0)) / whole
    return [
        name,
        f"{whole:.1f}",
        *(f"{found.seconds.get(stage, 0):.2f}" for stage in _COLUMNS),
        f"{100 * share:.0f} %",
        f"{found.memory[highest]:.0f} ({highest})",
        f"{found.data / 1e6:.1f}",
        f"{found.report / 1e3:.0f}",
        *earlier,
        today(),
        found.commit,
    ]


HEADER = [
    "job",
    "CPU s",
    *_COLUMNS,
    "identification and deviations",
    "largest memory, MB",
    "file, MB",
    "report, kB",
    "before, CPU s",
    "before, MB",
    "before, commit",
    "date",
    "commit",
]


def page(rows: Sequence[Sequence[str]]) -> str:
    """Return the text of the page; of jobs that were not run the rows that it has."""
    before = _PAGE.read_text(encoding="utf-8").splitlines() if _PAGE.is_file() else []
    lines = table(HEADER, (f"| {' | '.join(row)} |" for row in rows), before, [(name,) for name in JOBS])
    return f"""# Ten jobs, from the file to the report

Written by `python -m benchmarks.jobs --page`: `modalscope identify FILE -o report.html` with nothing set, one process and one thread each.
CPU seconds by stage; imports are counted apart wherever they happen. Memory is the largest of the whole process, about 120 MB of which are
the program and its packages, with the stage that takes it. Data are simulated but for those of the beam. Before: the same on the same
machine, in turns, with an earlier commit.

{lines}
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("word", nargs="?", default="")
    parser.add_argument("--before", type=Path)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    _PLACE.mkdir(parents=True, exist_ok=True)
    rows = []
    print("\t".join(HEADER))
    for name, files in JOBS.items():
        if options.word in name:
            made = files()
            before = None if options.before is None else ran(made, options.before)
            rows.append(row_of(name, ran(made), before))
            print("\t".join(rows[-1]), flush=True)
    if options.page:
        _PAGE.write_text(page(rows), encoding="utf-8")
    shutil.rmtree(_PLACE, ignore_errors=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        _child(sys.argv[3:], sys.argv[2])
    else:
        main()
