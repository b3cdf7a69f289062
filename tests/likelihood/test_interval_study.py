"""Do intervals of 95 % hold the truth, for data of every kind and through the whole program?"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.likelihood.interval_cases import KINDS, Kind, found
from tests.studies import Study

#: First seed, and cases a kind: some are dear.
FIRST, MANY, FEW = 3000, 50, 16


@pytest.mark.study("standard-deviations")
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name.replace(" ", "-"))
def test_study_of_intervals_through_the_whole_program(kind: Kind, study: Callable[[str, str], Study]) -> None:
    """Of 300 modes a coverage of 95 % is known to 1.3 %, and what is asked leaves twice that."""
    count = MANY if kind.swift else FEW
    each = [found(kind, seed) for seed in range(FIRST, FIRST + count)]
    complete = [one for one in each if one.found == one.true and not one.false]
    table = study(f"{kind.name}, whole program", f"{count} structures, seeds {FIRST} to {FIRST + count - 1}")
    for words, some in (("", each), (", complete lists", complete)):
        held = np.concatenate([one.held for one in some])
        error = 200 * np.sqrt(0.05 * 0.95 / max(len(held), 1))
        for name, column in zip(("f", "zeta"), held.T, strict=True):
            least = {"least": kind.least - error} if some is complete else {}
            table.row(
                f"coverage of 95 % intervals, {name}{words}, {len(held)} modes",
                100 * column.mean(),
                form=".1f",
                unit=" %",
                **least,
            )
    table.row(
        "modes found", 100 * sum(one.found for one in each) / sum(one.true for one in each), form=".0f", unit=" %"
    )
    table.row("modes left open", sum(one.open for one in each), form=".0f")
    table.row("poles that are no modes", sum(one.false for one in each), form=".0f")
    assert not table.missed
