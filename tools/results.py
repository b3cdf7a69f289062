"""Results of small jobs of every kind, held against those that stand in `tests/results/reference.json`.

    python -m tools.results [--jobs 2] [WORD]   run the jobs whose names hold the word, and say what differs
    python -m tools.results --write [WORD]      write what they give instead

The jobs are in `tools/jobs.py`, those on real tests in `tools/real_tests.py`. What they give is kinds, keys and numbers: the texts of
messages may change. A job without its data is skipped; with MODALSCOPE_NEED_DATA=1 it fails.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

__all__ = ["KERNEL", "SHAPES", "TOLERANCES", "differences", "kernel", "main", "result_of", "written"]

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = ROOT / "tests" / "results" / "reference.json"

#: Values of lists of different lengths that differ by less, relative, are the same one.
_NEAR = 1e-3
#: Largest relative difference of the numbers under a key; all else is equal.
TOLERANCES = {"frequencies": 1e-9, "damping": 1e-7, "deviations": 1e-6, "values": 1e-9}
#: The same of lists of real tests, which are to hold on every processor (see `tools.real_tests`): ten times what was seen of frequencies,
#: four times of damping, and less than what a mode that matters explains.
TOLERANCES |= {"f": 1e-5, "zeta": 5e-3, "explained": 1e-3}

#: The same of the standard deviations of real tests.
TOLERANCES |= {"f_std": 0.02, "zeta_std": 0.02, "shapes_std": 0.02}

#: Values of real tests that moved by less than this part of their deviation are the same: processors round otherwise, and modes that the
#: data hardly determine move with it. So are deviations of doubtful modes within this factor.
_MAX_MOVED, _MAX_DOUBTFUL = 0.15, 1.5

#: Under this key stand shapes, a list a mode: real and imaginary part of every component in turn. They differ where 1 - MAC exceeds this.
SHAPES, _MAX_UNLIKE = "shapes of modes", 1e-5

#: Under this key stands the kernel of the linear algebra library that the reference was written on.
KERNEL = "written on"

#: A job without its data, or without a package that reads them, gives this alone, with what is missing.
SKIPPED = "skipped"
#: Data are not there, and the environment says that they must be.
_LACKING = "is not there"


def lacks_data(found: Any) -> bool:
    """Whether a job was skipped for want of data although MODALSCOPE_NEED_DATA=1 asks for them."""
    return os.environ.get("MODALSCOPE_NEED_DATA") == "1" and str(found.get(SKIPPED, "")).endswith(_LACKING)


def differences(expected: Any, found: Any, place: str = "", tolerance: float = 0.0) -> Iterator[str]:
    """Yield in words where two results differ; a key of `TOLERANCES` holds for all below it."""
    if isinstance(expected, dict) and isinstance(found, dict):
        found = _without_rounding(expected, found)
        for key in [*expected, *(key for key in found if key not in expected)]:
            inside = f"{place}.{key}" if place else key
            if key not in found:
                yield f"{inside}: missing"
            elif key not in expected:
                yield f"{inside}: new"
            else:
                how = _unlike if key == SHAPES else differences
                yield from how(expected[key], found[key], inside, TOLERANCES.get(key, tolerance))
    elif isinstance(expected, list) and isinstance(found, list) and len(expected) == len(found):
        for index, pair in enumerate(zip(expected, found, strict=True)):
            yield from differences(*pair, f"{place}[{index}]", tolerance)
    elif _are_numbers(expected) and _are_numbers(found):
        lost, new = _without(expected, found), _without(found, expected)
        yield f"{place}: {len(expected)} -> {len(found)} values; lost {_short(lost)}, new {_short(new)}"
    elif not _same(expected, found, tolerance):
        yield f"{place}: {_short(expected)} -> {_short(found)}"


def _without_rounding(expected: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """Return what was found of a real test, with what processors may round otherwise as it is expected."""
    numbers = [each.get(key) for each in (expected, found) for key in ("f", "f_std", "zeta", "zeta_std")]
    if not all(numbers) or expected.get("grades", ()) != found.get("grades"):
        return found
    doubtful, changed = np.array(expected["grades"]) == "doubtful", dict(found)
    for name in ("f", "zeta"):
        pairs = (np.array([expected[key], found[key]], float) for key in (name, f"{name}_std"))
        (value, new), (deviation, other) = pairs
        near = np.abs(new - value) < _MAX_MOVED * deviation
        alike = doubtful & near & (np.abs(np.log(other / deviation)) < np.log(_MAX_DOUBTFUL))
        for key, same in ((name, near), (f"{name}_std", alike)):
            changed[key] = [a if is_same else b for a, b, is_same in zip(expected[key], found[key], same, strict=True)]
    return changed


def _unlike(expected: Any, found: Any, place: str, tolerance: float) -> Iterator[str]:
    """Yield in words which shapes differ; `tolerance` is that of other numbers."""
    if [len(each) for each in expected] != [len(each) for each in found]:
        yield f"{place}: {len(expected)} -> {len(found)} shapes"
        return
    for index, pair in enumerate(zip(expected, found, strict=True)):
        a, b = (np.reshape(each, (-1, 2)) @ [1, 1j] for each in pair)
        unlike = 1 - abs(np.vdot(a, b)) ** 2 / max(np.vdot(a, a).real * np.vdot(b, b).real, 1e-300)
        if unlike > _MAX_UNLIKE:
            yield f"{place}[{index}]: 1 - MAC {unlike:.2g}"


def _without(values: list[float], others: list[float]) -> list[float]:
    """Return the values that are near none of the others."""
    return [each for each in values if not any(math.isclose(each, other, rel_tol=_NEAR) for other in others)]


def _are_numbers(values: Any) -> bool:
    return isinstance(values, list) and all(isinstance(each, int | float) for each in values)


def _same(expected: Any, found: Any, tolerance: float) -> bool:
    if type(expected) is type(found) is float or {type(expected), type(found)} == {int, float}:
        return math.isclose(found, expected, rel_tol=0, abs_tol=tolerance * abs(expected))
    return type(expected) is type(found) and bool(expected == found)


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 300 else text[:300] + " ..."


def written(value: Any, indent: str = "") -> str:
    """Return JSON with a line for every key, and every list of numbers and words on one line."""
    if isinstance(value, dict) and value:
        inner = indent + " "
        entries = (f"{inner}{json.dumps(key)}: {written(each, inner)}" for key, each in value.items())
        return "{\n" + ",\n".join(entries) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(each, dict | list) for each in value):
        inner = indent + " "
        return "[\n" + ",\n".join(f"{inner}{written(each, inner)}" for each in value) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)


def result_of(name: str) -> tuple[str, Any, float]:
    """Run one job in an empty folder, on one core; return its name, what it gave and the CPU seconds."""
    from tools.real_tests import JOBS, Missing  # needs the package, which says nothing of how results are compared

    back = Path.cwd()
    started = time.process_time()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.chdir(folder)
        try:
            found = JOBS[name]()
        except Missing as missing:
            found = {SKIPPED: str(missing)}
        except Exception:  # noqa: BLE001 - a job that breaks down differs from the reference; the others are run
            traceback.print_exc()
            found = {"broken": True}
        finally:
            os.chdir(back)
    return name, json.loads(json.dumps(found)), time.process_time() - started


def _results(names: list[str], processes: int) -> Iterator[tuple[str, Any, float]]:
    if processes == 1:
        yield from map(result_of, names)
        return
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        yield from pool.map(result_of, names)


def kernel() -> str:
    """Return the libraries of linear algebra with their kernels: sums of another order end in other digits."""
    found = {
        f"{each['internal_api']} {each['version']} {each.get('architecture', '')}".strip() for each in threadpool_info()
    }
    return ", ".join(sorted(found)) or "no library that tells its kernel"


def main(arguments: list[str] | None = None) -> int:
    """Run the jobs, and compare or write; 1 where something differs."""
    parser = argparse.ArgumentParser(prog="python -m tools.results")
    parser.add_argument("word", nargs="?", default="", help="run the jobs whose names hold this")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--write", action="store_true", help="write the reference instead")
    asked = parser.parse_args(arguments)
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):  # sums of one order alone
        if os.environ.get(threads) != "1":
            os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
            os.execv(sys.executable, [sys.executable, "-m", "tools.results", *(arguments or sys.argv[1:])])
    from tools.real_tests import JOBS

    names = [name for name in JOBS if asked.word in name]
    reference = json.loads(REFERENCE.read_text("utf-8")) if REFERENCE.exists() else {}
    wrong, total = 0, 0.0
    for name, found, seconds in _results(names, asked.jobs):
        total += seconds
        skipped = SKIPPED in found
        told = [] if skipped or asked.write else list(differences(reference.get(name, {}), found))
        told += ["MODALSCOPE_NEED_DATA=1"] if lacks_data(found) else []
        print(f"{seconds:6.2f} s  {name}{': skipped, ' + found[SKIPPED] if skipped else ''}", flush=True)
        for line in told:
            print(f"          {line}", flush=True)
        wrong += bool(told)
        if asked.write and not skipped:
            reference[name] = found
    if asked.write:
        REFERENCE.parent.mkdir(exist_ok=True)
        ordered = {KERNEL: kernel(), **{name: reference[name] for name in JOBS if name in reference}}
        REFERENCE.write_text(written(ordered) + "\n", "utf-8")
    print(f"{len(names)} jobs, {total:.0f} CPU s" + ("" if asked.write else f": {wrong} differ"))
    print(
        f"on {kernel()}"
        + ("" if asked.write else f"; the reference was written on {reference.get(KERNEL, 'what nobody noted')}")
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
