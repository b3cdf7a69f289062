"""What is told of the poles that contended: values of the diagram, refined ones where it has none, parts, and what was left out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from modalscope.analysis.workflow.analyze import analyze
from modalscope.data import FrequencyResponse, Signals
from modalscope.data.deferred import Deferred
from modalscope.identification.orders import ORDERS_END
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.selection.judging import recount, verdict
from modalscope.selection.judging.copies import Copies
from modalscope.selection.judging.evidence import Candidate, evidence_of
from modalscope.selection.judging.joint_selection import select_jointly
from modalscope.selection.judging.outcome import modes_of
from modalscope.selection.judging.select import select
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.judging.tracking import Poles
from modalscope.selection.judging.verdict import Contest, SelectionResult, _shown_by, verdicts
from tests.selection.judging.made import Pole, diagram_of, poles_of
from tests.selection.judging.test_joint_selection import NOISE, PARTS, POLES, SHAPES, F, data, selection_of

ORDERS = tuple(range(2, 42, 2))

#: What a diagram has of the modes: frequencies a hair off, so that its values are known from the refined ones.
OFF = 1 + 1e-5


def shown(j: int, orders: tuple[int, ...] = ORDERS, factor: complex = OFF) -> list[Pole]:
    shape, part = tuple(SHAPES[:, j]), tuple(PARTS[j])
    return [Pole(n, shape=shape, part=part, s=complex(POLES[j] * factor)) for n in orders]


def trial_of(
    *made: Pole, start: tuple[int, ...] = (0, 1, 2, 3), response: FrequencyResponse | None = None, **how: object
) -> tuple[SelectionResult, list[np.ndarray]]:
    """Return a trial of hand-made poles, and the groups of those that are equal but for their order."""
    response = data() if response is None else response
    diagram = diagram_of(*made, response=response, orders=ORDERS)
    flat: Poles = poles_of(*made, orders=ORDERS)
    selection: SelectionProblem = selection_of(response, **how)
    found = select_jointly(selection, POLES[list(start)], PARTS[list(start)].astype(complex))
    assert found is not None
    groups = [np.flatnonzero(np.abs(flat.pole - s) < 1e-9) for s in dict.fromkeys(flat.pole)]
    return SelectionResult(diagram, flat, evidence_of(diagram), Contest(selection, found)), groups


def told(*made: Pole, **how: object) -> list[Candidate]:
    trial, groups = trial_of(*made, **how)  # type: ignore[arg-type]
    return verdicts(trial, groups)


def modes(candidates: list[Candidate]) -> list[Candidate]:
    return sorted((c for c in candidates if not c.against), key=lambda c: c.frequency)


ALL = [p for j in range(4) for p in shown(j)]


def test_a_mode_has_the_values_of_the_diagram_and_its_gain() -> None:
    found = modes(told(*ALL))
    assert [c.frequency for c in found] == pytest.approx(list(np.abs(POLES * OFF) / (2 * np.pi)), rel=1e-12)
    assert all(c.own is None and c.members.size == len(ORDERS) for c in found)
    assert all(c.facts["gain"] == c.gain > 10 * c.facts["noise_gain"] for c in found)


@pytest.mark.parametrize(
    ("coloured", "away", "group"), [(False, 0.2, 1), (False, 0.4, 0), (True, 0.4, 1), (True, 0.7, 0)]
)
def test_orders_give_the_values_of_a_mode_that_they_show_near_enough(coloured: bool, away: float, group: int) -> None:
    # .3 half bandwidths; half of one where a resonance that shifts draws the refinement away
    s = complex(POLES[0])
    off = shown(0, factor=1 - 1j * away * s.real / s)
    found = told(*off, *(p for j in (1, 2, 3) for p in shown(j)), coloured=coloured)
    near = next(
        c for c in found if abs(c.frequency - abs(s) / (2 * np.pi)) < 1.5 * -s.real / (2 * np.pi) and not c.against
    )
    assert near.members.size == group * len(ORDERS)


@pytest.mark.parametrize(("frequency", "outside"), [(13.99, True), (14.01, False), (25.99, False), (26.01, True)])
def test_a_damped_pole_stands_for_modes_outside_where_its_bandwidth_reaches_an_end_of_the_band(
    frequency: float, outside: bool
) -> None:
    """Two half bandwidths of 2 Hz from the ends of 10 to 30 Hz; in coloured errors it may stand for anything anywhere."""
    pole = poles_from(frequency, 2 / frequency)
    for coloured in (False, True):
        trial = SimpleNamespace(
            selection=SimpleNamespace(coloured=coloured, band=(10.0, 30.0)), contest=SimpleNamespace(poles=[pole])
        )
        assert verdict._may_stand_outside(trial, 0) is (outside or coloured)  # type: ignore[arg-type]


def test_the_noise_gain_is_the_bound_in_deviations() -> None:
    trial, _ = trial_of(*ALL)
    assert trial.bar == pytest.approx(np.sqrt(trial.selection.bar / 2))
    assert trial.gain == pytest.approx(np.sqrt(trial.found.gain / 2))


def test_a_mode_that_no_orders_agree_on_has_refined_values_and_deviations_of_its_own() -> None:
    found = modes(told(*(p for j in (0, 1, 2) for p in shown(j))))
    last = found[-1]
    assert len(found) == 4
    assert last.own is not None
    assert (last.members.size, last.facts["orders_found"]) == (0, 0)
    assert last.frequency == pytest.approx(18, rel=1e-4)
    assert 0 < last.own.frequency_std < 0.01
    assert "not in the diagram" not in str(last.facts)


def test_values_further_off_than_a_part_of_the_bandwidth_do_not_stand_for_a_mode() -> None:
    # 30 % of the decay rate: zeta = .01 makes it .003 of the frequency
    near, far = (
        modes(told(*(p for j in (1, 2, 3) for p in shown(j)), *shown(0, factor=1 + q * 0.003))) for q in (0.9, 1.1)
    )
    assert near[0].own is None
    assert far[0].own is not None


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_of_groups_that_show_a_mode_the_one_at_most_orders_gives_its_values(factor: float) -> None:
    few = shown(0, ORDERS[:7], factor=1 + 0.001 * factor)
    found = modes(told(*ALL, *few))
    assert len(found) == 4
    assert found[0].frequency == pytest.approx(abs(POLES[0] * OFF) / (2 * np.pi), rel=1e-12)


def test_a_group_that_no_mode_answers_to_is_told_with_what_it_would_explain() -> None:
    noise = [Pole(n, f=22, zeta=0.01, shape=(1, 0, 1), part=(1, 0)) for n in ORDERS]
    left = [c for c in told(*ALL, *noise) if c.against]
    assert len(left) == 1
    assert left[0].frequency == pytest.approx(22)
    assert left[0].gain < left[0].facts["noise_gain"]
    assert f"significance {left[0].gain:.1f} given the other modes; noise alone reaches" in left[0].against[0]


def test_what_exceeds_white_noise_and_not_the_errors_of_the_data_is_told_so() -> None:
    # a coherent line under Hann's window, beside coloured errors
    known = data()
    values = known.values.copy()
    values[199:202] += 0.02 * np.array([0.5, 1.0, 0.5])[:, None, None]
    line = [Pole(n, f=float(F[200]), zeta=0.003, shape=(1, 1, 1), part=(1, 1)) for n in ORDERS[:3]]
    found = told(*ALL, *line, response=replace(known, values=values), coloured=True)
    left = next(c for c in found if abs(c.frequency - F[200]) < 0.01)
    assert left.gain > left.facts["noise_gain"]
    assert "barely above the noise: significance" in left.against[0]


def test_what_data_leave_open_is_no_mode() -> None:
    weak = data(noise=NOISE)
    x = 2j * np.pi * F[:, None, None]
    wide = poles_from(22.0, 0.06)
    H = weak.values + 0.05 * (np.ones((1, 3, 2)) / (x - wide) + np.ones((1, 3, 2)) / (x - wide.conj()))
    found = told(*ALL, response=replace(weak, values=H))
    against = [c for c in found if c.against and abs(c.frequency - 22) < 1.5]
    sure = [c for c in modes(found) if abs(c.frequency - 22) < 1.5]
    assert bool(against) != bool(sure)
    for c in against:
        assert "uncertain: frequency by" in c.against[0] or "given the other modes" in c.against[0]


@pytest.mark.parametrize(("coloured", "share", "listed"), [(True, 1 / 3, 4), (True, np.inf, 0), (False, 1 / 3, 0)])
def test_of_coloured_data_a_plain_peak_is_listed_however_uncertain_and_says_so(
    monkeypatch: pytest.MonkeyPatch, coloured: bool, share: float, listed: int
) -> None:
    monkeypatch.setattr(verdict, "_MAX_DEVIATION", 1e-9)
    monkeypatch.setattr(verdict, "LEAST_PEAK", share)  # no mode is more than all of the response
    found = told(*ALL, coloured=coloured)
    assert len(modes(found)) == listed
    texts = [c.facts["uncertain"] for c in modes(found)] or [c.against[0] for c in found]
    assert all(text.startswith("uncertain: frequency by") for text in texts)


def test_of_coloured_data_a_mode_that_spans_many_lines_need_not_be_shown_by_orders() -> None:
    # 18 Hz with 1.2 %: a bandwidth of 8.6 lines; 9 Hz with 1 %: 3.6 lines
    found = told(*(p for j in (0, 1, 2) for p in shown(j)), coloured=True)
    assert abs(modes(found)[-1].frequency - 18) < 0.1
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recount, "_MIN_BANDWIDTH_LINES", 5.0)
        found = told(*(p for j in (1, 2, 3) for p in shown(j)), coloured=True)
    assert modes(found)[0].frequency > 10


@pytest.fixture
def _narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the mode at 9 Hz be too narrow to tell its width."""
    monkeypatch.setattr(recount, "_MIN_BANDWIDTH_LINES", 5.0)


