"""How near to the Cramer-Rao bound every row comes with its default blocks; the table of docs/deviations.md (`make study`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modalscope.identification.lookup import find_method
from modalscope.identification.method import Method
from tests.identification.bound import bound
from tests.methods.bound_cases import DECIBEL, KINDS, Case, identified, random_case, rows_of, selected

PAGE = Path(__file__).parents[2] / "docs" / "deviations.md"
BEGIN, END = "<!-- bound: written by `make study` -->", "<!-- end of bound -->"

#: Structures of every length of record.
SIZES = {400: 60, 1000: 24, 4000: 16}

#: Sets of noise of every structure, and the first seed.
DRAWS, FIRST = 2, 500

HEAD = "| data | row | " + " | ".join(f"{n} samples" for n in SIZES) + " |\n|---|---|" + "---|" * len(SIZES)

_FOUND: dict[tuple[str, str], dict[int, str]] = {}


def ratios(row: Method, cases: list[Case], draws: int = DRAWS) -> np.ndarray:
    """Return root mean squares of errors over the bound, of f and zeta of all modes, structure by structure."""
    every = [[identified(row, case, 1000 * k + d) for d in range(draws)] for k, case in enumerate(cases)]
    return np.array([np.sqrt(np.mean(np.square(found))) for found in every])


def quantiles(values: np.ndarray) -> np.ndarray:
    """Return the median, the value that 90 % stay below, and the largest."""
    return np.asarray(np.quantile(values, [0.5, 0.9, 1], method="nearest"))


def _kept(kind: str, what: str, samples: int, values: np.ndarray) -> None:
    cell = " / ".join(f"{v:.2g}" if v >= 10 else f"{v:.2f}" for v in quantiles(values)).replace("inf", "lost")
    _FOUND.setdefault((kind, what), {})[samples] = cell
    print(f"{kind}, {samples}: {what}: {cell}")


# ---------------------------------------------------------------------------------------------------------- short form


@pytest.mark.parametrize("kind", KINDS)
def test_the_bound_on_compressed_rows_is_that_of_the_definition(kind: str) -> None:
    case = random_case(kind, 400, 1)
    rows = 2 if kind == "frequency responses" else 1
    deviation = 10 ** (-DECIBEL / 20) * np.sqrt(np.mean(np.abs(case.clean.values) ** 2, axis=0) / rows)
    plain = bound(case.clean, case.modes, deviation)[:2]
    assert np.allclose(case.least, plain, rtol=1e-5)  # what central differences leave of ten digits


@pytest.mark.parametrize("name", ["era", "alternate"])
@pytest.mark.parametrize(("kind", "domain"), [(KINDS[0], "time"), (KINDS[1], "time"), (KINDS[2], "s"), (KINDS[2], "z")])
def test_at_the_true_order_errors_are_within_twice_the_bound(kind: str, domain: str, name: str) -> None:
    """Sixteen structures: their median scatters by a fifth, and lies at 1.1 to 1.5; rows over a thirtieth of the record gave 4 to 14."""
    cases = [random_case(kind, 1000 if domain == "time" else 600, seed) for seed in range(16)]
    row = find_method(name, domain, domain, None)
    assert np.median(ratios(row, cases, draws=1)) < 2


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


@pytest.mark.study
@pytest.mark.parametrize("samples", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_every_row_at_the_true_order(kind: str, samples: int) -> None:
    cases = [random_case(kind, samples, FIRST + seed) for seed in range(SIZES[samples])]
    for row in rows_of(kind):
        found = ratios(row, cases)
        _kept(kind, f"{row.name} ({row.domain})", samples, found)
        if row.name in ("era", "alternate", "least_squares"):
            assert np.median(found) < 2.2  # measured to a tenth


@pytest.mark.study
@pytest.mark.parametrize("samples", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_slowest_mode_as_it_is_selected_and_refined(kind: str, samples: int) -> None:
    cases = [random_case(kind, samples, FIRST + seed) for seed in range(SIZES[samples])]
    pairs = np.array([[selected(case, 1000 * k + d) for d in range(DRAWS)] for k, case in enumerate(cases)])
    size = np.sqrt(np.mean(np.square(pairs), axis=(1, 3)))
    _kept(kind, "selected: slowest mode", samples, size[:, 0])
    _kept(kind, "refined: slowest mode", samples, size[:, 1])
    assert np.median(size[:, 0]) < (2 if kind != "frequency responses" else 5)
    assert np.median(size[:, 1]) < 1.15  # four errors of deviation 1 have a root mean square of .92 in the median


@pytest.mark.study
def test_the_page_shows_the_table() -> None:
    """Last in this file: writes what was found; what did not run this time stays as it was."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    body, _, after = rest.partition(END)
    shown = {tuple(cells[1:3]): cells[3:-1] for cells in map(_cells, body.strip().splitlines()[2:])}
    for label, found in _FOUND.items():
        old = shown.get(label, [""] * len(SIZES))
        shown[label] = [found.get(n, there) for n, there in zip(SIZES, old, strict=True)]
    lines = [
        f"| {' | '.join((*label, *shown[label]))} |" for label in sorted(shown, key=lambda label: KINDS.index(label[0]))
    ]
    PAGE.write_text(f"{before}{BEGIN}\n{HEAD}\n" + "\n".join(lines) + f"\n{END}{after}", encoding="utf-8")


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("|")]
