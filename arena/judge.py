"""Our own row of the arena, run anew, against the stored one: `python -m arena.judge`, a part of `make results`.

Lists that change are printed. It fails where one of the scores falls by more than chance: of the modes (or sets) that differ so many
are worse that as many or more would be by a fair coin in fewer than one case of fifty. Six of six are, five of five are not.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from math import comb
from typing import Any

import modalscope as ms
from arena.pages import OURS, SCORES
from arena.programs import all_contestants
from arena.run import tried
from arena.sets import Missing, all_sets

__all__ = ["chance", "changes", "fallen"]

Told = dict[str, Any]

#: Less is no chance.
_LEAST = 0.02

#: A shape is worse whose 1 - MAC grows by this factor, beyond the second.
_WORSE, _ROUNDING = 1.5, 1e-4


def chance(worse: int, better: int) -> float:
    """Return the probability that of all that differ as many or more are worse by a fair coin: sum of C(n, k) / 2^n, k >= worse."""
    n = worse + better
    return sum(comb(n, k) for k in range(worse, n + 1)) / 2**n


def changes(before: Told, now: Told) -> Iterator[tuple[str, int]]:
    """Yield what changed in the run of a set: the score, and how many are worse (negative: better)."""
    a, b = ({mode["known"]: mode for mode in run.get("modes", []) if mode["is"] == "found"} for run in (before, now))
    yield "found", len(set(a) - set(b))
    yield "found", -len(set(b) - set(a))
    wrong = [sum(mode["is"] in ("false", "twice") for mode in run.get("modes", [])) for run in (before, now)]
    yield "false or twice", wrong[1] - wrong[0]
    silent = [sum(mode["wrong"] and not mode["marked"] for mode in run.get("modes", [])) for run in (before, now)]
    yield "wrong without a word", silent[1] - silent[0]
    for known in set(a) & set(b):
        one, other = a[known], b[known]
        yield "right modes marked as unsure", int(other["marked"]) - int(one["marked"])
        for key in ("f_held", "zeta_held"):
            if key in one and key in other:
                yield "intervals that hold", int(one[key]) - int(other[key])
        x, y = (max(mode.get("shape_error") or 0.0, _ROUNDING) for mode in (one, other))
        yield "shapes", int(y > _WORSE * x) - int(x > _WORSE * y)


def fallen(before: dict[str, Told], now: dict[str, Told]) -> list[str]:
    """Return the scores that fell by more than chance, in words; runs by set."""
    counts: dict[str, list[int]] = {}
    for name in before.keys() & now.keys():
        for score, worse in changes(before[name], now[name]):
            each = counts.setdefault(score, [0, 0])
            each[worse < 0] += abs(worse)
    return [
        f"{score}: {worse} worse, {better} better"
        for score, (worse, better) in sorted(counts.items())
        if chance(worse, better) < _LEAST
    ]


def _listed(run: Told) -> str:
    return ", ".join(f"{mode['f']:.5g} {mode['is']}" for mode in run.get("modes", [])) or run["status"]


def main(arguments: list[str] | None = None) -> int:
    """Run our own row on the sets whose names hold the word, and compare; 1 where a score fell."""
    parser = argparse.ArgumentParser(prog="python -m arena.judge")
    parser.add_argument("word", nargs="?", default="")
    word = parser.parse_args(arguments).word
    held = json.loads(SCORES.read_text("utf-8"))["sets"]
    before = {n: e["results"][OURS] for n, e in held.items() if word in n and e["scored"] and OURS in e["results"]}
    now = {}
    for name in before:
        try:
            now[name] = tried(all_sets()[name], [all_contestants()[OURS]])[0]["results"][OURS]
        except (Missing, ms.DataError) as missing:
            print(f"{name}: left out: {missing}", flush=True)
            continue
        if (then := _listed(before[name])) != (today := _listed(now[name])):
            print(f"{name}:\n  {then}\n  {today}", flush=True)
    said = fallen(before, now)
    print(f"arena: {len(now)} sets; " + ("; ".join(said) if said else "no score fell by more than chance"))
    return int(bool(said))


if __name__ == "__main__":
    sys.exit(main())