@pytest.mark.usefixtures("_narrow")
def test_of_coloured_data_a_mode_is_shown_at_a_quarter_of_the_orders() -> None:
    for count, listed in ((5, True), (4, False)):
        found = told(*(p for j in (1, 2, 3) for p in shown(j)), *shown(0, ORDERS[:count]), coloured=True)
        assert (abs(modes(found)[0].frequency - 9) < 0.1) is listed
    assert "found at 4 of 20 orders only" in next(c for c in found if c.against).against[0]
    # of white data gain alone decides
    assert len(modes(told(*(p for j in (1, 2, 3) for p in shown(j)), *shown(0, ORDERS[:4])))) == 4


@pytest.mark.usefixtures("_narrow")
@pytest.mark.parametrize(
    ("orders", "late"), [(ORDERS[-4:], True), (ORDERS[-8:-4], False), ((*ORDERS[9:12], ORDERS[-1]), False)]
)
def test_what_only_the_last_orders_show_began_too_late_to_be_told(orders: tuple[int, ...], late: bool) -> None:
    # four orders of twenty: up to the last one, up to the fourth last, and at four of the eleven since the first
    found = told(*(p for j in (1, 2, 3) for p in shown(j)), *shown(0, orders), coloured=True)
    assert [c.facts.get("late", False) for c in found if c.against and abs(c.frequency - 9) < 0.1] == [late]


