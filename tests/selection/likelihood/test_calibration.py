"""Are the deviations right? Errors over many seeds against what was predicted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.selection.likelihood.cases import CASES, Case, errors
from tests.studies import Study


@pytest.mark.study("standard-deviations")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.label)
def test_the_spread_over_seeds_is_the_predicted_one(case: Case, study: Callable[[str, str], Study]) -> None:
    """Of 400 seeds a ratio is known to 3.5 % and a coverage to 1.1 %; the limits are widened by twice that of fewer."""
    found = [
        errors(case.data(k), case.order, method=case.method, domain=case.domain, **case.options)
        for k in range(case.seeds)
    ]
    apart, std = (np.array(part) for part in zip(*found, strict=True))
    typical = np.median(std, axis=0) if case.median else np.sqrt(np.nanmean(std**2, axis=0))
    ratio = np.std(apart, axis=0, ddof=1) / typical
    covered = 100 * np.sum(np.abs(apart) < case.quantile * std, axis=0) / np.sum(np.isfinite(std), axis=0)
    bias = np.mean(apart, axis=0) / typical
    _record(
        study(case.label.replace(" | ", ", "), f"{case.seeds} seeds, 0 to {case.seeds - 1}"), case, ratio, covered, bias
    )
    known, least = 1 + 2 / np.sqrt(2 * case.seeds), 2 * 100 * np.sqrt(0.05 * 0.95 / case.seeds)
    limits = np.array(case.ratios) * [1 / known, known, 1 / known, known]
    assert np.all((ratio[0] > limits[0]) & (ratio[0] < limits[1])), ratio[0]
    assert np.all((ratio[1] > limits[2]) & (ratio[1] < limits[3])), ratio[1]
    assert case.coverage is None or np.all(covered > case.coverage - least), covered


def _record(table: Study, case: Case, ratio: np.ndarray, covered: np.ndarray, bias: np.ndarray) -> None:
    """Record the figures with what is asked of every row of this kind, widened by twice the sampling error."""
    known, percent = 2 / np.sqrt(2 * case.seeds), 200 * np.sqrt(0.05 * 0.95 / case.seeds)
    for name, values, (low, high) in zip(("f", "zeta"), ratio, case.asked[:2], strict=True):
        limits = {"least": low * (1 - known), "most": high * (1 + known)}
        table.row(f"scatter over standard deviation, {name}", values, form=".2f", **limits)
    limits = {}
    if case.asked.coverage is not None:
        low, high = case.asked.coverage
        limits = {"least": low - percent, "most": high + percent}
    for name, values in zip(("f", "zeta"), covered, strict=True):
        table.row(f"coverage of 95 % intervals, {name}", values, form=".1f", unit=" %", **limits)
    table.row("bias in standard deviations", bias, form=".2f")
