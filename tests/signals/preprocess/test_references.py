"""Outputs that stand for all others as references of correlations."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import Signals
from modalscope.signals.preprocess.correlation import spanning_outputs
from modalscope.systems import chain5


def test_few_outputs_are_all_references() -> None:
    record = chain5().simulate(inputs="ambient", samples=2000, sampling_rate=20.0)
    assert spanning_outputs(record) == tuple(range(len(record.output_dofs)))


def test_references_span_what_moves_and_leave_noise_and_channels_at_rest() -> None:
    rng = np.random.default_rng(3)
    shapes = rng.standard_normal((4, 50))
    y = rng.standard_normal((4000, 4)) @ shapes + 0.01 * rng.standard_normal((4000, 50))
    y[:, 7], y[:, 11] = 0.0, rng.standard_normal(4000)
    chosen = spanning_outputs(Signals(outputs=y, sampling_rate=1.0), 4)
    assert 7 not in chosen
    assert 11 not in chosen
    assert np.linalg.cond(shapes[:, list(chosen)]) < 50


@pytest.mark.slow
def test_correlations_of_many_channels_take_thirty_references_and_say_so() -> None:
    few = chain5().simulate(inputs="ambient", samples=20_000, sampling_rate=20.0, seed=1)
    many = np.random.default_rng(0).standard_normal((few.outputs.shape[1], 40))
    y = few.outputs @ many
    record = Signals(outputs=y + 1e-3 * y.std() * np.random.default_rng(1).standard_normal(y.shape), sampling_rate=20.0)
    diagram = ms.stabilize(record, band=(0.0, 9.0), orders=range(2, 21, 2), deviations=False)
    assert diagram.response.values.shape[1:] == (40, 30)
    assert any("30 of 40 channels" in note.text for note in diagram.notes)
    projected = ms.stabilize(record, band=(0.0, 9.0), method="ssi-data", orders=[10], deviations=False)
    assert projected.poles.size
