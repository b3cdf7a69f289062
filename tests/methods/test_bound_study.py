"""How near to the Cramer-Rao bound every row comes with its default blocks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.records.bound_cases import DECIBEL, KINDS, Case, identified, random_case, rows_of, selected
from modalscope.identification.method import Method
from modalscope.identification.method_names import find_method
from tests.selection.judging.bound import bound
from tests.studies import Study

#: Structures of every length of record.
SIZES = {400: 60, 1000: 24, 4000: 16}

#: Sets of noise of every structure, and the first seed.
DRAWS, FIRST = 2, 500


def ratios(row: Method, cases: list[Case], draws: int = DRAWS) -> np.ndarray:
    """Return root mean squares of errors over the bound, of f and zeta of all modes, structure by structure."""
    every = [[identified(row, case, 1000 * k + d) for d in range(draws)] for k, case in enumerate(cases)]
    return np.array([np.sqrt(np.mean(np.square(found))) for found in every])


def show(table: Study, what: str, values: np.ndarray, most: float | None = None) -> None:
    """Record the median, the value that 90 % stay below, and the largest."""
    tail = np.quantile(values, [0.9, 1], method="nearest")
    table.row(f"{what}: median", np.median(values), most=most)
    table.row(f"{what}: 90 % of structures, and all", " / ".join(f"{v:.3g}" for v in tail).replace("inf", "lost"))


# ---------------------------------------------------------------------------------------------------------- short form


@pytest.mark.parametrize("kind", KINDS)
def test_the_bound_on_compressed_rows_is_that_of_the_definition(kind: str) -> None:
    case = random_case(kind, 400, 1)
    rows = 2 if kind == "frequency responses" else 1
    deviation = 10 ** (-DECIBEL / 20) * np.sqrt(np.mean(np.abs(case.clean.values) ** 2, axis=0) / rows)
    plain = bound(case.clean, case.modes, deviation)[:2]
    assert np.allclose(case.least, plain, rtol=1e-5)  # what central differences leave of ten digits


@pytest.mark.slow
@pytest.mark.parametrize("name", ["era", "alternate"])
@pytest.mark.parametrize(("kind", "domain"), [(KINDS[0], "time"), (KINDS[1], "time"), (KINDS[2], "s"), (KINDS[2], "z")])
def test_at_the_true_order_errors_are_within_twice_the_bound(kind: str, domain: str, name: str) -> None:
    """Sixteen structures: their median scatters by a fifth, and lies at 1.1 to 1.5; rows over a thirtieth of the record gave 4 to 14."""
    cases = [random_case(kind, 1000 if domain == "time" else 600, seed) for seed in range(16)]
    row = find_method(name, domain, domain, None)
    assert np.median(ratios(row, cases, draws=1)) < 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS[:2])
@pytest.mark.parametrize("name", ["era", "alternate", "least_squares"])
def test_either_side_may_be_the_short_one(kind: str, name: str) -> None:
    """Pooled over structures with more outputs than inputs: one to three per cent apart at sixty of 400 samples, eight at 15 dB."""
    cases = [case for case in (random_case(kind, 400, seed) for seed in range(20)) if case.clean.values.shape[1] > 3]
    row, sizes = find_method(name, "time", "time", None), (66, 334)
    lying, standing = (
        [identified(row, case, k, block_rows=r, block_columns=s) for k, case in enumerate(cases)]
        for r, s in (sizes, sizes[::-1])
    )
    ratio = [np.linalg.norm(two) / np.linalg.norm(one) for one, two in zip(lying, standing, strict=True)]
    assert abs(np.log(ratio).mean()) < 0.1


# ---------------------------------------------------------------------------------------------------------------- study


def structures(samples: int) -> str:
    """Return which cases a study of records of this length is of."""
    count = SIZES[samples]
    return f"{count} structures x {DRAWS} sets of noise, seeds {FIRST} to {FIRST + count - 1}"


@pytest.mark.study("methods")
@pytest.mark.parametrize("samples", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_row_at_the_true_order(kind: str, samples: int, study: Callable[[str, str], Study]) -> None:
    """A median is measured to a tenth."""
    cases = [random_case(kind, samples, FIRST + seed) for seed in range(SIZES[samples])]
    table = study(f"error over the Cramér-Rao bound, {kind}, {samples} samples, true order", structures(samples))
    for row in rows_of(kind):
        most = 2.2 if row.name in ("era", "alternate", "least_squares") else None
        show(table, f"{row.name} ({row.domain})", ratios(row, cases), most)
    assert not table.missed


@pytest.mark.study("methods")
@pytest.mark.parametrize("samples", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_slowest_mode_as_it_is_selected_and_refined(
    kind: str, samples: int, study: Callable[[str, str], Study]
) -> None:
    cases = [random_case(kind, samples, FIRST + seed) for seed in range(SIZES[samples])]
    pairs = np.array([[selected(case, 1000 * k + d) for d in range(DRAWS)] for k, case in enumerate(cases)])
    size = np.sqrt(np.mean(np.square(pairs), axis=(1, 3)))
    table = study(f"error over the Cramér-Rao bound, {kind}, {samples} samples, slowest mode", structures(samples))
    show(table, "selected", size[:, 0], 2 if kind != "frequency responses" else 5)
    # four errors of one standard deviation have a root mean square of .92 in the median
    show(table, "refined", size[:, 1], 1.15)
    assert not table.missed
