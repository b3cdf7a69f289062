"""Residues fitted together with residual terms: what the data contain besides the modes is no part of their shapes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data.modes import ModalModel
from modalscope.data.rebuilt import fit_of, rebuilt
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.data.response import Response
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.joint_fit import for_judging, joint_fit, joint_residues, with_terms
from tests.support import relative

#: Modes, and poles besides them: one between two modes, one below and one above the band.
F, ZETA = np.array([2.0, 3.0, 3.6]), np.array([0.01, 0.02, 0.01])
BESIDES = poles_from([3.3, 0.5, 6.0], [0.02, 0.05, 0.05])


def modes_of(outputs: int = 3, inputs: int = 2, seed: int = 0) -> ModalModel:
    rng = np.random.default_rng(seed)
    shapes, part = (rng.standard_normal(n) + 0.3j * rng.standard_normal(n) for n in ((outputs, 3), (3, inputs)))
    return ModalModel(poles=poles_from(F, ZETA), shapes=shapes, participation=part, quantity="displacement")


def free_part(response: Response, seed: int, powers: tuple[int, ...]) -> np.ndarray:
    """Return random contributions of the poles besides and of powers, of any rank, on the rows of the data."""
    basis = response.whole_basis(BESIDES - response.added_damping, powers)
    columns = basis.columns / np.linalg.norm(basis.columns, axis=0)
    flat = columns @ np.random.default_rng(seed).standard_normal((columns.shape[1], basis.data[0].size))
    return flat.reshape(basis.data.shape) * np.linalg.norm(basis.data) / np.linalg.norm(flat)


def made(kind: str) -> tuple[ModalModel, Response, tuple[int, ...]]:
    """Return modes, data that hold them with as much besides, and the powers."""
    modes = modes_of()
    if kind == "samples":
        clean = modes.impulse_response(500, 20.0)
        return modes, replace(clean, values=clean.values + free_part(clean, 1, ())), ()
    if kind == "lines":
        clean = modes.frequency_response(np.linspace(1, 4.5, 300))
        rows, powers = free_part(clean, 1, clean.outside_powers), clean.outside_powers
        return modes, replace(clean, values=clean.values + rows[:300] + 1j * rows[300:]), powers
    spectra = spectra_of(modes, ())
    rows, powers = free_part(spectra, 1, spectra.refined_powers), spectra.refined_powers
    half = len(rows) // 2
    return modes, replace(spectra, values=spectra.values + rows[:half] + 1j * rows[half:]), powers


def spectra_of(modes: ModalModel, besides: tuple[complex, ...]) -> RecordSpectra:
    """Return the spectra of two runs that modes give under random forces, with ends of runs."""
    rng = np.random.default_rng(3)
    runs = [
        ms.Signals(outputs=rng.standard_normal((n, 3)), inputs=rng.standard_normal((n, 2)), sampling_rate=20.0)
        for n in (400, 300)
    ]
    spectra = record_spectra(as_records(ms.merge(runs)), (1.0, 4.5))
    part = np.hstack([modes.known_participation("a test"), rng.standard_normal((3, 2)) + 0j])
    nothing = np.zeros((1, 3, 2))
    return replace(spectra, values=spectra.evaluated(modes.poles, modes.shapes, part, nothing)[:, :, None])


def residues(shapes: ComplexArray, participation: ComplexArray) -> ComplexArray:
    return np.asarray(shapes.T[:, :, None] * participation[:, None, :])


def given(response: Response, values: np.ndarray) -> dict[str, Any]:
    """Return what makes a response of other outputs on the same lines or samples."""
    if response.grid is None:
        return {"values": values, "sampling_rate": response.sampling_rate, "quantity": response.quantity}
    return {"values": values, "frequencies": response.grid, "quantity": response.quantity}


KINDS = ("lines", "samples", "records")


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_besides_the_modes_is_not_pressed_into_them(kind: str) -> None:
    modes, response, powers = made(kind)
    true = residues(modes.shapes, modes.known_participation("a test"))
    fit = joint_fit(response, modes.poles, modes.shapes * 1.0, BESIDES, powers)
    assert relative(residues(fit.shapes, response.of_inputs(fit.participation)), true) < 1e-6
    alone, fields = joint_residues(response, modes.poles, modes.shapes)
    assert relative(residues(alone, fields["participation"]), true) > 0.1  # without the terms


@pytest.mark.parametrize("kind", KINDS)
def test_modes_and_terms_together_rebuild_the_data(kind: str) -> None:
    modes, response, powers = made(kind)
    found = with_terms(response, modes, BESIDES, powers)
    assert fit_of(found, response) < 1e-9
    assert np.array_equal(found.shapes, modes.shapes)
    assert fit_of(replace(found, residual_terms=()), response) > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_terms_are_least_squares_on_what_the_modes_leave_whatever_else_is_there(kind: str) -> None:
    modes, response, powers = made(kind)
    noisy = replace(
        response, values=response.values + 0.1 * np.random.default_rng(0).standard_normal(response.values.shape)
    )
    found = with_terms(noisy, modes, BESIDES, powers)
    basis = noisy.whole_basis(BESIDES, powers)
    left = noisy.values - rebuilt(noisy, found)
    rows = np.concatenate([left.real, left.imag]) if np.iscomplexobj(left) else left
    columns = basis.columns / np.linalg.norm(basis.columns, axis=0)
    assert np.abs(columns.T @ rows.reshape(len(rows), -1)).max() < 1e-6 * np.linalg.norm(noisy.values)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_that_weigh_nothing_do_not_count(kind: str) -> None:
    modes, response, powers = made(kind)
    values = response.values.copy()
    values[50:60] *= 100
    count = response.count
    rows = np.ones(count * (1 + bool(np.iscomplexobj(values))))
    rows[50:60] = 1e9
    rows[-count:][50:60] = 1e9
    fit = joint_fit(replace(response, values=values), modes.poles, modes.shapes, BESIDES, powers, rows=rows)
    true = residues(modes.shapes, modes.known_participation("a test"))
    assert relative(residues(fit.shapes, response.of_inputs(fit.participation)), true) < 1e-5


@pytest.mark.parametrize("kind", ["lines", "records"])
def test_levels_of_channels_weigh_the_residues_and_stay_out_of_the_terms(kind: str) -> None:
    modes, response, powers = made(kind)
    sides = (np.array([1.0, 100.0, 0.01]), np.array([10.0, 0.1]))
    fit = joint_fit(response, modes.poles, modes.shapes, BESIDES, powers, sides=sides)
    plain = joint_fit(response, modes.poles, modes.shapes, BESIDES, powers)
    assert relative(fit.terms.residues, plain.terms.residues) < 1e-5
    assert relative(residues(fit.shapes, fit.participation), residues(plain.shapes, plain.participation)) < 1e-5


def test_a_list_is_judged_without_the_poles_inside_the_band() -> None:
    modes, response, powers = made("lines")
    fewer = modes.take([0, 2])  # the mode between them hides among the poles
    told = with_terms(response, fewer, np.append(BESIDES, modes.poles[1]), powers)
    assert fit_of(told, response) < 1e-9
    judged = for_judging(response, told)
    (terms,) = judged.residual_terms
    assert np.allclose(np.sort(terms.poles.imag), np.sort(BESIDES[1:].imag))
    assert 0.1 < fit_of(judged, response) < fit_of(replace(told, residual_terms=()), response)
    assert for_judging(response, judged) is judged


def test_columns_that_depend_on_each_other_are_one() -> None:
    modes, response, powers = made("lines")
    twice = joint_fit(response, modes.poles, modes.shapes, np.repeat(BESIDES, 2), powers)
    once = joint_fit(response, modes.poles, modes.shapes, BESIDES, powers)
    f = response.grid
    assert f is not None
    assert relative(twice.terms.on_lines(f), once.terms.on_lines(f)) < 1e-8
    assert relative(residues(twice.shapes, twice.participation), residues(once.shapes, once.participation)) < 1e-8


def test_direct_terms_approximate_what_the_terms_hold() -> None:
    """Where the terms have no place, as in a state-space model, residuals on all frequencies are least squares on the same remainder."""
    modes, response, powers = made("lines")
    found = with_terms(response, modes, BESIDES, powers)
    without = replace(found, residual_terms=())
    best = fit_of(without, response)
    for name in ("lower_residual", "upper_residual"):
        for by in (0.999, 1.001):
            assert fit_of(replace(without, **{name: by * getattr(found, name)}), response) > best


@pytest.mark.parametrize("kind", ["lines", "samples"])
def test_of_nothing_nothing_is_fitted(kind: str) -> None:
    modes, response, powers = made(kind)
    none = with_terms(response, modes.take([]), np.zeros(0, complex), powers)
    assert fit_of(replace(none, residual_terms=(), lower_residual=None, upper_residual=None), response) == 1
    assert none.residual_terms[0].poles.size == 0


@pytest.mark.parametrize("kind", ["lines", "samples"])
def test_of_many_outputs_their_span_is_fitted(kind: str) -> None:
    """Outputs that stand many times each have the residues that they have once."""
    modes, response, _ = made(kind)
    again, start = np.tile(np.arange(3), 50), modes.shapes + 0.3
    many = type(response)(**given(response, response.values[:, again]))
    shapes, fields = joint_residues(response, modes.poles, start)
    own, more = joint_residues(many, modes.poles, start[again])
    assert own.shape == (150, 3)
    found, known = residues(own, more["participation"]), residues(shapes, fields["participation"])
    assert relative(found, known[:, again]) < 1e-6
