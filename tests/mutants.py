"""One-line faults put into a copy of the library, one at a time: the tests named beside each must fail.

`python -m tests.mutants [word] [--processes 2]` tries those of `mutants.toml` whose name or file holds the word, and prints what lives.
A mutant whose text does not stand exactly once in its file is a failure, and so is one that does not even load. Slow tests are run for
those alone that the others do not notice.
"""

from __future__ import annotations

import argparse
import compileall
import multiprocessing
import os
import py_compile
import shutil
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIST = Path(__file__).with_suffix(".toml")
LIBRARY = Path("src/modalscope")

#: What tests read beside the library and themselves.
BESIDE = ("pyproject.toml", "README.md", "CHANGELOG.md")

#: A fault that makes tests run this long, in seconds, is noticed.
PATIENCE = 120

#: Files and tests that are run together without a fault; each has that patience.
TOGETHER = 12

#: One thread each: several faults are tried at a time. Pictures are drawn nowhere. Measured data lie beside the project, not beside a copy.
#: What other packages would plug into pytest takes longer to load than most of these tests, and none of them needs it.
SURROUNDINGS = {
    "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
    "MPLBACKEND": "Agg",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MODALSCOPE_DATA": os.environ.get("MODALSCOPE_DATA") or str(ROOT.parent / "shared" / "data"),
}

#: What every run needs is loaded once; the library itself is not.
LOADED = [
    *("numpy", "scipy.linalg", "scipy.optimize", "scipy.signal", "matplotlib.pyplot"),
    *("threadpoolctl", "pytest", "doctest", "hypothesis.strategies"),
]

FORKS = multiprocessing.get_context("forkserver")

#: Exit status of pytest: all passed, some failed, none were chosen; and of a process that said nothing more.
PASSED, FAILED, NONE, CRASHED = 0, 1, 5, -1

#: Which tests are run: the slow ones only for a fault that the others do not notice.
QUICK, SLOW = "not study and not bench and not slow", "slow and not study and not bench"


@dataclass(frozen=True)
class Mutant:
    """One fault: a text of a file (relative to the library), what stands there instead, and the tests that must notice."""

    name: str
    file: str
    text: str
    replacement: str
    tests: tuple[str, ...]


