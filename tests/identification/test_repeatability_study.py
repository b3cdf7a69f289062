"""How far the runs of a measured aircraft disagree, beside halves of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from tests.studies import Study
from tests.support import measured

#: Ten runs of two accelerometers under one shaker.
RUNS = np.repeat(np.arange(10), 2)

#: The modes of two close pairs exchange what they have between halves: nothing is promised for them.
CLOSE = (9.17, 9.47, 18.98, 19.1)


def aircraft() -> ms.FrequencyResponse:
    """Return the response with the accelerometers, which were roved, as its inputs, by reciprocity: groups are columns."""
    with np.load(measured("hati_gvt", "hati_ws3_frf.npz")) as file:
        values, lines = file["H"][:, None, :], file["freq"]
    data = ms.FrequencyResponse(values=values, frequencies=lines, quantity="acceleration", groups=tuple(RUNS.tolist()))
    return data.band(3, 36)


def beside_halves(count: int) -> tuple[ms.ModalModel, np.ndarray]:
    """Return the refined modes, and the deviations of f and zeta that random halves of the runs show, (2, n)."""
    data = aircraft()
    found = ms.refine(data, ms.select(ms.stabilize(data)))
    differences, rng = [], np.random.default_rng(0)
    for _ in range(count):
        first = np.isin(RUNS, rng.permutation(10)[:5])
        parts = [[int(i) for i in np.flatnonzero(half)] for half in (first, ~first)]
        a, b = (ms.refine(data.select(inputs=part), found.select(inputs=part)) for part in parts)
        assert len(a) == len(b) == len(found)
        differences.append([a.frequencies - b.frequencies, a.damping_ratios - b.damping_ratios])
    return found, np.sqrt(np.mean(np.square(differences), axis=0)) / 2


def far_apart(found: ms.ModalModel) -> np.ndarray:
    """Return which modes belong to no close pair."""
    return np.min(np.abs(found.frequencies[:, None] - CLOSE), axis=1) > 0.1


@pytest.mark.study("refinement")
def test_study_of_thirty_halves(study: Callable[[str, str], Study]) -> None:
    found, halves = beside_halves(30)
    f, zeta = found.frequencies, found.damping_ratios
    told = np.array([found.frequencies_repeatability, found.damping_ratios_repeatability])
    ratio, kept = halves / told, far_apart(found)
    missed = []
    for k in range(len(found)):
        table = study(
            f"aircraft, 10 runs, {f[k]:.2f} Hz" + " (close pair)" * (not kept[k]),
            "30 random halves of the runs, seed 0",
        )
        noise = found.frequencies_std[k]
        for what, value in (("noise", noise), ("repeatability of runs", told[0, k]), ("halves", halves[0, k])):
            table.row(f"relative standard deviation of f, {what}", value / f[k], form=".1e")
        for what, value in (("repeatability of runs", told[1, k]), ("halves", halves[1, k])):
            table.row(f"relative standard deviation of zeta, {what}", 100 * value / zeta[k], form=".1f", unit=" %")
        limits = {"least": 0.33, "most": 3} if kept[k] else {}
        for name, value in zip(("f", "zeta"), ratio[:, k], strict=True):
            table.row(f"halves over repeatability, {name}", value, form=".2f", **limits)
        missed += table.missed
    assert not missed
