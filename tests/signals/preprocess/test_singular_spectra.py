"""Enhanced frequency-domain decomposition: a check of damping that shares nothing with the table."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.signals.preprocess import decomposition
from modalscope.signals.preprocess.spectra import Segments, cross_spectra
from modalscope.systems import chain5


def test_the_decay_of_each_peak_is_the_damping_of_its_mode() -> None:
    truth = chain5().modes()
    record = chain5().simulate(inputs="ambient", duration=3600, sampling_rate=20.0, noise=0.1)
    peaks = decomposition(record, segment=8000).damped_peaks()
    assert np.allclose(peaks.frequencies, truth.frequencies, rtol=0.005)
    # an hour holds 3000 periods and more: scatter of 13 % at .25 %, and the ends of a bell are lost
    assert np.allclose(peaks.damping_ratios, truth.damping_ratios, rtol=0.3)
    assert peaks.shapes.shape == (4, 5)


def test_a_bell_of_few_lines_has_no_damping() -> None:
    record = chain5().simulate(inputs="ambient", duration=600, sampling_rate=20.0)
    peaks = decomposition(record, segment=200).damped_peaks(1)
    assert np.all(np.isfinite(peaks.frequencies))
    assert np.all(np.isnan(peaks.damping_ratios))


@pytest.mark.parametrize(("length", "averages"), [(128, 8), (64, 18)])
def test_singular_values_of_few_segments_are_those_of_the_spectral_matrix(length: int, averages: int) -> None:
    outputs = np.random.default_rng(0).standard_normal((2, 320, 12)) @ np.diag(np.arange(1.0, 13))
    found = decomposition(Signals(outputs=outputs, sampling_rate=8.0), segment=length)
    y = outputs - outputs.mean(axis=1, keepdims=True)
    whole = cross_spectra(y, None, 8.0, Segments.of(320, length), whole=True)
    assert found.averages == whole.averages == averages
    k = min(averages, 12)
    values = np.linalg.eigvalsh(whole.outputs)[:, ::-1]
    assert np.allclose(found.frequencies, whole.frequencies)
    assert np.allclose(found.singular_values, values[:, :k])
    assert np.all(np.abs(values[:, k:]) < 1e-12 * values[:, :1])
    of_vectors = found.vectors * found.singular_values[:, None] @ found.vectors.conj().transpose(0, 2, 1)
    assert np.allclose(of_vectors, whole.outputs)