def load(path: Path = LIST) -> list[Mutant]:
    """Return the faults of a list."""
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    return [Mutant(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]


def mutated(source: str, mutant: Mutant) -> str:
    """Return the source with the fault in it; its text must stand there exactly once."""
    count = source.count(mutant.text)
    if count != 1:
        raise ValueError(f"{mutant.name}: {mutant.text!r} occurs {count} times in {mutant.file}, not once")
    if mutant.replacement == mutant.text:
        raise ValueError(f"{mutant.name}: the replacement is the text itself")
    return source.replace(mutant.text, mutant.replacement)


def misfits(mutants: Sequence[Mutant], root: Path = ROOT) -> list[str]:
    """Return what is wrong with a list, before anything runs."""
    names = [m.name for m in mutants]
    wrong = [f"{name}: named twice" for name in sorted({n for n in names if names.count(n) > 1})]
    for mutant in mutants:
        wrong += [f"{mutant.name}: there is no {t}" for t in mutant.tests if not _is_there(root, t)]
        if not mutant.tests:
            wrong.append(f"{mutant.name}: no test is named")
        try:
            mutated((root / LIBRARY / mutant.file).read_text(encoding="utf-8"), mutant)
        except (OSError, ValueError) as error:
            wrong.append(str(error))
    return wrong


def _is_there(root: Path, test: str) -> bool:
    """Whether a file of tests, and the test in it that is named, are there."""
    file, _, name = test.partition("::")
    path, function = root / file, name.rpartition("::")[2].partition("[")[0]
    return path.is_file() and (not function or f"def {function}(" in path.read_text(encoding="utf-8"))


def copy_to(folder: Path, root: Path = ROOT) -> Path:
    """Copy what tests need; compiled files carry the hash of their source, so that a fault of the same size is never missed."""
    for name in (
        folder_name for folder_name in ("src", "tests", "benchmarks", "examples") if (root / folder_name).exists()
    ):
        shutil.copytree(root / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in BESIDE:
        if (root / name).exists():
            shutil.copy(root / name, folder)
    compileall.compile_dir(folder / "src", quiet=1, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)
    return folder


@contextmanager
def _folder() -> Iterator[Path]:
    """Give a folder for copies; where compiled files lie elsewhere, those of the copies are taken away with it."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        try:
            yield place
        finally:
            if sys.pycache_prefix:
                shutil.rmtree(Path(sys.pycache_prefix, *place.parts[1:]), ignore_errors=True)


def run(folder: Path, tests: Iterable[str], which: str = QUICK, patience: float = PATIENCE) -> tuple[int, str]:
    """Run tests against the library of a copy up to the first failure; return the exit status and the end of what was said."""
    log, end = folder / "log.txt", folder / "status.txt"
    end.unlink(missing_ok=True)
    # a fork of a server that holds what the library imports: starting anew would take longer than the tests
    child = FORKS.Process(target=_run_here, args=(folder, tuple(tests), which, log, end))
    child.start()
    child.join(patience)
    if child.is_alive():
        child.kill()
        child.join()
        return FAILED, f"longer than {patience} s"
    status = int(end.read_text()) if end.exists() else CRASHED
    return status, log.read_text(encoding="utf-8", errors="replace")[-2500:]


def _run_here(folder: Path, tests: tuple[str, ...], which: str, log: Path, end: Path) -> None:
    """Be the process that runs tests in a copy; what is said and the exit status of pytest are left in files."""
    os.chdir(folder)
    os.environ["PYTHONPATH"] = str(folder / "src")  # for the commands that tests start
    sys.path[:0] = [str(folder / "src"), str(folder)]
    for name in [name for name in sys.modules if name.partition(".")[0] in ("tests", "benchmarks")]:
        del sys.modules[name]  # those of the copy are meant
    with log.open("w") as said:
        os.dup2(said.fileno(), 1)
        os.dup2(said.fileno(), 2)
    end.write_text(str(int(pytest.main(["-x", "-q", "--no-header", "-p", "no:cacheprovider", "-m", which, *tests]))))


def attempt(folder: Path, mutant: Mutant, dear: set[str]) -> str:
    """Put one fault into a copy, run its tests and take it out again; return what is wrong, empty when it was noticed.

    Tests whose slow ones were needed are added to `dear`.
    """
    path = folder / LIBRARY / mutant.file
    source = path.read_text(encoding="utf-8")
    path.write_text(mutated(source, mutant), encoding="utf-8")
    try:
        status, words = run(folder, mutant.tests)
        if status in (PASSED, NONE):
            dear.update(mutant.tests)
            slow, words = run(folder, mutant.tests, SLOW)
            status = status if slow == NONE else slow
    finally:
        path.write_text(source, encoding="utf-8")
    if status == PASSED:
        return "LIVES"
    return "" if status == FAILED else f"BROKEN (status {status})\n{words}"


class Workshop:
    """Copies of the project, in each of which one run of tests is at work at a time."""

    def __init__(self, copies: Sequence[Path], pool: ThreadPoolExecutor) -> None:
        self.copies: SimpleQueue[Path] = SimpleQueue()
        self.pool, self.started = pool, time.perf_counter()
        for folder in copies:
            self.copies.put(folder)

    def in_a_copy(self, call: Callable[[Path], Any]) -> Any:
        """Return what a call gives in the first copy that is free."""
        folder = self.copies.get()
        try:
            return call(folder)
        finally:
            self.copies.put(folder)

    def each(self, call: Callable[[Path, Any], Any], given: Sequence[Any]) -> Iterator[Any]:
        """Yield what a call gives for each, in turn."""
        return self.pool.map(lambda one: self.in_a_copy(lambda folder: call(folder, one)), given)

    def passes(self, named: Sequence[str], which: str) -> bool:
        """Whether tests pass without a fault; what fails is printed."""

        def sound(folder: Path, tests: Sequence[str]) -> tuple[int, str]:
            return run(folder, tests, which, PATIENCE * len(tests))

        heaps = -(-len(named) // TOGETHER)
        shares = [named[k::heaps] for k in range(heaps)]
        for tests, (status, words) in zip(shares, self.each(sound, shares), strict=True):
            if status not in (PASSED, NONE):  # once more, as the tests themselves are run again once
                status, words = self.in_a_copy(lambda folder, tests=tests: sound(folder, tests))
            if status not in (PASSED, NONE):
                print(f"the tests fail without any fault\n{words}")
                return False
        print(f"without a fault {len(named)} files or tests pass, {time.perf_counter() - self.started:.0f} s")
        return True


def part_of(words: str) -> tuple[int, int]:
    """Return K and N of "K/N"."""
    first, parts = (int(word) for word in words.split("/"))
    if not 1 <= first <= parts:
        raise ValueError(words)
    return first, parts


def main(arguments: Sequence[str] | None = None, path: Path = LIST, root: Path = ROOT) -> int:
    """Try all faults; 0 when every one is noticed by tests that pass without it."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("word", nargs="?", default="", help="part of a name or a file")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--part", type=part_of, default=(1, 1), metavar="K/N", help="every N-th fault, from the K-th on"
    )
    given = parser.parse_args(arguments)
    every = load(path)
    wrong = misfits(every, root)
    if wrong:
        print(*wrong, sep="\n")
        return 1
    first, parts = given.part
    mutants = [m for m in every if given.word in m.name or given.word in m.file][first - 1 :: parts]
    if not mutants:
        print(f"no mutant has {given.word!r} in its name or file")
        return 1
    os.environ.update(SURROUNDINGS)
    FORKS.set_forkserver_preload(LOADED)
    started, dear = time.perf_counter(), set[str]()
    with _folder() as place, ThreadPoolExecutor(given.processes) as pool:
        workshop = Workshop([copy_to(place / str(k), root) for k in range(given.processes)], pool)
        if not workshop.passes(sorted({t for m in mutants for t in m.tests}), QUICK):
            return 1
        found = list(workshop.each(lambda folder, mutant: attempt(folder, mutant, dear), mutants))
        if dear and not workshop.passes(sorted(dear), SLOW):
            return 1
    left = [(mutant, words) for mutant, words in zip(mutants, found, strict=True) if words]
    for mutant, words in left:
        print(f"{words}: {mutant.name} ({mutant.file}): {mutant.text!r} -> {mutant.replacement!r}")
    print(f"{len(mutants) - len(left)} of {len(mutants)} mutants noticed, {time.perf_counter() - started:.0f} s")
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main())
