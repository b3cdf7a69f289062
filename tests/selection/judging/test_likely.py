"""Which poles take part in the noise model beside the modes, and data without noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from modalscope.data import FrequencyResponse
from modalscope.data.whitening import levels_of_channels
from modalscope.identification.diagrams import stabilize
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging import verdict as likely
from modalscope.selection.judging.evidence import evidence_of, oscillations
from modalscope.selection.judging.select import contest_of, select
from modalscope.selection.judging.selection_problem import SelectionProblem
from modalscope.selection.likelihood.reference_model import Floor, floor_of
from modalscope.systems import chain5
from tests.selection.judging.hard import lines_of, random_structure, score
from tests.selection.judging.made import NUDGE, diagram_of, poles_of
from tests.selection.judging.test_joint_selection import F, data
from tests.selection.judging.test_verdict import ALL, OFF, ORDERS, POLES


def posed(monkeypatch: pytest.MonkeyPatch, error: float) -> list[bool]:
    """Return whether out-of-band poles take part in the selections in white noise, and in that in coloured errors.

    A mode at 26 Hz, 5 % damped, lies outside the band of 5 to 25 Hz and is in no order: what four poles leave is coloured. `error`: of
    each line a mean of nine independent ones, which neighbours share.
    """
    x, outside = 2j * np.pi * F[:, None, None], poles_from(26.0, 0.05)
    e = np.random.default_rng(1).standard_normal((2, F.size + 8, 3, 2))
    sums = np.cumsum(np.pad(e[0] + 1j * e[1], ((1, 0), (0, 0), (0, 0))), axis=0)
    skirt = 0.5 * np.ones((3, 2)) * (1 / (x - outside) + 1 / (x - outside.conj()))
    response = replace(data(), values=data().values + skirt + error * (sums[9:] - sums[:-9]) / 3)
    diagram, poles = diagram_of(*ALL, response=response, orders=ORDERS), poles_of(*ALL, orders=ORDERS)
    arenas: list[SelectionProblem] = []
    monkeypatch.setattr(likely, "select_jointly", lambda selection, *_, **__: arenas.append(selection))
    likely.likely(diagram, poles, evidence_of(diagram))
    assert floor_of(response, POLES * OFF).colour.coloured
    assert [arena.coloured for arena in arenas] == [False, False, True]
    assert [np.ptp(arena.problem.rows) == 0 for arena in arenas[1:]] == [True, False]
    # beside the terms for all that is far outside every pole that takes part has two columns
    least = response.basis(np.zeros(0), response.outside_powers).columns.shape[1]
    return [arena.problem.terms.shape[1] > least for arena in arenas]


@pytest.mark.parametrize(("error", "part"), [(0.0, True), (0.1, False)])
def test_skirts_take_part_where_what_is_left_is_much_whiter_beside_them_and_never_in_coloured_errors(
    error: float, part: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert posed(monkeypatch, error) == [part, part, False]


@pytest.mark.parametrize("whiter", [True, False])
def test_skirts_take_part_from_seven_tenths_of_the_excess_on(whiter: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    floors: list[Floor] = []

    def told(*given: Any) -> Floor:
        found = floor_of(*given)
        if floors:
            excess = floors[0].colour.excess * (0.7 - NUDGE if whiter else 0.7 + NUDGE)
            found = replace(found, colour=replace(found.colour, excess=excess))
        floors.append(found)
        return found

    monkeypatch.setattr(likely, "floor_of", told)
    assert posed(monkeypatch, 0.0) == [whiter, whiter, False]


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (71001, 71005))])
def test_data_without_noise_have_their_modes_and_no_others(seed: int) -> None:
    # poles of lscf are good to 1e-6 here: what they leave is misfit, and what they leave refined is rounding, and no noise
    structure = random_structure(seed)
    f = np.linspace(0.7 * np.abs(structure.poles).min(), 1.15 * np.abs(structure.poles).max(), 250) / (2 * np.pi)
    response = FrequencyResponse(values=lines_of(structure, f), frequencies=f, quantity=structure.quantity)
    found = score(structure, select(stabilize(response, method="lscf")))
    assert found.found.all()
    assert found.spurious == 0


@pytest.mark.parametrize(("part", "computed"), [(1 - NUDGE, True), (1 + NUDGE, False)])
def test_a_millionth_of_the_data_is_no_noise_of_a_measurement(part: float, computed: bool) -> None:
    floor = floor_of(data(), POLES)
    assert likely._computed(replace(floor, share=(1e-6 * part) ** 2)) is computed
    even = np.outer(*levels_of_channels(data().values))
    assert floor.share == pytest.approx(np.sum((floor.left / even) ** 2) / np.sum((floor.data / even) ** 2))


@pytest.mark.parametrize(("largest", "listed"), [(8, True), (14, False)])
def test_a_mode_that_the_data_need_is_of_a_diagram_that_shows_it_or_has_no_room_for_it(
    largest: int, listed: bool
) -> None:
    lines = chain5().frequency_response(np.arange(15, 376) * 0.02, quantity="acceleration", noise=0.01, seed=0)
    decided = contest_of([stabilize(lines, method="era", domain="z", orders=range(8, 17, 2))])
    assert decided is not None
    assert len(decided.found.poles) == 5
    diagram = stabilize(lines, method="alternate", domain="z", orders=range(2, largest + 1, 2))
    every = oscillations(diagram)
    poles = every.take(np.flatnonzero(np.abs(every.frequency - 4.168) > 0.5))  # as if the third mode were at no order
    _, found = likely.likely(diagram, poles, evidence_of(diagram), decided)
    (third,) = (c for c in found if abs(c.frequency - 4.168) < 0.02)
    assert third.against == (() if listed else ("needed by the data, but shown at no orders of this diagram",))
    others = [c for c in found if not c.against and c is not third]
    if not listed:  # what shows the others is its own
        assert [round(c.frequency, 1) for c in others] == [0.9, 2.6, 5.4, 6.1]
        assert all(c.members.size for c in others)


def test_further_diagrams_add_the_candidates_that_the_first_does_not_have() -> None:
    poles = poles_of(*ALL, orders=ORDERS)
    some, first = poles.take(np.flatnonzero(poles.frequency < 11)), float(poles.frequency.min())
    assert 0 < some.pole.size < poles.pole.size
    both = likely._starts_of(some, [poles])
    alone = likely._starts_of(poles, [])
    assert np.allclose(np.sort(both.frequency), np.sort(alone.frequency))
    assert both.frequency[0] == pytest.approx(first)
    assert likely._starts_of(poles, [poles, some]).pole.size == alone.pole.size
