"""Which poles are reported: the orders that are used, exact data, one mode once, and modes asked for by hand."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from modalscope import DataError
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.orders import SLACK
from modalscope.selection.judging.select import select
from tests.selection.judging.made import NUDGE, Pole, diagram_of, response_of

ONE = Pole(2, 8, 0.02, shape=(1, 2), part=(0.5, 1, -2))
TWO = Pole(2, 14, 0.01, shape=(3, -1), part=(1, 0.5, 1))
#: Found now and then: never a mode.
RARE = Pole(2, 20, 0.01, shape=(1, -1), part=(0.1, 0, 0.1))
RESPONSE = response_of([ONE.pole, TWO.pole], [ONE.shape, TWO.shape], [ONE.part, TWO.part], kind="correlation")

ORDERS = range(2, 42, 2)


def at(mode: Pole, orders: Iterable[int]) -> list[Pole]:
    return [mode._replace(order=n) for n in orders]


def diagram(*made: Pole, errors: Iterable[float] | None = None, **more: object) -> StabilizationDiagram:
    """Order 22 is the first that fits, so that all orders are used unless errors are given."""
    fit = [1.0] * 10 + [0.1] * 10 if errors is None else [*errors]
    return diagram_of(*made, response=RESPONSE, orders=ORDERS, fit_errors=fit, **more)


BOTH = [*at(ONE, ORDERS), *at(TWO, ORDERS)]


def test_modes_at_all_orders_are_reported_by_frequency_with_what_was_counted() -> None:
    modes = select(diagram(*at(TWO, ORDERS), *at(ONE, ORDERS)))
    assert np.allclose(modes.poles, [ONE.pole, TWO.pole])
    assert [(r["orders_found"], r["orders_tried"]) for r in modes.reasons] == [(20, 20), (20, 20)]


def test_what_has_something_against_it_is_not_reported() -> None:
    modes = select(diagram(*BOTH, *at(RARE, [2, 4, 6, 8])))
    assert np.allclose(modes.frequencies, [8, 14])


def test_values_are_medians_of_the_members() -> None:
    f = np.resize([8.0, 8.001, 8.01], 20)
    modes = select(diagram(*(ONE._replace(order=n, f=v) for n, v in zip(ORDERS, f, strict=True))))
    assert modes.frequencies[0] == pytest.approx(8.001, abs=1e-12)


def used(errors: list[float]) -> int:
    """How many of the orders 2, 4, ..., 40 are used."""
    return int(select(diagram(*BOTH, errors=errors)).reasons[0]["orders_tried"])


@pytest.mark.parametrize(("error", "orders"), [(SLACK * (1 - NUDGE), 11), (SLACK * (1 + NUDGE), 12)])
def test_orders_are_used_up_to_twenty_above_the_first_that_fits_as_well_as_the_best(error: float, orders: int) -> None:
    # order 2 fits nearly as well as the best, order 4 just as well: up to 22 or up to 24
    assert used([0.1 * error] + [0.1] * 19) == orders


def test_orders_are_used_up_to_twice_the_first_that_fits() -> None:
    # order 24 is the first: 2 x 24 > 24 + 20, so that all are used; from 12 on it is 12 + 20 = 32, the sixteenth
    assert used([1.0] * 11 + [0.1] * 9) == 20
    assert used([1.0] * 5 + [0.1] * 15) == 16
    wide = range(4, 124, 4)
    made = [*at(ONE, wide), *at(TWO, wide)]
    errors = [1.0] * 9 + [0.1] * 21  # order 40 is the first: up to 80, the twentieth
    found = select(diagram_of(*made, response=RESPONSE, orders=wide, fit_errors=errors))
    assert found.reasons[0]["orders_tried"] == 20


def test_poles_of_orders_that_are_not_used_do_not_count() -> None:
    late = [*at(ONE, ORDERS), *(TWO._replace(order=n) for n in range(24, 42, 2))]
    errors = [0.1] * 20  # used up to order 22
    assert np.allclose(select(diagram(*late, errors=errors)).frequencies, [8])


def test_the_noise_is_that_of_the_best_fit_among_the_orders_used() -> None:
    first = select(diagram(*BOTH)).reasons[0]["signal_to_noise"]
    assert select(diagram(*BOTH, errors=[1.0] * 10 + [0.11] + [0.1] * 9)).reasons[0][
        "signal_to_noise"
    ] == pytest.approx(first)
    assert select(diagram(*BOTH, errors=[1.0] * 10 + [0.2] * 10)).reasons[0]["signal_to_noise"] == pytest.approx(
        first / 2
    )


def test_splits_are_merged_before_they_are_followed() -> None:
    beside = TWO._replace(f=14.01, shape=(3.01, -1))
    modes = select(diagram(*BOTH, *at(beside, ORDERS)))
    assert len(modes) == 2
    assert 14 < modes.frequencies[1] < 14.01


@pytest.mark.parametrize(("count", "groups"), [(2, 0), (3, 1)])
def test_three_poles_that_agree_are_the_least_that_can_be_asked_for(count: int, groups: int) -> None:
    made = diagram(*BOTH, *at(RARE, range(2, 2 + 2 * count, 2)))
    if groups:
        assert np.allclose(select(made, frequencies=[20]).frequencies, [20])
    else:
        with pytest.raises(DataError, match="a mode at 20 Hz"):
            select(made, frequencies=[20])


# ------------------------------------------------------------------------------------------------------------ exact data


def test_of_exact_data_the_modes_are_the_poles_of_their_rank() -> None:
    made = [ONE._replace(order=2), ONE._replace(order=4), TWO._replace(order=4), TWO._replace(order=6, f=15)]
    exact = diagram_of(*made, response=RESPONSE, exact_rank=4)
    modes = select(exact)
    assert np.allclose(modes.poles, [ONE.pole, TWO.pole])
    assert modes.reasons[0]["text"] == "noise-free data of exact rank 4: a pole of that order"
    assert (modes.reasons[0]["orders_found"], modes.reasons[0]["orders_tried"]) == (1, 1)


@pytest.mark.parametrize(("part", "count"), [(1e-6, 3), (1e-12, 2)])
def test_a_pole_of_exact_data_that_contributes_rounding_is_no_mode(part: float, count: int) -> None:
    made = [ONE, TWO, RARE._replace(part=(part, 0, 0))]
    assert len(select(diagram_of(*made, response=RESPONSE, exact_rank=2))) == count


# --------------------------------------------------------------------------------------------------------------- by hand


def test_a_mode_asked_for_is_given_whatever_speaks_against_it() -> None:
    made = diagram(*BOTH, *at(RARE, [2, 4, 6, 8]))
    assert np.allclose(select(made, frequencies=[20, 8]).frequencies, [8, 20])


@pytest.mark.parametrize("side", [-1, 1])
def test_the_tolerance_is_a_part_of_the_frequency_asked(side: int) -> None:
    inside, outside = (8 / (1 + side * 0.01 * (1 + d)) for d in (-NUDGE, NUDGE))
    assert select(diagram(*BOTH), frequencies=[inside]).frequencies[0] == pytest.approx(8)
    with pytest.raises(DataError, match=r"no pole lies within 1 % of it at orders 2 to 40") as error:
        select(diagram(*BOTH), frequencies=[outside])
    assert "Select one of the nearest, 8, 14 Hz" in str(error.value)
    assert len(select(diagram(*BOTH), frequencies=[outside], tolerance=0.011)) == 1


def test_of_several_near_the_one_with_nothing_against_it_is_meant_then_the_one_at_most_orders() -> None:
    weak = Pole(2, 14.1, 0.001, shape=(1, 3.1), part=(0.1, 0, 0))
    made = diagram(*BOTH, *at(weak, [2, 4, 6, 8]))
    assert select(made, frequencies=[14.1]).frequencies[0] == pytest.approx(14)
    weaker = Pole(2, 14.2, 0.001, shape=(3, 1), part=(0, 0.1, 0))
    rare = diagram(*at(ONE, ORDERS), *at(weak, [2, 4, 6, 8]), *at(weaker, [2, 4, 6]))
    assert select(rare, frequencies=[14.2]).frequencies[0] == pytest.approx(14.1)


def test_two_frequencies_that_mean_one_mode_are_refused() -> None:
    with pytest.raises(DataError, match="two of them match the mode at 8 Hz"):
        select(diagram(*BOTH), frequencies=[8, 8.01])


def test_no_frequency_asked_by_hand_and_other_things_than_frequencies_are_refused() -> None:
    with pytest.raises(DataError, match="the list is empty"):
        select(diagram(*BOTH), frequencies=[])
    with pytest.raises(DataError, match="each of frequencies"):
        select(diagram(*BOTH), frequencies=[-8])
    with pytest.raises(DataError, match="tolerance"):
        select(diagram(*BOTH), frequencies=[8], tolerance=0)


def test_a_diagram_without_oscillations_has_no_modes() -> None:
    assert len(select(diagram(Pole(2, s=-1 + 0j), Pole(4, s=1 + 10j)))) == 0
