"""Weighted null-space fitting: the nearest model in the metric of an autoregression's errors, and its dual in the null space."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest
import scipy.linalg as sla

import modalscope as ms
from benchmarks.records.record_bound import Unmeasured, bound_of_poles, innovations_model, whitened
from modalscope.analysis.workflow.prediction_error import least_prediction_errors
from modalscope.data import Records
from modalscope.data.records import as_records
from modalscope.extras.predictor_fit import _first, autoregression, fitted
from modalscope.identification.identify import identify
from modalscope.identification.matrices.driven import driven_projection
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
    """Twelve records: root mean square over the bound."""
    errors = {name: _size(_over_the_bound(name, range(12), 0.3, 0.1)) for name in ("wnsf", "n4sid")}
    assert errors["wnsf"] < 0.95 * errors["n4sid"]


# ---------------------------------------------------------------------------------------------------------- the bound
def test_the_bound_of_a_record_is_that_of_differences() -> None:
    """By numerical derivatives of the errors of prediction in each unknown of a model in modal form, white forces."""
    model = structure(4, 1)
    data = record(model, 0, 0.3, 0.1, samples=600)
    noise = 0.1 * data.outputs.std(axis=0) / np.sqrt(1.01)
    A, C, K, covariance = innovations_model(model, Unmeasured(0.3, 0.0, noise))

    def errors(x: np.ndarray) -> np.ndarray:
        moved = A + sla.block_diag(*([[a, b], [-b, a]] for a, b in x[:6].reshape(-1, 2)))
        B, gain, D = x[6:12, None], x[12:18, None], x[18]
        other = ms.StateSpace(A=moved, B=model.B + B, C=C, D=[[D]], dt=1.0)
        left = data.outputs.T - other.simulate(data.inputs).T
        return whitened(moved, C, K + gain, left).ravel()

    steps = 1e-6 * np.eye(19)
    J = np.array([(errors(step) - errors(-step)) / 2e-6 for step in steps])
    spread = covariance[0, 0] * np.linalg.inv(J @ J.T)
    least = np.sqrt(np.diag(spread)[:6].reshape(-1, 2).sum(axis=1)) / np.abs(model.poles[model.poles.imag > 0])
    found = bound_of_poles(model, Unmeasured(0.3, 0.0, noise), data)
    assert np.sort(found) == pytest.approx(np.sort(least), rel=1e-4)


def _poles(name: str, data: ms.Signals) -> np.ndarray:
    """Return the poles by one way, six states."""
    if name == "era":
        return ms.identify(ms.estimate_markov(data), method=name, order=6, deviations=False).poles
    if name == "records":
        return ms.identify(data, route=name, order=6, deviations=False).poles
    if name == "refined":
        return ms.refine(data, ms.identify(data, route="records", order=6).modes).poles
    if name != "prediction":
        return ms.identify(data, method=name, order=6, deviations=False).poles
    begun = ms.identify(data, method="n4sid", order=6, deviations=False).state_space
    model = least_prediction_errors(begun, as_records(data))
    return np.log((begun if model is None else model).poles)


def _over_the_bound(name: str, seeds: Iterable[int], forces: float, noise: float, pole: float = 0.0) -> np.ndarray:
    """Return |s - s_0| over the bound, each error bounded by three half bandwidths."""
    found = []
    for seed in seeds:
        model = structure(seed)
        data = record(model, 1000 + seed, forces, noise, pole)
        by = Unmeasured(forces, pole, noise * data.outputs.std(axis=0) / np.sqrt(1 + noise**2))
        least, s = bound_of_poles(model, by, data), _poles(name, data)
        true = np.log(model.poles[model.poles.imag > 0])
        found += [min(np.abs(s - t).min(), -3 * t.real) / own for t, own in zip(true, least, strict=True)]
    return np.array(found)


def _size(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


#: Ways and what they are called.
WAYS = {
    "wnsf": "wnsf",
    "n4sid": "n4sid",
    "prediction": "n4sid refined to the least errors of prediction, as realize does",
    "era": "OKID and ERA",
    "records": "records on lines",
    "refined": "records on lines, refined",
}

#: The first seed of a study, and records of each kind.
FIRST, COUNT = 2000, 50


@pytest.mark.study("inputs")
@pytest.mark.parametrize("noise", [0.01, 0.1])
@pytest.mark.parametrize(
    ("forces", "pole", "words"),
    [
        (0.3, 0.0, "white unmeasured forces"),
        (0.3, 0.8, "coloured unmeasured forces (pole .8)"),
        (0.0, 0.0, "no unmeasured forces"),
    ],
)
def test_errors_of_poles_over_the_bound(
    forces: float, pole: float, words: str, noise: float, study: Callable[[str, str], Study]
) -> None:
    """Three hundred records, printed where a way loses, too; efficiency is claimed of wnsf where the forces are white."""
    decibel = round(-20 * np.log10(noise))
    seeds = range(FIRST, FIRST + COUNT)
    cases = f"{COUNT} records of 4000 samples, 3 modes, 2 outputs, 1 input; seeds {FIRST} to {seeds[-1]}"
    table = study(f"error of poles over the Cramér-Rao bound, {words}, {decibel} dB", cases)
    for name, called in WAYS.items():
        errors = _over_the_bound(name, seeds, forces, noise, pole)
        most = 1.1 if name == "wnsf" and forces and not pole else None
        table.row(f"{called}: root mean square", _size(errors), most=most)
        table.row(f"{called}: median", float(np.median(errors)))
