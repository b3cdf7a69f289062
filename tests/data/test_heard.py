"""Lines of noise alone do not count where it is asked how much the modes explain."""

import dataclasses

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ModalModel
from modalscope.data.rebuilt import fit_error_heard, fit_of, heard_lines, of_noise


@pytest.fixture
def modes() -> ModalModel:
    w, z = 2 * np.pi * np.array([20.0, 55.0]), np.array([0.01, 0.008])
    shapes = np.array([[1.0, 0.5], [0.6, -1.0], [0.3, 0.8]])
    return ModalModel(
        poles=-z * w + 1j * w * np.sqrt(1 - z**2),
        shapes=shapes + 0j,
        participation=-1j * shapes[:1].T,
        quantity="displacement",
    )


def measured(modes: ModalModel, seed: int, loud: float, level: float = 1e-3) -> FrequencyResponse:
    """Responses on 400 lines to 200 Hz, the upper half of which hold noise alone, `loud` times the largest response."""
    lines = 0.5 * np.arange(1, 401)
    clean = modes.frequency_response(lines).values
    sigma = np.where(lines < 100, level, loud) * np.abs(clean).max()
    rng = np.random.default_rng(seed)
    noise = (rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape)) / np.sqrt(2)
    variance = np.broadcast_to(sigma[:, None, None] ** 2, clean.shape)
    values = np.where(lines[:, None, None] < 100, clean, 0) + sigma[:, None, None] * noise
    return FrequencyResponse(values=values, frequencies=lines, quantity="displacement", variance=variance)


@pytest.mark.parametrize("seed", range(8))
def test_lines_without_force_are_left_out_and_named(modes, seed):
    response = measured(modes, seed, loud=3.0)
    heard = heard_lines(response)
    assert heard[response.frequencies < 95].mean() > 0.8
    assert not heard[response.frequencies > 105].any()
    assert fit_of(modes, response) < 0.1
    unknown = dataclasses.replace(response, variance=None)
    assert fit_of(modes, unknown) > 0.9
    (note,) = of_noise(response)
    assert note.numbers["lines"] == (~heard).sum()
    assert f"{(~heard).sum()} of 400 lines" in str(note)


def test_all_lines_count_where_noise_is_small_unknown_or_everything(modes):
    quiet = measured(modes, 0, loud=1e-3)
    drowned = measured(modes, 0, loud=3.0, level=3.0)
    for response in (quiet, dataclasses.replace(quiet, variance=None), drowned):
        assert heard_lines(response).all()
        assert not of_noise(response)


def test_the_error_is_that_of_the_lines_that_are_left(modes):
    response = measured(modes, 1, loud=3.0)
    heard, fitted = heard_lines(response), modes.frequency_response(response.frequencies).values
    left, whole = np.linalg.norm((response.values - fitted)[heard]), np.linalg.norm(response.values[heard])
    error, channels = fit_error_heard(response, fitted)
    assert error == pytest.approx(left / whole, rel=1e-12)
    assert channels.shape == (3, 1)
