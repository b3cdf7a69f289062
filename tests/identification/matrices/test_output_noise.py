"""The noise of outputs is seen on block rows, whatever modes there are and whatever the units, and a noisy output costs no mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.shaker import Shaker, shaker
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.identification.matrices.records import RecordLines, noise_beside_quietest, record_lines
from tests.support import relative


def with_noise_alone(test: Shaker, size: float) -> ms.Signals:
    """The record with one output more that holds nothing but noise."""
    old = test.signals
    noise = size * old.outputs.std() * np.random.default_rng(7).standard_normal((len(old.outputs), 1))
    return ms.Signals(outputs=np.hstack([old.outputs, noise]), inputs=old.inputs, sampling_rate=old.sampling_rate)


@pytest.mark.parametrize("modes", [0, 5, 14])
def test_the_ratios_are_those_of_the_noise(modes: int) -> None:
    rng = np.random.default_rng(modes)
    true, lines = np.array([0.003, 0.01, 0.1, 1.0]), 4000
    strong = 30 * rng.standard_normal((40, 4, 2 * modes)) @ rng.standard_normal((2 * modes, lines)) / np.sqrt(lines)
    noise = true[:, None] * rng.standard_normal((40, 4, lines)) / np.sqrt(lines)
    found = noise_beside_quietest((strong + noise).reshape(160, lines), 4)
    # a quarter of forty eigenvalues of 4000 lines is known to some hundredths
    assert np.allclose(found, true / 0.003, rtol=0.1)


def test_without_noise_all_outputs_stay_as_they_are() -> None:
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((60, 4)) @ rng.standard_normal((4, 500))
    assert np.array_equal(noise_beside_quietest(rows, 3), np.ones(3))


def test_the_matrix_is_the_one_of_the_outputs_divided_by_their_noise() -> None:
    """Second route: made anew with these sizes. The factor is known up to turns of its columns, what is taken off is not."""
    records = with_noise_alone(shaker(2, modes=3, outputs=3, seconds=3.0), 1e-3)
    made = record_lines(record_spectra(as_records(records)), domain="z", block_rows=20)
    again: RecordLines = replace(made, known=None)
    assert relative(made.triangle @ made.triangle.T, again.triangle @ again.triangle.T) < 1e-9
    assert relative(made.parts[0].taken_off, again.parts[0].taken_off) < 1e-6


@pytest.mark.slow
def test_an_output_of_noise_alone_costs_no_mode_and_no_accuracy() -> None:
    """Levelled by its root mean square it had a hundred directions of size one, before those of a weak mode."""
    test = shaker(2, modes=6, outputs=6, seconds=6.0)
    alone, beside = (ms.select(ms.stabilize(data)) for data in (test.signals, with_noise_alone(test, 1e-3)))
    assert len(beside) == len(alone) == 6
    errors = [np.abs(m.damping_ratios / test.damping_ratios - 1).max() for m in (alone, beside)]
    assert errors[1] < 1.5 * errors[0]
