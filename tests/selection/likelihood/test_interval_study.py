"""Do intervals of 95 % hold the truth, for data of every kind and through the whole program?"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from modalscope.numerics.checks import RealArray
from tests.selection.likelihood.interval_cases import KINDS, Found, Kind, found, numbers_of
from tests.studies import Study

#: First seed.
FIRST = 4000


@pytest.mark.study("standard-deviations")
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.replace(" ", "-"))
def test_study_of_intervals_through_the_whole_program(kind: Kind, study: Callable[[str, str], Study]) -> None:
    """What is asked leaves twice the sampling error of a coverage of 95 %."""
    seeds = range(FIRST, FIRST + kind.count)
    each = [found(kind, seed) for seed in seeds]
    truths = truths_of(kind, seeds, each)
    held = [one.held(truth) for one, truth in zip(each, truths, strict=True)]
    table = study(f"{kind.name}, whole program", f"{kind.count} records, seeds {FIRST} to {FIRST + kind.count - 1}")
    for words, some in (
        ("", held),
        (", complete lists", [h for h, one in zip(held, each, strict=True) if one.complete]),
    ):
        all_held = np.concatenate(some) if some else np.zeros((0, 2))
        error = 200 * np.sqrt(0.05 * 0.95 / max(len(all_held), 1))
        for name, column in zip(("f", "zeta"), all_held.T, strict=True):
            least = {"least": kind.least - error} if words else {}
            table.row(
                f"coverage of 95 % intervals, {name}{words}, {len(column)} modes",
                100 * float(column.mean()) if len(column) else np.nan,
                form=".1f",
                unit=" %",
                **least,
            )
    table.row("modes found", 100 * sum(o.right for o in each) / sum(o.true for o in each), form=".0f", unit=" %")
    table.row("modes left open", sum(one.open for one in each), form=".0f")
    table.row("poles that are no modes", sum(one.false for one in each), form=".0f")
    assert not table.missed


def truths_of(kind: Kind, seeds: Sequence[int], each: Sequence[Found]) -> list[RealArray]:
    """Return frequency and damping of the modes of every case: of the structure, or the mean over the draws that it has."""
    truths = [numbers_of(kind.make(seed)[1]) for seed in (seeds if not kind.draws else seeds[:: kind.draws])]
    if not kind.draws:
        return truths
    for k, truth in enumerate(truths):
        own = each[k * kind.draws : (k + 1) * kind.draws]
        which, values = (np.concatenate([getattr(one, name) for one in own]) for name in ("which", "values"))
        for j in np.unique(which):
            truth[j] = values[which == j].mean(axis=0)
    return [truth for truth in truths for _ in range(kind.draws)]
