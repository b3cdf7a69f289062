"""Obey every option that `info` prints for tests of the grammar, and count those that work at the first try.

    python -m benchmarks.exports.remedies FIRST COUNT [-v]

An option works where the command ends well with it, and what printed it is not said again.
"""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.exports import several
from benchmarks.exports.draw import HALVES, draw_choices
from benchmarks.exports.verdict import suggestions
from benchmarks.exports.write import write
from modalscope.interfaces.cli import main


def told(files: list[str], way: list[str]) -> tuple[int, list[str]]:
    """Return the status of `info` with some options, and the lines that it prints."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            status = main(["info", *files, *way])
        except SystemExit as error:  # an option that the command line does not know
            status = int(error.code or 0)
    return status, out.getvalue().splitlines()


def tried(files: list[str], rate: float | None) -> Iterator[tuple[str, bool, str]]:
    """Yield every option that `info` prints for files, whether it works, and the line that printed it or what came of it."""
    _, lines = told(files, [])
    for line in lines:
        for way in suggestions(line):
            words = [f"{rate or 1000.0:.9g}" if word == "HZ" else word for word in way]
            status, after = told(files, words)
            works = status == 0 and line not in after
            yield shlex.join(way), works, line if works else f"{line}\n      -> {after[-1] if after else status}"


def measure(first: int, count: int) -> list[tuple[str, bool, str]]:
    """Return what came of the options of so many tests of several files or in one, and as many of one file."""
    rows = []
    for seed in range(first, first + count):
        with tempfile.TemporaryDirectory() as name:
            test = several.drawn_test(Path(name), seed)
            rows += tried([str(path) for path in test.paths], test.drawn[0].truth.rate)
            half = list(HALVES)[seed % 2]
            one = write(Path(name), seed, draw_choices(np.random.default_rng([seed, 0]), half))
            rows += tried([str(one.path)], one.truth.rate)
    return rows


if __name__ == "__main__":
    found = measure(int(sys.argv[1]), int(sys.argv[2]))
    for way, works, message in found:
        if not works and "-v" in sys.argv:
            print(f"--- {way}\n    {message}")
    print(
        f"{len(found)} options, {100 * sum(works for _, works, _ in found) / max(1, len(found)):.1f} % work at the first try"
    )
