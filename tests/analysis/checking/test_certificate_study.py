"""Is the verdict of a certificate the truth's? Certificates at 20 dB beside the errors of many seeds.."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.checking.certificate import (
    LARGEST_BIAS,
    LEAST_COVERAGE,
    RATIOS,
    Calibration,
    calibration,
    certified,
    replicates_of,
)
from modalscope.numerics.checks import BoolArray, RealArray
from modalscope.systems import chain5
from tests.studies import Study

TRUTH = chain5().modes()

ORDER, SEEDS, CERTIFIED, REPLICATES = 10, 400, 20, 40

FIGURES = ("bias", "ratio", "coverage")

#: Coverage told may be so far from the true one, in points, where the true one is at least this many %.
COVERAGE_WITHIN, WHERE_AT_LEAST = 15, 70


class Case(NamedTuple):
    """One row of the table."""

    method: str
    options: dict[str, Any]

    @property
    def label(self) -> str:
        return ", ".join([self.method, *(f"{v} {k.replace('_', ' ')}" for k, v in self.options.items())])


CASES = (
    *(Case(name, {}) for name in ("era", "least_squares", "alternate", "polyreference")),
    # few blocks make the bias of ERA large: the verdict has something to find
    *(Case(name, {"block_rows": 18, "block_columns": 240}) for name in ("era", "alternate")),
)


def data(seed: int) -> Any:
    return chain5().impulse_response(400, noise=0.1, seed=seed)


def near_truth(seed: int, case: Case) -> Any:
    """Return the identified modes nearest to the five true ones: one mode twice where the record has lost one."""
    modes = ms.identify(data(seed), order=ORDER, method=case.method, **case.options).modes
    modes = modes.take(np.flatnonzero(modes.poles.imag > 0))
    return modes.take([int(np.argmin(np.abs(modes.poles - s))) for s in TRUTH.poles])


def values_and_deviations(modes: Any) -> RealArray:
    """Return (4, n), as a replicate gives them."""
    return np.stack(
        [getattr(modes, k) for k in ("frequencies", "damping_ratios", "frequencies_std", "damping_ratios_std")]
    )


def clear(told: Calibration, seeds: int) -> BoolArray:
    """Whether each figure of so many seeds lies further than twice its sampling error from the limit that decides."""
    bias, ratio = 2 / np.sqrt(seeds), 2 / np.sqrt(2 * seeds)
    cover = 2 * np.sqrt(LEAST_COVERAGE * (1 - LEAST_COVERAGE) / seeds)
    inside = (
        (np.abs(told.bias) < LARGEST_BIAS - bias)
        & (told.ratio > RATIOS[0] * (1 + ratio))
        & (told.ratio < RATIOS[1] * (1 - ratio))
        & (told.coverage > LEAST_COVERAGE + cover)
    )
    outside = (
        (np.abs(told.bias) > LARGEST_BIAS + bias)
        | (told.ratio < RATIOS[0] * (1 - ratio))
        | (told.ratio > RATIOS[1] * (1 + ratio))
        | (told.coverage < LEAST_COVERAGE - cover)
    )
    return np.asarray(inside | outside)


@pytest.mark.study("certificates")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.label)
def test_the_verdict_is_that_of_the_truth(case: Case, study: Callable[[str, str], Study]) -> None:
    """Seeds of the certificates are none of those that the truth is known from."""
    true = calibration(TRUTH, np.stack([values_and_deviations(near_truth(k, case)) for k in range(SEEDS)]))
    told = [verdicts(SEEDS + k, case) for k in range(CERTIFIED)]
    sure = clear(true, SEEDS)
    holds = np.stack([one.holds for one in told])
    there = np.stack([np.isfinite(one.seen) for one in told])
    right = [100 * np.mean((holds == true.holds)[there & sure & (true.holds == verdict)]) for verdict in (True, False)]
    where = 100 * true.coverage >= WHERE_AT_LEAST
    off = 100 * np.abs(np.nanmedian([one.coverage for one in told], axis=0) - true.coverage)[where].max()
    print(true.holds.T, true.bias.T.round(2), true.ratio.T.round(2), true.coverage.T.round(2), sep="\n")
    print(holds.mean(axis=0).T, np.median([one.coverage for one in told], axis=0).T.round(2), sep="\n")
    truth = (
        f"{SEEDS} seeds for the truth, 0 to {SEEDS - 1}; {CERTIFIED} certificates, {SEEDS} to {SEEDS + CERTIFIED - 1}"
    )
    table = study(f"chain5 at 20 dB, {case.label}", truth)
    table.row("figures that hold in truth", f"{int(true.holds.sum())} of {true.holds.size}")
    table.row("figures within twice their sampling error of a limit, not counted", int((~sure).sum()))
    for what, share in zip(("passed, of figures that hold", "refused, of figures that do not"), right, strict=True):
        if np.isfinite(share):
            table.row(what, share, least=80, form=".0f", unit=" %")
    table.row("coverage, error of the certificate in points", off, most=COVERAGE_WITHIN, form=".0f")


def verdicts(seed: int, case: Case) -> Calibration:
    """Return what the certificate of one record says of the modes nearest to the true ones; NaN where the record has lost one."""
    diagram = ms.stabilize(data(seed), orders=[ORDER], method=case.method, **case.options)
    modes = near_truth(seed, case)
    _, own = np.unique(modes.poles, return_index=True)
    own = np.sort(own)
    found = certified(replicates_of(diagram, modes.take(own)), REPLICATES, np.random.default_rng(seed))
    told = np.full((4, len(modes), 2), np.nan)
    told[:3, own] = np.moveaxis([[part[k] for part in (found.frequency, found.damping_ratio)] for k in FIGURES], 1, 2)
    told[3, own] = found.found[:, None]
    return Calibration(*told[:3], error=np.full_like(told[0], np.nan), seen=told[3])