def test_an_empty_list_says_why() -> None:
    made = shown(0, ORDERS[:3])
    diagram, poles = diagram_of(*made, response=data(), orders=ORDERS), poles_of(*made, orders=ORDERS)
    rare = replace(told(*ALL)[0], members=np.arange(3), against=("found at 3 of 20 orders only",))

    def why(made_of: object, left: list[Candidate]) -> list[str]:
        empty = modes_of(replace(diagram, **made_of), poles, [], left)  # type: ignore[arg-type]
        assert [c.reason for c in empty.left_out] == [c.against[0] for c in left]
        return [str(note) for note in empty.notes if note.kind == "no mode"]

    assert "9.0001 Hz: found at 3 of 20 orders only" in why({}, [rare])[0]
    assert "no decaying oscillation is found at three of the orders 2 to 40" in why({}, [])[0]
    assert [n for n in modes_of(diagram, poles, [replace(rare, against=())], [rare]).notes if n.kind == "no mode"] == []


def test_a_mode_that_began_too_late_is_a_note_of_the_list() -> None:
    made = [p for j in range(4) for p in shown(j)]
    diagram = diagram_of(*made, response=data(), orders=ORDERS)
    candidates = [c for c in told(*made) if not c.against]
    undecided = replace(candidates[0], facts=candidates[0].facts | {"late": True}, against=("shown at few orders",))
    listed = modes_of(diagram, poles_of(*made, orders=ORDERS), candidates[1:], [undecided])
    assert [str(n) for n in listed.notes if n.kind == ORDERS_END] == [
        "Modes at 9.0001 Hz appear at the last orders only (up to 40): give more orders, or narrower bands"
    ]
    assert not [n for n in modes_of(diagram, poles_of(*made, orders=ORDERS), candidates).notes if n.kind == ORDERS_END]


