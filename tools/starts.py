"""The five starts of the documentation as a new user does them: an empty environment, the wheel, and a few commands to a report.

`python -m tools.starts WHEEL` runs them, says how long each took, and fails where a command fails, where there are more than six of them,
or where the report does not name the modes that are known.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

__all__ = ["STARTS", "done", "main"]

ROOT = Path(__file__).resolve().parents[1]

#: An environment and the package in it: the first two commands of each.
INSTALL = ("{python} -m venv env", "env/bin/python -m pip install --quiet {wheel}")

#: Files that a start begins with, its commands, and a frequency that its report must show, Hz: published, or exact.
STARTS: dict[str, tuple[tuple[str, ...], tuple[str, ...], str]] = {
    "hammer": (
        ("examples/beam_hammer/beam_hammer.uff",),
        ("info beam_hammer.uff", "identify beam_hammer.uff --band 100 1700 -o report.html"),
        r"177\.0",
    ),
    "shaker": (
        (),
        ("simulate chain5 --kind records --noise 30 -o run1.npz", "identify run1.npz -o modes.json -o report.html"),
        r"0\.906",
    ),
    "ambient": (
        ("examples/palisaden/palisaden.npz", "examples/palisaden/points.csv", "examples/palisaden/lines.csv"),
        (
            "psd palisaden.npz -o spectra.png",
            "identify palisaden.npz --band 1 4 --geometry points.csv --lines lines.csv -o report.html",
        ),
        r"1\.88",
    ),
    "earthquake": (
        ("quake.csv",),
        (
            'info quake.csv --columns "time=1,in=2,out=3-7"',
            'identify quake.csv --columns "time=1,in=2,out=3-7" -o report.html',
        ),
        r"1\.75",
    ),
    "control": (
        (),
        (
            "simulate chain5 --kind impulse --noise 40 -o test.uff",
            "realize test.uff --order 10 -o model.mat",
            "identify test.uff -o report.html",
        ),
        r"0\.906",
    ),
}

#: As many commands as a start has at most.
MOST = 6


def main() -> int:
    """Do all of them; return 1 where one fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path)
    wheel = parser.parse_args().wheel.resolve()
    failed = [name for name in STARTS if not done(name, wheel)]
    print("\n".join(f"FAILED: {name}" for name in failed) or "every start ends in a report")
    return 1 if failed else 0


def done(name: str, wheel: Path) -> bool:
    """Whether a start comes to its report, from nothing; its times are printed."""
    files, words, known = STARTS[name]
    commands = [each.format(python=sys.executable, wheel=wheel) for each in INSTALL]
    commands += [f"env/bin/modalscope {each}" for each in words]
    with tempfile.TemporaryDirectory(prefix="modalscope-start-") as folder:
        place = Path(folder)
        for file in files:
            if file == "quake.csv":
                _quake(place / file)
            else:
                shutil.copy(ROOT / file, place)
        spent = []
        for command in commands:
            begun, before = time.monotonic(), _worked()
            ran = subprocess.run(command, shell=True, cwd=place, env=_alone(), capture_output=True, text=True)
            spent.append((time.monotonic() - begun, _worked() - before))
            if ran.returncode:
                print(f"{name}: {command}\n{ran.stdout}{ran.stderr}")
                return False
        report = (place / "report.html").read_text(encoding="utf-8")
    for what, part in (("install", spent[: len(INSTALL)]), ("the job", spent[len(INSTALL) :])):
        wall, work = (sum(each) for each in zip(*part, strict=True))
        print(f"{name:11} {what}: {len(part)} commands, {wall:.0f} s, of which {work:.0f} s of one core", flush=True)
    return len(commands) <= MOST and bool(re.search(known, report)) and "ms.analyze(" in report


def _worked() -> float:
    """Return the seconds that programs started here kept a core busy."""
    told = os.times()
    return told.children_user + told.children_system


def _alone() -> dict[str, str]:
    """Return the environment without what would lead to this tree."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}


def _quake(path: Path) -> None:
    """Write the simulated earthquake of the documentation as a table: time, the basement, five floors."""
    import numpy as np

    import modalscope as ms

    building = ms.systems.spring_chain(5, mass=2e5, stiffness=3e8, damping_ratio=0.03)
    t = np.arange(2000) / 50.0
    shaking = np.random.default_rng(7).standard_normal(t.size) * t * np.exp(-t / 4)
    moved = building.simulate(
        inputs=-np.diag(building.mass) * shaking[:, None], at=building.dofs, sampling_rate=50.0, quantity="acceleration"
    )
    floors = moved.outputs + shaking[:, None]
    floors = floors + 0.01 * floors.std() * np.random.default_rng(8).standard_normal(floors.shape)
    names = ["Time [s]", "Basement [m/s^2]", *(f"Floor {k} [m/s^2]" for k in range(1, 6))]
    table = np.column_stack([t, shaking, floors])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.9g")


if __name__ == "__main__":
    sys.exit(main())
