"""The programs of the arena: one contestant a variant, and the environments that they run in."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import modalscope
from arena.child import loaded

__all__ = ["HANDED", "PLACE", "Contestant", "all_contestants", "ready"]

HERE = Path(__file__).parent

#: Where environments, data and runs lie; not in the repository.
PLACE = HERE.parents[0] / "build" / "arena"

#: A file a program.
CONTESTANTS = HERE / "contestants"

#: Lists of modes that people handed in, a folder a program.
HANDED = HERE / "handed"

_SECONDS = 600


@dataclass(frozen=True)
class Contestant:
    """One row of the tables.

    Parameters
    ----------
    name, what, source : str
        Its name, what it does, and where its documentation shows these settings.
    path : Path
        The file that runs it, or the folder of lists that were handed in.
    requires, takes : tuple of str
        What is installed for it; the kinds of tests that it is made for.
    """

    name: str
    what: str
    source: str
    path: Path
    requires: tuple[str, ...]
    takes: tuple[str, ...]

    @property
    def environment(self) -> Path:
        """The folder of its environment."""
        return PLACE / "environments" / "-".join(re.sub("[^A-Za-z0-9.]+", "_", each) for each in self.requires)

    @property
    def python(self) -> Path:
        """The interpreter that runs it."""
        if not self.requires:
            return Path(sys.executable)
        return self.environment / ("Scripts/python.exe" if os.name == "nt" else "bin/python")

    def code(self) -> str:
        """Return the text that decides what it gives, for the key of a run."""
        own = self.path.read_text("utf-8") if self.path.is_file() else ""
        return own + (HERE / "child.py").read_text("utf-8") + ("" if self.requires else _of_this_program())


@cache
def _of_this_program() -> str:
    """Return the digest of the program that the arena is part of, whose version does not change with every commit."""
    digest = hashlib.sha256()
    for path in sorted(Path(modalscope.__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


@cache
def all_contestants() -> dict[str, Contestant]:
    """Return every contestant by its name."""
    found = []
    for path in sorted(CONTESTANTS.glob("[!_]*.py")):
        module = loaded(str(path))
        told = (module.SOURCE, path, tuple(module.REQUIRES), tuple(module.TAKES))
        found += [Contestant(name, what, *told) for name, what in module.VARIANTS.items()]
    for path in sorted(HANDED.glob("*/program.toml")):
        about = tomllib.loads(path.read_text("utf-8"))
        handed = (f"{about['name']}, handed in",)
        found.append(Contestant(about["name"], about["what"], about["settings"], path.parent, handed, ()))
    return {each.name: each for each in sorted(found, key=lambda each: (each.name != "modalscope", each.name.lower()))}


def _run(*command: str, **environment: str) -> str | None:
    """Run a command; return what it complains of where it fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, env=os.environ | environment)
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    return None if done.returncode == 0 else (done.stderr.strip().splitlines() or ["it failed"])[-1]


def ready(contestant: Contestant) -> str | None:
    """Make the environment of a contestant unless it is there; return why there is none, where it does not install."""
    if not contestant.requires:
        return None
    place, asked = contestant.environment, "\n".join(contestant.requires)
    stamp = place / "installed"
    if stamp.is_file() and stamp.read_text("utf-8") == asked:
        return None
    shutil.rmtree(place, ignore_errors=True)
    beside, python = Path(sys.executable).parent, str(contestant.python)
    uv = shutil.which("uv", path=f"{beside}{os.pathsep}{os.environ['PATH']}")
    if uv is not None:
        wrong = _run(uv, "venv", "--quiet", "--python", sys.executable, str(place)) or _run(
            uv, "pip", "install", "--quiet", "--python", python, *contestant.requires, UV_LINK_MODE="copy"
        )
    else:
        venv.create(place, with_pip=True)
        wrong = _run(python, "-m", "pip", "install", "--quiet", *contestant.requires)
    if wrong is None:
        stamp.write_text(asked, "utf-8")
    return wrong
