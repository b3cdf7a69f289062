"""Attack what SECURITY.md promises: `make attack SEED=3`, or `python -m tests.attack.harness 3`.

Files: a corpus of all suffixes, damaged by the mutations of `tests.io.mutations`, each read in a process with limits (`tests.io.fuzz`).
Values: those of `tests.arguments`, at every argument of every public name. What ends in anything but an answer or a DataError, or takes
more than 4 s for a file or 20 s for a call, is printed.
Files whose fields contradict each other (`built`), tests told in other units and orders (`moved`), commands that are killed, on a full disk
or with few descriptors (`cut_off`): what they answer otherwise than they may is printed, too. Two processes work; after 25 minutes no
more is begun, and what is left out counts as a fault.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import multiprocessing
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modalscope.data import DataError
from tests.extras.test_meshes import FILES as MESHES
from tests.io import corpus, fuzz, ordinary, test_recorders, test_stored
from tests.io.apart import read

#: What a whole attack has of each kind: damaged and built files, wrong values, data sets told otherwise, kills.
COUNTS = {"files": 20_000, "built": 10_000, "values": 10_000, "sets": 2000, "kills": 300}

#: Seconds after which no further part is begun, and how many of one kind are a part.
_LONGEST, _PARTS = 1500.0, 10

#: Files that other packages write, by name: each is left out where its package is not installed.
WRITTEN: dict[str, Callable[[Path], None]] = {
    "record.tdms": test_recorders.write_tdms,
    "record.mf4": test_recorders.write_mdf,
    "record.mdf": lambda path: test_recorders.write_mdf(path, "3.30"),
    "record.nc": test_recorders.write_netcdf,
    "classic.nc": lambda path: test_recorders.write_netcdf(path, "scipy"),
    "record.parquet": test_recorders.write_parquet,
    **{f"mesh{suffix}": test_recorders.write_mesh for suffix in (".vtu", ".ply", ".stl", ".obj")},
    "text.ply": lambda path: test_recorders.write_mesh(path, binary=False),
    "three.zarr": lambda path: test_stored.zarr_folder(path, np.ones((1500, test_stored.CHANNELS))),
    "two.zarr": lambda path: test_stored.zarr_folder(path, np.ones((1500, test_stored.CHANNELS)), zarr_format=2),
}


def whole_files(folder: Path) -> list[Path]:
    """Write a corpus of all suffixes, and return its files; those that need an option are left out."""
    corpus.write(folder)
    for name, case in ordinary.CASES.items():
        case.write(folder / f"{name.replace(' ', '-')}{case.suffix}")
    for name, text in MESHES.items():
        (folder / f"mesh-{name}").write_text(text)
    (folder / "points.csv").write_text("node,x,y,z\n" + "".join(f"{k},{k},0,0\n" for k in range(9)))
    np.save(folder / "array.npy", np.arange(60.0).reshape(30, 2))
    for name, write in WRITTEN.items():
        with contextlib.suppress(pytest.skip.Exception):
            write(folder / name)
    found = []
    for path in sorted(folder.iterdir()):
        try:
            read(path)
        except DataError:
            path.unlink()
        else:
            found.append(path)
    return found


@functools.cache
def _whole() -> tempfile.TemporaryDirectory[str]:
    """Write the corpus once for all parts: it takes 20 s of the processor, as much as 300 damaged files."""
    place = tempfile.TemporaryDirectory()
    whole_files(Path(place.name))
    return place


def files(count: int, seed: int) -> list[str]:
    """Read so many damaged files, and return what ended in other ways than it may."""
    whole = Path(_whole().name)
    suffixes = {path.suffix for path in whole.iterdir()}
    with tempfile.TemporaryDirectory() as work:
        tally = fuzz.run(Path(work), whole, count, workers=1, seed=seed)
    print(f"{count} damaged files of {len(suffixes)} suffixes, seed {seed}: {tally}")
    return [str(fault) for fault in tally.faults]


def asked(seed: int) -> Iterator[tuple[str, Any, dict[str, Any], str, str]]:
    """Give calls in an order of the seed, each with an argument and the name of a wrong value for it."""
    from tests.arguments import WRONG, calls

    pairs = [(call, wrong) for call in calls() for wrong in WRONG]
    for k in np.random.default_rng(seed).permutation(len(pairs)):
        (name, call, given, argument), wrong = pairs[int(k)]
        yield name, call, given, argument, wrong


def values(count: int, seed: int, leave: tuple[str, ...] = ()) -> list[str]:
    """Make so many calls with one wrong value each, and return those that are answered in other words than a DataError's."""
    from matplotlib import pyplot

    from tests.arguments import WRONG, judge
    from tests.test_every_argument import within

    told, done = [], 0
    warnings.simplefilter("ignore")
    for name, call, given, argument, wrong in asked(seed):
        if done == count:
            break
        if name in leave:
            continue
        done += 1
        try:
            with within(20):
                answer = judge(call, given, argument, WRONG[wrong]())
        except TimeoutError:
            answer = "no answer within 20 s"
        if answer:
            told.append(f"{name}({argument}={wrong}): {answer}")
        pyplot.close("all")
    print(f"{done} wrong values, seed {seed}: {len(told)} answered in other words than a DataError's")
    return told


def attacked(name: str, count: int, seed: int, until: float) -> list[str]:
    """Make one part of an attack, unless it is too late (s of the monotonic clock): a part that is left out is a fault, too."""
    from tests.attack import built, cut_off, moved

    attacks = {"files": files, "built": built.files, "values": values, "sets": moved.sets, "kills": cut_off.kills}
    if time.monotonic() > until:
        return [f"{count} {name} of seed {seed} were left out: time was over"]
    told = attacks[name](count, seed)
    sys.stdout.flush()
    return told


def main() -> int:
    from tests.attack import cut_off

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seed", type=int)
    parser.add_argument("--workers", type=int, default=2)
    for name, count in COUNTS.items():
        parser.add_argument(f"--{name}", type=int, default=count)
    options = parser.parse_args()
    begun = time.monotonic()
    told = cut_off.want()
    parts = [(name, -(-getattr(options, name) // _PARTS), part) for part in range(_PARTS) for name in COUNTS]
    with ProcessPoolExecutor(options.workers, multiprocessing.get_context("spawn")) as pool:
        waiting = [
            pool.submit(attacked, name, count, _PARTS * options.seed + part, begun + _LONGEST)
            for name, count, part in parts
            if count
        ]
        told += [fault for done in waiting for fault in done.result()]
    print(*told, f"{time.monotonic() - begun:.0f} s, {len(told)} faults", sep="\n")
    return bool(told)


if __name__ == "__main__":
    sys.exit(main())
