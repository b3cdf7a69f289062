"""What an order counts, which orders there are, and the rows that say so."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope import DataError
from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.fraction import fraction
from modalscope.identification.method import BLOCKS, STATES, checked_orders
from modalscope.identification.orders import DEGREES, choose, states_each


def factors(kept: int, rank: int) -> Factors:
    """Factors of `kept` directions, of which `rank` stand above rounding."""
    return Factors(np.eye(9)[:, :kept], np.ones(kept), np.eye(9)[:, :kept], np.ones(kept), rank, "by hand")


def lines(count: int, inputs: int = 1) -> FrequencyResponse:
    values = np.random.default_rng(0).standard_normal((count, 2, inputs)) * (1 + 1j)
    return FrequencyResponse(values=values, frequencies=1 + np.arange(count))


def test_orders_above_the_rank_are_left_out_with_a_note_and_an_exact_rank_is_an_order() -> None:
    reach = STATES.reach(factors(kept=8, rank=5), [2, 4, 6, 8], automatic=True)
    assert reach.orders == [2, 4, 5]
    assert reach.notes[0].numbers == {"lowest": 6.0, "highest": 8.0, "rank": 5.0}
    assert not STATES.reach(factors(kept=8, rank=8), [2, 4], automatic=True).notes


def test_a_rank_that_ends_with_the_matrix_is_not_that_of_the_data() -> None:
    """All directions that there are stand above rounding: nothing says that the data end there."""
    assert STATES.reach(factors(kept=5, rank=5), [2, 4, 8], automatic=True).orders == [2, 4]


def test_orders_asked_by_hand_that_are_all_too_large_are_an_error_and_chosen_ones_give_the_rank() -> None:
    with pytest.raises(DataError, match="Lower the orders to at most 3"):
        STATES.reach(factors(kept=8, rank=3), [4, 6], automatic=False)
    assert STATES.reach(factors(kept=8, rank=3), [4, 6], automatic=True).orders == [3]


def test_blocks_and_degrees_are_not_bounded_by_a_rank() -> None:
    for rule in (BLOCKS, DEGREES):
        assert rule.reach(factors(kept=8, rank=3), [4, 6], automatic=True).orders == [4, 6]


@pytest.mark.parametrize(
    ("measured", "top"),
    [
        (lines(200), 80),
        (lines(15), 14),
        (lines(15, inputs=3), 44),
        (ImpulseResponse(values=np.ones((50, 1, 1)), sampling_rate=1.0), 60),
        (ImpulseResponse(values=np.ones((50, 1, 1)), sampling_rate=1.0, kind="correlation"), 40),
    ],
)
def test_the_ladder_ends_where_more_states_are_of_no_use(
    measured: FrequencyResponse | ImpulseResponse, top: int
) -> None:
    ladder = STATES.ladder(measured)
    assert (ladder[0], ladder[-1]) == (2, top)
    assert set(np.diff(ladder)) == {2}


def test_degrees_end_at_sixty_and_at_two_hundred_and_forty_poles() -> None:
    assert DEGREES.ladder(lines(50))[-1] == 60
    assert DEGREES.ladder(lines(50, inputs=6))[-1] == 40
    assert states_each(DEGREES, lines(50, inputs=6)) == 6


@pytest.mark.parametrize("start", [0.0, 0.1, 0.2, 0.29, 0.31])
def test_degrees_end_where_lines_of_a_band_no_longer_tell_powers_apart(start: float) -> None:
    f = np.linspace(start * 100, 100, 400)
    measured = FrequencyResponse(values=np.full((400, 1, 1), 1 + 1j), frequencies=f)
    top = DEGREES.ladder(measured)[-1]
    # a band from .3 on is shifted to fill the half circle, and so does one that begins at zero
    assert top == 60 if start in (0.0, 0.31) else 25 < top <= 60
    assert np.all(np.isfinite(fraction(measured, degree=top).lower_triangle))
    if start == 0.29:
        with pytest.raises(DataError, match="cover too little of the unit circle"):
            assert fraction(measured, degree=2 * top).lower_triangle is None


def test_orders_are_sorted_each_once_and_there_must_be_one() -> None:
    assert checked_orders([8, 2, 4, 4]) == [2, 4, 8]
    with pytest.raises(DataError, match="the range of orders is empty"):
        checked_orders([])


def test_one_number_is_the_largest_of_the_orders() -> None:
    """Every second order up to it, for whoever takes orders, and in the document that replays it."""
    assert checked_orders(6) == [2, 4, 6]
    assert checked_orders(np.int64(5)) == [1, 3, 5]
    for wrong in (0, -2, 2.5, True, 10**12):
        with pytest.raises(DataError, match="orders needs "):
            checked_orders(wrong)
    response = ms.systems.chain5().impulse_response(120, noise=0.01, seed=0)
    assert ms.stabilize(response, orders=12).orders == tuple(range(2, 13, 2))
    assert ms.analyze(response, orders=12, refine=False).analysis.orders == tuple(range(2, 13, 2))
    comparison = ms.compare(response, ["era/time"], orders=12)
    assert comparison.settings["orders"] == comparison.results[0].diagram.orders == tuple(range(2, 13, 2))


def test_one_order_of_blocks_is_twice_what_stands_out_in_whole_blocks() -> None:
    """Four singular values far above the noise; blocks of three: 2 x 4 = 8 states are three blocks."""

    class Matrix:
        block_rows = 5

    d = np.concatenate([[100.0, 90, 80, 70], np.linspace(1.2, 0.8, 14)])
    P = np.eye(18)
    made = Factors(P, d, np.eye(40)[:, :18], d, 18, "by hand")
    choice = choose(BLOCKS, 18, lambda largest: (Matrix(), made))  # type: ignore[arg-type,return-value]
    assert choice.order == 9
    assert choose(STATES, 18, lambda largest: (Matrix(), made)).order == 4  # type: ignore[arg-type,return-value]
