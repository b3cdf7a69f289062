"""A correlation at the rate of a band has the poles of the structure."""

from __future__ import annotations

import numpy as np

from modalscope.data.responses import ImpulseResponse
from modalscope.identification.identify import identify
from modalscope.signals.preprocess.conditioning import slower_correlation
from modalscope.systems import chain5
from tests.support import match_poles


def test_a_filtered_and_decimated_markov_sequence_has_its_poles_and_those_of_the_filter() -> None:
    fast = chain5().state_space(dt=0.005).impulse_response(4000)
    given = ImpulseResponse(values=fast.values, sampling_rate=200.0, kind="correlation")
    slow = slower_correlation(given, 8.0)
    assert slow.sampling_rate == 200 / 6
    assert slow.kind == "correlation"
    found = identify(slow, method="era", order=18)  # ten states, and eight of the low-pass
    # poles of the filter that die within a sample cost digits: the smallest singular value is 1e-8 of the largest
    assert match_poles(found.modes.poles, chain5().modes().poles).damping_error < 0.02


def test_a_response_that_is_no_correlation_stays() -> None:
    response = chain5().state_space(dt=0.005).impulse_response(4000)
    assert slower_correlation(response, 8.0) is response
    correlation = ImpulseResponse(values=response.values, sampling_rate=200.0, kind="correlation")
    assert slower_correlation(correlation, 60.0) is correlation
    assert np.all(np.isfinite(slower_correlation(correlation, 1.0).values))


def test_a_free_decay_sampled_far_beyond_its_band_keeps_its_poles_and_gets_no_others() -> None:
    decay = chain5().free_decay(60_000, velocity=np.arange(1.0, 6.0), sampling_rate=2000.0)
    slow = slower_correlation(decay, 8.0)
    assert slow.sampling_rate == 2000 / 62
    found = identify(slow, method="era", order=10)
    assert match_poles(found.modes.poles, chain5().modes().poles).damping_error < 1e-6
    short = chain5().free_decay(1000, velocity=np.arange(1.0, 6.0), sampling_rate=2000.0)
    assert slower_correlation(short, 8.0).samples >= 100
