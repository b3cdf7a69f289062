"""Many outputs through few combinations: against the exact decomposition, and the modes against those of all outputs."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import FrequencyResponse, ImpulseResponse, identify, stabilize
from modalscope.data.response import output_scale
from modalscope.identification.fast import combinations as module
from modalscope.identification.fast.combinations import combinations
from modalscope.numerics.checks import locked
from modalscope.numerics.functions.poles import poles_from
from tests.support import relative

MODES, OUTPUTS, INPUTS = 6, 200, 2


def parts(weak: float = 1.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return poles, shapes and participation of six modes, one of them `weak` times the others; outputs of any size."""
    rng = np.random.default_rng(0)
    s = poles_from(np.sort(rng.uniform(0.05, 0.4, MODES)), rng.uniform(0.005, 0.02, MODES))
    C, B = rng.standard_normal((OUTPUTS, MODES)), rng.standard_normal((MODES, INPUTS))
    B[2] *= weak
    return s, C * 10 ** rng.uniform(-1, 1, (OUTPUTS, 1)), B


def lines(noise: float, weak: float = 1.0) -> FrequencyResponse:
    s, C, B = parts(weak)
    f = np.linspace(0.02, 0.45, 250)
    x = 2j * np.pi * f[:, None]
    H = (C * (-1j / (x - s) + 1j / (x - s.conj()))[:, None]) @ B
    return FrequencyResponse(values=noisy(H, noise), frequencies=f, quantity="displacement")


def samples(noise: float, weak: float = 1.0) -> ImpulseResponse:
    s, C, B = parts(weak)
    values = 2 * np.real((C * np.exp(np.arange(150)[:, None] * s)[:, None]) @ B)
    return ImpulseResponse(values=noisy(values, noise), sampling_rate=1.0)


def noisy(values: np.ndarray, level: float) -> np.ndarray:
    rng, size = np.random.default_rng(1), level * np.sqrt(np.mean(np.abs(values) ** 2, axis=(0, 2)))[:, None]
    if np.iscomplexobj(values):
        return values + size * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)) / np.sqrt(2)
    return values + size * rng.standard_normal(values.shape)


@pytest.mark.parametrize("make", [lines, samples])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_few_combinations_leave_out_what_the_smallest_singular_values_hold(make, noise: float, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(module, "_BLOCK_NUMBERS", 5000)
    response = make(noise)
    few = combinations(response, 30)
    level = response.values / output_scale(response)[:, None]
    flat = np.moveaxis(level, 1, 0).reshape(OUTPUTS, -1)
    d = np.linalg.svd(np.hstack([flat.real, flat.imag]), compute_uv=False)
    best = np.sum(d[30:] ** 2) / np.sum(d**2)
    # a range seen from a sketch is nearly the best one; without noise nothing is left but rounding, and there are no more than the rank
    assert best * (1 - 1e-9) <= few.discarded <= 1.05 * best + 1e-28
    count = 30 if noise else MODES
    back = few.U.T / few.scale
    assert few.U.shape == (OUTPUTS, count)
    assert relative(back @ response.values, few.response.values) < 1e-12
    assert relative(back @ few.spread(np.eye(count)), np.eye(count)) < 1e-12
    spread = few.spread(few.response.values.transpose(1, 0, 2)).transpose(1, 0, 2)
    rest = np.linalg.norm((spread - response.values) / output_scale(response)[:, None])
    assert np.isclose(rest**2 / np.sum(d**2), few.discarded, rtol=1e-6, atol=1e-28)


@pytest.mark.parametrize("make", [lines, samples])
def test_without_noise_modes_are_those_of_all_outputs_and_a_mode_at_1e_7_is_there(make) -> None:  # type: ignore[no-untyped-def]
    response = make(0.0, weak=1e-7)
    method = "alternate" if make is lines else "era"
    ours, theirs = (identify(response, method=method, order=12, factorization=way) for way in ("auto", "dense"))
    assert "200 outputs through 6 combinations" in str(ours.notes)
    assert "combinations" not in str(theirs.notes)
    s, _, _ = parts(1e-7)
    assert np.abs(ours.modes.poles / s - 1).max() < 1e-6
    assert ours.fit_error < 1e-9
    assert relative(ours.modes.poles, theirs.modes.poles) < 1e-6
    residues = ours.modes.shapes[:, None, :] * ours.modes.participation.T[None]
    strong = [0, 1, 3, 4, 5]
    own = theirs.modes.shapes[:, None, :] * theirs.modes.participation.T[None]
    assert relative(residues[..., strong], own[..., strong]) < 1e-8
    assert ours.modes.output_dofs == response.output_dofs


@pytest.mark.parametrize(
    ("make", "method"), [pytest.param(lines, "alternate", marks=pytest.mark.slow), (samples, "era")]
)
def test_in_noise_both_differ_by_less_than_their_deviations(make, method: str) -> None:  # type: ignore[no-untyped-def]
    """The misfit counts what was discarded: it is that of the shapes of all outputs, rebuilt."""
    response = make(0.02)
    found = [stabilize(response, method=method, orders=[12], factorization=way) for way in ("auto", "dense")]
    s = parts()[0]
    for diagram in found:
        assert diagram.frequencies_std is not None
        nearest = np.argmin(np.abs(diagram.poles[:, None] - s), axis=0)
        f, std = np.abs(diagram.poles[nearest]) / 2 / np.pi, diagram.frequencies_std[nearest]
        assert np.all(np.abs(f - np.abs(s) / 2 / np.pi) < 4 * std)
    first, second = found
    assert np.isclose(first.fit_errors[0], second.fit_errors[0], rtol=0.05)
    one = identify(response, method=method, order=12)
    assert np.isclose(one.fit_error, first.fit_errors[0], rtol=0.05)


def test_what_is_asked_of_single_outputs_needs_all_of_them() -> None:
    response = samples(0.0)
    found = identify(response, method="era", order=12, row_weights=np.linspace(1, 2, OUTPUTS), block_rows=5)
    assert "combinations" not in str(found.notes)


@pytest.mark.parametrize("kind", [float, complex])
def test_what_is_spread_over_all_outputs_is_not_copied_again(kind: type) -> None:
    few = combinations(samples(0.0), 6)
    found = few.spread(np.ones((few.U.shape[1], 3), dtype=kind))
    assert np.allclose(found, (few.U.sum(axis=1) * few.scale)[:, None])
    assert locked(found) is found
