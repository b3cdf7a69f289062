"""Lists do not depend on how descents walk; what each rule of the choice changes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np
import pytest

import modalscope as ms
from tests.selection.judging.ablation import (
    CASES,
    CHANGES,
    PATHS,
    RULES,
    RULES_OF_REFINEMENT,
    alike,
    change_without,
    changed,
    frequencies_of,
    full,
    posed,
)
from tests.studies import Study


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lines, 40 dB", "shifted: columns, pair"])
def test_lists_are_the_same_on_other_paths(kind: str) -> None:
    diagram = posed(kind, 3).diagram
    listed = frequencies_of(diagram)
    for path in PATHS.values():
        with changed(path):
            assert alike(frequencies_of(diagram), listed)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["coloured errors", "shifted: rows and columns, pair"])
def test_lists_are_the_same_in_any_order_of_channels_and_turned(kind: str) -> None:
    """Without reciprocity: as it is, outputs and inputs in other orders, and outputs for inputs."""
    response, rng = CASES[kind](93000).data, np.random.default_rng(0)
    outputs, inputs = (rng.permutation(count) for count in response.values.shape[1:])
    others = response.values[:, outputs][:, :, inputs], response.values.transpose(0, 2, 1)
    known = {"frequencies": response.frequencies, "quantity": response.quantity}
    listed = frequencies_of(ms.stabilize(response, reciprocal=False))
    for values in others:
        assert alike(
            frequencies_of(ms.stabilize(ms.FrequencyResponse(values=values, **known), reciprocal=False)), listed
        )


@pytest.mark.slow
def test_a_rule_that_is_off_is_seen() -> None:
    """Without the rule on copies a shifting structure lists them: a switch that does nothing would tell nothing."""
    diagram = posed("shifted: rows", 3).diagram
    with changed(RULES["copies: two modes or one that shifts"]):
        without = frequencies_of(diagram)
    assert len(without) > len(frequencies_of(diagram))


SEEDS = range(71000, 71005)


@pytest.mark.study("ablation")
@pytest.mark.parametrize("rule", [*RULES, *RULES_OF_REFINEMENT])
def test_study_of_a_rule(rule: str, study: Callable[[str, str], Study]) -> None:
    """What becomes of the lists of all kinds of data without a rule."""
    found = {(kind, seed): change_without(rule, kind, seed) for kind in CASES for seed in SEEDS}
    row(study, rule, {case: change for case, change in found.items() if change is not None})


def row(study: Callable[[str, str], Study], rule: str, found: Mapping[tuple[str, int], str]) -> None:
    """Write what becomes of the lists in which a rule ran."""
    kinds, seeds = {kind for kind, _ in found}, [seed for _, seed in found]
    table = study(rule, f"{len(found)} lists of {len(kinds)} kinds, seeds {min(seeds)} to {max(seeds)}")
    counts = Counter(found.values())
    told = [f"{counts[change]} {change}" for change in CHANGES if counts[change]]
    table.row("lists without it", ", ".join(told) or "all the same")
    where = Counter(kind for (kind, _), change in found.items() if change)
    if where:
        table.row("where", "; ".join(f"{kind} ({count})" for kind, count in where.most_common(4)))


@pytest.mark.study("ablation")
@pytest.mark.parametrize("path", list(PATHS))
def test_study_of_a_path(path: str, study: Callable[[str, str], Study]) -> None:
    """On another path of the descents nothing should change: in one list of 25 at most."""
    lists = 0
    for kind in CASES:
        for seed in SEEDS:
            with changed(PATHS[path]):
                lists += not alike(full(kind, seed, False).modes.frequencies, frequencies_of(posed(kind, seed).diagram))
    count = len(CASES) * len(SEEDS)
    found = study(path, f"{count} lists of {len(CASES)} kinds, seeds {SEEDS[0]} to {SEEDS[-1]}")
    found.row("lists that change on another path", lists, most=count // 25)
    assert not found.missed
