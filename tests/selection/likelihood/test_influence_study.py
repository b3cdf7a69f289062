"""What first order gives beside differences of the code, row by row."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import ImpulseResponse
from modalscope.data.response import Response
from modalscope.selection.likelihood.covariance import PoleInfluence, influence_on
from modalscope.systems import chain5
from modalscope.systems.records import white_noise
from tests.studies import Study
from tests.support import add_noise, built, cut_order, relative

#: Noise, dB; sets of it, changes of each, and their size in deviations of the noise (smaller ones leave rounding at 80 dB).
LEVELS, SETS, CHANGES, STEP = (80, 40, 20), 5, 4, 0.1


class Row(NamedTuple):
    """One row of the table of methods, the order at which its poles are compared, and how far first order may be off."""

    method: str
    domain: str
    order: int = 10
    asked: float = 1e-3
    levels_kept: bool = False

    @property
    def label(self) -> str:
        """What it is called in the table."""
        return f"{self.method} ({self.domain}), {self.order}" + ", levels of outputs kept" * self.levels_kept


_CUT = ("era", "least_squares", "alternate", "polyreference")
ROWS = (
    *(Row(method, domain) for domain in ("time", "z", "s") for method in _CUT),
    Row("prce", "time", 12, 2e-3),
    *(Row("lscf", "z", 20, 2e-3, kept) for kept in (False, True)),
)
TRUE = chain5().modes().poles


def clean(row: Row, few: bool = False) -> Response:
    """Return samples for rows in the time domain, lines for the others; few where every value is moved by itself."""
    if row.domain == "time":
        return chain5().impulse_response(50 if few else 200)
    return chain5().frequency_response(np.linspace(0.3, 8.0, 41 if few else 161))


def influence(data: Response, row: Row) -> tuple[np.ndarray, PoleInfluence]:
    """Return the five poles of a row, and how the data move them."""
    pipeline = built(data, row.order, method=row.method, domain=row.domain)
    cut = cut_order(pipeline, row.order)
    near = np.array([int(np.argmin(np.abs(cut.modal.poles - s))) for s in TRUE])
    found = influence_on(pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen.take(near))
    return cut.modal.poles[near], found


def changed(data: Response, change: np.ndarray, row: Row, poles: np.ndarray) -> np.ndarray:
    """Return half of what the poles differ by when a change is added to the data and taken off."""
    ends = [influence(replace(data, values=data.values + sign * change), row)[0] for sign in (1, -1)]
    near = [end[[int(np.argmin(np.abs(end - s))) for s in poles]] for end in ends]
    return np.asarray(near[0] - near[1]) / 2


def difference(row: Row, decibel: float, seed: int, changes: int = CHANGES) -> float:
    """Return how far predicted changes of the five poles are from those of the code, relative."""
    plain = clean(row)
    data = add_noise(plain, decibel, seed)
    size = STEP * 10 ** (-decibel / 20) * np.sqrt(np.mean(np.abs(plain.values) ** 2, axis=0))
    poles, found = influence(data, row)
    rng = np.random.default_rng(100 + seed)
    moves = np.stack([size * white_noise(plain.values, 1.0, rng) for _ in range(changes)])
    if row.levels_kept:
        rise = np.sum((data.values.conj() * moves).real, axis=(1, 3)) / np.sum(np.abs(data.values) ** 2, axis=(0, 2))
        moves = moves - rise[:, None, :, None] * data.values
    return relative(found.of(moves), [changed(data, move, row, poles) for move in moves])


def outer_products(row: Row) -> float:
    """Return how far the moments by outer products are from those by every value of the response, relative."""
    data = add_noise(clean(row, few=True), 80, 0)
    _, found = influence(data, row)
    shape, parts = data.values.shape, 1 if isinstance(data, ImpulseResponse) else 2
    variance = np.random.default_rng(0).uniform(1, 2, shape[1:])
    size, square = np.zeros(len(TRUE)), np.zeros(len(TRUE), complex)
    for k in range(shape[0]):
        units = np.zeros((variance.size, *shape), data.values.dtype)
        units[:, k] = np.eye(variance.size).reshape(-1, *shape[1:])
        for part in (1, 1j)[:parts]:
            moved, weight = found.of(part * units), variance.ravel()[:, None] / parts
            size += np.sum(weight * np.abs(moved) ** 2, axis=0)
            square += np.sum(weight * moved**2, axis=0)
    moments = found.joint(found, variance)
    return max(relative(moments.size, size), relative(moments.square, square))


def orders_beside(row: Row) -> float:
    """Return by how much deviations at the same orders differ when every second or every fourth order is asked for, relative."""
    data = add_noise(clean(row), 40, 0)
    both = [ms.stabilize(data, method=row.method, domain=row.domain, orders=range(4, 29, step)) for step in (2, 4)]
    every, fourth = (
        np.concatenate([diagram.frequencies_std[shared], diagram.damping_ratios_std[shared]])
        for diagram in both
        for shared in [np.isin(diagram.order_of_pole, both[1].orders)]
    )
    told = np.isfinite(fourth) & (fourth > 0)  # damping of real poles is 1, whatever the noise
    assert np.array_equal(told, np.isfinite(every) & (every > 0))
    return float(np.max(np.abs(every[told] / fourth[told] - 1)))


# ---------------------------------------------------------------------------------------------------------- short form


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.label)
def test_first_order_is_the_difference_of_the_code(row: Row) -> None:
    """The derivative is that without noise: one set and one change at 80 dB scatter by a factor of two about a thousandth."""
    assert difference(row, 80, 0, changes=2) < 4e-3
    assert orders_beside(row) < 1e-9


@pytest.mark.parametrize(
    "row", [row for row in ROWS if row.method in ("era", "lscf", "prce")], ids=lambda row: row.label
)
def test_moments_are_those_of_every_value(row: Row) -> None:
    assert outer_products(row) < 1e-12


# ---------------------------------------------------------------------------------------------------------------- study


@pytest.mark.study("standard-deviations")
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.label)
def test_first_order_at_every_level_of_noise(row: Row, study: Callable[[str, str], Study]) -> None:
    """Truncating rows: in proportion to the noise. A matrix fraction: at any level, but for the levels of its outputs."""
    found = [np.sqrt(np.mean([difference(row, level, seed) ** 2 for seed in range(SETS)])) for level in LEVELS]
    apart, steps = outer_products(row), orders_beside(row)
    any_level = row.method in ("lscf", "prce")
    table = study(
        f"first order against differences, {row.label}",
        f"{SETS} sets of noise x {CHANGES} changes, seeds 0 to {SETS - 1}",
    )
    for level, value in zip(LEVELS, found, strict=True):
        limit = row.asked if any_level or level == LEVELS[0] else None
        table.row(f"relative difference of pole changes, {level} dB", value, most=limit, form=".2e")
    table.row("moments against those of every value, relative", apart, most=1e-12, form=".0e")
    table.row("standard deviations of orders in other steps, relative", steps, most=1e-9, form=".0e")
    assert found[0] < 2 * row.asked
    assert apart < 1e-12
    assert steps < 1e-9
