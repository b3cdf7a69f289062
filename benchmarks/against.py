"""The same work by this library and by other programs, each in an environment of its own: equal results first, then times in pairs.

`python -m benchmarks.against [WORDS]` does the works whose names hold the words. The table is written to build/bench/table.md.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks.peers.install import PLACE, python_of
from benchmarks.peers.pairs import Child, Measured, paired
from benchmarks.peers.works import WORKS, Work

_HEAD = "| work | program | ours, CPU s | theirs | ratio | ours, MB | theirs | poles differ by |\n|---|---|---|---|---|---|---|---|\n"


def row(work: Work, who: str, found: Measured) -> str:
    """Return a line of the table."""
    times = f"{found.ours:.3g} | {found.theirs:.3g} | {found.ratio:.2g}"
    return f"| {work.name} | {who} | {times} | {found.our_peak:.0f} | {found.their_peak:.0f} | {found.difference:.0e} |"


def rows(work: Work) -> Iterator[tuple[str, bool]]:
    """Yield the lines of one piece of work, and whether the results are equal."""
    arrays = work.data()
    with ExitStack() as held:
        path = Path(held.enter_context(tempfile.TemporaryDirectory())) / "data.npz"
        np.savez(path, **arrays)
        waiting = {
            own: held.enter_context(Child("modalscope", own, path)) for own in {own for *_, own, _ in work.peers}
        }
        for program, function, own, equal in work.peers:
            if python_of(program) is None:
                yield f"| {work.name} | {program}: left out, it is not installed |", True
                continue
            with Child(program, function, path) as theirs:
                found = paired(waiting[own], theirs, arrays.get("truth"))
            yield row(work, f"{program}, {function}", found), bool(found.difference <= equal)


def main() -> None:
    """Run what is asked; fail where results are not equal."""
    words, table, unequal = sys.argv[1:], [], []
    for work in WORKS:
        if not all(word in work.name for word in words):
            continue
        for line, alike in rows(work):
            print(line if alike else f"{line} NOT EQUAL", flush=True)
            table.append(line)
            unequal += [] if alike else [line]
        if work.left_out:
            print(f"  left out: {work.left_out}", flush=True)
    PLACE.mkdir(parents=True, exist_ok=True)
    (PLACE / "table.md").write_text(_HEAD + "\n".join(table) + "\n", encoding="utf-8")
    if unequal:
        raise SystemExit(f"results are not equal in {len(unequal)} of {len(table)} rows")


if __name__ == "__main__":
    main()
