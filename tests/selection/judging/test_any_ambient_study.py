"""Any ambient record with nothing set: which of the modes that can be seen are listed with their shapes, and what is listed falsely."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from tests.selection.judging.any_ambient import DISTURBANCES, FAMILIES, cable, disturbed, level_of, paired
from tests.studies import Study

#: A shape is right above this MAC; and its deviations say so where 1 - MAC across it is below a quarter of what is left: two deviations.
RIGHT, SAID = 0.95, 0.0125

#: At least so many of a hundred modes that can be seen are right.
ASKED = dict(zip(FAMILIES, (95, 85, 95, 95), strict=True))


@pytest.mark.slow
def test_all_modes_of_a_cable_are_listed() -> None:
    """Fifteen modes at equal distances: 30 states, and orders up to twice as many."""
    case = cable(2)
    modes = ms.analyze(case.record).modes
    own, alike = paired(case, modes)
    assert np.all(own >= 0)
    assert np.all(alike > RIGHT)
    assert len(modes) == len(own)


@pytest.mark.study("ambient")
@pytest.mark.parametrize("family", FAMILIES)
def test_any_ambient_record(family: str, study: Callable[[str, str], Study]) -> None:
    seen, right, false, sure, wrong = 0, 0, 0, 0, 0
    inside: list[list[bool]] = []
    over: list[float] = []  # 1 - MAC over what is stated of it
    for seed in range(1000, 1100):
        case = FAMILIES[family](seed)
        modes = ms.analyze(case.record).modes
        own, alike = paired(case, modes)
        visible, (f, zeta) = case.visible(), case.truth[:2]
        seen, right = seen + int(visible.sum()), right + int((alike > RIGHT)[visible].sum())
        near = np.abs(modes.frequencies[:, None] - f) < np.maximum(0.01 * f, f * zeta)
        false += int((~near.any(axis=1)).sum())
        if modes.shapes_std is None:
            continue  # a record without any mode
        scale = case.units * level_of(case.truth)
        open_there = np.sum((modes.shapes_std / scale[:, None]) ** 2, axis=0) / np.sum(
            np.abs(modes.shapes / scale[:, None]) ** 2, axis=0
        )
        ends = modes.interval()
        for i in np.flatnonzero(visible & (own >= 0)):
            j = own[i]
            sure, wrong = sure + int(open_there[j] < SAID), wrong + int(open_there[j] < SAID and alike[i] < RIGHT)
            over.append(float((1 - alike[i]) / open_there[j]))
            truth = {"frequency": f[i], "damping_ratio": zeta[i]}
            inside.append([ends[name][j][0] <= value <= ends[name][j][1] for name, value in truth.items()])
    table = study(family, "100 records, seeds 1000 to 1099")
    table.row(
        f"modes of {seen} that can be seen, listed, MAC > .95", 100 * right / seen, least=ASKED[family], unit=" %"
    )
    table.row(f"shapes of {sure} whose deviations say MAC > .95 and that have less", wrong, most=sure // 40)
    table.row("1 - MAC over what is stated of it, median", float(np.nanmedian(over)), most=2)
    table.row("the same, mean", float(np.nanmean(over)))
    table.row("false modes", false, most=2)
    for name, part in zip(("frequency", "damping ratio"), np.mean(inside, axis=0), strict=True):
        table.row(f"intervals of 95 % that hold the {name}", 100 * part, least=93, unit=" %")
    assert not table.missed


@pytest.mark.study("ambient")
@pytest.mark.parametrize("kind", DISTURBANCES)
def test_disturbed_ambient_records(kind: str, study: Callable[[str, str], Study]) -> None:
    """Of 32 records of each kind before stretches had a level: 52 % of intervals held under gusts, bursts made two false modes a record."""
    seen, right, false, inside = 0, 0, 0, []
    cases = [(family, seed) for family in FAMILIES.values() for seed in range(2000, 2012)]
    for family, seed in cases:
        case = disturbed(family(seed), kind, seed)
        modes, visible, (f, zeta) = ms.analyze(case.record).modes, case.visible(), case.truth[:2]
        own, alike = paired(case, modes)
        seen, right = seen + int(visible.sum()), right + int((alike > RIGHT)[visible].sum())
        near = np.abs(modes.frequencies[:, None] - f) < np.maximum(0.01 * f, f * zeta)
        false += int((~near.any(axis=1)).sum())
        ends = modes.interval()
        for i in np.flatnonzero(visible & (own >= 0)):
            truth = {"frequency": f[i], "damping_ratio": zeta[i]}
            inside.append([ends[name][own[i]][0] <= value <= ends[name][own[i]][1] for name, value in truth.items()])
    table = study(kind, f"{len(cases)} records, seeds 2000 to 2011")
    least = 87 if kind == "weather" else 92
    table.row(f"modes of {seen} that can be seen, listed, MAC > .95", 100 * right / seen, least=least, unit=" %")
    table.row("false modes a record", false / len(cases), most=1.0)
    for name, part in zip(("frequency", "damping ratio"), np.mean(inside, axis=0), strict=True):
        table.row(f"intervals of 95 % that hold the {name}", 100 * part, least=90, unit=" %")
    assert not table.missed