def shifting(factor: float) -> tuple[SelectionResult, list[np.ndarray]]:
    """Return a trial of data whose last resonance shifts: a second pole beside it, of the same shape."""
    x = 2j * np.pi * F[:, None, None]
    shifted = POLES[3] * factor
    R = np.outer(SHAPES[:, 3], [PARTS[3, 0], 0.3])
    H = data().values + R / (x - shifted) + R / (x - shifted.conj())
    response = replace(data(), values=H)
    flat = [*ALL, *shown(3, ORDERS[:6], factor=factor)]
    diagram = diagram_of(*flat, response=response, orders=ORDERS)
    selection = selection_of(response, coloured=True)
    start = np.append(POLES, shifted)
    found = select_jointly(selection, start, np.vstack([PARTS, [[PARTS[3, 0], 0.3]]]).astype(complex))
    assert found is not None
    poles = poles_of(*flat, orders=ORDERS)
    groups = [np.flatnonzero(np.abs(poles.pole - s) < 1e-9) for s in dict.fromkeys(poles.pole)]
    contest = Contest(selection, found)
    contest.__dict__["copies"] = Copies(
        np.array([0, 1, 2, 3, 3]), found.poles, np.zeros(5, bool), np.array([1e-3, 0]), ("",) * 4 + ("it shifts",)
    )
    return SelectionResult(diagram, poles, evidence_of(diagram), contest), groups


def test_a_mode_with_parts_is_as_sure_as_one_mode_of_both_would_be() -> None:
    # the deviation of a mode in half bandwidths goes as noise over the size of what it explains, whatever its shape
    lone, (both, _) = trial_of(*ALL)[0], shifting(1.004)
    x = 2j * np.pi * F[:, None, None]
    one = np.outer(SHAPES[:, 3], PARTS[3]) / (x - POLES[3])
    more = np.outer(SHAPES[:, 3], [PARTS[3, 0], 0.3]) / (x - 1.004 * POLES[3])
    size = np.linalg.norm(one + more) / np.linalg.norm(one)
    assert both.contest.hosts.tolist() == [0, 1, 2, 3, 3]
    expected = np.array(lone.left_open(3)) / size
    # the two are a third of a half bandwidth apart, nearly one resonance, which the participation of the stronger meets in part
    assert np.allclose(both.left_open(3), expected, rtol=0.2)
    # each alone is open: what the one explains the other may explain
    f, zeta = frequencies_and_damping(both.found.poles[3:])
    assert np.min(both.found.frequency_std[3:] / (f * zeta)) > 3 * max(expected)
    assert np.min(both.found.damping_std[3:] / zeta) > 3 * max(expected)


