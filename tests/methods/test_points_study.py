"""Rows that interpolate lines or have a common denominator beside those of the report: errors over the Cramer-Rao bound, and modes lost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.bound_cases import DECIBEL, Case, errors, random_case
from tests.studies import Study
from tests.support import add_noise

#: Structures of 2 to 6 modes on 200 lines, and the first seed.
STRUCTURES, LINES, FIRST = 100, 200, 900


class Row(NamedTuple):
    """A row with the order at which it has the true number of states, or what it needs."""

    method: str
    domain: str
    order: Callable[[Case], int]


def _states(case: Case) -> int:
    return case.order


ROWS = (
    Row("alternate", "s", _states),
    Row("era", "s", _states),
    Row("lscf", "z", lambda case: 30),
    Row("loewner", "s", _states),
    Row("loewner", "z", _states),
    Row("aaa", "s", lambda case: case.order // 2 + 1),
    Row("vector-fitting", "s", _states),
)


def found(row: Row, case: Case, decibel: float, seed: int) -> np.ndarray:
    """Return errors of f and zeta of every mode over the bound, (2, n); infinite for modes without a pole."""
    data = add_noise(case.clean, decibel, seed)
    options: dict[str, Any] = {
        "method": row.method,
        "domain": row.domain,
        "order": row.order(case),
        "deviations": False,
    }
    return errors(case, ms.identify(data, **options).poles) * 10 ** ((decibel - DECIBEL) / 20)


@pytest.mark.slow
def test_a_loewner_matrix_comes_as_near_the_bound_as_the_usual_row() -> None:
    """Twelve structures at 40 dB; of all hundred the medians are 1.2 for the alternate row and 1.02 for Loewner matrices."""
    cases = [random_case("frequency responses", 2 * LINES, FIRST + seed) for seed in range(12)]
    for row in (ROWS[0], ROWS[3]):
        sizes = [np.sqrt(np.mean(found(row, case, 40.0, k) ** 2)) for k, case in enumerate(cases)]
        assert np.median(sizes) < 2, row


@pytest.mark.study("methods")
@pytest.mark.parametrize("decibel", [40.0, 20.0])
def test_rows_on_points_at_the_true_order(decibel: float, study: Callable[[str, str], Study]) -> None:
    cases = [random_case("frequency responses", 2 * LINES, FIRST + seed) for seed in range(STRUCTURES)]
    table = study(
        f"error over the Cramér-Rao bound, {LINES} lines, {decibel:g} dB, true order",
        f"{STRUCTURES} structures, seeds {FIRST} to {FIRST + STRUCTURES - 1}",
    )
    for row in ROWS:
        every = [found(row, case, decibel, k) for k, case in enumerate(cases)]
        sizes = np.array([np.sqrt(np.mean(e**2)) for e in every])
        lost = sum(int(np.isinf(e[0]).sum()) for e in every)
        most = {"loewner": 1.5, "vector-fitting": 1.5}.get(
            row.method, 2.2 if row.domain == "s" and row.method != "aaa" else None
        )
        table.row(f"{row.method} ({row.domain}): median", np.median(sizes), most=most)
        table.row(
            f"{row.method} ({row.domain}): 90 % of structures", f"{np.quantile(sizes, 0.9, method='nearest'):.3g}"
        )
        table.row(f"{row.method} ({row.domain}): modes lost", f"{lost} of {sum(len(c.modes) for c in cases)}")
    assert not table.missed
