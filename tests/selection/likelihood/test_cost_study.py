"""What deviations of all poles cost beside the diagram without them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5
from tests.studies import Study
from tests.support import BEAM


class Cost(NamedTuple):
    """Data of one kind, and the rows of the table of methods that take them."""

    what: str
    data: Callable[[], Any]
    rows: tuple[tuple[str, str], ...]
    asked: float


_CUT = ("alternate", "era", "least_squares", "polyreference")


def _samples(count: int) -> Callable[[], Any]:
    return lambda: chain5().impulse_response(count, noise=0.01, seed=0)


def _lines(count: int) -> Callable[[], Any]:
    return lambda: chain5().frequency_response(np.linspace(0.2, 7, count), noise=0.01, seed=0)


def _on_lines() -> Any:
    return chain5().simulate(at=[0, 3], samples=4000, sampling_rate=20, noise=0.01, seed=0)


def _ambient() -> Any:
    return chain5().simulate(inputs="ambient", duration=1000, sampling_rate=20, noise=0.01, seed=0)


def _beam() -> Any:
    return ms.read(BEAM / "beam_hammer.uff").band(100, 4500)


_TIME = tuple((name, "time") for name in _CUT)
_LINES = tuple((name, domain) for domain in ("s", "z") for name in _CUT)
COSTS = (
    Cost("4 x 2, 400 samples", _samples(400), (*_TIME, ("prce", "time")), 1.5),
    Cost("4 x 2, 3000 samples", _samples(3000), (*_TIME, ("prce", "time")), 1.5),
    Cost("4 x 2, 680 lines", _lines(680), (*_LINES, ("lscf", "z")), 2.0),
    Cost("4 x 2, 4000 lines", _lines(4000), (*_LINES, ("lscf", "z")), 2.0),
    Cost("beam, 7 x 6, 4401 lines", _beam, (("alternate", "s"), ("alternate", "z"), ("lscf", "z")), 2.0),
    Cost("ambient record, 4 x 20 000", _ambient, (("alternate", "time"), ("ssi-data", "time")), 1.5),
)


def seconds(data: Any, method: str, domain: str, turns: int) -> tuple[float, float, int]:
    """Return the least processor time of a diagram without and with deviations, taken in turns, and its largest order."""
    spent: dict[bool, list[float]] = {False: [], True: []}
    largest = 0
    for _ in range(turns):
        for deviations, found in spent.items():
            started = time.process_time()
            diagram = ms.stabilize(data, method=method, domain=domain, deviations=deviations)
            found.append(time.process_time() - started)
            largest = max(diagram.orders)
    return min(spent[False]), min(spent[True]), int(largest)


@pytest.mark.slow
@pytest.mark.parametrize("cost", COSTS[:1], ids=lambda cost: cost.what)
def test_deviations_cost_about_as_much_as_the_diagram(cost: Cost) -> None:
    """Twice what is asked: small diagrams, three turns on a machine that does other things."""
    data = cost.data()
    seconds(data, *cost.rows[0], turns=1)
    without, with_them, _ = seconds(data, *cost.rows[0], turns=3)
    assert with_them < 2 * cost.asked * without


@pytest.mark.study("resources")
@pytest.mark.parametrize("cost", COSTS, ids=lambda cost: cost.what)
def test_cost_of_deviations(cost: Cost, study: Callable[[str, str], Study]) -> None:
    data = cost.data()
    seconds(data, *cost.rows[0], turns=1)
    for method, domain in cost.rows:
        without, with_them, largest = seconds(data, method, domain, 3)
        ratio = round(with_them / without, 1)
        table = study(
            f"diagram of {cost.what}, {method} ({domain}), orders to {largest}",
            "1 set of data, seed 0, best of 3 turns",
        )
        table.row("without standard deviations, CPU s", without, form=".2g")
        table.row("with standard deviations, CPU s", with_them, form=".2g")
        table.row("ratio", ratio, most=cost.asked, form=".1f")
    assert np.isfinite(ratio)
