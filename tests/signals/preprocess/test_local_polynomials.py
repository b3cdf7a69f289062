"""Local polynomial and rational models: free of leakage, with their own variance; lines too far apart."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import Signals
from modalscope.signals.preprocess import estimate_frf, local_models
from modalscope.signals.preprocess.frf import leakage_note
from modalscope.signals.preprocess.plans import narrowest_peak
from tests.support import random_system, refused, relative

MODEL = random_system(np.random.default_rng(5), outputs=2, inputs=2, modes=3, damping=(0.005, 0.02), direct=True)


def record(samples=4000, seed=0, noise=0.0, runs=None, mixing=None):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((runs or 1, samples, 2))
    u = u if mixing is None else u @ mixing
    y = np.stack([MODEL.simulate(run, 3 * rng.standard_normal(6)) for run in u])  # a transient at every start
    y = y + noise * rng.standard_normal(y.shape)
    return Signals(outputs=y if runs else y[0], inputs=u if runs else u[0], sampling_rate=1.0)


@pytest.mark.slow
def test_without_noise_the_error_falls_with_the_lines_in_a_bandwidth():
    """Interpolation: a rational model of degree 2 of a resonance errs far less than a polynomial; both fall fast, H1 slowly."""
    errors = {}
    for estimator in ("lpm", "lrm", "h1"):
        errors[estimator] = []
        for samples in (4000, 16000):
            frf = estimate_frf(record(samples), estimator=estimator)
            errors[estimator].append(relative(frf.values, MODEL.frequency_response(frf.frequencies).values))
    assert errors["lrm"][0] < 1e-3 < errors["h1"][1]
    # degree 2: the first term left out is of third order in lines over bandwidth, 4^3 = 64 for four times the length
    assert errors["lpm"][1] < errors["lpm"][0] / 20
    assert errors["lrm"][1] < errors["lrm"][0] / 20


def test_two_runs_share_the_response_and_not_the_transient():
    data = record(3000, runs=2)
    found = local_models(data)
    assert relative(found.values, MODEL.frequency_response(found.frequencies).values) < 2e-3
    # 2 x 17 lines of equations: half of the lines serve
    assert found.half_width < local_models(record(3000)).half_width


def test_the_definition_on_one_line():
    data, k, n = record(600, noise=0.1), 100, 12
    Y, U = np.fft.rfft(data.outputs, axis=0), np.fft.rfft(data.inputs, axis=0)
    r = np.arange(-n, n + 1) / n
    near = k + np.arange(-n, n + 1)
    K = np.hstack([r[:, None] ** s * U[near] for s in range(3)] + [r[:, None] ** s for s in range(3)])
    theta = np.linalg.lstsq(K, Y[near], rcond=None)[0]
    left = Y[near] - K @ theta
    found = local_models(data, "lpm", half_width=n)
    power = np.sum(np.abs(left) ** 2, axis=0) / (2 * n + 1 - 9)
    spread = np.diag(np.linalg.inv(K.conj().T @ K)).real
    assert np.isclose(found.frequencies[k - 1], k / 600)
    assert np.allclose(found.values[k - 1], theta[:2].T)
    assert np.allclose(found.variance[k - 1], power[:, None] * spread[:2])
    assert np.allclose(found.noise[k - 1], power * 2 / 600)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lpm", "lrm"])
def test_variance_and_noise_are_those_that_are_there(kind):
    """White noise of .2, twelve records: errors over predicted deviations have a mean square near one, the noise its density .08."""
    squares, noise = [], []
    for seed in range(12):
        found = local_models(record(4000, seed, noise=0.2), kind)
        error = found.values - MODEL.frequency_response(found.frequencies).values
        squares.append(np.abs(error) ** 2 / found.variance)
        noise.append(found.noise)
    # with nine degrees of freedom the ratio of a square to its estimated variance has the mean 18 / 16, the median near .7
    assert 0.5 < np.median(squares) < 1.1
    # in the resonances themselves the lines are few and the polynomial's interpolation adds to the noise
    assert np.isclose(np.median(noise), 2 * 0.2**2, rtol=0.15)


@pytest.mark.slow
def test_damping_from_local_models_is_not_raised_by_leakage():
    data = record(6000, noise=0.05)
    truth = np.sort(ms.identify(MODEL.impulse_response(400), order=6).modes.damping_ratios)
    biased, free = (
        np.sort(
            ms.identify(
                estimate_frf(data, estimator=e, held=True, **o), method="alternate", domain="z", order=6
            ).modes.damping_ratios
        )
        for e, o in (("h1", {"segment": 500}), ("lrm", {}))
    )
    assert np.abs(free / truth - 1).max() < 0.05 < np.abs(biased / truth - 1).max()


def test_what_local_models_cannot_take_is_said():
    refused("an option of averaged segments", estimate_frf, record(), estimator="lrm", segment=500)
    refused("half_width", local_models, record(), half_width=3)
    refused("the runs have", local_models, record(30))
    same = record(mixing=np.array([[1.0, 1.0], [0.0, 0.0]]))
    refused("the forces vanish, or are proportional", local_models, same)


def test_segments_are_as_long_as_the_narrowest_resonance_wants():
    narrow = random_system(np.random.default_rng(1), outputs=1, inputs=1, modes=1, damping=(0.001, 0.002))
    wide = random_system(np.random.default_rng(1), outputs=1, inputs=1, modes=1, damping=(0.2, 0.3))
    u = np.random.default_rng(0).standard_normal((8000, 1))
    for model, part in ((narrow, 4), (wide, 8)):
        frf = estimate_frf(Signals(outputs=model.simulate(u), inputs=u, sampling_rate=1.0))
        assert np.isclose(1 / (frf.frequencies[1] - frf.frequencies[0]), 8000 / part)
        assert f"segments of {8000 // part} samples" in frf.processing[-1]


def test_the_width_of_a_peak_is_that_at_half_power():
    f = np.linspace(0, 10, 2001)
    power = 1 / ((f**2 - 4) ** 2 + (2 * 0.05 * 2 * f) ** 2)
    # the tenth of the power is counted from the foot of the peak, not from zero
    assert np.isclose(narrowest_peak(f, power), 2 * 0.05 * 2, rtol=0.05)
    assert narrowest_peak(f, np.ones(2001)) is None


@pytest.mark.slow
def test_a_result_from_lines_too_far_apart_says_so():
    data = record(6000, noise=0.05)
    response = estimate_frf(data, segment=500)
    spacing = 1 / 500
    note = leakage_note(data, response, np.array([0.1, 0.2]), np.array([3.9 * spacing / 0.1, 4.1 * spacing / 0.2]))
    assert note.kind == "leakage"
    assert (note.numbers["modes"], note.numbers["frequency"]) == (1, 0.1)
    assert leakage_note(data, response, np.array([0.2]), np.array([4.1 * spacing / 0.2])) is None
    assert leakage_note(data, estimate_frf(data, estimator="lrm"), np.array([0.1]), np.array([0.001])) is None
    assert (
        leakage_note(response, response, np.array([0.1]), np.array([0.001])) is None
    )  # what was measured elsewhere is not known
    found = ms.analyze(data, route="frf", domain="s")
    assert any(n.kind == "leakage" for n in found.notes)
    assert not any(n.kind == "leakage" for n in ms.analyze(data, route="records").notes)
