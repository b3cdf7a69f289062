"""What speaks for a group of poles: the size of its own contribution, its share of a peak, and the limits of being a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.evidence import (
    CERTAIN,
    LEAST_ORDERS,
    LEAST_PEAK,
    LEAST_PEAK_AMBIENT,
    LEAST_PERSISTENCE,
    LEAST_PROMINENCE,
    LEAST_PROMINENCE_AMBIENT,
    LEAST_SHARE,
    LEAST_SIGNAL,
    UNCERTAIN,
    WHOLE_PEAK,
    Candidate,
    Evidence,
    Gathered,
    evidence_of,
    judge,
    oscillations,
    peaks,
    sentence,
)
from tests.selection.judging.made import NUDGE, Pole, diagram_of, poles_of, response_of

#: Two outputs of root mean square 1 and 2 over three inputs.
LEVELS = np.array([1.0, 2.0])


def samples(count: int = 100, rate: float = 50.0, **how: object) -> ImpulseResponse:
    values = np.ones((count, 2, 3)) * LEVELS[:, None]
    return ImpulseResponse(values=values, sampling_rate=rate, **how)  # type: ignore[arg-type]


def lines(count: int = 50, step: float = 0.5) -> FrequencyResponse:
    values = np.ones((count, 2, 3)) * LEVELS[:, None] * 1j
    return FrequencyResponse(values=values, frequencies=1 + step * np.arange(count))


# ---------------------------------------------------------------------------------------------- a pole's own contribution


@pytest.mark.parametrize(("s", "kept"), [(-1 + 10j, 1), (-1 + 0j, 0), (1 + 10j, 0), (-0.05 + 50 * np.pi * 1j, 0)])
def test_only_decaying_oscillations_are_weighed(s: complex, kept: int) -> None:
    # the last lies on half the sampling rate
    assert oscillations(diagram_of(Pole(2, s=s), response=samples(), dt=1 / 50)).pole.size == kept


@pytest.mark.parametrize(("zeta", "kept"), [(0.9 - NUDGE, 1), (0.9 + NUDGE, 0)])
def test_nearly_aperiodic_poles_are_no_modes_to_select(zeta: float, kept: int) -> None:
    assert oscillations(diagram_of(Pole(2, zeta=zeta), response=samples())).pole.size == kept


@pytest.mark.parametrize(("dt", "kept"), [(1 / 50, 0), (1 / 52, 1), (None, 1)])
def test_what_falls_by_e_within_a_sample_stands_for_a_delay(dt: float | None, kept: int) -> None:
    assert oscillations(diagram_of(Pole(2, s=-51 + 60j), response=samples(), dt=dt)).pole.size == kept


def test_what_belongs_to_a_pole_stays_with_it_when_others_go() -> None:
    kept = oscillations(
        diagram_of(Pole(2, s=-1 + 0j), Pole(4, s=-2 + 10j, shape=(0, 1), part=(0, 0, 1)), response=samples())
    )
    assert (kept.orders, kept.order.tolist(), kept.pole.tolist()) == ((2, 4), [4], [-2 + 10j])
    assert kept.shape.tolist() == [[0, 1]]
    assert kept.participation.tolist() == [[0, 0, 1]]


def test_the_own_contribution_in_samples_is_its_energy_over_that_of_the_data_on_levelled_outputs() -> None:
    # |shape| = |(3, 8 / 2)| = 5, |participation| = 2, sum over samples of a decay 50 / 8 per s; data: 6 channels of 100 ones
    own = oscillations(diagram_of(Pole(2, s=-8 + 60j, shape=(3, 8), part=(0, 0, 2)), response=samples())).own
    assert own[0] == pytest.approx(5 * 2 * np.sqrt(50 / 8) / np.sqrt(600))


def test_a_pole_that_hardly_decays_acts_for_no_more_than_the_samples_there_are() -> None:
    own = oscillations(diagram_of(Pole(2, s=-1e-9 + 60j, shape=(1, 0)), response=samples())).own
    assert own[0] == pytest.approx(np.sqrt(2 * 100) / np.sqrt(600))


def test_the_own_contribution_on_lines_is_the_integral_over_them() -> None:
    # integral of 1 / |j w - s|^2 is pi / 8, lines lie 2 pi 0.5 rad/s apart; data: 6 channels of 50 ones
    own = oscillations(diagram_of(Pole(2, s=-8 + 60j, shape=(3, 8), part=(0, 0, 2)), response=lines())).own
    assert own[0] == pytest.approx(5 * 2 * np.sqrt(np.pi / 8 / np.pi) / np.sqrt(300))


def test_a_mode_alone_is_all_of_its_response() -> None:
    mode = Pole(2, 8, 0.01, shape=(1, 2j), part=(1, 0.5, -2))
    response = response_of([mode.pole], [mode.shape], [mode.part])
    own = oscillations(diagram_of(mode, response=response)).own
    # the sum over samples is taken for an integral: Re s / fs = 1 % off, and the phase counts for less than zeta
    assert own[0] == pytest.approx(1, abs=0.02)
    f = np.linspace(4, 12, 400)
    H = sum(
        np.outer(a, b) / (2j * np.pi * f[:, None, None] - s)
        for a, b, s in (
            (mode.shape, mode.part, mode.pole),
            (np.conj(mode.shape), np.conj(mode.part), np.conj(mode.pole)),
        )
    )
    own = oscillations(diagram_of(mode, response=FrequencyResponse(values=H, frequencies=f))).own
    # tails beyond four Hz to either side hold 2 / pi * 0.08 / 4 = 1.3 % of the integral
    assert own[0] == pytest.approx(1, abs=0.02)


# --------------------------------------------------------------------------------------------- what the data themselves say


def test_evidence_of_lines_is_their_size_and_indicator_on_levelled_outputs() -> None:
    values = np.zeros((10, 2, 3), complex)
    values[:, 0, 0], values[:, 1, 2] = 3, 0.5j
    response = FrequencyResponse(values=values, frequencies=np.arange(1.0, 11))
    seen = evidence_of(diagram_of(Pole(2), response=response))
    # each row's root mean square over three inputs is its one entry over root 3
    assert np.allclose(seen.level, np.sqrt(6))
    assert np.allclose(seen.curves, np.sqrt(3))
    assert seen.curves.shape == (10, 2)
    assert np.array_equal(seen.frequencies, response.frequencies)
    # residues of 2 x 3 channels from 10 lines: 2 + 3 numbers of 6 are free
    assert seen.samples == pytest.approx(np.sqrt(10 * 6 / 5))
    assert not seen.ambient


def test_what_data_show_is_gathered_once_for_the_same_data_and_anew_for_others() -> None:
    gathered, shown = Gathered(), []
    faster, other = samples(rate=60.0), samples(count=50)
    moved = FrequencyResponse(values=lines().values, frequencies=lines().frequencies ** 1.01)
    for response in (samples(), samples(), faster, other, samples(added_damping=0.5), lines(), lines(), moved):
        shown.append(gathered.of(diagram_of(Pole(2), response=response)))
        assert np.array_equal(shown[-1].level, evidence_of(diagram_of(Pole(2), response=response)).level)
    assert [shown.index(each) for each in shown] == [0, 0, 2, 3, 4, 5, 5, 7]


def test_evidence_of_samples_is_their_transform_on_eight_times_finer_lines() -> None:
    values = np.zeros((20, 2, 3))
    values[0, 0, 0] = values[0, 1, 2] = 1  # its transform is the same at every line
    response = ImpulseResponse(values=values, sampling_rate=50.0)
    seen = evidence_of(diagram_of(Pole(2), response=response))
    assert (seen.frequencies[-1], seen.frequencies[1]) == (25.0, 50 / 160)
    scale = 1 / np.sqrt(60)  # root mean square over 20 samples and 3 inputs
    assert np.allclose(seen.level, np.sqrt(2) / scale / 50)
    assert np.allclose(seen.curves, 1 / scale / 50)
    assert seen.samples == pytest.approx(np.sqrt(20 * 6 / 5))
    assert not seen.ambient


def test_of_correlations_the_indicator_is_that_of_amplitudes() -> None:
    values = np.zeros((20, 2, 3))
    values[0, 0, 0] = values[0, 1, 2] = 1
    plain = evidence_of(diagram_of(Pole(2), response=ImpulseResponse(values=values, sampling_rate=50.0)))
    ambient = evidence_of(
        diagram_of(Pole(2), response=ImpulseResponse(values=values, sampling_rate=50.0, kind="correlation"))
    )
    assert ambient.ambient
    assert np.allclose(ambient.curves**2, plain.curves)
    assert np.allclose(ambient.level, plain.level)


def test_the_share_of_a_peak_is_the_poles_own_term_over_the_level_at_its_frequency() -> None:
    response = lines()
    seen = Evidence(np.array([1.0, 3.0]), np.array([10.0, 30.0]), np.ones((2, 1)), 1.0, False)
    pole = Pole(2, s=complex(poles_from(2.0, 0.5)), shape=(3, 8), part=(0, 0, 2))
    diagram = diagram_of(pole, response=response)
    # |shape| on levelled outputs 5, participation 2, |Re s| = 2 pi; the level half way is 20
    assert peaks(diagram, poles_of(pole), seen)[0] == pytest.approx(5 * 2 / (2 * np.pi) / 20)


# ----------------------------------------------------------------------------------------------- windows, and a late start

WINDOW = 2.0


@pytest.mark.parametrize("late", [0, 20])
def test_what_speaks_for_a_mode_under_a_window_is_what_speaks_for_the_pole_that_the_data_have(late: int) -> None:
    mode, other = Pole(2, 8, 0.02, shape=(1, 2), part=(0.5, 1, -2)), Pole(2, 14, 0.01, shape=(3, -1), part=(1, 0.5, 1))

    def facts(added: float) -> dict[str, float]:
        """Judge data that have decays of WINDOW more, of which so much is known to be a window's."""
        kept = [WINDOW - added + 0j] * 2
        data = response_of([p.pole - WINDOW for p in (mode, other)], [mode.shape, other.shape], [mode.part, other.part])
        data = replace(data, added_damping=added, first_sample=late)
        diagram = diagram_of(
            *(p._replace(s=p.pole - k) for p, k in zip((mode, other), kept, strict=True)), response=data
        )
        poles, seen = oscillations(diagram), evidence_of(diagram)
        found = judge(poles, np.array([0]), peaks(diagram, poles, seen), 0.1, seen).facts
        return {name: found[name] for name in ("share_of_peak", "signal_to_noise", "indicator_prominence")}

    assert facts(WINDOW) == pytest.approx(facts(0.0), rel=1e-9)


