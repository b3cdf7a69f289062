"""Modes paired across methods: which are the same, who has a vote, and what the methods agree on."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from modalscope.analysis.comparing.agreement import Group, pair
from modalscope.analysis.comparing.run import MethodResult
from modalscope.data.indicators import mac
from modalscope.data.modes import ModalModel
from modalscope.data.sameness import log_ratios
from modalscope.numerics.functions.poles import poles_from
from tests.analysis.comparing.made import ALL, ALTERNATE, ERA, LEAST, POLY, PRCE, Mode, kin, result
from tests.selection.judging.made import NUDGE, at_angle

X = (1.0, 0.0)


def paired(*results: MethodResult, equal: tuple[str, ...] = ()) -> tuple[tuple[Group, ...], tuple[Group, ...]]:
    names = [r.name for r in results if r.modes is not None]
    return pair(results, kin(names, equal) if equal else kin(names))


def groups(*modes: Mode) -> list[int]:
    """Let as many methods find one mode each, and return the sizes of the groups by frequency."""
    found, _ = paired(*(result(name, [mode]) for name, mode in zip(ALL, modes, strict=False)))
    return [len(g.members) for g in found]


# -------------------------------------------------------------------------------------------------------- what is one mode


def ratio(one: Mode, other: Mode) -> float:
    models = [ModalModel(poles=poles_from([f], [zeta]), shapes=np.array(x)[:, None]) for f, zeta, x in (one, other)]
    return float(log_ratios(*models)[0, 0])


@pytest.mark.parametrize(("zeta", "other"), [(0.0001, 0.0001), (0.02, 0.02), (0.2, 0.2), (0.02, 0.005), (0.005, 0.02)])
@pytest.mark.parametrize(("side", "sizes"), [(-1, [2]), (1, [1, 1])])
def test_modes_are_one_where_they_are_the_same_rather(zeta: float, other: float, side: int, sizes: list[int]) -> None:
    limit = brentq(lambda apart: ratio((10, zeta, X), (10 * (1 + apart), other, X)), 0, 1)
    at = 10 * (1 + limit * (1 + side * NUDGE))
    assert groups((10, zeta, X), (at, other, X)) == sizes
    assert groups((at, other, X), (10, zeta, X)) == sizes


@pytest.mark.parametrize(("side", "sizes"), [(1, [2]), (-1, [1, 1])])
def test_modes_of_different_shapes_are_not_one(side: int, sizes: list[int]) -> None:
    limit = brentq(lambda like: ratio((10, 0.02, X), (10, 0.02, at_angle(like))), 0.01, 0.99)
    assert groups((10, 0.02, X), (10, 0.02, at_angle(limit + side * NUDGE))) == sizes


def test_one_mode_of_a_method_in_a_group() -> None:
    found, _ = paired(result(ERA, [(10, 0.02, X), (10.01, 0.02, X)]), result(PRCE, [(10.012, 0.02, X)]))
    assert [dict(g.members) for g in found] == [{ERA: 0}, {ERA: 1, PRCE: 0}]


@pytest.mark.parametrize("other", [(10, 0.02, at_angle(0.99)), (10, 0.02, at_angle(0.8)), (10.1, 0.02, X)])
def test_of_two_the_likelier_is_taken(other: Mode) -> None:
    damped: Mode = (10, 0.0152, X)
    found, _ = paired(result(ERA, [(10, 0.02, X)]), result(PRCE, [other, damped]))
    first = 0 if ratio((10, 0.02, X), other) > ratio((10, 0.02, X), damped) else 1
    assert max(found, key=lambda g: len(g.members)).members == {ERA: 0, PRCE: first}


def test_modes_are_assigned_at_least_cost_in_all() -> None:
    # 10.15 is nearest to 10.20, but 10.33 then has nothing within reach of 10.00
    found, _ = paired(
        result(ERA, [(10.0, 0.02, X), (10.2, 0.02, X)]), result(PRCE, [(10.15, 0.02, X), (10.33, 0.02, X)])
    )
    assert [dict(g.members) for g in found] == [{ERA: 0, PRCE: 0}, {ERA: 1, PRCE: 1}]


def test_a_mode_moves_to_the_group_it_is_nearest_to_when_that_has_come_up() -> None:
    # era's own mode is joined by alternate's, which belongs to what only the others see
    early = result(ERA, [(10.0, 0.02, X)])
    between = result(ALTERNATE, [(10.22, 0.02, X)])
    late = [result(name, [(10.0, 0.02, X), (10.24, 0.02, X)]) for name in (POLY, LEAST)]
    found, _ = paired(early, between, *late)
    assert [sorted(g.members) for g in found] == [sorted([ERA, POLY, LEAST]), sorted([ALTERNATE, POLY, LEAST])]


# ------------------------------------------------------------------------------------------------------- who has a vote


def test_transformed_data_have_no_vote_and_what_they_alone_show_is_unconfirmed() -> None:
    found, alone = paired(
        result(ERA, [(10, 0.02, X)]),
        result(ALTERNATE, [(10.1, 0.02, X)]),
        result(PRCE, [(10.2, 0.04, X), (20, 0.02, X)], exact=False),
    )
    assert len(found) == 1
    assert found[0].votes == (ERA, ALTERNATE)
    assert found[0].voters == 2
    assert found[0].members == {ERA: 0, ALTERNATE: 0, PRCE: 0}
    assert (found[0].frequency, found[0].damping) == (pytest.approx(10.05), pytest.approx(0.02))
    assert [g.frequency for g in alone] == [pytest.approx(20)]
    assert alone[0].votes == ()


def test_methods_that_are_the_same_have_one_vote_together() -> None:
    results = [result(ERA, [(10, 0.02, X)]), result(LEAST, [(10, 0.02, X)]), result(PRCE, [(10.2, 0.02, X)])]
    assert paired(*results)[0][0].frequency == pytest.approx(10)
    same = paired(*results, equal=(ERA, LEAST))[0][0]
    assert same.votes == (ERA, PRCE)
    assert same.voters == 2
    assert same.frequency == pytest.approx(10.1)


def test_where_no_method_has_a_vote_all_have() -> None:
    found, alone = paired(*(result(name, [(10, 0.02, X)], exact=False) for name in (ERA, PRCE)))
    assert found[0].votes == (ERA, PRCE)
    assert not alone


def test_methods_that_failed_take_no_part_and_no_modes_are_no_groups() -> None:
    found, _ = paired(result(ERA, None), result(PRCE, [(10, 0.02, X)]))
    assert (found[0].voters, found[0].votes) == (1, (PRCE,))
    assert paired(result(ERA, None), result(PRCE, None)) == ((), ())
    assert paired(result(ERA, []), result(PRCE, [])) == ((), ())
    # a method that found nothing has a vote against
    assert paired(result(ERA, []), result(PRCE, [(10, 0.02, X)]))[0][0].voters == 2


# ------------------------------------------------------------------------------------------------- what they agree on


def test_values_are_medians_and_groups_come_by_frequency() -> None:
    f, zeta = [10, 10.01, 10.1], [0.02, 0.022, 0.021]
    results = [result(n, [(20, 0.02, X), (a, b, X)]) for n, a, b in zip((ERA, ALTERNATE, PRCE), f, zeta, strict=True)]
    found, _ = paired(*results)
    assert [g.frequency for g in found] == [pytest.approx(10.01), pytest.approx(20)]
    assert found[0].damping == pytest.approx(0.021)
    assert found[0].members == {ERA: 1, ALTERNATE: 1, PRCE: 1}
    assert found[0].frequencies == {n: pytest.approx(v) for n, v in zip((ERA, ALTERNATE, PRCE), f, strict=True)}
    assert found[0].damping_ratios == {n: pytest.approx(v) for n, v in zip((ERA, ALTERNATE, PRCE), zeta, strict=True)}
    assert found[0].half_bandwidth == pytest.approx(10.01 * 0.021)
    assert abs(found[0].pole) == pytest.approx(2 * np.pi * 10.01)
    assert found[0].pole.real == pytest.approx(-2 * np.pi * 10.01 * 0.021)


@pytest.mark.parametrize(
    ("f", "spread"),
    [
        ([10.0], 0.0),
        ([10.0, 10.2], 0.2 / np.sqrt(2)),
        ([10.0, 10.1, 10.2], 0.1),
        ([10.0, 10.02, 10.1, 10.3], 1.4826 * 0.05),  # from 10.06: .06, .04, .04, .24
        ([10.0, 10.02, 10.1, 10.3, 10.13], 1.4826 * 0.08),  # from 10.1: .1, .08, 0, .2, .03
    ],
)
def test_between_methods_it_is_the_standard_deviation_of_few_and_the_median_deviation_of_many(
    f: list[float], spread: float
) -> None:
    found, _ = paired(*(result(name, [(v, v / 500, X)]) for name, v in zip(ALL, f, strict=False)))
    assert len(found) == 1
    assert found[0].frequency_between == pytest.approx(spread, abs=1e-12)
    assert found[0].damping_between == pytest.approx(spread / 500, abs=1e-12)


def test_the_shape_is_that_of_the_vote_nearest_to_all_others() -> None:
    shapes = {ERA: at_angle(1.0), ALTERNATE: at_angle(0.99), LEAST: at_angle(0.9), PRCE: at_angle(0.8)}
    found, _ = paired(*(result(name, [(10, 0.02, s)], exact=name != PRCE) for name, s in shapes.items()))
    assert np.allclose(found[0].shape, at_angle(0.99))
    for name, shape in shapes.items():
        assert found[0].mac[name] == pytest.approx(mac(shape, at_angle(0.99))[0, 0])
