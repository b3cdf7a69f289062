"""Correlations: the definition, what they are of an ambient record in theory, and the ways they are cut and weighted."""

import numpy as np
import pytest
import scipy.linalg as sla
from scipy import signal

from modalscope.data import DataError, Signals
from modalscope.signals.preprocess import correlation_blocks, decomposition, estimate_correlation, half_spectra
from modalscope.systems import chain5
from tests.support import random_system, relative


def noise(samples=500, channels=3, runs=None, seed=0):
    shape = (samples, channels) if runs is None else (runs, samples, channels)
    return Signals(outputs=np.random.default_rng(seed).standard_normal(shape), sampling_rate=10.0)


def by_definition(y, references, lags):
    y = y - y.mean(axis=0)
    N = len(y)
    return np.array([y[k:].T @ y[: N - k, references] / (N - k) for k in range(lags + 1)])


def test_correlations_follow_their_definition_from_lag_one():
    record = noise()
    found = estimate_correlation(record, references=["y3", "y1"], lags=40)
    expected = by_definition(record.outputs, [2, 0], 40)
    assert np.allclose(found.values, expected[1:], atol=1e-13)
    assert np.allclose(found.feedthrough, expected[0], atol=1e-13)
    assert found.kind == "correlation"
    assert found.input_dofs == ("y3", "y1")
    assert found.times[0] == pytest.approx(0.1)  # lag 1


def test_runs_are_averaged():
    record = noise(runs=3)
    expected = np.mean([by_definition(y, [0, 1, 2], 20) for y in record.outputs], axis=0)
    assert np.allclose(estimate_correlation(record, lags=20).values, expected[1:], atol=1e-13)


@pytest.mark.parametrize("runs", [None, 2])
def test_blocks_add_up_to_the_whole_estimate(runs):
    record = noise(runs=runs)
    blocks = correlation_blocks(record, lags=30, blocks=7)
    whole = estimate_correlation(record, lags=30)
    assert np.allclose(blocks.mean[1:], whole.values, atol=1e-13)
    assert len(blocks.values) == (7 if runs is None else 8)  # at least as many as asked, the same in each run


@pytest.mark.slow
def test_scatter_of_the_blocks_predicts_that_of_the_estimate():
    # 200 records: the relative error of a standard deviation is 1 / sqrt(400) = 5 %, of that from 20 blocks less when pooled
    estimates, predicted = [], []
    for seed in range(200):
        blocks = correlation_blocks(noise(2000, 2, seed=seed), lags=10, blocks=20)
        estimates.append(blocks.mean)
        predicted.append(blocks.values.var(axis=0, ddof=1) / 20)
    ratio = np.mean(predicted, axis=0) / np.var(estimates, axis=0)
    assert 0.9 < ratio.mean() < 1.1


def test_windowed_segments_are_unbiased_too():
    """An AR(1) record has R(k) = a^k / (1 - a^2)."""
    a, rng = 0.8, np.random.default_rng(1)
    y = signal.lfilter([1], [1, -a], rng.standard_normal((20, 5000)), axis=1)[:, :, None]
    record = Signals(outputs=y, sampling_rate=1.0)
    expected = a ** np.arange(1, 21) / (1 - a**2)
    for window in ("hann", "none"):
        found = estimate_correlation(record, lags=20, window=window, segment=80)
        # Bartlett: deviation sqrt(2 R0^2 (1 + a^2) / (1 - a^2) / N) with N = 1e5 is 2.7 %; windowed 20 % more; four deviations
        assert np.abs(found.values[:, 0, 0] - expected).max() < 4 * 0.0325 * expected[0]