@pytest.mark.parametrize("late", [0, 20])
def test_a_mode_alone_is_all_of_its_response_under_a_window_and_from_a_late_sample_on(late: int) -> None:
    mode = Pole(2, 8, 0.01, shape=(1, 2j), part=(1, 0.5, -2))
    # 20 samples of 50 Hz are .4 s
    decayed = np.array(mode.part) * np.exp((mode.pole - WINDOW) * late / 50)
    data = response_of([mode.pole - WINDOW], [mode.shape], [decayed], added_damping=WINDOW, first_sample=late)
    diagram = diagram_of(mode, response=data)
    poles = oscillations(diagram)
    # the sum over samples is taken for an integral: Re s / fs = 5 % off in energy, and the phase counts for less than 5 %
    assert poles.own[0] == pytest.approx(1, abs=0.05)
    assert peaks(diagram, poles, evidence_of(diagram))[0] == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(("side", "ratio"), [(1, 100.0), (-1, 1.0)])
def test_a_peak_is_looked_for_within_the_bandwidth_that_the_data_have(side: int, ratio: float) -> None:
    # half a bandwidth of 0.1 Hz, and so much more that the peak at 10 Hz lies just inside or outside
    mode = Pole(1, 10.3, 0.1 / 10.3)
    added = 2 * np.pi * 0.2 * (1 + side * 0.1)
    seen = Evidence(FREQUENCIES, np.ones(201), curves(100.0), 1.0, False, added)
    assert judge(poles_of(mode), np.array([0]), np.ones(1), 1.0, seen).facts["indicator_prominence"] == ratio


