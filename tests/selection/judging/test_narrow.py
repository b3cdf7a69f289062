"""Narrow bands of structures whose errors are no white noise: lists without what is none, and shapes of their own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.indicators import mac
from modalscope.numerics.checks import IntArray
from tests.selection.judging.hard import score
from tests.selection.judging.narrow import FEWEST, narrow_case, narrow_gains
from tests.studies import Study


def judged(seeds: range) -> IntArray:
    """Return cases, lists that hold all modes above 10 deviations and nothing else, modes that are none, and shapes with a MAC below .9."""
    counts = np.zeros(4, int)
    for seed in seeds:
        case = narrow_case(seed)
        if case.lines.size < FEWEST:
            continue
        true, modes = case.within, ms.select(ms.stabilize(case.response, band=case.band))
        found = score(true, modes)
        nearest = np.argmin(np.abs(true.poles[:, None] - modes.poles), axis=1) if len(modes) else np.zeros(0, int)
        alike = [
            mac(modes.shapes[:, [nearest[j]]], np.linalg.svd(true.residues[j])[0][:, [0]])[0, 0]
            for j in np.flatnonzero(found.found)
        ]
        counts += [1, found.perfect(narrow_gains(case) > 10), found.spurious, np.sum(np.array(alike) < 0.9)]
    return counts


@pytest.mark.slow
def test_a_narrow_band_lists_its_modes_with_their_own_shapes() -> None:
    cases, complete, spurious, foreign = judged(range(300, 302))
    assert (cases, complete, spurious) == (2, 2, 0)
    assert foreign <= 1  # of some sixteen: the study has the share


@pytest.mark.study("bands")
def test_study_of_narrow_bands(study: Callable[[str, str], Study]) -> None:
    """Seeds that nothing was developed on; shares are known to 3, 1.5 and 2.5 %."""
    cases, above10, spurious, foreign = judged(range(40000, 40150))
    found = study("narrow band, coloured errors", f"{cases} bands of seeds 40000 to 40149")
    share = 100 / cases
    found.row("lists with all modes of significance 10, no others", share * above10, least=81, unit=" %")
    found.row("false modes over lists", share * spurious, most=6, unit=" %")
    found.row("shapes with MAC below 0.9 over lists", share * foreign, most=15, unit=" %")
    assert not found.missed
