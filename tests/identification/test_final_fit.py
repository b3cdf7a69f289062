"""What a refinement reports explains the data as far as its poles can: residues and terms are those of least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.modal.rebuilt import fit_of
from tests.identification.test_record_terms import record
from tests.judging.coloured import coloured_response
from tests.judging.hard import Structure, impulse_response, lines_of, random_structure


def one_input(structure: Structure) -> Structure:
    return replace(structure, residues=structure.residues[:, :, :1])


def left_of_lines(response: ms.FrequencyResponse, modes: ms.ModalModel) -> float:
    """Second route: plain least squares in every channel of one input, with residual terms (j w)^(p - 2) and (j w)^p."""
    x, p = (
        2j * np.pi * response.frequencies[:, None],
        ("displacement", "velocity", "acceleration").index(response.quantity or ""),
    )
    one, other = 1 / (x - modes.poles), 1 / (x - modes.poles.conj())
    columns = np.hstack([one + other, 1j * (one - other), (x / abs(x[-1])) ** (p - 2), (x / abs(x[-1])) ** p])
    rows = np.vstack([columns.real, columns.imag])
    H = response.values[:, :, 0]
    flat = np.vstack([H.real, H.imag])
    left = flat - rows @ np.linalg.lstsq(rows, flat, rcond=None)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(flat))


@pytest.mark.parametrize("seed", [3, 4])
def test_of_one_input_the_misfit_is_that_of_least_squares_with_the_reported_poles(seed: int) -> None:
    # lines err by a part of the response: the likelihood's residues are those of its own weights and terms
    response = coloured_response(one_input(random_structure(seed)), seed)
    modes = ms.refine(response, ms.select(ms.stabilize(response)))
    assert fit_of(modes, response) == pytest.approx(left_of_lines(response, modes), rel=1e-9)


def test_of_records_no_shapes_participation_or_direct_terms_explain_more() -> None:
    signals, truth = record(0, 0.0)
    modes, response = ms.refine(signals, truth), record_spectra(as_records(signals), None)
    best = fit_of(modes, response)
    rng = np.random.default_rng(0)
    for name in ("shapes", "participation", "feedthrough"):
        values = getattr(modes, name)
        for size in (1e-4, -1e-4):
            moved = values * (1 + size * rng.standard_normal(values.shape))
            assert fit_of(replace(modes, shapes_std=None, **{name: moved}), response) > best * (1 - 1e-9)


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


def test_of_samples_too() -> None:
    response, _ = impulse_response(random_structure(6), 30.0, 6)
    modes = ms.refine(response, ms.select(ms.stabilize(response)))
    again = replace(modes, shapes_std=None, shapes=modes.shapes * (1 + 1e-4))
    assert fit_of(again, response) > fit_of(modes, response)
