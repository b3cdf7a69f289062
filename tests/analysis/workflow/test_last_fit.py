"""Shapes and what is left: both right, for records of every quantity, length, noise and plane."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from tests.analysis.workflow.last_fit import Scored, part_of_a_band, record, scored
from tests.studies import Study

#: First seed, and count.
FIRST, COUNT = 5000, 60

#: What is asked of (1 - MAC) over its stated variance, and of what is left over what free residues leave.
MEDIAN, TAIL, SHARE = (0.5, 2.0), 6.0, 1.05


@pytest.mark.study("refinement")
def test_study_of_shapes_and_of_what_is_left(study: Callable[[str, str], Study]) -> None:
    """First order asks for a mean of one; shapes of modes that hardly stand out have longer tails."""
    each = [scored(record(seed)) for seed in range(FIRST, FIRST + COUNT)]
    table = study("shapes of records with measured forces", f"{COUNT} records, seeds {FIRST} to {FIRST + COUNT - 1}")
    ratios = np.concatenate([one.ratios for one in each])
    table.row("(1 - MAC) over its stated variance, median", np.median(ratios), least=MEDIAN[0], most=MEDIAN[1])
    table.row("(1 - MAC) over its stated variance, 95 % quantile", np.quantile(ratios, 0.95), most=TAIL)
    table.row("left over what free residues leave, largest", shares(each).max(), most=SHARE)
    assert not table.missed


@pytest.mark.study("refinement")
def test_study_of_shapes_in_bands_that_end_among_modes(study: Callable[[str, str], Study]) -> None:
    """Modes at an end of their band may lie beyond their intervals: another just outside is no smooth background."""
    each = [scored(part_of_a_band(seed)) for seed in range(FIRST, FIRST + COUNT)]
    table = study("shapes in bands that end among modes", f"{COUNT} responses, seeds {FIRST} to {FIRST + COUNT - 1}")
    ratios = np.concatenate([one.ratios for one in each])
    table.row("(1 - MAC) over its stated variance, median", np.median(ratios), least=MEDIAN[0], most=MEDIAN[1])
    table.row("(1 - MAC) over its stated variance, 95 % quantile", np.quantile(ratios, 0.95))
    table.row("left over the noise, median", np.median([one.left / one.noise for one in each]), most=1.5)
    table.row("left over what free residues leave, largest", shares(each).max(), most=SHARE)
    assert not table.missed


@pytest.mark.slow
def test_modes_outside_a_band_do_not_bias_those_inside() -> None:
    one = scored(part_of_a_band(60018))
    assert one.ratios.size == 2
    assert one.ratios.max() < 2
    assert one.left < 1.3 * one.noise
    # without poles that stand for them 32 % more than the noise is left in each, and shapes of the third err by ten times what is said
    for one in [scored(part_of_a_band(seed)) for seed in (60028, 60031, 60039)]:
        assert one.ratios.max() < 4
        assert one.left < 1.1 * one.noise


@pytest.mark.slow
def test_shapes_hold_what_is_said_of_them_and_little_is_left() -> None:
    each = [scored(record(seed)) for seed in range(3)]
    ratios = np.concatenate([one.ratios for one in each])
    assert ratios.size > 15
    assert MEDIAN[0] < np.median(ratios) < MEDIAN[1]
    assert np.quantile(ratios, 0.95) < TAIL
    assert shares(each).max() < SHARE


def shares(each: Sequence[Scored]) -> np.ndarray:
    return np.array([one.left / one.free for one in each])
