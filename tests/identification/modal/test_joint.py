"""Residues of all modes fitted together: never worse than from the shapes given, right without noise, nothing lost by compression."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.modes import ModalModel
from modalscope.data.response import Response
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.joint_fit import joint_residues
from tests.support import relative

seeds = st.integers(0, 2**32 - 1)


def case(seed: int, lines: bool) -> tuple[ModalModel, Response]:
    rng = np.random.default_rng(seed)
    poles = poles_from(np.sort(rng.uniform(0.05, 0.45, 4)), rng.uniform(0.005, 0.05, 4))
    shapes, participation = (rng.standard_normal(size) + 0.3j * rng.standard_normal(size) for size in ((3, 4), (4, 2)))
    modes = ModalModel(poles=poles, shapes=shapes, participation=participation)
    if lines:
        return modes, modes.frequency_response(np.linspace(0.01, 0.5, 200))
    return modes, modes.impulse_response(300, 1.0)


def left(response: Response, poles: np.ndarray, shapes: np.ndarray, participation: np.ndarray) -> float:
    """What modes leave when every channel's terms are fitted beside them, by plain least squares."""
    basis = response.basis(poles, response.outside_powers)
    rest = basis.data - basis.rebuilt(shapes, participation, np.zeros((basis.terms.shape[1], *basis.data.shape[1:])))
    flat = rest.reshape(len(rest), -1)
    if basis.terms.shape[1]:
        flat = flat - basis.terms @ np.linalg.lstsq(basis.terms, flat, rcond=None)[0]
    return float(np.linalg.norm(flat))


@pytest.mark.parametrize("lines", [True, False])
@given(seeds)
@settings(max_examples=15, deadline=None)
def test_it_never_leaves_more_than_the_shapes_given(lines: bool, seed: int) -> None:
    modes, response = case(seed, lines)
    rng = np.random.default_rng(seed)
    wrong = modes.shapes * np.exp(0.5 * rng.standard_normal(modes.shapes.shape))
    before, _ = response.basis(modes.poles, response.outside_powers).fit_participation(wrong)
    shapes, fields = joint_residues(response, modes.poles, wrong)
    after = left(response, modes.poles, shapes, fields["participation"])
    assert after <= left(response, modes.poles, wrong, before) * (1 + 1e-9)


@pytest.mark.parametrize("lines", [True, False])
def test_without_noise_wrong_shapes_come_right(lines: bool) -> None:
    modes, response = case(5, lines)
    shapes, fields = joint_residues(response, modes.poles, np.ones_like(modes.shapes))
    found = shapes.T[:, :, None] * fields["participation"][:, None, :]
    assert relative(found, modes.shapes.T[:, :, None] * modes.participation[:, None, :]) < 0.02


def test_a_window_is_in_the_data_and_not_in_the_poles() -> None:
    modes, response = case(3, lines=False)
    assert isinstance(response, ImpulseResponse)
    decay = np.exp(-0.05 * response.times)[:, None, None]
    windowed = replace(response, values=response.values * decay, added_damping=0.05)
    shapes, fields = joint_residues(windowed, modes.poles, modes.shapes)
    found = shapes.T[:, :, None] * fields["participation"][:, None, :]
    # a pulse response counts its steps from one sample before the first: the window there is a common factor
    factor = decay[0, 0, 0] if response.kind == "pulse" else 1.0
    assert relative(found, factor * modes.shapes.T[:, :, None] * modes.participation[:, None, :]) < 1e-9


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_a_compressed_problem_has_the_same_fit(seed: int) -> None:
    modes, response = case(seed, True)
    basis = response.basis(modes.poles, (-2, 0))
    small = basis.compressed()
    assert len(small.data) == basis.columns.shape[1]
    noisy = basis.data + np.random.default_rng(seed).standard_normal(basis.data.shape)
    noise = replace(basis, data=noisy)
    for ours, theirs in zip(
        noise.compressed().fit_participation(modes.shapes), noise.fit_participation(modes.shapes), strict=True
    ):
        assert relative(ours, theirs) < 1e-8


def test_no_modes_are_no_residues() -> None:
    for response in case(0, True)[1], case(0, False)[1]:
        assert isinstance(response, FrequencyResponse | ImpulseResponse)
        shapes, fields = joint_residues(response, np.zeros(0, complex), np.zeros((3, 0), complex))
        assert (shapes.shape, fields["participation"].shape) == ((3, 0), (0, 2))
