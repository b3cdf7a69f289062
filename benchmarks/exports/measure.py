"""Measure the reader on seeds of the grammar. `python -m benchmarks.exports.measure FIRST COUNT [near|far] [-v]`."""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from benchmarks.exports.draw import HALVES, PLAIN
from benchmarks.exports.verdict import COSTS, shrunk, tried
from benchmarks.exports.write import Drawn

#: Verdict, half, choices a file.
Row = tuple[str, str, dict[str, str]]


def measure(first: int, count: int, halves: tuple[str, ...] = tuple(HALVES), report: bool = False) -> list[Row]:
    """Return the verdicts on `count` seeds of each half in turn."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        for k in range(count):
            half = halves[k % len(halves)]
            drawn, word, message = tried(Path(name), first + k, half)
            rows.append((word, half, drawn.choices))
            if report and COSTS[word] >= 0.2 and half in halves:
                _reported(Path(name), first + k, drawn, word, message)
            drawn.path.unlink()
    return rows


def by_dimension(rows: list[Row]) -> dict[str, dict[str, list[str]]]:
    """Return the verdicts on the files of every value of every dimension."""
    by: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for word, _, choices in rows:
        for name, value in sorted(choices.items()):
            if name not in ("half", "maker"):
                by[name][value].append(word)
    return {name: dict(sorted(values.items())) for name, values in sorted(by.items())}


def table(rows: list[Row]) -> str:
    """Return shares of the verdicts, in all, by half and by dimension."""
    lines = []
    for title in ("all", *HALVES):
        of = [word for word, half, _ in rows if title in ("all", half)]
        lines.append(
            f"{title:6} {len(of):5} " + "  ".join(f"{w} {100 * of.count(w) / max(1, len(of)):.1f}" for w in COSTS)
        )
    for name, values in by_dimension(rows).items():
        for value, words in values.items():
            good = sum(word in ("right", "names or units lost") for word in words)
            silent = sum(word in ("wrong in silence", "crash") for word in words)
            shares = f"right {100 * good / len(words):5.1f}  in silence {100 * silent / len(words):4.1f}"
            lines.append(f"{name:10} {value:20} {len(words):4}  {shares}")
    return "\n".join(lines)


def _reported(folder: Path, seed: int, drawn: Drawn, word: str, message: str) -> None:
    """Print what is left of a file's choices when all that may be plain is plain."""
    simple = shrunk(folder, seed, drawn.choices, word)
    odd = {key: value for key, value in simple.items() if PLAIN.get(key) != value and key not in ("maker", "half")}
    print(f"--- {seed} {word}: {odd}\n    {message[:400]}")


if __name__ == "__main__":
    chosen = tuple(word for word in sys.argv[3:] if word in HALVES) or tuple(HALVES)
    print(table(measure(int(sys.argv[1]), int(sys.argv[2]), chosen, "-v" in sys.argv)))
