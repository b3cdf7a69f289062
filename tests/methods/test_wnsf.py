"""Weighted null-space fitting: the nearest model in the metric of an autoregression's errors, and its dual in the null space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg as sla

import modalscope as ms
from modalscope.blocks.driven import driven_projection
from modalscope.data import Records
from modalscope.identification.identify import identify
from modalscope.realizations.predictor_fit import _first, autoregression, fitted
from tests.studies import Study
from tests.support import match_poles, random_system


def structure(seed: int, outputs: int = 2) -> ms.StateSpace:
    """Three modes between .03 and .4 of the sampling rate, damping of .5 to 5 %, one input."""
    rng = np.random.default_rng(seed)
    f, zeta = np.sort(rng.uniform(0.03, 0.4, 3)), rng.uniform(0.005, 0.05, 3)
    poles = np.exp(2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2)))
    A = sla.block_diag(*([[z.real, z.imag], [-z.imag, z.real]] for z in poles))
    return ms.StateSpace(A=A, B=rng.standard_normal((6, 1)), C=rng.standard_normal((outputs, 6)), dt=1.0)


def record(
    model: ms.StateSpace, seed: int, forces: float, noise: float, pole: float = 0.0, samples: int = 4000
) -> ms.Signals:
    """White input; unmeasured forces on all states, through a filter of this pole, beside it; white noise on the outputs."""
    rng = np.random.default_rng(seed)
    u, w = rng.standard_normal((samples, 1)), forces * rng.standard_normal((samples, model.order))
    for k in range(1, samples):
        w[k] = pole * w[k - 1] + np.sqrt(1 - pole**2) * w[k]
    x, y = np.zeros(model.order), np.zeros((samples, len(model.C)))
    for k in range(samples):
        y[k] = model.C @ x
        x = model.A @ x + model.B @ u[k] + w[k]
    return ms.Signals(outputs=y + noise * y.std(axis=0) * rng.standard_normal(y.shape), inputs=u, sampling_rate=1.0)


def test_exact_records_have_exact_poles() -> None:
    model = random_system(np.random.default_rng(5), outputs=3, inputs=2, modes=3, damping=(0.005, 0.03), direct=True)
    u = np.random.default_rng(0).standard_normal((1200, 2))
    found = identify(ms.Signals(outputs=model.simulate(u), inputs=u, sampling_rate=1.0), method="wnsf", order=6)
    assert (found.method, found.settings["route"]) == ("wnsf", "subspace")
    assert match_poles(found.poles, np.log(model.poles)).frequency_error < 1e-9
    assert any("as n4sid" in note.text for note in found.notes)


def test_the_weighted_null_space_has_the_same_misfit() -> None:
    """r' (T cov T')^-1 r with r = T H, T the polynomial of the predictor's poles down the coefficients, of one output."""
    matrix = driven_projection(Records(runs=(record(structure(1, 1), 0, 0.3, 0.01),)), 20, 40)
    ar = autoregression(matrix)
    model = structure(1, 1)
    at = _first(ar, model.A, model.C / matrix.scales[0])
    for _ in range(6):  # to the last digits of the minimum
        at = fitted(ar, at)
    values = np.concatenate([at.values, at.values[at.times == 2].conj()])
    polynomial = np.poly(values).real[::-1]
    rows = ar.length - len(values)
    T = np.kron(
        sla.toeplitz(np.eye(1, rows)[0] * polynomial[0], np.pad(polynomial, (0, rows - 1))), np.eye(ar.channels)
    )
    inverse = sla.solve_triangular(ar.triangle, np.eye(len(ar.triangle)))
    covariance = inverse @ inverse.T / ar.weight[0, 0] ** 2
    r = T @ ar.coefficients[:, 0]
    weighted = r @ np.linalg.solve(T @ covariance @ T.T, r)
    assert weighted == pytest.approx(np.sum(ar.misfit(at.coefficients(ar.length)) ** 2), rel=1e-5)


def test_slopes_are_those_of_differences() -> None:
    matrix = driven_projection(Records(runs=(record(structure(2), 0, 0.3, 0.01),)), 20, 40)
    ar = autoregression(matrix)
    model = structure(2)
    at = _first(ar, model.A, model.C / matrix.scales[0][:, None])
    slopes = at.slopes(10)
    for k in range(slopes.shape[2]):
        step = 1e-6 * np.eye(slopes.shape[2])[k]
        by_difference = (at.moved(step).coefficients(10) - at.moved(-step).coefficients(10)) / 2e-6
        assert np.allclose(slopes[:, :, k].reshape(by_difference.shape), by_difference, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize(("forces", "short"), [(0.3, False), (0.0, True)])
def test_a_predictor_that_fades_too_slowly_is_said(forces: float, short: bool) -> None:
    """Under measurement noise alone the predictor fades as slowly as the structure."""
    found = identify(record(structure(3), 0, forces, 0.01, samples=1500), method="wnsf", order=6)
    assert any("n4sid has no such limit" in note.text for note in found.notes) is short


@pytest.mark.slow
def test_unmeasured_forces_disturb_it_less_than_n4sid() -> None:
    """Twelve records: root mean square in half bandwidths."""
    errors = {name: _errors(name, 12, 0.3, 0.01) for name in ("wnsf", "n4sid")}
    assert errors["wnsf"] < 0.9 * errors["n4sid"]


def _errors(name: str, count: int, forces: float, noise: float, pole: float = 0.0) -> float:
    """Return the root mean square of |s - s_0| over the half bandwidth, each bounded by 3."""
    found = []
    for seed in range(count):
        model, data = structure(seed), record(structure(seed), 1000 + seed, forces, noise, pole)
        data = ms.estimate_markov(data) if name == "era" else data
        s = identify(data, method=name, order=6, deviations=False).poles
        true = np.log(model.poles[model.poles.imag > 0])
        found += [min(np.abs(s - t).min() / -t.real, 3.0) for t in true]
    return float(np.sqrt(np.mean(np.square(found))))


@pytest.mark.study("inputs")
@pytest.mark.parametrize(
    ("forces", "noise", "pole", "words", "most"),
    [
        (0.3, 0.01, 0.0, "white unmeasured forces, 40 dB", 1.0),
        (0.3, 0.01, 0.8, "coloured unmeasured forces (pole .8), 40 dB", None),
        (0.1, 0.1, 0.0, "weak unmeasured forces, 20 dB", None),
        (0.0, 0.1, 0.0, "no unmeasured forces, 20 dB", None),
        (0.0, 0.01, 0.0, "no unmeasured forces, 40 dB", None),
    ],
)
def test_weighted_null_space_fitting_beside_its_neighbours(
    forces: float, noise: float, pole: float, words: str, most: float | None, study: Callable[[str, str], Study]
) -> None:
    """Forty records: root mean square errors of poles, in half bandwidths; printed where it loses, too."""
    table = study(f"wnsf, {words}", "40 records of 4000 samples, 3 modes, 2 outputs, 1 input; seeds 0 to 39")
    errors = {name: _errors(name, 40, forces, noise, pole) for name in ("wnsf", "n4sid", "era")}
    for name, words_of in (("wnsf", "wnsf"), ("n4sid", "n4sid"), ("era", "OKID and ERA")):
        table.row(f"error of poles, {words_of}, half bandwidths", errors[name])
    table.row("error of wnsf over that of n4sid", errors["wnsf"] / errors["n4sid"], most=most)
