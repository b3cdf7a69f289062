"""Lists do not depend on how descents walk; what each rule of the choice changes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import modalscope as ms
from tests.selection.judging.ablation import CASES, PATHS, RULES, alike, changed, diagram_of_case, frequencies_of
from tests.studies import Study


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lines, 40 dB", "shifted: columns, pair"])
def test_lists_are_the_same_on_other_paths(kind: str) -> None:
    diagram = diagram_of_case(kind, 3)
    listed = frequencies_of(diagram)
    for path in PATHS.values():
        with changed(path):
            assert alike(frequencies_of(diagram), listed)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["coloured errors", "shifted: rows and columns, pair"])
def test_lists_are_the_same_in_any_order_of_channels_and_turned(kind: str) -> None:
    """Without reciprocity: as it is, outputs and inputs in other orders, and outputs for inputs."""
    response, rng = CASES[kind](93000), np.random.default_rng(0)
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
    diagram = diagram_of_case("shifted: rows", 3)
    with changed(RULES["copies of shifting resonances"]):
        without = frequencies_of(diagram)
    assert len(without) > len(frequencies_of(diagram))


@pytest.mark.study("ablation")
@pytest.mark.parametrize("kind", list(CASES))
def test_study_of_rules_and_paths(kind: str, study: Callable[[str, str], Study]) -> None:
    """Of each rule, in how many lists something changes without it; of each path the same, where nothing should."""
    seeds = range(70000, 70025)
    lists = dict.fromkeys((*RULES, *PATHS), 0)
    for seed in seeds:
        diagram = diagram_of_case(kind, seed)
        full = frequencies_of(diagram)
        for name, rule in (RULES | PATHS).items():
            with changed(rule):
                lists[name] += not alike(frequencies_of(diagram), full)
    found = study(kind, f"25 cases, seeds {seeds[0]} to {seeds[-1]}")
    for name in RULES:
        found.row(f"lists that change without: {name}", lists[name])
    for name in PATHS:
        found.row(f"lists that change on another path: {name}", lists[name], most=1)
    assert not found.missed
