from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from modalscope import systems
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.diagrams import stabilize
from modalscope.selection.judging.select import select
from modalscope.selection.likelihood import deviations
from modalscope.selection.likelihood.deviations import deviations_of

ORDERS = range(6, 21, 2)


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Return a list that grows with every pole whose deviation is computed: its order, its index there."""
    found: list[tuple[int, int]] = []
    monkeypatch.setattr(
        deviations,
        "deviations_of",
        lambda *given: (
            found.extend((one.order, int(k)) for one in given[2:] for k in one.which) or deviations_of(*given)
        ),
    )
    return found


def diagram(**how: bool) -> StabilizationDiagram:
    lines = np.arange(30, 751, 2) * 0.01
    data = systems.chain5().frequency_response(lines, quantity="acceleration", noise=0.01, seed=0)
    return stabilize(data, orders=ORDERS, **how)


def test_deviations_are_computed_when_first_read_and_each_once(computed: list[tuple[int, int]]) -> None:
    late = diagram()
    first = len(computed)
    assert 0 < first <= 10  # one order tells whether there are any, for the note
    f, zeta = late.frequencies_std, late.damping_ratios_std
    assert f is not None
    assert zeta is not None
    assert len(f) == len(late.poles) == len(set(computed)) == len(computed)
    at_once = diagram(deviations=True)
    assert len(computed) == 2 * len(f)  # nothing was read of it
    assert np.array_equal(at_once.frequencies_std, f, equal_nan=True)
    assert np.array_equal(at_once.damping_ratios_std, zeta, equal_nan=True)
    assert [str(n) for n in at_once.notes] == [str(n) for n in late.notes]


def test_none_are_ever_computed_where_that_is_asked(computed: list[tuple[int, int]]) -> None:
    never = diagram(deviations=False)
    assert select(never).frequencies_std is None
    assert never.frequencies_std is None
    assert never.damping_ratios_std is None
    assert not computed
    assert never.deviations_at(np.array([0])) == (None, None)


def test_a_selection_computes_those_of_its_modes_alone_and_gives_the_same(computed: list[tuple[int, int]]) -> None:
    late = diagram()
    modes = select(late)
    assert len(set(computed)) == len(computed) < len(late.poles)
    whole = select(diagram(deviations=True))
    assert modes.frequencies_std == pytest.approx(whole.frequencies_std, rel=1e-9)
    assert modes.damping_ratios_std == pytest.approx(whole.damping_ratios_std, rel=1e-9)


def test_what_is_changed_keeps_deviations_unread_and_what_is_replaced_or_sent_has_them(
    computed: list[tuple[int, int]],
) -> None:
    late = diagram()
    before = len(computed)
    other = late.changed(method="era", damping_ratios_std=np.zeros(len(late.poles)))
    assert len(computed) == before
    assert other.method == "era"
    some = np.array([3, 0])
    f, zeta = other.deviations_at(some)
    assert f is not None
    assert zeta is not None
    assert not zeta.any()
    assert np.array_equal(f, late.frequencies_std[some])
    sent, same = pickle.loads(pickle.dumps(late)), replace(late, method="era")
    for found in (sent, same):
        assert np.array_equal(found.frequencies_std, late.frequencies_std, equal_nan=True)
        assert np.array_equal(found.damping_ratios_std, late.damping_ratios_std, equal_nan=True)
    assert len(set(computed)) == len(computed)
