"""Records under forces of which some are not measured: refined all the same, lines weighted by what is left, with intervals."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.selection.likelihood.settling import settle, task_of
from tests.selection.judging.test_refine_records import runs_of, system
from tests.selection.likelihood.interval_cases import record


@pytest.mark.slow
def test_unmeasured_forces_of_half_the_measured_ones_leave_modes_refined_with_intervals() -> None:
    data, poles = record(701, unmeasured=0.5)
    modes = ms.analyze(data).modes
    assert modes.converged
    j = [int(np.argmin(np.abs(poles - s))) for s in modes.poles]
    truth = -poles.real[j] / np.abs(poles[j])
    assert np.all(np.abs(modes.damping_ratios / truth - 1) < 0.03)
    ends = modes.interval()
    assert all(np.all(np.isfinite(each)) for each in ends.values())
    held = (ends["damping_ratio"][:, 0] < truth) & (truth < ends["damping_ratio"][:, 1])
    assert held.mean() >= 0.6  # five of 95 %


def test_lines_are_weighted_where_the_residual_is_that_of_modes_and_not_in_white_noise() -> None:
    for unmeasured, weighted in ((0.0, False), (0.5, True)):
        data, poles = record(701, unmeasured=unmeasured, seconds=10.0)
        found = ms.identify(data, route="records", order=2 * len(poles)).modes
        spectra = record_spectra(as_records(data), None)
        participation, _ = spectra.basis(found.poles, (0,)).fit_participation(found.shapes)
        settled = settle(task_of(spectra, np.zeros(0), None, None), found.poles, found.shapes, participation)
        rows = settled.descent.point.problem.rows
        assert bool(np.ptp(rows) > 0.01) is weighted


def test_as_many_inputs_as_outputs_are_projected_on_their_past() -> None:
    """Only references of correlations could have a past of their own; records with inputs have none to choose."""
    model = system(2, 2)
    records = runs_of(model, [900], noise=0.01)
    assert len(ms.identify(records, route="subspace", order=6).modes) == 3
