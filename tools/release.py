"""What is given away, tried as a stranger would: built, looked into, installed into empty environments, and tested there.

`python -m tools.release` (or `make release-check`) builds the source archive and the wheel, unpacks the archive, and runs its tests
against the installed wheel by every Python that is found: all of them without extras, and with extras every file of which anything was
skipped for want of one, which is all that extras can change. The page is then served from that environment with no Node to be found, and
the five starts of the documentation are made from nothing.
`--tests tests/data` runs a part of them.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urljoin
from urllib.request import HTTPCookieProcessor, build_opener
from xml.etree import ElementTree

from tools.starts import STARTS, done

__all__ = ["EXTRAS", "PYTHONS", "faults_of_wheel", "main", "served_without_node", "skipped_files"]

ROOT = Path(__file__).resolve().parents[1]

#: The first must be there; the others are tried where an interpreter is found, and never claimed else.
PYTHONS = ("3.11", "3.12", "3.13", "3.14")

#: What the tests need of their own, and the extras of the fuller environment.
TOOLS = ("hypothesis>=6.100", "pytest>=8.3", "pytest-xdist>=3.6", "pytest-cov>=6.0")
EXTRAS = "all"

#: How a test says that it wants a package; others are skipped for want of measured data, or of a browser.
WANTED = re.compile("could not import|is not installed")

#: Tests of the tree and its tools, which strangers have not, and comparisons with programs of others.
LEFT = (
    "tests/test_mutants.py",
    "tests/test_layout.py",
    "tests/test_licences.py",
    "tests/test_branches.py",
    "tests/test_sources.py",
)


def faults_of_wheel(names: Sequence[str]) -> list[str]:
    """Return what is wrong with the names of a wheel's files: nothing but the package and its metadata, and the marks of both."""
    wanted = ("modalscope/py.typed", "modalscope/__main__.py")
    missing = [f"it has no {name}" for name in wanted if name not in names]
    if not any(name.endswith("licenses/LICENSE") for name in names):
        missing.append("it has no licence")
    strange = [name for name in names if not name.startswith(("modalscope/", "modalscope-"))]
    return missing + [f"it holds {name}" for name in strange]


