"""The noise of a response: whitened it has variance one; likelihood, significance and bound are those of the plain formulas."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.selection.likelihood import TERMS, Noise
from modalscope.systems import chain5
from tests.support import refused

LINES = np.linspace(0.3, 8, 300)
TRUTH = chain5().modes(quantity="acceleration")
CLEAN = chain5().frequency_response(LINES, quantity="acceleration")


def noisy(seed: int, size: float = 1e-3) -> ms.FrequencyResponse:
    rng = np.random.default_rng(seed)
    e = rng.standard_normal(CLEAN.values.shape) + 1j * rng.standard_normal(CLEAN.values.shape)
    return ms.FrequencyResponse(values=CLEAN.values + size * e, frequencies=LINES, quantity="acceleration")


def test_whitened_noise_has_variance_one_and_the_likelihood_is_the_gaussian() -> None:
    frf = noisy(0)
    noise = Noise(response=frf, modes=TRUTH)
    e = noise.whiten(frf.values - CLEAN.values)
    assert e.shape == (600, *frf.values.shape[1:])
    # one of 3000 or more squares: a few per cent
    assert np.mean(e**2) == pytest.approx(1, abs=0.05)
    assert noise.log_likelihood(TRUTH) == pytest.approx(np.sum(-(e**2) / 2 - np.log(2 * np.pi * 1e-6) / 2), rel=2e-2)
    moved = ms.ModalModel(poles=TRUTH.poles * 1.01, shapes=TRUTH.shapes, participation=TRUTH.participation)
    assert noise.log_likelihood(moved) < noise.log_likelihood(TRUTH) - 100


def test_the_rise_is_the_likelihood_ratio_without_a_mode() -> None:
    noise = Noise(response=noisy(0), modes=TRUTH)
    for k in (0, 4):
        without = TRUTH.take(np.arange(5) != k)
        ratio = 2 * (noise.log_likelihood(TRUTH) - noise.log_likelihood(without))
        # without its participation the others' stay as they are: a little more is lost than where all are fitted again
        assert noise.rise(TRUTH)[k] == pytest.approx(ratio, rel=1e-6)


@pytest.mark.slow
def test_the_covariance_is_the_scatter_of_refined_poles() -> None:
    found = np.array([ms.refine(noisy(seed), TRUTH).poles for seed in range(40)])
    stated = Noise(response=noisy(0), modes=TRUTH).covariance(TRUTH)
    for part, k in ((found.real, 0), (found.imag, 1)):
        # 40 records: the deviation of a standard deviation is 11 %
        assert np.allclose(part.std(axis=0) / np.sqrt(stated[:, k, k]), 1, atol=0.4)


def test_terms_have_words_and_records_are_refused() -> None:
    assert {"rows", "outputs", "inputs", "variance"} <= set(TERMS)
    assert ms.likelihood.Noise is Noise
    record = chain5().simulate(samples=400, sampling_rate=20.0)
    refused("response of Noise", lambda: Noise(response=record, modes=TRUTH))
    bare = ms.ModalModel(poles=TRUTH.poles, shapes=TRUTH.shapes)
    refused("no participation", lambda: Noise(response=noisy(0), modes=bare))