# ------------------------------------------------------------------------------------------------------- for and against

FREQUENCIES = np.linspace(5, 15, 201)  # one every 0.05 Hz


def curves(ratio: float) -> np.ndarray:
    """One curve with a peak at 10 Hz of this height over a flat floor, and one that is flat."""
    return np.stack([np.where(np.isclose(FREQUENCIES, 10), ratio, 1.0), np.full(201, 5.0)], axis=1)


def weighed(
    found: Sequence[int],
    tried: int = 20,
    *,
    own: float = 100.0,
    fit: float = 1.0,
    ratio: float = 100.0,
    peak: float = 1.0,
    samples: float = 1.0,
    ambient: bool = False,
    left_open: float = np.nan,
) -> Candidate:
    """Judge one mode at 10 Hz found at some of the orders 1, 2, ..., beside a pole that does not belong to it."""
    poles = poles_of(Pole(tried, 11, own=0.0), *(Pole(n, own=own) for n in found), orders=range(1, tried + 1))
    group = np.arange(1, len(found) + 1)
    seen = Evidence(FREQUENCIES, np.ones(201), curves(ratio), samples, ambient)
    return judge(poles, group, np.r_[9.0, np.full(len(found), peak)], fit, seen, left_open)


def last(count: int, tried: int = 20) -> range:
    """The last of the orders, so that nothing is intermittent."""
    return range(tried - count + 1, tried + 1)