def test_of_overlapping_poles_of_one_shape_in_coloured_data_the_strongest_stands_where_copies_are_not_known() -> None:
    known = shifting(1.0005)[0].contest
    contest = Contest(replace(known.selection, coloured=True), known.outcome)
    contest.__dict__["copies"] = None
    strongest = 3 + int(np.argmax(known.outcome.gain[3:]))
    assert contest.hosts.tolist() == [0, 1, 2, strongest, strongest]


def test_of_coloured_data_poles_that_act_as_one_are_parts_of_the_strongest() -> None:
    # the second pole of a resonance that shifts: a third of a bandwidth off, with the same shape
    everything = verdicts(*shifting(1.008))
    assert len(modes(everything)) == 4
    part = [c for c in everything if c.against and c.against[0].startswith("duplicate of")]
    assert len(part) == 1
    host = modes(everything)[-1]
    assert part[0].against[0] == f"duplicate of {host.frequency:.5g} Hz: it shifts"
    # the values of a mode with parts are those of the group at most orders
    assert host.members.size == len(ORDERS)


def test_a_mode_that_one_input_alone_shows_says_so() -> None:
    x = 2j * np.pi * F[:, None, None]
    R = np.outer([1, 1, 1], [0.2, 0.0])
    lone = poles_from(22.0, 0.01)
    response = replace(data(), values=data().values + R / (x - lone) + R / (x - lone.conj()))
    found = modes(told(*ALL, response=response))
    assert [c.facts.get("rests_on") for c in found] == [None] * 4 + [response.input_dofs[0]]