def main() -> int:
    """Build, look, install, test; return 1 where anything fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", nargs="+", default=["tests"], help="what is tested; all by default")
    parser.add_argument("--workers", default="2")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="modalscope-release-") as folder:
        place = Path(folder)
        archive, wheel = _built(place / "dist")
        faults = faults_of_wheel(zipfile.ZipFile(wheel).namelist())
        for fault in faults:
            print(f"{wheel.name}: {fault}")
        with tarfile.open(archive) as held:
            held.extractall(place, filter="data")
        source = place / archive.name.removesuffix(".tar.gz")
        failed = [fault for python in _pythons() for fault in _faults_by(python, place, wheel, source, options)]
        failed += [f"the start {name}" for name in STARTS if not done(name, wheel)]
    for fault in failed:
        print(f"FAILED: {fault}")
    return 1 if failed or faults else 0


def _built(folder: Path) -> tuple[Path, Path]:
    """Build both, the wheel from the archive, so that nothing comes in that the archive does not hold."""
    _run(_uv("build", "--quiet", "--out-dir", str(folder), str(ROOT)))
    return next(folder.glob("*.tar.gz")), next(folder.glob("*.whl"))


def _uv(*words: str) -> list[str]:
    return [str(Path(sys.executable).with_name("uv")), *words]


def _pythons() -> list[str]:
    """Return the interpreters to try, and name those that are not here."""
    found = [name for name in PYTHONS if answers(name)]
    for name in PYTHONS:
        if name not in found:
            print(f"Python {name}: no interpreter here, not tested")
    return found


def answers(version: str) -> bool:
    """Whether there is a Python of a version: a name on the path may be a shim that leads to none."""
    if version == f"{sys.version_info.major}.{sys.version_info.minor}":
        return True
    command = [f"python{version}", "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:
        return False
    return told.returncode == 0 and told.stdout.strip() == version


def _faults_by(python: str, place: Path, wheel: Path, source: Path, options: argparse.Namespace) -> list[str]:
    """Return what fails with one interpreter: without extras, with them, and the page."""
    told = place / f"plain-{python}.xml"
    home = _environment(python, "", place, wheel)
    good = _passes(home, source, options.tests, options.workers, told)
    faults = [] if good else [f"Python {python}, no extras"]
    readme = ["-m", "slow", "tests/test_readme.py"]  # what it says runs after a plain install
    faults += [] if _passes(home, source, readme, options.workers) else [f"Python {python}, the README"]
    home = _environment(python, EXTRAS, place, wheel)
    wanting = skipped_files(told.read_text(encoding="utf-8"))
    if wanting and not _passes(home, source, wanting, options.workers):
        faults.append(f"Python {python}, {EXTRAS}")
    return faults + [f"Python {python}, the page: {fault}" for fault in served_without_node(home, place)]


def skipped_files(told: str) -> list[str]:
    """Return the files of which any test wanted a package, from what pytest wrote as JUnit XML of the kind `xunit1`."""
    found = set()
    for case in ElementTree.fromstring(told).iter("testcase"):
        skipped = case.find("skipped")
        if skipped is not None and WANTED.search(f"{skipped.get('message')} {skipped.text}"):
            found.add(str(case.get("file")))
    return sorted(found)


def _environment(python: str, extras: str, place: Path, wheel: Path) -> Path:
    """Make an empty environment with the wheel and what its tests need."""
    home = place / f"env-{python}-{'extras' if extras else 'plain'}"
    print(f"== Python {python}, {extras or 'no extras'}", flush=True)
    _run(_uv("venv", "--quiet", "--python", python, str(home)))
    wanted = f"{wheel}[{extras}]" if extras else str(wheel)
    _run(_uv("pip", "install", "--quiet", "--python", str(home / "bin" / "python"), wanted, *TOOLS))
    return home


def _passes(home: Path, source: Path, tests: Sequence[str], workers: str, told: Path | None = None) -> bool:
    """Whether tests of the archive pass against the wheel in an environment."""
    left = [word for name in LEFT if name not in tests for word in ("--ignore", name)]
    pytest = [str(home / "bin" / "python"), "-m", "pytest", "-q", "-n", workers, "-p", "no:cacheprovider"]
    told_to = [] if told is None else [f"--junitxml={told}", "-o", "junit_family=xunit1"]
    done = subprocess.run([*pytest, *told_to, *left, *tests], cwd=source, env=_surroundings(), check=False)
    return done.returncode == 0


def _surroundings() -> dict[str, str]:
    """Return the environment without what would lead to this tree."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MODALSCOPE_NEED_DATA")}


def served_without_node(home: Path, folder: Path) -> list[str]:
    """Return what is wrong with the page that an environment serves where no Node is on the path."""
    bare = _surroundings() | {"PATH": str(home / "bin")}
    command = [str(home / "bin" / "modalscope"), "app", "--no-browser", "--folder", str(folder)]
    with subprocess.Popen(command, cwd=folder, env=bare, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            said = next((line for line in server.stdout if "http://" in line), "")
            return _faults_of_page(said[said.find("http://") :].strip()) if said else ["it was not served"]
        finally:
            server.terminate()


def _faults_of_page(address: str) -> list[str]:
    """Return what is missing of a page: its frame, its script, its style."""
    visitor = build_opener(HTTPCookieProcessor())
    with visitor.open(address, timeout=30) as answer:
        frame = answer.read().decode()
    faults = []
    for name in ("/static/page.js", "/static/page.css"):
        with visitor.open(urljoin(address, name), timeout=30) as answer:
            if name not in frame or len(answer.read()) < 1000:
                faults.append(f"it has no {name}")
    return faults


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True, env=os.environ | {"UV_LINK_MODE": "copy"})


if __name__ == "__main__":
    sys.exit(main())