def test_a_mode_at_all_orders_has_nothing_against_it() -> None:
    assert weighed(last(20)).against == ()


@pytest.mark.parametrize(
    ("tried", "least"), [(20, LEAST_ORDERS), (40, round(LEAST_SHARE * 40)), (3, 3)], ids=["five", "share", "all of few"]
)
def test_a_mode_is_found_at_five_orders_and_at_a_share_of_all(tried: int, least: int) -> None:
    assert weighed(last(least, tried), tried).against == ()
    assert f"found at {least - 1} of {tried} orders only" in weighed(last(least - 1, tried), tried).against


def test_a_mode_persists_from_its_first_order_on() -> None:
    enough = round(LEAST_PERSISTENCE * 20)
    assert weighed(range(1, enough + 1)).against == ()
    assert weighed(range(1, enough)).against == ("intermittent: found at 35 % of the orders from its first one on",)
    # found at the last three of twenty it has not persisted for five orders yet
    assert weighed(last(3)).facts["persistence"] == pytest.approx(3 / LEAST_ORDERS)
    assert weighed([5, 20]).facts["persistence"] == pytest.approx(2 / 16)


@pytest.mark.parametrize("samples", [1.0, 4.0])
def test_a_mode_stands_above_what_the_fit_leaves(samples: float) -> None:
    # own over fit, times the square root of the number of samples behind a residue
    own = LEAST_SIGNAL * 0.5 / samples
    assert weighed(last(20), own=own, fit=0.5, samples=samples).against == ()
    below = weighed(last(20), own=own * (1 - NUDGE), fit=0.5, samples=samples)
    assert below.against == ("signal-to-noise ratio 6.0: not significant",)
    assert below.facts["signal_to_noise"] == pytest.approx(LEAST_SIGNAL * (1 - NUDGE))


def test_of_correlations_the_signal_is_not_asked() -> None:
    assert weighed(last(20), own=1e-6, ambient=True).against == ()


HIDDEN = ("weak response and no CMIF peak at its frequency",)


@pytest.mark.parametrize(
    ("ratio", "peak", "against"),
    [
        (LEAST_PROMINENCE, 0.0, ()),
        (LEAST_PROMINENCE - NUDGE, 0.0, HIDDEN),
        (1.0, LEAST_PEAK, ()),
        (1.0, LEAST_PEAK - NUDGE, HIDDEN),
    ],
)
def test_a_mode_is_seen_as_a_peak_or_as_much_of_the_response(ratio: float, peak: float, against: tuple[str]) -> None:
    assert weighed(last(20), ratio=ratio, peak=peak).against == against


@pytest.mark.parametrize(
    ("ratio", "peak", "found", "against"),
    [
        (LEAST_PROMINENCE_AMBIENT, LEAST_PEAK_AMBIENT, 9, ()),
        (LEAST_PROMINENCE_AMBIENT - NUDGE, LEAST_PEAK_AMBIENT, 9, HIDDEN),
        (LEAST_PROMINENCE_AMBIENT, LEAST_PEAK_AMBIENT - NUDGE, 9, HIDDEN),
        (1.0, WHOLE_PEAK, 10, ()),
        (1.0, WHOLE_PEAK - NUDGE, 10, HIDDEN),
        (1.0, WHOLE_PEAK, 9, HIDDEN),
    ],
)
def test_of_correlations_a_mode_is_seen_as_a_peak_with_a_part_in_it_or_as_the_whole_at_half_of_the_orders(
    ratio: float, peak: float, found: int, against: tuple[str]
) -> None:
    assert weighed(last(found), ratio=ratio, peak=peak, ambient=True).against == against


