"""Environments of the other programs under build/bench: made once, by uv where it can be had, else by pip.

What does not install is left out in words.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

__all__ = ["PEERS", "PLACE", "python_of"]

#: Where the environments and the data lie.
PLACE = Path("build/bench")

#: Program -> what is installed for it.
PEERS = {
    "scipy": "scipy",
    "control": "control",
    "pymor": "pymor",
    "modred": "modred",
    "pyyeti": "pyyeti",
    "pyoma_2": "pyoma_2",
    "sdypy_EMA": "sdypy-EMA",
}

#: modred asks setuptools for what later ones no longer have.
BUILD = "setuptools<81"

_SECONDS = 300


def python_of(peer: str) -> Path | None:
    """Return the interpreter of a program's environment, None where it was not installed."""
    if peer == "modalscope":
        return Path(sys.executable)
    place = PLACE / peer
    return _interpreter(place) if (place / "installed").is_file() else None


def _interpreter(place: Path) -> Path:
    return place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def _run(*command: str, **environment: str) -> str | None:
    """Run a command; return what it complains of where it fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, env=os.environ | environment)
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    return None if done.returncode == 0 else (done.stderr.strip().splitlines() or ["it failed"])[-1]


def install(peer: str) -> str | None:
    """Make one environment; return why there is none, where there is none."""
    place = PLACE / peer
    shutil.rmtree(place, ignore_errors=True)
    limits = place.with_suffix(".txt")
    limits.parent.mkdir(parents=True, exist_ok=True)
    limits.write_text(f"{BUILD}\n")
    beside = Path(sys.executable).with_name("uv")
    uv = str(beside) if beside.exists() else shutil.which("uv")
    python, package = str(_interpreter(place)), PEERS[peer]
    if uv is not None:
        wrong = _run(uv, "venv", "--quiet", "--python", sys.executable, str(place)) or _run(
            *(uv, "pip", "install", "--quiet", "--python", python, "--build-constraint", str(limits), package),
            UV_LINK_MODE="copy",
        )
    else:
        venv.create(place, with_pip=True)
        wrong = _run(python, "-m", "pip", "install", "--quiet", package, PIP_CONSTRAINT=str(limits))
    if wrong is None:
        (place / "installed").write_text(f"{package}\n")
    return wrong


def main() -> None:
    """Make what is missing."""
    for peer in PEERS:
        if python_of(peer) is None:
            wrong = install(peer)
            print(
                f"{peer}: {'installed' if wrong is None else f'left out, for it does not install: {wrong}'}", flush=True
            )


if __name__ == "__main__":
    main()
