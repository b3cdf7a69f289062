"""How far the runs of a measured aircraft disagree, beside halves of them; the table of docs/refinement.md (`make study`)."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from tests.support import measured
from tests.tables import Table

HEAD = (
    "f [Hz]",
    "f: noise, 1e-5",
    "runs",
    "halves",
    "halves / runs",
    "zeta: runs, %",
    "halves",
    "halves / runs",
    "within 3",
)
TABLE = Table("refinement.md", "runs", HEAD)

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


def test_repeatability_of_a_measured_aircraft_is_how_far_halves_of_its_runs_disagree() -> None:
    """Four halves tell a deviation to a third."""
    found, halves = beside_halves(4)
    assert found.frequencies_repeatability is not None
    ratio = halves / np.array([found.frequencies_repeatability, found.damping_ratios_repeatability])
    kept = far_apart(found)
    assert kept.sum() >= 4
    assert np.all((ratio[:, kept] > 1 / 4) & (ratio[:, kept] < 4))


@pytest.mark.study
def test_study_of_thirty_halves() -> None:
    found, halves = beside_halves(30)
    f, zeta = found.frequencies, found.damping_ratios
    told = np.array([found.frequencies_repeatability, found.damping_ratios_repeatability])
    ratio, kept = halves / told, far_apart(found)
    held = np.all((ratio > 1 / 3) & (ratio < 3), axis=0)
    labels = []
    for k in range(len(found)):
        labels.append(f"{f[k]:.2f}")
        cells = [1e5 * v / f[k] for v in (found.frequencies_std[k], told[0, k], halves[0, k])]
        TABLE.keep(
            labels[-1],
            *(f"{c:.0f}" for c in cells),
            f"{ratio[0, k]:.1f}",
            *(f"{100 * v / zeta[k]:.1f}" for v in (told[1, k], halves[1, k])),
            f"{ratio[1, k]:.1f}",
            ("yes" if held[k] else "no") + ("" if kept[k] else " (close pair)"),
        )
    TABLE.write(labels)
    assert np.all(held[kept])