@pytest.mark.parametrize(("ratio", "listed"), [(1.1, True), (0.9, False)])
def test_of_coloured_data_what_noise_may_explain_is_no_mode_at_however_many_orders(
    ratio: float, listed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    trial, groups = trial_of(*ALL, coloured=True)
    monkeypatch.setattr(Contest, "recounted", Deferred(4, lambda index: np.full((1, len(index)), ratio), rows=1))
    gain = trial.found.gain.copy()
    gain[0] = 0.9 * trial.selection.bar
    found = verdicts(replace(trial, contest=Contest(trial.selection, replace(trial.found, gain=gain))), groups)
    weak = next(c for c in found if abs(c.frequency - 9) < 0.1)
    assert weak.members.size == len(ORDERS)
    assert any("noise alone reaches" in why for why in weak.against) is not listed
    assert all(not c.against for c in found if c.frequency > 10)


@pytest.mark.parametrize(("away", "mode"), [(0.9, 0), (1.1, -1), (2.0, -1)])
def test_a_group_shows_a_mode_within_a_half_bandwidth(away: float, mode: int) -> None:
    # 10 Hz with 1 %: .1 Hz; the group's own is as wide and a hundredth more at most
    group = poles_of(*(Pole(n, f=10 + 0.101 * away) for n in ORDERS))
    settled, residues = poles_from(np.array([10.0]), np.array([0.01])), (np.array([[1.0], [0.0]]), None)
    trial = SimpleNamespace(
        contest=SimpleNamespace(poles=settled), poles=group, found=SimpleNamespace(residues=residues)
    )
    assert _shown_by(trial, [np.arange(len(ORDERS))]) == [mode]  # type: ignore[arg-type]


@pytest.mark.parametrize(("ratio", "listed"), [(2.0, True), (1.2, False)])
def test_what_tells_more_of_a_mode_tells_more_of_where_it_lies(
    ratio: float, listed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # at 4 of 20 orders its gain is counted again: twice the bar, where the first count said one. Deviations of .4 are .2 then, less
    # than the .3 of a mode; at 1.2 bars they are .33
    made = [*(p for j in (1, 2, 3) for p in shown(j)), *shown(0, ORDERS[:4])]
    trial, groups = trial_of(*made, coloured=True)
    monkeypatch.setattr(Contest, "recounted", Deferred(4, lambda index: np.full((1, len(index)), ratio), rows=1))
    monkeypatch.setattr(SelectionResult, "left_open", lambda self, j: (0.4, 0.4) if j == at else (0.1, 0.1))
    at = int(np.argmin(trial.contest.poles.imag))
    gain = trial.found.gain.copy()
    gain[at] = trial.selection.bar
    found = verdicts(replace(trial, contest=Contest(trial.selection, replace(trial.found, gain=gain))), groups)
    mode = next(c for c in found if abs(c.frequency - 9) < 0.1)
    assert mode.gain == pytest.approx(ratio * trial.bar)
    assert ("uncertain" not in mode.facts) is listed


# -------------------------------------------------------------------------------------------------------------- the whole way


def test_select_lists_modes_of_white_data_with_what_it_left_out() -> None:
    noise = [Pole(n, f=22, zeta=0.01, shape=(1, 0, 1), part=(1, 0)) for n in ORDERS]
    diagram = diagram_of(*ALL, *noise, response=data(), orders=ORDERS)
    found = select(diagram)
    assert np.allclose(found.frequencies, np.abs(POLES) / (2 * np.pi), rtol=1e-4)
    assert found.gain is not None
    assert np.all(found.gain > 10)
    assert [round(c.frequency) for c in found.left_out] == [22]
    assert found.left_out[0].remedy == "take=[22] reports it anyway"
    assert len(select(diagram, take=[22])) == 5
    less = select(diagram, refuse=[18])
    assert len(less) == 3
    assert "refused by the user" in [c.reason for c in less.left_out]


def test_without_groups_spreads_and_indicators_are_unknown_and_deviations_are_those_of_the_fit() -> None:
    made = [p for j in (0, 1, 2) for p in shown(j)]
    diagram = diagram_of(
        *made,
        response=data(),
        orders=ORDERS,
        frequencies_std=np.full(len(made), 0.5),
        damping_ratios_std=np.full(len(made), 0.5),
        indicators={"emac": np.ones(len(made))},
    )
    found = select(diagram)
    assert np.isnan(found.frequencies_spread).tolist() == [False] * 3 + [True]
    assert np.isnan(found.indicators["emac"]).tolist() == [False] * 3 + [True]
    assert found.frequencies_std[:3].tolist() == [0.5] * 3
    assert found.frequencies_std[3] < 0.01
    assert "not in the diagram" in found.reasons[3]["text"]


@pytest.mark.parametrize("nudge", [-1e-12, 0.0, 1e-12])
def test_rounding_does_not_choose_the_middle_of_a_group(nudge: float) -> None:
    """Of two, and of the middle two of four, both are as far from the median: whichever is nearer by rounding, the first is taken."""
    four = poles_of(*(Pole(n, f=10 + 0.01 * n + nudge * (n == 3)) for n in (1, 2, 3, 4)))
    assert verdict._starts(four, [np.arange(4)]).tolist() == [1]
    # and what is nearer by more than that is taken, wherever it stands
    three = poles_of(*(Pole(n, f=f) for n, f in ((1, 10.0), (2, 10.1), (3, 10.05))))
    assert verdict._starts(three, [np.arange(3)]).tolist() == [2]


@pytest.mark.parametrize("turns", [0.2, 3.0])
def test_what_did_not_come_back_once_in_a_free_decay_is_a_drift_and_no_mode(turns: float) -> None:
    t = np.arange(1200) / 40
    tones = [np.exp(2 * np.pi * f * (-zeta + 1j) * t) for f, zeta in ((1.7, 0.006), (4.1, 0.01))]
    slow = np.exp(-0.02 * t) * np.cos(2 * np.pi * turns * t / 30 + 1)
    y = np.stack([*tones, slow], axis=1).real @ np.array([[1, 0.6], [0.8, -1], [0.3, -0.2]])
    y += 0.002 * np.random.default_rng(0).standard_normal(y.shape)
    modes = analyze(Signals(outputs=y, sampling_rate=40.0, quantities="displacement")).modes
    found = modes.frequencies
    assert np.allclose(found[-2:], [1.7, 4.1], rtol=1e-3)
    if turns < 1:
        assert found.size == 2
        assert any("less than one period" in str(each) for each in modes.left_out)
    else:
        assert np.allclose(found[:-2], [turns / 30], rtol=0.02)
