"""What a refinement reports is the very model whose poles it reports: its residues, and the terms that were fitted with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.indicators import mac
from modalscope.data.rebuilt import fit_of
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.selection.likelihood.joint_fit import joint_fit
from modalscope.selection.likelihood.whitening import levels_of
from tests.analysis.workflow.last_fit import left_by_free_residues
from tests.identification.test_record_terms import record
from tests.selection.judging.coloured import coloured_response
from tests.selection.judging.hard import impulse_response, lines_of, random_structure


@pytest.mark.parametrize("seed", [4])
def test_residues_are_those_of_the_likelihood_itself(seed: int) -> None:
    """Lines err by a part of the response; fitted again in turn from elsewhere, residues come back to what was reported."""
    response = coloured_response(random_structure(seed), seed)
    modes = ms.refine(response, ms.select(ms.stabilize(response, orders=range(24, 41, 8))))
    (terms,) = modes.residual_terms
    sizes = np.sqrt(np.mean(np.abs(response.values) ** 2, axis=0))
    sides = levels_of(sizes, sizes)  # coloured errors tell no levels of channels
    again = joint_fit(
        response,
        modes.poles,
        modes.shapes * (1 + 0.01 * np.random.default_rng(0).standard_normal(modes.shapes.shape)),
        terms.poles,
        terms.powers,
        sides=(sides.outputs, sides.inputs),
    )
    assert np.max(1 - np.diag(mac(again.shapes, modes.shapes))) < 1e-6


def test_of_records_no_shapes_or_participation_explain_more_with_the_terms() -> None:
    signals, truth = record(0, 0.0)
    modes, response = ms.refine(signals, truth), record_spectra(as_records(signals), None)
    best = fit_of(modes, response)
    rng = np.random.default_rng(0)
    for name in ("shapes", "participation"):
        values = getattr(modes, name)
        for size in (1e-3, -1e-3):
            moved = values * (1 + size * rng.standard_normal(values.shape))
            assert fit_of(replace(modes, shapes_std=None, **{name: moved}), response) > best
    assert best < 1.05 * left_by_free_residues(response, modes)


def test_what_weights_leave_out_does_not_count_in_the_last_fit_either() -> None:
    structure = random_structure(5)
    f = np.linspace(0.7 * np.abs(structure.poles).min(), 1.15 * np.abs(structure.poles).max(), 500) / (2 * np.pi)
    H = lines_of(structure, f) + 0
    spoilt = H.copy()
    spoilt[200:210] += 10 * np.abs(H).max()
    weights = np.ones(f.size)
    weights[200:210] = 1e-9
    truth = ms.identify(
        ms.FrequencyResponse(values=H, frequencies=f, quantity=structure.quantity), order=2 * structure.poles.size
    ).modes
    whole, less = (
        ms.refine(ms.FrequencyResponse(values=v, frequencies=f, quantity=structure.quantity), truth, weights=w)
        for v, w in ((H, None), (spoilt, weights))
    )
    assert np.allclose(less.residues, whole.residues, rtol=1e-5)
    terms, all_terms = (each.residual_terms[0].on_lines(f) for each in (less, whole))
    assert np.abs(terms - all_terms).max() < 1e-6 * np.abs(H).max()


def test_of_samples_too() -> None:
    response, _ = impulse_response(random_structure(6), 30.0, 6)
    modes = ms.refine(response, ms.select(ms.stabilize(response)))
    again = replace(modes, shapes_std=None, shapes=modes.shapes * (1 + 1e-4))
    assert fit_of(again, response) > fit_of(modes, response)