@pytest.mark.slow
def test_correlations_of_an_ambient_record_are_a_markov_sequence():
    """R(k) = C A^(k-1) G with G = A P C' + B D', P = A P A' + B B' (white forces of unit power)."""
    model = random_system(np.random.default_rng(3), outputs=3, inputs=3, modes=3, damping=(0.02, 0.1), direct=True)
    u = np.random.default_rng(4).standard_normal((400_000, 3))
    y = model.simulate(u)[1000:]
    found = estimate_correlation(Signals(outputs=y, sampling_rate=1.0), lags=30)
    P = sla.solve_discrete_lyapunov(model.A, model.B @ model.B.T)
    G = model.A @ P @ model.C.T + model.B @ model.D.T
    expected = np.array([model.C @ np.linalg.matrix_power(model.A, k) @ G for k in range(30)])
    R0 = model.C @ P @ model.C.T + model.D @ model.D.T
    # time constants of tens of samples leave some 1e4 independent ones: one per cent
    assert relative(found.values, expected) < 0.05
    assert relative(found.feedthrough, R0) < 0.03


def test_half_spectra_are_rational_and_give_the_whole_spectrum():
    model = random_system(np.random.default_rng(3), outputs=2, inputs=2, modes=2, damping=(0.1, 0.2), direct=True)
    R = model.impulse_response(2000, kind="correlation", feedthrough=model.D + model.D.T)
    half = half_spectra(R, lines=101)
    z = np.exp(2j * np.pi * half.frequencies / R.sampling_rate)
    resolvent = np.array([model.C @ np.linalg.solve(x * np.eye(4) - model.A, model.B) for x in z])
    # damping of 10 % at .02 of the sampling rate: decayed to rounding in 2000 samples
    assert relative(half.values, resolvent + R.feedthrough / 2) < 1e-10
    assert half.sampling_rate == R.sampling_rate
    assert relative(R.to_frequency_response(half.frequencies).values, half.values) < 1e-10


def test_half_spectra_refuse_what_is_no_correlation():
    with pytest.raises(DataError, match="this is a pulse response"):
        half_spectra(chain5().impulse_response(50))


def test_decomposition_finds_the_modes_of_a_chain():
    structure = chain5()
    record = structure.simulate(inputs="ambient", samples=60_000, sampling_rate=20.0, quantity="velocity")
    look = decomposition(record)
    found, shapes = look.peaks(5)
    modes = structure.modes()
    # a peak lies within its half-power bandwidth, 2 zeta f, or two lines of 20 / 3000 Hz under a Hann window
    width = np.maximum(modes.damping_ratios * modes.frequencies, 2 * 20 / 3000)
    assert np.all(np.abs(found - modes.frequencies) < width)
    assert shapes.shape == (4, 5)
    assert np.all(look.singular_values[:, :-1] >= look.singular_values[:, 1:])


def test_decomposition_is_the_power_spectral_density():
    record = noise(4000, 1)
    f, power = signal.welch(record.outputs[:, 0], fs=10.0, nperseg=200, detrend=False)
    look = decomposition(record, segment=200)
    centred = signal.welch(record.outputs[:, 0] - record.outputs.mean(), fs=10.0, nperseg=200, detrend=False)[1]
    assert np.allclose(look.frequencies, f)
    assert np.allclose(look.singular_values[:, 0], centred, rtol=1e-12)
    assert power.shape == centred.shape


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"lags": 500}, "Lower lags to at most 499"),
        ({"references": ["y9"]}, "reference 'y9'"),
        ({"references": ["y1", "y1"]}, "Name every reference once"),
        ({"window": "hanning"}, "Did you mean 'hann'"),
        ({"segment": 100}, "no window is given"),
        ({"window": "hann", "lags": 90, "segment": 80}, "segment=80 for 90 lags"),
        ({"window": "hann", "lags": 99, "segment": 100}, "no overlap with itself at the largest lag"),
    ],
)
def test_what_cannot_be_estimated_is_said(options, text):
    with pytest.raises(DataError, match=text):
        estimate_correlation(noise(), **options)


def test_blocks_that_are_too_many_are_refused():
    with pytest.raises(DataError, match="Lower blocks"):
        correlation_blocks(noise(100), lags=5, blocks=90)


def test_blocks_have_at_every_lag_as_many_products_as_the_record() -> None:
    record = noise()
    found = correlation_blocks(record, lags=40, blocks=7)
    assert np.array_equal(found.pairs.sum(axis=0), 500 - np.arange(41))
    assert np.allclose(found.mean, by_definition(record.outputs, [0, 1, 2], 40), atol=1e-13)
