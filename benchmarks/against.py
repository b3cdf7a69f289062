"""The same work by this library and by other programs, each in an environment of its own: equal results first, then times in pairs.

`python -m benchmarks.against [WORDS]` does the works whose names hold the words. The table is written to build/bench/table.md, with
`--page` also to docs/validation/peers.md, where works that were not done keep their rows.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from benchmarks._published import commit_of, table, today
from benchmarks.peers.install import PLACE, python_of
from benchmarks.peers.pairs import Child, Measured, paired
from benchmarks.peers.works import WORKS, Work

__all__ = ["page"]

_HEAD = ("work", "program", "ours, CPU s", "theirs", "ratio", "ours, MB", "theirs", "poles differ by")

#: Where the table is published.
_PAGE = Path(__file__).parents[1] / "docs" / "validation" / "peers.md"


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


def page(lines: Sequence[str], before: Sequence[str], measured: str) -> str:
    """Return the text of the page: new lines with what says when they were `measured`, and of the other works those from before."""
    names = [(work.name, f"{who}, {function}") for work in WORKS for who, function, *_ in work.peers]
    rows = table([*_HEAD, "date", "commit"], (f"{line} {measured}" for line in lines), before, names)
    return f"""# Other programs at the same work

Written by `python -m benchmarks.against --page`, the part of `make bench` that compares. Results are compared first. Then both work in
turn, in an environment each, with one thread. The ratio is the median of theirs over ours, pair by pair: above 1 modalscope is faster.
Memory is what the work takes above the data. Two works differ in what is asked: "OKID and ERA, 4 x 2" chooses the observer's order among
nineteen by cross-validation, where modred takes one that it is given (the row below gives ours one, too); "the whole diagram" has shapes,
indicators and the stability of every pole, where sdypy-EMA computes poles alone.

{rows}
"""


def main() -> None:
    """Run what is asked; fail where results are not equal."""
    parser = argparse.ArgumentParser()
    parser.add_argument("words", nargs="*")
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    done, unequal = [], []
    for work in WORKS:
        if not all(word in work.name for word in options.words):
            continue
        for line, alike in rows(work):
            print(line if alike else f"{line} NOT EQUAL", flush=True)
            done.append(line)
            unequal += [] if alike else [line]
        if work.left_out:
            print(f"  left out: {work.left_out}", flush=True)
    PLACE.mkdir(parents=True, exist_ok=True)
    lines = [f"| {' | '.join(_HEAD)} |", "| --- " * len(_HEAD) + "|", *done]
    (PLACE / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    if unequal:
        raise SystemExit(f"results are not equal in {len(unequal)} of {len(done)} rows")
    if options.page:
        before = _PAGE.read_text(encoding="utf-8").splitlines() if _PAGE.is_file() else []
        _PAGE.write_text(page(done, before, f"{today()} | {commit_of(_PAGE.parent)} |"), encoding="utf-8")


if __name__ == "__main__":
    main()
