"""Why methods differ: every rule from both sides of its limit, and which cause is named for which mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.data_causes import changed, order_cause
from modalscope.analysis.comparing.diagnosis import CAUSES, HEAVY, Cause, disagreements, mode_causes
from modalscope.analysis.comparing.run import MethodResult
from modalscope.analysis.comparing.scatter import Biased, Scatter
from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.modes import ModalModel
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.evidence import LEAST_PEAK, LEAST_SIGNAL
from tests.analysis.comparing.made import ALL, ALTERNATE, ERA, POLY, PRCE, group, result
from tests.selection.judging.made import NUDGE, Pole, diagram_of

SAMPLES = ImpulseResponse(values=np.ones((100, 2, 3)), sampling_rate=50.0)


def lines(first: float = 0.0, last: float = 100.0, step: float = 0.01) -> FrequencyResponse:
    f = np.arange(first, last + step / 2, step)
    return FrequencyResponse(values=1j * np.ones((f.size, 2, 3)), frequencies=f)


def named(
    *groups: Group,
    response: ImpulseResponse | FrequencyResponse = SAMPLES,
    results: Sequence[MethodResult] = (),
    differing: Sequence[str] = (),
) -> list[str]:
    return [c.name for c in mode_causes(0, groups, response, results, differing)]


def test_nothing_is_wrong_with_a_plain_mode() -> None:
    assert named(group(10, 0.02), group(20, 0.02), response=lines()) == []


@pytest.mark.parametrize(("side", "expected"), [(-1, []), (1, ["heavy damping"])])
def test_heavy_damping_begins_above_ten_per_cent(side: int, expected: list[str]) -> None:
    assert named(group(10, HEAVY * (1 + side * NUDGE))) == expected


# ------------------------------------------------------------------------------------------------------------ close pair


@pytest.mark.parametrize(("side", "expected"), [(-1, ["close pair"]), (1, [])])
def test_a_close_pair_lies_within_the_sum_of_both_half_bandwidths(side: int, expected: list[str]) -> None:
    # 10 Hz of 2 % and f of 1 %: 0.2 + 0.01 f = f - 10
    f = 10 + (0.2 + 0.1) / 0.99 * (1 + side * NUDGE)
    assert named(group(10, 0.02), group(f, 0.01)) == expected
    assert named(group(f, 0.01), group(10, 0.02)) == expected


def test_beside_a_heavily_damped_mode_nothing_is_a_close_pair() -> None:
    assert named(group(10, 0.02), group(10.5, HEAVY * (1 - NUDGE))) == ["close pair"]
    assert named(group(10, 0.02), group(10.5, HEAVY * (1 + NUDGE))) == []
    assert named(group(10, HEAVY * (1 + NUDGE)), group(10.5, 0.02)) == ["heavy damping"]


def test_the_nearest_is_the_one_it_is_close_to() -> None:
    cause = mode_causes(0, [group(10, 0.02), group(10.3, 0.02), group(9.9, 0.02)], SAMPLES, [])[0]
    assert cause.evidence == "9.9 Hz is 1 % away, half bandwidths 0.2 and 0.2 Hz"


# ---------------------------------------------------------------------------------------------------- bandwidths in the data

#: A decay of 1 / s widens every half bandwidth by 1 / (2 pi) Hz.
WIDER = 0.3


def windowed(response: ImpulseResponse | FrequencyResponse) -> Any:
    return replace(response, added_damping=2 * np.pi * WIDER)


def test_under_a_window_modes_are_close_when_their_bandwidths_in_the_data_overlap() -> None:
    # half bandwidths of 0.2 and 0.1 / 0.99 Hz, each 0.3 Hz wider under the window
    for side, expected in ((-1, ["close pair"]), (1, [])):
        f = 10 + (0.3 + 2 * WIDER) / 0.99 * (1 + side * NUDGE)
        assert named(group(10, 0.02), group(f, 0.01), response=windowed(SAMPLES)) == expected
        assert named(group(10, 0.02), group(f, 0.01)) == []
    cause = mode_causes(0, [group(10, 0.02), group(10.5, 0.02)], windowed(SAMPLES), [])[0]
    assert cause.evidence == "10.5 Hz is 5 % away, half bandwidths 0.5 and 0.51 Hz"


@pytest.mark.parametrize(("side", "expected"), [(-1, ["edge of the band"]), (1, [])])
def test_under_a_window_the_edge_is_one_bandwidth_of_the_data_wide(side: int, expected: list[str]) -> None:
    # 10 Hz of 2 %: a bandwidth of 0.4 Hz, and of 1 Hz under the window
    away = 2 * (0.2 + WIDER) * (1 + side * NUDGE)
    assert named(group(10, 0.02), response=windowed(lines(10 - away, 100.0))) == expected
    assert named(group(10, 0.02), response=lines(10 - away, 100.0)) == []


@pytest.mark.parametrize(("side", "expected"), [(-1, []), (1, ["too few lines"])])
def test_under_a_window_lines_are_counted_within_the_bandwidth_of_the_data(side: int, expected: list[str]) -> None:
    step = 2 * (0.2 + WIDER) / 3 * (1 + side * NUDGE)
    assert named(group(10, 0.02), response=windowed(lines(step=step))) == expected
    assert named(group(10, 0.02), response=lines(step=step)) == ["too few lines"]


# ------------------------------------------------------------------------------------------------------------- weak mode


def told(name: str, share: float, signal: float) -> MethodResult:
    """Return a method whose second mode has these reasons."""
    reasons = ({"share_of_peak": 9.0, "signal_to_noise": 9e9}, {"share_of_peak": share, "signal_to_noise": signal})
    return result(name, [(5, 0.02, (1, 0)), (10, 0.02, (1, 0))], reasons=reasons)


@pytest.mark.parametrize(
    ("share", "signal", "expected"),
    [
        (LEAST_PEAK, 4 * LEAST_SIGNAL, []),
        (LEAST_PEAK - NUDGE, 4 * LEAST_SIGNAL, ["weak mode"]),
        (LEAST_PEAK, 4 * LEAST_SIGNAL - NUDGE, ["weak mode"]),
    ],
)
def test_a_weak_mode_is_little_of_its_peak_or_near_the_noise(share: float, signal: float, expected: list[str]) -> None:
    found = group(members={ERA: 1})
    assert named(found, results=[told(ERA, share, signal)]) == expected


def test_weakness_is_the_median_of_the_methods_that_found_it() -> None:
    strong = [told(ERA, 1.0, 1000.0), told(ALTERNATE, 1.0, 1000.0)]
    weak = told(PRCE, 0.0, 1.0)
    found = group(members={ERA: 1, ALTERNATE: 1, PRCE: 1})
    assert named(found, results=[*strong, weak]) == []
    # prce does not have it here, and its second mode is another one
    assert named(group(members={ERA: 1}), results=[strong[0], weak]) == []
    assert named(group(members={PRCE: 1}), results=[*strong, weak]) == ["weak mode"]
    assert named(found, results=[result(ERA, [(10, 0.02, (1, 0))] * 2)]) == []  # no reasons, nothing to say


# ------------------------------------------------------------------------------------------------ lines, band and blocks


@pytest.mark.parametrize(("side", "expected"), [(-1, ["edge of the band"]), (1, [])])
def test_the_edge_is_one_bandwidth_wide_at_either_end(side: int, expected: list[str]) -> None:
    away = 0.4 * (1 + side * NUDGE)  # 2 x 10 Hz x 2 %
    assert named(group(10, 0.02), response=lines(first=10 - away)) == expected
    assert named(group(10, 0.02), response=lines(last=10 + away, step=(10 + away) / 2000)) == expected
    assert named(group(10, 0.02), response=SAMPLES) == []


@pytest.mark.parametrize(("side", "expected"), [(1, ["too few lines"]), (-1, [])])
def test_three_lines_lie_within_a_bandwidth(side: int, expected: list[str]) -> None:
    step = 0.4 / 3 * (1 + side * NUDGE)
    assert named(group(10, 0.02), response=lines(step=step)) == expected


def in_time(name: str, rows: Any, dt: float = 0.01, **more: Any) -> MethodResult:
    diagram = diagram_of(Pole(2), response=SAMPLES, settings={"block_rows": rows}, dt=dt)
    return result(name, [(10, 0.02, (1, 0))], diagram=diagram, **more)


@pytest.mark.parametrize(("rows", "expected"), [(10, []), (9, ["too few blocks"])])
def test_the_block_rows_span_one_period(rows: int, expected: list[str]) -> None:
    # 10 Hz sampled at 100 Hz: ten samples a period
    assert named(group(10), results=[in_time(ERA, 100), in_time(ALTERNATE, rows)]) == expected


def test_blocks_of_canonical_forms_of_transformed_data_and_of_lines_say_nothing() -> None:
    assert named(group(10), results=[in_time(POLY, 2)]) == []
    assert named(group(10), results=[in_time(PRCE, 2)]) == []
    assert named(group(10), results=[in_time(ERA, 2, exact=False)]) == []
    assert named(group(10), results=[in_time("era (z)", 2)]) == []


def test_transformed_data_are_the_cause_when_they_alone_differ() -> None:
    results = [result(ERA, exact=False), result(PRCE, exact=False), result("era (s)")]
    assert named(group(10), results=results, differing=[ERA]) == ["transformed data"]
    assert named(group(10), results=results, differing=[ERA, PRCE]) == ["transformed data"]
    assert named(group(10), results=results, differing=[ERA, "era (s)"]) == []
    assert named(group(10), results=results) == []
    evidence = mode_causes(0, [group(10)], SAMPLES, results, [ERA])[0].evidence
    assert evidence == "only methods on data transformed to lines differ"


# ----------------------------------------------------------------------------------------------------------------- order


def fitted(errors: Sequence[float], *, singular: Sequence[float] = (1, 1, 1), **more: Any) -> MethodResult:
    """Return a method whose fit errors at orders 2, 4, ... are these."""
    diagram = diagram_of(Pole(2), response=SAMPLES, orders=range(2, 2 * len(errors) + 1, 2), fit_errors=errors, **more)
    return result(ERA, diagram=replace(diagram, singular_values=np.array(singular, float)))


def too_low(errors: Sequence[float], **more: Any) -> bool:
    return order_cause([fitted(errors, **more)]) is not None


@pytest.mark.parametrize(("side", "expected"), [(-1, True), (1, False)])
def test_an_order_is_too_low_when_the_error_still_falls_steeply(side: int, expected: bool) -> None:
    # orders 2 to 16, three quarters are 12: two pairs of states later it is .85^2 of what it was
    end = 0.02 * 0.85**2 * (1 + side * NUDGE)
    assert too_low([0.5, 0.4, 0.3, 0.2, 0.1, 0.02, end, end]) is expected


@pytest.mark.parametrize(
    ("before", "end", "expected"),
    [
        (0.15, 0.15 * 0.8 * (1 - NUDGE), True),
        (0.15, 0.15 * 0.8 * (1 + NUDGE), False),
        (0.1 * (1 + NUDGE) / 0.79, 0.1 * (1 + NUDGE), True),
        (0.1 * (1 - NUDGE) / 0.79, 0.1 * (1 - NUDGE), False),
    ],
)
def test_or_by_a_fifth_while_more_than_a_tenth_is_left(before: float, end: float, expected: bool) -> None:
    assert too_low([0.5, 0.4, 0.3, 0.2, 0.2, before, end, end]) is expected


@pytest.mark.parametrize(
    ("left", "count", "expected"),
    [(0.03 * (1 + NUDGE), 17, True), (0.03 * (1 - NUDGE), 17, False), (0.03 * (1 + NUDGE), 16, False)],
)
def test_or_when_more_singular_values_stand_out_than_there_are_states(left: float, count: int, expected: bool) -> None:
    # 16 states; values above 2.86 stand out of a median of 1, those below do not
    singular = [2.86 * (1 + NUDGE)] * count + [2.86 * (1 - NUDGE)] * 2 + [1.0] * 40
    assert too_low([left] * 8, singular=singular) is expected


def test_exact_data_and_rounding_are_never_too_low() -> None:
    falling = [0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01]
    assert too_low(falling)
    assert not too_low(falling, exact_rank=16)
    assert not too_low([*falling[:-1], 1e-10])
    assert not too_low([0.5])  # one order cannot fall


def test_most_of_the_methods_on_the_data_themselves_decide() -> None:
    falling = fitted([0.8, 0.7, 0.6, 0.5, 0.4, 0.32, 0.24, 0.2])
    settled = fitted([0.01] * 8)
    assert order_cause([falling, falling, settled]) is not None
    assert order_cause([falling, settled]) is None
    assert order_cause([falling, settled, replace(falling, exact=False)]) is None
    assert order_cause([result(ERA, None)]) is None
    cause = order_cause([falling])
    assert cause is not None
    assert cause.name == "order too low"


def test_an_order_is_too_low_by_the_rule_that_fired() -> None:
    def why(errors: Sequence[float], **more: Any) -> str:
        cause = order_cause([fitted(errors, **more)])
        assert cause is not None
        return cause.evidence

    # 0.2 / 0.32 in two pairs of states is 21 % each; 0.15 to 0.115 is more than a fifth in all, and 12 % each
    assert why([0.8, 0.7, 0.6, 0.5, 0.4, 0.32, 0.24, 0.2]) == (
        "fit error 20 % at order 16, still falling by 21 % with every two states"
    )
    assert why([0.5, 0.4, 0.3, 0.2, 0.2, 0.15, 0.115, 0.115]) == (
        "fit error 12 % at order 16, 77 % of that before the last quarter of the orders"
    )
    assert why([0.05] * 8, singular=[3.0] * 17 + [1.0] * 40) == (
        "fit error 5 % at order 16, and 17 singular values exceed the noise"
    )


def shifted(f: float, damping: float) -> ModalModel:
    poles = poles_from(np.array([10.0, 20.0 + f]), np.array([0.02, damping]))
    return ModalModel(poles=poles, shapes=np.eye(2))


@pytest.mark.parametrize("side", [-1, 1])
def test_more_orders_change_modes_that_move_by_a_quarter_of_the_half_bandwidth_or_of_the_damping(side: int) -> None:
    before, step = shifted(0.0, 0.02), 0.25 * (1 + side * NUDGE)
    for direction in (-1, 1):
        assert changed(before, shifted(direction * step * 0.4, 0.02)) is (side > 0)
        assert changed(before, shifted(0.0, 0.02 * (1 + direction * step))) is (side > 0)


def test_more_orders_change_modes_when_one_comes_or_goes() -> None:
    two = shifted(0.0, 0.02)
    assert not changed(two, two)
    assert changed(two, two.take([0]))
    assert changed(two.take([0]), two)


# --------------------------------------------------------------------------------------------------------- disagreements

EVERY = [result(name) for name in ALL[:3]]


def differing(values: dict[str, float], results: Sequence[MethodResult] = EVERY) -> list[tuple[str, ...]]:
    """Return who differs on a mode at 10 Hz of 2 % damping, of which some values of the second method are given."""
    found = group(10, 0.02, [r.name for r in EVERY])
    for field, value in values.items():
        found = replace(found, **{field: {**getattr(found, field), ALL[1]: value}})
    return [d.methods for d in disagreements([found], SAMPLES, results, [])]


@pytest.mark.parametrize(("side", "off"), [(-1, []), (1, [(ALL[1],)])])
def test_a_value_is_off_by_a_quarter_of_the_half_bandwidth_of_the_damping_or_a_tenth_of_the_shape(
    side: int, off: list[tuple[str]]
) -> None:
    step = 1 + side * NUDGE
    for direction in (-1, 1):
        assert differing({"frequencies": 10 + direction * 0.25 * 0.2 * step}) == off
        assert differing({"damping_ratios": 0.02 * (1 + direction * 0.25 * step)}) == off
    assert differing({"mac": 1 - 0.1 * step}) == off


def test_a_method_that_misses_a_mode_differs_and_one_that_failed_does_not() -> None:
    assert differing({}, [*EVERY, result(PRCE)]) == [(PRCE,)]
    assert differing({}, [*EVERY, result(PRCE, None)]) == []


def test_what_differs_is_said_with_its_values_and_without_a_rule_it_is_not_separated() -> None:
    g = replace(group(10, 0.02, ALL[:2]), frequencies={ALL[0]: 10.0, ALL[1]: 10.1}, mac={ALL[0]: 1.0, ALL[1]: 0.5})
    (found,) = disagreements([g], SAMPLES, EVERY, [])
    assert found.mode == 0
    assert found.what == "not found by Polyreference; SSI-cov (alternate): frequency 10.1 Hz, MAC 0.50"
    assert found.methods == (ALL[2], ALL[1])
    assert [(c.name, c.evidence) for c in found.causes] == [
        ("not separated", "found by 2 methods, and no other rule applies")
    ]


def test_bias_is_named_with_its_witness_and_small_distances_count_when_the_noise_cannot_make_them() -> None:
    g = replace(group(10, 0.02, ALL[:3]), damping_ratios={ALL[0]: 0.02, ALL[1]: 0.021, ALL[2]: 0.02})
    nothing = (np.zeros(1),) * 7
    far = Scatter(*nothing, biased=({ALL[1]: (Biased("damping", 0.001, 12.3),)},), known=(frozenset(ALL[:2]),))
    (found,) = disagreements([g], SAMPLES, EVERY, [], far)
    assert found.what == "SSI-cov (alternate): damping 2.1 % (12.3 standard deviations of the difference)"
    assert [str(c) for c in found.causes] == ["bias (damping by SSI-cov (alternate) is 12.3 standard deviations off)"]
    # what the noise explains is no disagreement, however far; where that is not known a quarter counts
    g = replace(g, damping_ratios={ALL[0]: 0.02, ALL[1]: 0.03, ALL[2]: 0.03})
    near = replace(far, biased=({},))
    assert [d.methods for d in disagreements([g], SAMPLES, EVERY, [], near)] == [(ALL[2],)]


def test_findings_come_first_and_stand_for_what_no_rule_explains() -> None:
    low, dead = Cause("order too low", "20 % is left"), Cause("dead channel", "2 is zero")
    missed = group(10, 0.02, ALL[:2])
    found = disagreements(
        [missed, group(30, 0.02), replace(missed, frequency=20.0, damping=0.2)], SAMPLES, EVERY, [low, dead]
    )
    assert [(d.mode, [c.name for c in d.causes]) for d in found] == [
        (None, ["order too low"]),
        (None, ["dead channel"]),
        (0, ["order too low"]),
        (2, ["heavy damping"]),
    ]


def test_a_cause_says_its_name_its_numbers_and_what_to_do() -> None:
    cause = Cause("weak mode", "makes up 3 %")
    assert str(cause) == "weak mode (makes up 3 %)"
    assert cause.remedy == CAUSES["weak mode"]