@pytest.mark.parametrize(
    ("left_open", "found", "against"),
    [
        (CERTAIN - NUDGE, last(5), ()),
        (CERTAIN, last(5), HIDDEN),
        (CERTAIN - NUDGE, last(4), ("found at 4 of 20 orders only", *HIDDEN)),
        # it stays up to the last orders, but for a gap that a track may have
        (CERTAIN - NUDGE, range(9, 19), ()),
        (CERTAIN - NUDGE, range(8, 18), HIDDEN),
    ],
)
def test_of_correlations_a_mode_that_is_known_well_and_lasts_need_not_be_seen(
    left_open: float, found: range, against: tuple[str, ...]
) -> None:
    assert weighed(found, ratio=1.0, peak=0.0, ambient=True, left_open=left_open).against == against
    # of responses, whose deviations are of white noise, that is no evidence here
    assert HIDDEN[0] in weighed(found, ratio=1.0, peak=0.0, left_open=left_open).against


def test_of_few_orders_a_mode_that_is_known_well_need_not_be_at_all() -> None:
    # of five orders the first two cannot hold it
    assert weighed(last(3, 5), 5, ratio=1.0, peak=0.0, ambient=True, left_open=CERTAIN - NUDGE).against == ()
    assert weighed(last(3, 5), 5, ambient=True, left_open=CERTAIN).against == ("found at 3 of 5 orders only",)
    assert weighed(last(3, 5), 5).against == ("found at 3 of 5 orders only",)


def test_of_correlations_nothing_is_a_mode_that_the_record_leaves_open() -> None:
    assert weighed(last(20), ambient=True, left_open=UNCERTAIN - NUDGE).against == ()
    assert weighed(last(20), ambient=True, left_open=UNCERTAIN).against == (
        "frequency or damping uncertain: standard deviation 0.7 of its half bandwidth or damping",
    )
    assert weighed(last(20), left_open=UNCERTAIN).against == ()
    assert weighed(last(20), ambient=True, left_open=0.4).facts["left_open"] == 0.4
    assert "left_open" not in weighed(last(20), ambient=True).facts


def test_everything_against_a_group_is_said() -> None:
    bad = weighed([1, 20], own=0.1, ratio=1.0, peak=0.0)
    assert [words.split()[0] for words in bad.against] == ["found", "intermittent:", "signal-to-noise", "weak"]


def test_values_and_facts_are_medians_of_the_members() -> None:
    made = [Pole(n, f, zeta, own=own) for n, f, zeta, own in ((2, 10, 0.01, 1), (4, 11, 0.03, 2), (8, 10.1, 0.02, 9))]
    poles = poles_of(*made, orders=range(2, 13, 2))
    seen = Evidence(FREQUENCIES, np.ones(201), np.ones((201, 1)), 3.0, False)
    found = judge(poles, np.arange(3), np.array([0.2, 0.9, 0.4]), 0.5, seen)
    assert (found.frequency, found.damping) == (pytest.approx(10.1), pytest.approx(0.02))
    assert found.facts == {
        "orders_found": 3,
        "orders_tried": 6,
        "first_order": 2,
        "last_order": 8,
        "persistence": 0.5,
        "signal_to_noise": pytest.approx(2 / 0.5 * 3),
        "share_of_peak": pytest.approx(0.4),
        "indicator_prominence": 1.0,
    }


def test_a_fit_without_any_error_divides_by_nothing() -> None:
    assert np.isfinite(weighed(last(20), fit=0.0).facts["signal_to_noise"])


# --------------------------------------------------------------------------------------------------------------- in words

FACTS = {"orders_found": 7, "orders_tried": 20, "first_order": 4, "last_order": 18}


@pytest.mark.parametrize(
    ("share", "ratio", "words"),
    [
        (LEAST_PEAK, 1.0, "33 % of the response at its frequency;"),
        (1.7, LEAST_PROMINENCE, "100 % of the response at its frequency; CMIF peak"),
        (0.0, LEAST_PROMINENCE, "(4 to 18); CMIF peak 1.2 x its surroundings;"),
        (0.0, np.inf, "; isolated CMIF peak;"),
        (LEAST_PEAK - NUDGE, LEAST_PROMINENCE - NUDGE, "weak at its frequency;"),
    ],
)
def test_the_sentence_says_where_a_mode_was_found_and_what_shows_it(share: float, ratio: float, words: str) -> None:
    said = sentence({**FACTS, "share_of_peak": share, "indicator_prominence": ratio}, 0.123)
    assert said.startswith("found at 7 of 20 orders (4 to 18); ")
    assert words in said
    assert said.endswith("; without it the unexplained part grows by 12 %")
