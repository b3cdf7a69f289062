"""Zoom: the chirp-z transform equals the long transform's lines."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope.data import DataError
from modalscope.signals.preprocess import estimate_frf
from modalscope.signals.preprocess.plans import chirp_z
from modalscope.systems import chain5
from tests.support import relative


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_chirp_z_equals_the_transform_on_its_own_lines(seed):
    rng = np.random.default_rng(seed)
    N = int(rng.integers(10, 3000))
    first, count = int(rng.integers(0, N // 2)), int(rng.integers(2, 200))
    x = rng.standard_normal((2, N, 3))
    whole = np.fft.fft(x, axis=1)
    lines = (first + np.arange(count)) * (48.0 / N)
    found = chirp_z(x, lines, 48.0)
    assert np.abs(found - whole[:, (first + np.arange(count)) % N]).max() < 1e-13 * np.abs(whole).max()


def test_chirp_z_loses_no_digits_over_long_records():
    N = 300_007  # a prime: the plain transform has its own chirp
    x = np.random.default_rng(0).standard_normal((1, N, 1))
    whole = np.fft.rfft(x, axis=1)
    lines = np.arange(40_000, 40_300) * 100.0 / N
    assert np.abs(chirp_z(x, lines, 100.0) - whole[:, 40_000:40_300]).max() < 1e-13 * np.abs(whole).max()


@settings(max_examples=20, deadline=None)
@given(low=st.floats(0, 20), width=st.floats(0.01, 20), count=st.integers(2, 50))
def test_chirp_z_equals_its_definition_on_any_lines(low, width, count):
    x = np.random.default_rng(0).standard_normal((1, 500, 1))
    lines = np.linspace(low, low + width, count)
    expected = np.exp(-2j * np.pi * np.outer(lines / 80.0, np.arange(500))) @ x[0]
    # 500^2 / 2 turns in the chirp cost 1e5 roundings of the spacing
    assert np.allclose(chirp_z(x, lines, 80.0)[0], expected, atol=1e-9)


@pytest.fixture(scope="module")
def data():
    return chain5().simulate(samples=40_000, sampling_rate=20.0, noise=0.01)


def test_a_zoomed_response_is_a_part_of_the_long_one(data):
    whole = estimate_frf(data, segment=5000)
    zoomed = estimate_frf(data, segment=5000, zoom=(2.0, 3.0))
    part = whole.band(2.0 - 1e-9, 3.0 + 1e-9)
    assert np.allclose(zoomed.frequencies, part.frequencies)
    for name in ("values", "coherence", "variance"):
        assert relative(getattr(zoomed, name), getattr(part, name)) < 1e-10


def test_lines_can_be_finer_than_the_segment(data):
    zoomed = estimate_frf(data, segment=5000, zoom=(2.0, 3.0), zoom_lines=1001)
    assert zoomed.lines == 1001
    coarse = estimate_frf(data, segment=5000, zoom=(2.0, 3.0))
    assert relative(zoomed.values[::4], coarse.values) < 1e-9


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"zoom": (3, 2)}, "a zoom into 3 to 2 Hz"),
        ({"zoom": (2, 30)}, "the record contains 0 to 10 Hz"),
        ({"zoom": (2, 2.001)}, "fewer than two inside"),
        ({"zoom": (2, 3), "excitation": "periodic"}, "a periodic excitation allows no zoom"),
    ],
)
def test_what_cannot_be_zoomed_is_said(data, options, text):
    with pytest.raises(DataError, match=text):
        estimate_frf(data, **options)
