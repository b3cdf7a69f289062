"""Enhanced frequency-domain decomposition: a check of damping that shares nothing with the table."""

from __future__ import annotations

import numpy as np

from modalscope.preprocess import decomposition
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
