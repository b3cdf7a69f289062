"""What a pole contributes, against the term built out in full."""

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data.rebuilt import contributions, peak_sizes
from modalscope.data.response import output_scale
from modalscope.systems import chain5

MODES = chain5().modes()


def alone(k):
    return replace(MODES.take([k]), feedthrough=None)


WINDOW, LATE, RATE = 0.4, 30, 20.0  # 1/s on decays of .01 to .6 1/s, and one and a half seconds that were cut off


def damped(modes, added):
    return replace(modes, poles=modes.poles - added)


def on_samples(modes):
    return modes.impulse_response(4000, RATE)


def on_late_samples(modes):
    return modes.impulse_response(4000, RATE, first_sample=LATE)


def on_lines(modes):
    return modes.frequency_response(np.linspace(0.01, 30, 20_000))


@pytest.mark.parametrize("k", range(5))
@pytest.mark.parametrize(
    ("made", "window"), [(on_samples, 0.0), (on_lines, 0.0), (on_late_samples, WINDOW), (on_lines, WINDOW)]
)
def test_it_is_the_norm_of_the_term_built(k, made, window):
    """The sum of |2 Re R exp(s t)|^2 over samples is |R|^2 fs / |Re s| but for its fast part, of relative size zeta and 1 / (decay fs).

    A band of 25 half bandwidths on either side at least holds 1 - 2 / 25 pi of the energy of the resonance; lines are fine. Under a
    window both the decay and the size at the first sample there is are those with the window on.
    """
    response, term = (made(damped(modes, window)) for modes in (MODES, alone(k)))
    scale = output_scale(response)[:, None]
    wanted = np.linalg.norm(term.values / scale) / np.linalg.norm(response.values / scale)
    data = replace(response, added_damping=window)
    found = contributions(data, MODES.poles, MODES.shapes.T, MODES.participation)[k]
    assert found == pytest.approx(wanted, rel=0.06 if made is on_late_samples else 0.05)


@pytest.mark.parametrize("late", [0, LATE])
@pytest.mark.parametrize("part", [contributions, peak_sizes])
def test_a_window_that_is_told_is_one_that_is_in_the_poles(part, late):
    told = damped(MODES, WINDOW).impulse_response(400, RATE, first_sample=late)
    marked = replace(told, added_damping=WINDOW)
    own = part(told, MODES.poles - WINDOW, MODES.shapes.T, MODES.participation)
    assert part(marked, MODES.poles, MODES.shapes.T, MODES.participation) == pytest.approx(own, rel=1e-12)


@pytest.mark.parametrize("part", [contributions, peak_sizes])
def test_samples_that_begin_late_are_those_of_residues_that_have_decayed(part):
    """Y(k + q) = phi z^k (z^q l'): what is counted from the impulse, or from the first sample, is one response."""
    late = MODES.impulse_response(400, RATE, first_sample=LATE)
    now = replace(late, first_sample=0)
    decayed = MODES.participation * np.exp(MODES.poles * LATE / RATE)[:, None]
    from_impulse = part(late, MODES.poles, MODES.shapes.T, MODES.participation)
    assert from_impulse == pytest.approx(part(now, MODES.poles, MODES.shapes.T, decayed), rel=1e-12)


@pytest.mark.parametrize("late", [0, LATE])
def test_the_peak_of_samples_under_a_window_is_what_their_transform_shows_there(late):
    """The transform of R z^k over all k is R / (1 - z exp(-j w dt)) dt, |R| / |Re s| at w = Im s but for Re s dt / 2, 1 %."""
    one = alone(2)
    response = damped(one, WINDOW).impulse_response(2000, RATE, first_sample=late)
    f, H = response.spectrum()
    level = np.linalg.norm(H / output_scale(response)[:, None], axis=(1, 2))
    found = peak_sizes(replace(response, added_damping=WINDOW), one.poles, one.shapes.T, one.participation)
    assert found[0] == pytest.approx(np.interp(one.frequencies[0], f, level), rel=0.05)


def test_an_undamped_pole_contributes_no_more_than_its_samples():
    response = MODES.impulse_response(100, 20.0)
    still = MODES.poles.imag * 1j
    bound = (
        np.linalg.norm(MODES.shapes.T / output_scale(response), axis=1)
        * np.linalg.norm(MODES.participation, axis=1)
        * np.sqrt(2 * 100)
    )
    total = np.linalg.norm(response.values / output_scale(response)[:, None])
    found = contributions(response, still, MODES.shapes.T, MODES.participation)
    assert found == pytest.approx(bound / total)


@pytest.mark.parametrize("part", [contributions, peak_sizes])
def test_units_of_a_sensor_do_not_matter(part):
    factor = np.array([1e-3, 1.0, 50.0, 1e6])
    response = MODES.impulse_response(300, 20.0)
    other = replace(response, values=response.values * factor[:, None])
    before = part(response, MODES.poles, MODES.shapes.T, MODES.participation)
    after = part(other, MODES.poles, MODES.shapes.T * factor, MODES.participation)
    assert after == pytest.approx(before, rel=1e-12)


def test_the_peak_is_what_one_mode_shows_at_its_frequency():
    """|R / (j w - s)| at w = |s| is |R| / |Re s| but for terms of the order zeta."""
    one = alone(0)
    response = one.frequency_response(np.array([one.frequencies[0]]))
    level = response.values[0] / output_scale(response)[:, None]
    found = peak_sizes(response, one.poles, one.shapes.T, one.participation)
    assert found[0] == pytest.approx(np.linalg.norm(level), rel=0.02)
