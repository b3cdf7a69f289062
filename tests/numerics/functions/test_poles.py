"""Poles, frequencies and damping ratios."""

from __future__ import annotations

import numpy as np
from hypothesis import given, strategies as st

from modalscope.numerics.functions.poles import (
    frequencies_and_damping,
    one_of_each_pair,
    pole_kinds,
    poles_from,
    to_continuous,
    to_discrete,
)

frequencies = st.floats(1e-3, 1e4)
ratios = st.floats(-0.99, 0.99)


@given(f=frequencies, zeta=ratios)
def test_poles_give_back_the_frequency_and_damping_they_were_made_of(f: float, zeta: float) -> None:
    f2, zeta2 = frequencies_and_damping(poles_from(f, zeta))
    np.testing.assert_allclose(f2, f, rtol=1e-14)
    np.testing.assert_allclose(zeta2, zeta, atol=1e-15)


@given(f=st.floats(1e-3, 0.499), zeta=st.floats(-0.5, 0.9), rate=st.floats(0.1, 1e5))
def test_sampled_poles_return_below_half_the_sampling_rate(f: float, zeta: float, rate: float) -> None:
    s = poles_from(f * rate, zeta)
    back = to_continuous(to_discrete(s, 1 / rate), 1 / rate)
    # exp(s dt) has a modulus down to exp(-2 pi .5 * .9), of which 17 digits are kept
    np.testing.assert_allclose(back, s, rtol=1e-11)


@given(f=st.floats(0.51, 0.999), zeta=st.floats(0.001, 0.1))
def test_frequencies_above_half_the_sampling_rate_fold(f: float, zeta: float) -> None:
    s = poles_from(f, zeta)
    folded = to_continuous(to_discrete(s, 1.0), 1.0)
    np.testing.assert_allclose(np.abs(folded.imag), abs(2 * np.pi - s.imag), rtol=1e-9)
    np.testing.assert_allclose(folded.real, s.real, rtol=1e-9)


def test_every_kind_of_pole_has_its_name() -> None:
    z = np.array([0.9 * np.exp(1j), 0.5, -0.5, 1.1 * np.exp(2j), 0.0])
    assert pole_kinds(to_continuous(z, 0.01), 0.01) == ("mode", "real", "nyquist", "unstable", "zero")
    assert pole_kinds([-1 + 2j, -3, 0.1 + 1j]) == ("mode", "real", "unstable")
    assert pole_kinds(np.zeros(0)) == ()


def test_a_negative_real_pole_is_at_nyquist_above_the_axis_whatever_the_sign_of_its_zero() -> None:
    for zero in (0.0, -0.0):
        s = to_continuous(complex(-0.5, zero), 0.1)
        np.testing.assert_allclose(s, np.log(0.5) / 0.1 + 10j * np.pi)
        assert one_of_each_pair(np.atleast_1d(s)).size == 1


@given(st.lists(st.tuples(frequencies, st.floats(0.001, 0.9)), min_size=1, max_size=8), st.integers(0, 3))
def test_one_of_each_pair_keeps_every_pair_and_every_real_pole_once(
    pairs: list[tuple[float, float]], real: int
) -> None:
    upper = poles_from(*np.array(pairs).T)
    alone = -np.arange(1.0, real + 1)
    poles = np.concatenate([upper.conj(), alone, upper])
    kept = poles[one_of_each_pair(poles)]
    assert kept.size == len(pairs) + real
    assert np.all(np.diff(np.abs(kept)) >= 0)
    assert np.all(kept.imag >= 0)


def test_a_pole_at_the_origin_has_no_frequency_and_no_damping() -> None:
    f, zeta = frequencies_and_damping([0.0])
    assert (f[0], zeta[0]) == (0.0, 0.0)
