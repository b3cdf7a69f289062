"""Poles of all orders: what is stable against the order before, which orders are tried, what is in a diagram and how well it fits."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from modalscope import DataError, stabilize
from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel, Signals
from modalscope.identification.matrices.matrix import Eigen, ModalFit, Triple
from modalscope.identification.modal.eigenmodes import Eigenmodes
from modalscope.identification.stabilize import TOLERANCES, stable_against
from modalscope.identification.sweep import Cut
from tests.selection.judging.made import NUDGE, Pole, at_angle, response_of

ONE = Pole(2, 8, 0.02, shape=(1, 0.2), part=(0.5, 1, -2))
TWO = Pole(2, 14, 0.01, shape=(3, -0.1), part=(1, 0.5, 1))
RESPONSE = response_of([ONE.pole, TWO.pole], [ONE.shape, TWO.shape], [ONE.part, TWO.part])


def noisy(seed: int = 0, level: float = 0.05, samples: int = 400, **how: Any) -> ImpulseResponse:
    rng = np.random.default_rng(seed)
    noise = level * rng.standard_normal(RESPONSE.values.shape)
    return replace(RESPONSE, values=(RESPONSE.values + noise)[:samples], **how)


# ------------------------------------------------------------------------------------------------------ the rule itself


def flags(after: list[Pole], before: list[Pole], **limits: float) -> list[tuple[bool, ...]]:
    """Return for each pole of an order whether frequency, damping and shape are those of the order before."""

    def cut(order: int, made: list[Pole]) -> Cut:  # the one place that knows what an order of the sweep is made of
        n = len(made)
        poles = np.array([p.pole for p in made], complex)
        shapes = np.array([p.shape for p in made], complex).reshape(n, 2).T
        states = np.eye(n, dtype=complex)
        fit = ModalFit(shapes, np.ones((n, 3), complex), np.zeros((1, 2, 3)))
        return Cut(
            order=order,
            triple=Triple(A=np.zeros((n, n)), B=None, C=np.zeros((2, n)), rank=n),
            modal=Eigenmodes(poles, Eigen(poles, states, states), fit),
            wrapped=lambda: ModalModel(poles=poles, shapes=shapes),
            reported=np.arange(n),
            outside=np.zeros(0, int),
            indicators={},
            misfit=0.0,
        )

    found = stable_against(cut(2, before), cut(4, after), {**TOLERANCES, **limits})
    return [tuple(bool(v) for v in column) for column in found.T]


@pytest.mark.parametrize(("side", "stable"), [(-1, True), (1, False)])
def test_frequencies_are_compared_with_the_lower(side: int, stable: bool) -> None:
    step = 1 + TOLERANCES["frequency"] * (1 + side * NUDGE)
    assert flags([Pole(4, 10 * step)], [Pole(2, 10)]) == [(stable, stable, stable)]
    assert flags([Pole(4, 10)], [Pole(2, 10 * step)]) == [(stable, stable, stable)]


@pytest.mark.parametrize(("side", "stable"), [(-1, True), (1, False)])
def test_damping_is_compared_with_the_larger(side: int, stable: bool) -> None:
    less = 0.02 * (1 - TOLERANCES["damping"] * (1 + side * NUDGE))
    assert flags([Pole(4, 10, less)], [Pole(2, 10, 0.02)]) == [(True, stable, True)]
    assert flags([Pole(4, 10, 0.02)], [Pole(2, 10, less)]) == [(True, stable, True)]


def test_damping_of_growing_poles_is_compared_by_size() -> None:
    assert flags([Pole(4, 10, -0.02)], [Pole(2, 10, -0.0201)]) == [(True, True, True)]
    assert flags([Pole(4, 10, -0.02)], [Pole(2, 10, 0.02)]) == [(True, False, True)]


@pytest.mark.parametrize(("side", "stable"), [(-1, True), (1, False)])
def test_shapes_may_be_off_by_their_limit(side: int, stable: bool) -> None:
    off = TOLERANCES["shape"] * (1 + side * NUDGE)
    assert flags([Pole(4, shape=at_angle(1 - off))], [Pole(2)]) == [(True, True, stable)]


def test_limits_can_be_given() -> None:
    after, before = [Pole(4, 10.2, 0.02, shape=at_angle(0.9))], [Pole(2, 10, 0.024)]
    assert flags(after, before) == [(False, False, False)]
    assert flags(after, before, frequency=0.03) == [(True, False, False)]
    assert flags(after, before, frequency=0.03, damping=0.2, shape=0.11) == [(True, True, True)]


def test_damping_and_shape_are_those_of_one_pole_of_that_frequency() -> None:
    elsewhere = [Pole(2, 20, 0.02), Pole(2, 10, 0.5, shape=(0, 1))]
    assert flags([Pole(4, 10, 0.02)], elsewhere) == [(True, False, False)]
    # damping is that of one and shape that of another: only one of the two can be meant
    halves = [Pole(2, 10, 0.02, shape=(0, 1)), Pole(2, 10, 0.5)]
    assert sum(flags([Pole(4, 10, 0.02)], halves)[0]) == 2
    # the one that agrees in all is found behind one that agrees in part
    assert flags([Pole(4, 10, 0.02)], [*halves, Pole(2, 10.05, 0.02)]) == [(True, True, True)]


def test_each_pole_has_its_own_flags_and_an_order_without_poles_makes_nothing_stable() -> None:
    found = flags([Pole(4, 10), Pole(4, 12), Pole(4, 14, 0.02)], [Pole(2, 14, 0.01), Pole(2, 10)])
    assert found == [(True, True, True), (False, False, False), (True, False, True)]
    assert flags([Pole(4)], []) == [(False, False, False)]
    assert flags([], [Pole(2)]) == []


# ---------------------------------------------------------------------------------------------------------- the diagram


def test_the_flags_of_a_diagram_are_those_of_the_plain_definition() -> None:
    d = stabilize(noisy(), orders=range(2, 21, 2))
    assert not d.stable_frequency[d.order_of_pole == d.orders[0]].any()
    f, zeta = d.frequencies, d.damping_ratios
    for before, after in pairwise(d.orders):
        for i in np.flatnonzero(d.order_of_pole == after):
            best = (False, False, False)
            for k in np.flatnonzero(d.order_of_pole == before):
                a, b = d.shapes[:, i], d.shapes[:, k]
                like = abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a) * np.vdot(b, b)).real
                near = abs(f[i] - f[k]) <= 0.01 * min(f[i], f[k])
                damped = near and abs(zeta[i] - zeta[k]) <= 0.05 * max(abs(zeta[i]), abs(zeta[k]))
                best = max(best, (near, damped, near and 1 - like <= 0.05), key=sum)
            own = (d.stable_frequency[i], d.stable_damping[i], d.stable_shape[i])
            assert sum(own) == sum(best)
            assert own[0] == best[0]
    assert 0 < d.stable.sum() < d.stable_frequency.sum()


def test_an_exponential_window_is_taken_off_the_poles_of_every_order() -> None:
    added = 1.5
    k = np.arange(400)[:, None, None] / 50.0
    windowed = replace(RESPONSE, values=RESPONSE.values * np.exp(-added * k), added_damping=added)
    d = stabilize(windowed, orders=[2, 4])
    last = d.poles[d.order_of_pole == 4]
    assert np.allclose(np.sort_complex(last), np.sort_complex(np.array([ONE.pole, TWO.pole])), rtol=1e-8)


def test_shapes_and_participation_are_rows_by_pole() -> None:
    d = stabilize(RESPONSE, orders=[4], reciprocal=False)
    assert (d.shapes.shape, d.participation.shape) == ((2, 2), (2, 3))
    for mode in (ONE, TWO):
        i = int(np.argmin(np.abs(d.poles - mode.pole)))
        assert np.allclose(np.outer(d.shapes[:, i], d.participation[i]), np.outer(mode.shape, mode.part), atol=1e-8)


def test_the_fit_error_of_an_order_is_what_its_poles_leave_of_the_levelled_outputs() -> None:
    data = noisy()
    d = stabilize(data, orders=[2, 4, 8], reciprocal=False)
    level = np.sqrt(np.mean(data.values**2, axis=(0, 2)))[:, None]
    for n, error in zip(d.orders, d.fit_errors, strict=True):
        own = d.order_of_pole == n
        real = d.poles[own].imag == 0
        # a real pole stands for itself, not for a pair
        participation = d.participation[own] / (1 + real[:, None])
        rebuilt = response_of(d.poles[own], d.shapes.T[own], participation).values
        left = np.linalg.norm((data.values - rebuilt) / level) / np.linalg.norm(data.values / level)
        assert error == pytest.approx(left, rel=1e-9)


def test_the_fit_error_on_lines_counts_real_and_imaginary_part_and_the_direct_term() -> None:
    f = np.linspace(2, 20, 80)
    s = 2j * np.pi * f[:, None, None]
    R = np.outer(ONE.shape, ONE.part)
    direct = np.outer([1, -1], [0.1, 0, 0.2])
    H = R / (s - ONE.pole) + R / (s - np.conj(ONE.pole)) + direct
    d = stabilize(FrequencyResponse(values=H, frequencies=f), orders=[2])
    assert d.fit_errors[0] < 1e-9
    rng = np.random.default_rng(0)
    noise = 0.2 * np.std(H) * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    d = stabilize(FrequencyResponse(values=H + noise, frequencies=f), orders=[2], domain="s", reciprocal=False)
    level = np.sqrt(np.mean(np.abs(H + noise) ** 2, axis=(0, 2)))[:, None]
    # the two states take next to nothing of 80 lines of noise
    expected = np.linalg.norm(noise / level) / np.linalg.norm((H + noise) / level)
    assert d.fit_errors[0] == pytest.approx(expected, rel=0.05)


def test_poles_outside_a_band_are_counted_not_drawn() -> None:
    d = stabilize(RESPONSE, orders=[4], band=(10, 20))
    assert np.allclose(d.poles, [TWO.pole])
    assert "1 pole not drawn: outside the band, or computational" in map(str, d.notes)
    edge = stabilize(RESPONSE, orders=[4], band=(10, 14 * (1 + 1e-9)))
    assert edge.poles.size == 1
    assert stabilize(RESPONSE, orders=[4], band=(10, 14 * (1 - 1e-9))).poles.size == 0


def test_indicators_belong_to_the_poles_beside_them() -> None:
    d = stabilize(noisy(), orders=range(2, 13, 2), band=(10, 20))
    assert all(column.shape == d.poles.shape for column in d.indicators.values())
    true = np.abs(d.poles - TWO.pole) < 0.01 * abs(TWO.pole)
    assert d.indicators["emac"][true & (d.order_of_pole >= 6)].min() > d.indicators["emac"][~true].max()


# ------------------------------------------------------------------------------------------------------ which orders


@pytest.mark.parametrize(("kind", "largest"), [("dirac", 60), ("correlation", 40)])
def test_orders_of_samples_go_up_to_sixty_and_of_correlations_to_forty(kind: str, largest: int) -> None:
    assert stabilize(noisy(kind=kind)).orders == tuple(range(2, largest + 1, 2))


def lines(count: int, outputs: int = 2, inputs: int = 3) -> FrequencyResponse:
    rng = np.random.default_rng(0)
    shape = (count, outputs, inputs)
    values = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    return FrequencyResponse(values=values, frequencies=np.linspace(2, 20, count))


def test_orders_of_lines_go_up_to_eighty_and_to_as_many_as_there_are_columns_of_lines_and_inputs() -> None:
    assert stabilize(lines(60)).orders == tuple(range(2, 81, 2))
    assert stabilize(lines(20, outputs=20, inputs=1)).orders == tuple(range(2, 21, 2))
    # 14 x 3 columns, but the rows carry fewer; ten lines lie in the band
    assert "orders 30 to 42 left out: the data matrix has rank 28" in map(
        str, stabilize(lines(14), reciprocal=False).notes
    )
    assert "orders 22 to 30 left out: the data matrix has rank 20" in map(
        str, stabilize(lines(60), band=(2, 5), reciprocal=False).notes
    )


@pytest.mark.slow
def test_records_without_inputs_are_correlations_and_those_with_inputs_lines() -> None:
    rng = np.random.default_rng(0)
    outputs, inputs = rng.standard_normal((2500, 2)), rng.standard_normal((2500, 1))
    assert stabilize(Signals(outputs=outputs, sampling_rate=50.0)).orders[-1] == 40
    assert stabilize(Signals(outputs=outputs, inputs=inputs, sampling_rate=50.0)).orders[-1] == 80


@pytest.mark.slow
@pytest.mark.parametrize(("inputs", "degrees"), [(3, range(2, 61, 2)), (5, range(2, 49, 2)), (6, range(2, 41))])
def test_degrees_of_a_matrix_fraction_go_up_to_sixty_and_to_240_poles(inputs: int, degrees: range) -> None:
    assert stabilize(lines(260, outputs=1, inputs=inputs), method="lscf", reciprocal=False).orders == tuple(degrees)


def test_orders_beyond_the_rank_of_exact_data_are_left_out_and_the_rank_is_known() -> None:
    d = stabilize(RESPONSE, orders=[2, 6, 8])
    assert (d.orders, d.exact_rank) == ((2, 4), 4)
    assert "orders 6 to 8 left out: the data matrix has rank 4" in map(str, d.notes)
    assert stabilize(noisy(), orders=[2, 4]).exact_rank is None
    with pytest.raises(DataError, match="orders 6 to 8"):
        stabilize(RESPONSE, orders=[6, 8])


def test_a_rank_that_is_all_the_columns_there_are_is_not_exact_and_no_order_of_its_own() -> None:
    d = stabilize(lines(14), orders=[4, 40], method="era")
    assert (d.orders, d.exact_rank) == ((4,), None)
    assert any(str(note).startswith("orders 40 to 40 left out") for note in d.notes)


def test_orders_are_sorted_and_tried_once_and_counted_as_they_are_done() -> None:
    seen: list[tuple[int, int]] = []
    d = stabilize(noisy(), orders=[6, 2, 4, 2], progress=lambda done, of: seen.append((done, of)))
    assert d.orders == (2, 4, 6)
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_what_cannot_be_asked() -> None:
    with pytest.raises(DataError, match="there are frequency, damping, shape"):
        stabilize(RESPONSE, tolerances={"frequencies": 0.1})
    with pytest.raises(DataError, match="damping"):
        stabilize(RESPONSE, tolerances={"damping": 0})
    with pytest.raises(DataError, match="order"):
        stabilize(RESPONSE, orders=[2, 0])


def test_given_limits_are_kept_beside_the_others() -> None:
    d = stabilize(noisy(), orders=[2, 4], tolerances={"shape": 0.5})
    assert d.tolerances == {"frequency": 0.01, "damping": 0.05, "shape": 0.5}
