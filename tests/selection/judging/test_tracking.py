"""Poles followed over orders: when two of one order are one mode, when two of different orders agree, what a track is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.selection.judging.tracking import (
    _MAX_DECAY_RATIO,
    GAP,
    SAME_BANDWIDTH,
    SAME_DAMPING,
    SAME_FREQUENCY,
    SAME_SHAPE,
    SPLIT,
    consensus,
    join_broken,
    merge_splits,
    tracks,
)
from tests.selection.judging.made import NUDGE, Pole, at_angle, poles_of

# ------------------------------------------------------------------------------------------------- splits within an order


def test_two_poles_within_their_bandwidths_become_their_energy_weighted_mean() -> None:
    # residues 2 and 4: energies 2^2 / 1 = 4 and 4^2 / 2 = 8
    pair = poles_of(
        Pole(4, s=-1 + 100j, shape=(1, 0), part=(0, 2, 0), own=0.3),
        Pole(4, s=-2 + 101j, shape=(1, 0), part=(0, 4, 0), own=0.5),
    )
    one = merge_splits(pair)
    assert one.pole.size == 1
    assert np.allclose(one.pole, (4 * (-1 + 100j) + 8 * (-2 + 101j)) / 12, rtol=1e-14)
    assert np.allclose(np.outer(one.shape[0], one.participation[0]), [[0, 6, 0], [0, 0, 0]], atol=1e-14)
    # the size of a contribution goes with the residue over the root of the decay: 6 / 2 of the first, and Re s = -20/12
    assert one.own[0] == pytest.approx(0.3 * 3 / np.sqrt(20 / 12))
    assert (one.order[0], one.orders) == (4, (4,))


@pytest.mark.parametrize("strong", [0, 1])
def test_a_merged_pole_keeps_the_place_in_the_diagram_of_the_stronger(strong: int) -> None:
    size = [3.0, 1.0] if strong == 0 else [1.0, 3.0]
    made = [Pole(4, 30), *(Pole(4, s=-1 + (100 + k) * 1j, part=(size[k], 0, 0)) for k in range(2))]
    assert merge_splits(poles_of(*made)).index.tolist() == [0, 1 + strong]


def test_what_acts_against_each_other_is_still_merged_to_a_pole_between() -> None:
    pair = poles_of(Pole(4, s=-1 + 100j, part=(3, 0, 0)), Pole(4, s=-1 + 101j, part=(-1, 0, 0)))
    one = merge_splits(pair)
    assert np.allclose(one.pole, -1 + 100.1j)  # energies 9 and 1
    assert np.allclose(np.outer(one.shape[0], one.participation[0]), [[2, 0, 0], [0, 0, 0]])


@pytest.mark.parametrize("strong", [1.0, 100.0])
def test_what_is_many_times_as_wide_goes_with_a_mode_and_says_nothing_of_its_decay(strong: float) -> None:
    # with a hundredth of the energy a part of 20 times the width would move the damping by a fifth; residues still add up
    for wider, kept in ((_MAX_DECAY_RATIO - NUDGE, False), (_MAX_DECAY_RATIO + NUDGE, True)):
        narrow = Pole(2, s=-1 + 100j, part=(strong, 0, 0))
        wide = Pole(2, s=complex(-wider, 101), part=(3.0, 0, 0))
        one = merge_splits(poles_of(narrow, wide))
        own = -1 + 100j if strong**2 > 9 / wider else complex(-wider, 101)
        assert one.pole.size == 1
        assert bool(abs(one.pole[0] - own) < 1e-12) is kept
        assert np.linalg.norm(one.shape[0]) * np.linalg.norm(one.participation[0]) == pytest.approx(strong + 3)


@pytest.mark.parametrize(("apart", "left"), [(3 - NUDGE, 1), (3.0, 2), (3 + NUDGE, 2)])
def test_poles_overlap_when_nearer_than_the_sum_of_their_half_bandwidths(apart: float, left: int) -> None:
    pair = poles_of(Pole(2, s=-1 + 100j), Pole(2, s=complex(-2, 100 + apart)))
    assert merge_splits(pair).pole.size == left


@pytest.mark.parametrize(("side", "left"), [(-1, 1), (1, 2)])
def test_a_summed_residue_is_of_rank_one_by_its_second_singular_value(side: int, left: int) -> None:
    # residues on different outputs and inputs have the singular values 1 and r; 1 - 2.5 r^2 is the likeness
    r = np.sqrt((1 - SPLIT) / 2.5) + side * NUDGE
    pair = poles_of(Pole(2, s=-1 + 100j), Pole(2, s=-1 + 100.5j, shape=(0, 1), part=(0, 0, r)))
    assert merge_splits(pair).pole.size == left


@pytest.mark.parametrize(
    ("shape", "part"), [((0, 1), (1, 0, 0)), ((1, 0), (0, 1, 0))], ids=["other shape", "other participation"]
)
def test_residues_that_share_one_side_only_sum_to_rank_one(shape: tuple[int, ...], part: tuple[int, ...]) -> None:
    pair = poles_of(Pole(2, s=-1 + 100j), Pole(2, s=-1 + 100.5j, shape=shape, part=part))
    assert merge_splits(pair).pole.size == 1


@pytest.mark.parametrize(
    ("apart", "shape", "left"),
    [(3.0 + NUDGE, (0, 1), 2), (3.0 - NUDGE, (0, 1), 1), (30.0, (0.2, 1), 2), (30.0, (3.1, 1), 1), (np.inf, (0, 1), 1)],
    ids=["apart", "within their deviations", "unlike shapes", "one shape", "not known"],
)
def test_what_inputs_drive_alike_is_two_modes_where_the_data_tell_them_apart(
    apart: float, shape: tuple[float, ...], left: int
) -> None:
    """Both under one participation, .5 rad/s from each other; the second stands second in the diagram."""
    pair = poles_of(Pole(2, s=-1 + 100j), Pole(2, s=-1 + 100.5j, shape=shape))
    each = np.nan if np.isinf(apart) else 0.5 / apart
    assert merge_splits(pair, np.array([0.25 * each, 0.75 * each])).pole.size == left


def test_in_levels_of_channels_their_units_count_for_nothing() -> None:
    """One in units of each channel is merged as the other, to the same values; without levels the first output would be all there is."""
    outputs, inputs = np.array([1e9, 1e-3]), np.array([1e-4, 1.0, 1e6])
    made = [Pole(2, s=-1 + 100j, shape=(1, 0.4), part=(1, 2, 3)), Pole(2, s=-2 + 101j, shape=(1, 0.6), part=(1, 2, 1))]
    pair, one = poles_of(*made), merge_splits(poles_of(*made))
    told = replace(pair, shape=pair.shape * outputs, participation=pair.participation * inputs)
    other = merge_splits(told, levels=(outputs, inputs))
    assert (one.pole.size, other.pole.size) == (1, 1)
    assert np.allclose(other.pole, one.pole, rtol=1e-14)
    assert np.allclose(other.own, one.own, rtol=1e-12)
    residue = np.outer(one.shape[0] * outputs, one.participation[0] * inputs)
    assert np.allclose(np.outer(other.shape[0], other.participation[0]), residue, rtol=1e-12)


def test_repeated_modes_stay_apart() -> None:
    pair = poles_of(Pole(2, s=-1 + 100j), Pole(2, s=-1 + 100j, shape=(0, 1), part=(0, 1, 0)))
    assert merge_splits(pair).pole.size == 2


@pytest.mark.parametrize(("likeness", "left"), [(SPLIT + NUDGE, 1), (SPLIT - NUDGE, 2)])
def test_with_one_input_shapes_decide_and_with_one_output_participation(likeness: float, left: int) -> None:
    turned = at_angle(likeness)
    one_input = poles_of(Pole(2, s=-1 + 100j, part=(1,)), Pole(2, s=-1 + 100.5j, shape=turned, part=(1,)))
    one_output = poles_of(
        Pole(2, s=-1 + 100j, shape=(1,)), Pole(2, s=-1 + 100.5j, shape=(1,), part=(turned[0], 0, turned[1]))
    )
    assert merge_splits(one_input).pole.size == left
    assert merge_splits(one_output).pole.size == left


def test_poles_of_different_orders_are_never_merged_and_three_of_one_order_become_one() -> None:
    made = [Pole(2, s=-1 + 100j), *(Pole(4, s=complex(-1, 100 + 0.1 * k)) for k in range(3)), Pole(6, s=-1 + 100j)]
    merged = merge_splits(poles_of(*made))
    assert merged.order.tolist() == [2, 4, 6]
    # the first two are twice one of them, of four times its energy
    assert np.allclose(merged.pole[1], -1 + (4 * 100.05 + 100.2) / 5 * 1j)


# -------------------------------------------------------------------------------------------------------- what agrees


def agree(a: Pole, b: Pole) -> bool:
    poles = poles_of(a, b)
    members = consensus(poles, np.array([0, 1]))
    assert consensus(poles, np.array([1, 0])).size == members.size  # agreement is mutual
    return bool(members.size == 2)


@pytest.mark.parametrize(("side", "expected"), [(-1, True), (1, False)])
@pytest.mark.parametrize(
    ("zeta", "limit"), [(0.1, SAME_FREQUENCY), (0.01, SAME_BANDWIDTH * 0.01), (0.001, SAME_BANDWIDTH * 0.001)]
)
def test_frequencies_agree_within_half_a_per_cent_and_a_quarter_of_the_half_bandwidth(
    zeta: float, limit: float, side: int, expected: bool
) -> None:
    # the distance is a part of the lower frequency
    assert agree(Pole(2, 10, zeta), Pole(4, 10 * (1 + limit * (1 + side * NUDGE)), zeta)) is expected


def test_the_wider_of_two_bandwidths_counts() -> None:
    apart = SAME_BANDWIDTH * 0.01 * (1 - NUDGE)
    assert agree(Pole(2, 10, 0.01), Pole(4, 10 * (1 + apart), 0.009))
    assert not agree(Pole(2, 10, 0.009), Pole(4, 10 * (1 + apart), 0.009))


@pytest.mark.parametrize(("side", "expected"), [(-1, True), (1, False)])
def test_damping_agrees_within_a_quarter_of_the_larger(side: int, expected: bool) -> None:
    assert agree(Pole(2, zeta=0.1), Pole(4, zeta=0.1 * (1 - SAME_DAMPING * (1 + side * NUDGE)))) is expected


@pytest.mark.parametrize(("side", "expected"), [(1, True), (-1, False)])
def test_shapes_agree_above_their_likeness(side: int, expected: bool) -> None:
    assert agree(Pole(2), Pole(4, shape=at_angle(SAME_SHAPE + side * NUDGE))) is expected


def test_participation_is_not_asked_of_poles_that_agree() -> None:
    assert agree(Pole(2), Pole(4, part=(0, 0, 1)))


def test_the_consensus_is_that_of_the_member_most_agree_with() -> None:
    # within 0.5 %: the middle one agrees with both ends, which do not agree with each other; the last is an outlier
    poles = poles_of(*(Pole(2 * k + 2, f, 0.1) for k, f in enumerate([10.0, 10.04, 10.08, 10.5])))
    assert consensus(poles, np.arange(4)).tolist() == [0, 1, 2]
    assert consensus(poles, np.array([3, 0, 1])).tolist() == [0, 1]


# ------------------------------------------------------------------------------------------------------------- tracks


def followed(*made: Pole, orders: range | None = None) -> list[list[int]]:
    return [t.tolist() for t in tracks(poles_of(*made, orders=orders))]


def test_a_mode_at_every_order_is_one_track_and_no_track_has_two_poles_of_an_order() -> None:
    assert followed(Pole(2, 10), Pole(2, 20), Pole(4, 10.001), Pole(4, 20), Pole(6, 10)) == [[0, 2, 4], [1, 3]]
    assert followed(Pole(2), Pole(4), Pole(4)) == [[0, 1], [2]]


def test_poles_are_assigned_at_least_cost_in_all_not_one_by_one() -> None:
    # 10.03 lies nearest to 10.04, but then 10.065 would have to go to 10.00: 0.1 + 0.65 instead of 0.3 + 0.25
    assert followed(Pole(2, 10.0), Pole(2, 10.04), Pole(4, 10.03), Pole(4, 10.065)) == [[0, 2], [1, 3]]


@pytest.mark.parametrize(("places", "count"), [(GAP, 1), (GAP + 1, 2)])
def test_a_track_goes_on_up_to_so_many_orders_later(places: int, count: int) -> None:
    assert len(followed(Pole(2), Pole(2 + 2 * places), orders=range(2, 14, 2))) == count


@pytest.mark.parametrize(("zeta", "limit"), [(0.0001, 0.001), (0.005, 0.01), (0.1, 0.02)])
def test_a_track_looks_two_half_bandwidths_far_but_at_least_and_at_most_so_far(zeta: float, limit: float) -> None:
    for side, count in ((-1, 1), (1, 2)):
        assert len(followed(Pole(2, 10, zeta), Pole(4, 10 * (1 + limit * (1 + side * NUDGE)), zeta))) == count


@pytest.mark.parametrize(("likeness", "count"), [(0.5 + NUDGE, 1), (0.5 - NUDGE, 2)])
def test_a_track_does_not_go_on_with_another_shape(likeness: float, count: int) -> None:
    assert len(followed(Pole(2), Pole(4, shape=at_angle(likeness)))) == count


@pytest.mark.parametrize(
    "rival",
    [Pole(4, 10, shape=at_angle(0.93)), Pole(4, 10, zeta=0.01 * (1 - 0.28))],
    ids=["1 - MAC of 0.07", "28 % in damping"],
)
def test_distance_in_half_bandwidths_weighs_against_damping_and_four_times_the_shape(rival: Pole) -> None:
    # the rival costs 0.28: more than 0.27 half bandwidths of frequency, less than 0.29
    assert followed(Pole(2), rival, Pole(4, 10 * 1.0027)) == [[0, 2], [1]]
    assert followed(Pole(2), rival, Pole(4, 10 * 1.0029)) == [[0, 1], [2]]


@pytest.mark.parametrize(("apart", "expected"), [(0.49, [[0], [1, 2, 3]]), (0.51, [[0, 3], [1, 2]])])
def test_an_order_missed_costs_half_a_half_bandwidth(apart: float, expected: list[list[int]]) -> None:
    # the last pole lies at the very frequency of the track that missed an order, and a little off the one that did not
    beside = 10 * (1 + 0.01 * apart)
    assert followed(Pole(2, 10), Pole(2, beside), Pole(4, beside), Pole(6, 10)) == expected


def test_no_poles_no_tracks() -> None:
    empty = poles_of(Pole(2)).take(np.array([], dtype=int))
    assert tracks(empty) == []


# ------------------------------------------------------------------------------------------------- lost and taken up


def joined(host: list[Pole], other: list[Pole]) -> list[list[int]]:
    poles = poles_of(*host, *other)
    groups = [np.arange(len(host)), np.arange(len(host), len(host) + len(other))]
    return [g.tolist() for g in join_broken(poles, groups)]


HOST = [Pole(n) for n in (2, 4, 6, 8, 10)]


def test_a_mode_lost_and_taken_up_again_is_one_group() -> None:
    assert joined(HOST, [Pole(12), Pole(14)]) == [list(range(7))]


@pytest.mark.parametrize(("side", "groups"), [(-1, 1), (1, 2)])
def test_it_lies_within_the_sum_of_both_half_bandwidths(side: int, groups: int) -> None:
    # 10 (1 + d) is d * 10 Hz away; the half bandwidths are 0.1 and 0.012 (1 + d) 10
    d = (0.01 + 0.012) / (1 - 0.012) * (1 + side * NUDGE)
    assert len(joined(HOST, [Pole(12, 10 * (1 + d), 0.012)])) == groups


@pytest.mark.parametrize(("likeness", "groups"), [(0.9 + NUDGE, 1), (0.9 - NUDGE, 2)])
def test_it_has_the_same_shape(likeness: float, groups: int) -> None:
    assert len(joined(HOST, [Pole(12, shape=at_angle(likeness))])) == groups


def test_orders_the_group_has_already_and_damping_off_by_half_are_not_taken() -> None:
    others = [Pole(10), Pole(12, zeta=0.01 * (1.5 + NUDGE)), Pole(14, zeta=0.01 * (1.5 - NUDGE)), Pole(16, zeta=0.0051)]
    assert joined(HOST, others) == [[0, 1, 2, 3, 4, 7, 8]]


def test_the_larger_group_takes_up_the_smaller_and_of_equals_that_of_lower_frequency() -> None:
    assert joined([Pole(12)], HOST) == [[1, 2, 3, 4, 5, 0]]
    assert joined([Pole(2, 10.01)], [Pole(4, 10)]) == [[1, 0]]


def test_frequency_and_damping_of_poles_are_those_of_their_definition() -> None:
    poles = poles_of(Pole(2, s=-3 + 4j), Pole(4, s=-6 + 8j), Pole(4, s=-5 + 12j, own=0.5))
    assert np.allclose(poles.frequency, np.array([5, 10, 13]) / (2 * np.pi))
    assert np.allclose(poles.damping, [3 / 5, 3 / 5, 5 / 13])
    last = poles.take(np.array([2]))
    assert (last.order.tolist(), last.pole.tolist(), last.own.tolist()) == ([4], [-5 + 12j], [0.5])
    assert last.orders == (2, 4)
