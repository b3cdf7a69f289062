"""No unit of a channel counts in records with forces: outputs and inputs in powers of ten of their own give the same list."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.selection.judging.bands import merge_bands
from modalscope.selection.likelihood.whitening import levels_of

CHAIN = ms.systems.chain5()
OUTPUTS, INPUTS = np.array([1e-12, 1e12, 1.0, 1e-3]), np.array([1e12, 1e-12])


@cache
def record() -> Any:
    return CHAIN.simulate(samples=1000, sampling_rate=20.0, noise=0.02, seed=3)


@cache
def modes(outputs: bool, inputs: bool) -> Any:
    told = replace(
        record(),
        outputs=record().outputs * (OUTPUTS if outputs else 1.0),
        inputs=record().inputs * (INPUTS if inputs else 1.0),
    )
    return ms.analyze(told, orders=range(8, 17, 2)).modes


@pytest.mark.parametrize(
    ("outputs", "inputs"),
    [*(pytest.param(*one, marks=pytest.mark.slow) for one in ((True, False), (False, True))), (True, True)],
)
def test_modes_intervals_grades_and_reasons_are_those_of_any_unit(outputs: bool, inputs: bool) -> None:
    one, other = modes(False, False), modes(outputs, inputs)
    np.testing.assert_allclose(other.poles, one.poles, rtol=1e-7)
    np.testing.assert_allclose(other.frequencies_std, one.frequencies_std, rtol=1e-4)
    np.testing.assert_allclose(other.damping_ratios_std, one.damping_ratios_std, rtol=1e-4)
    told, known = (each.shapes_std / np.abs(each.shapes) for each in (other, one))
    np.testing.assert_allclose(told, known, rtol=1e-4)  # whatever is no size of the shape is none in any unit
    assert [dict(mode.words) for mode in other] == [dict(mode.words) for mode in one]
    losses = [[reasons["fit_loss"] for reasons in each.reasons] for each in (one, other)]
    np.testing.assert_allclose(losses[1], losses[0], rtol=1e-4)
    assert {note.kind for note in other.notes} == {note.kind for note in one.notes}
    rows, columns = OUTPUTS if outputs else np.ones(4), INPUTS if inputs else np.ones(2)
    for a, b in zip(one.residues, other.residues, strict=True):
        np.testing.assert_allclose(b / rows[:, None] * columns, a, rtol=1e-4, atol=1e-4 * np.abs(a).max())
    np.testing.assert_allclose(
        other.feedthrough / rows[:, None] * columns, one.feedthrough, atol=1e-4 * np.abs(one.feedthrough).max()
    )


def test_levels_go_with_the_units_and_one_that_is_fitted_to_rounding_stays_a_ten_millionth_of_the_largest() -> None:
    deviations, units = np.array([[0.1], [0.2], [1e-12]]), np.array([[1e9], [1e-9], [1e3]])
    one, other = levels_of(deviations, np.ones((3, 1))), levels_of(deviations * units, units)
    np.testing.assert_allclose(other.outputs * other.inputs, one.outputs * one.inputs * units[:, 0])
    np.testing.assert_allclose(one.outputs * one.inputs, [0.1, 0.2, 2e-8])


def test_shapes_of_bands_are_compared_in_levels_of_the_outputs() -> None:
    """A loud channel alone would make any two shapes alike."""
    both = CHAIN.modes().take([0, 1])
    close = replace(
        both,
        poles=both.poles[0] * np.array([1.0, 1.004]),
        shapes=np.abs(both.shapes) * [[1, 1], [1, 1], [1, 1], [1e6, 1e6]],
    )
    close = replace(close, shapes=close.shapes * np.array([[1, -1], [1, 1], [1, -1], [1, 1]]))
    parts, bands = [close.take([0]), close.take([1])], [(0.5, 1.2), (0.6, 1.3)]
    assert len(merge_bands(parts, bands)) == 1
    assert len(merge_bands(parts, bands, level=np.array([1, 1, 1, 1e6]))) == 2
