"""What a pole contributes, against the term built out in full."""

from dataclasses import replace

import numpy as np
import pytest

from modalscope.modal.contribution import contributions, peak_sizes, residue_sizes
from modalscope.model.response import output_scale
from modalscope.systems import chain5

MODES = chain5().modes()


def alone(k):
    return replace(MODES.take([k]), feedthrough=None)


@pytest.mark.parametrize("k", range(5))
def test_on_samples_it_is_the_norm_of_the_term_built(k):
    """The sum of |2 Re R exp(s t)|^2 over samples is |R|^2 fs / |Re s| but for its fast part, of relative size zeta and 1 / (decay fs)."""
    response = MODES.impulse_response(4000, 20.0)
    scale = output_scale(response)[:, None]
    term = alone(k).impulse_response(4000, 20.0).values
    wanted = np.linalg.norm(term / scale) / np.linalg.norm(response.values / scale)
    found = contributions(response, MODES.poles, MODES.shapes.T, MODES.participation)[k]
    assert found == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize("k", range(5))
def test_on_lines_it_is_the_norm_of_the_term_built(k):
    """A band of 25 half bandwidths on either side at least holds 1 - 2 / 25 pi of the energy of the resonance; lines are fine."""
    response = MODES.frequency_response(np.linspace(0.01, 15, 20_000))
    scale = output_scale(response)[:, None]
    term = alone(k).frequency_response(response.frequencies).values
    wanted = np.linalg.norm(term / scale) / np.linalg.norm(response.values / scale)
    found = contributions(response, MODES.poles, MODES.shapes.T, MODES.participation)[k]
    assert found == pytest.approx(wanted, rel=0.05)


def test_an_undamped_pole_contributes_no_more_than_its_samples():
    response = MODES.impulse_response(100, 20.0)
    still = MODES.poles.imag * 1j
    bound = residue_sizes(MODES.shapes.T, MODES.participation, output_scale(response)) * np.sqrt(2 * 100)
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
