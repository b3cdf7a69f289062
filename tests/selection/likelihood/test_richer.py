"""The noise that a rich model leaves: its level channel by channel, whether it is white, and line by line where it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.matched import amplitudes, strongest_peaks
from modalscope.selection.likelihood.reference_model import _few, by_line, floor_of
from modalscope.selection.likelihood.whitening import gain_factor_in_correlated_noise

F = np.linspace(2, 40, 2000)
POLES = poles_from(np.array([8.0, 15.0, 29.0]), np.array([0.01, 0.02, 0.005]))
OUTPUTS, INPUTS = np.array([1.0, 3.0, 0.2]), np.array([1.0, 0.5])
SIGMA = 1e-3 * np.outer(OUTPUTS, INPUTS)


def clean() -> RealArray:
    rng = np.random.default_rng(0)
    x = 2j * np.pi * F
    R = rng.standard_normal((3, 3, 2))
    return sum(R[j] * (1 / (x - s) + 1 / (x - s.conj()))[:, None, None] for j, s in enumerate(POLES)) * np.ones(
        (1, 3, 2)
    )


def noise(seed: int = 1, correlation: float = 0.0) -> np.ndarray:
    """Noise of unit deviation a real row, neighbours correlated as in an autoregression."""
    e = np.random.default_rng(seed).standard_normal((2, F.size, 3, 2))
    for k in range(1, F.size):
        e[:, k] = correlation * e[:, k - 1] + np.sqrt(1 - correlation**2) * e[:, k]
    return np.asarray(e[0] + 1j * e[1])


def response(level: RealArray | float = 1.0, correlation: float = 0.0) -> FrequencyResponse:
    values = clean() + SIGMA * noise(correlation=correlation) * np.reshape(level, (-1, 1, 1))
    return FrequencyResponse(values=values, frequencies=F)


def test_the_floor_is_the_noise_of_every_channel() -> None:
    floor = floor_of(response(), POLES)
    told = np.outer(floor.levels.outputs, floor.levels.inputs) * np.sqrt(floor.variance)
    # a deviation from 4000 rows is known to 1.1 %; six channels share five levels
    assert np.allclose(told, SIGMA, rtol=0.04)
    assert not floor.colour.coloured
    assert floor.left.shape == (4000, 3, 2)


def test_columns_of_the_model_are_counted() -> None:
    few = FrequencyResponse(values=SIGMA * noise(), frequencies=F).band(2, 3.5)
    many = poles_from(np.linspace(2, 3.5, 60), np.full(60, 0.01))  # of 158 rows they may take half
    floor = floor_of(few, many)
    told = np.outer(floor.levels.outputs, floor.levels.inputs) * np.sqrt(floor.variance)
    assert np.mean(np.log(told / SIGMA)) == pytest.approx(0, abs=0.1)


def test_of_too_many_poles_the_least_damped_take_part() -> None:
    few = response().band(14, 16)
    wide = poles_from(np.linspace(14, 16, 100), np.full(100, 0.5))
    assert floor_of(few, np.append(wide, POLES)).variance == pytest.approx(floor_of(few, POLES).variance, rel=0.5)
    kept = _few(few, np.append(wide, POLES))
    assert kept.size < wide.size
    assert np.isin(POLES, kept).all()


def test_a_variance_that_is_known_levels_the_data() -> None:
    known = replace(response(), variance=np.broadcast_to(2 * (7 * SIGMA) ** 2, response().values.shape).copy())
    assert floor_of(known, POLES).variance == pytest.approx(1 / 49, rel=0.05)


def test_noise_that_is_correlated_along_lines_and_a_mode_that_is_missing_are_coloured() -> None:
    assert floor_of(response(correlation=0.3), POLES).colour.coloured
    assert floor_of(response(), POLES[:2]).colour.coloured


def test_the_level_of_samples_tells_nothing_of_colour_and_their_correlation_does() -> None:
    rng = np.random.default_rng(2)
    e = rng.standard_normal((1000, 2, 2)) * np.linspace(0.2, 2, 1000)[:, None, None]
    uneven = ImpulseResponse(values=e, sampling_rate=100.0)
    assert not floor_of(uneven, POLES).colour.coloured
    smooth = ImpulseResponse(values=e[1:] + e[:-1], sampling_rate=100.0)
    assert floor_of(smooth, POLES).colour.coloured


def test_line_by_line_the_deviation_follows_the_level() -> None:
    level = np.where(F < 20, 1.0, 5.0)
    floor = by_line(floor_of(response(level), POLES), F.size)
    low, high = (np.median(floor.rows[: F.size][part]) for part in (F < 18, F > 22))
    assert high / low == pytest.approx(5, rel=0.1)
    assert np.array_equal(floor.rows[: F.size], floor.rows[F.size :])
    told = floor.rows[:, None, None] * np.outer(floor.levels.outputs, floor.levels.inputs) * np.sqrt(floor.variance)
    assert np.median(told[: F.size][F < 18] / SIGMA) == pytest.approx(1, abs=0.1)


def test_correlated_lines_count_for_less_by_one_plus_over_one_minus_their_correlation() -> None:
    plain, long = (by_line(floor_of(response(correlation=rho), POLES), F.size) for rho in (0.0, 0.6))
    # the rows' deviation holds sqrt tau, the variance does not: 1.6 / 0.4 = 4
    ratio = np.median(long.rows / plain.rows)
    assert ratio == pytest.approx(2, rel=0.15)
    assert long.variance == pytest.approx(plain.variance, rel=0.1)


def test_a_correlation_near_one_lengthens_the_noise_by_no_more_than_a_hundred() -> None:
    floor = by_line(floor_of(response(correlation=0.999), POLES[:0]), F.size)
    level = np.sqrt(99)
    assert np.max(floor.rows) <= level * 10
    assert np.median(floor.rows) > 3


# ------------------------------------------------------------------------------------------------------------ matched filters


@pytest.mark.parametrize("j", range(3))
def test_the_amplitude_of_a_mode_alone_is_its_residue_times_the_size_of_its_function(j: int) -> None:
    R = np.outer([1, 2j, -1], [1, 0.5 - 0.3j])
    x = 2j * np.pi * F[:, None, None]
    H = R / (x - POLES[j]) + R.conj() / (x - POLES[j].conj())
    data = FrequencyResponse(values=H, frequencies=F)
    light = data.select(outputs=[0], inputs=[0])
    basis = data.basis(POLES[[j]], ())
    rows = np.ones(len(basis.data))
    A = amplitudes(light, basis.data, rows, POLES[[j]])[0]
    # A is R times |g| but for the overlap with the mirror image, a part zeta of it, and the lines cut off
    size = np.sqrt(np.sum(basis.functions**2) / 2)
    assert np.allclose(A, R * size, atol=0.03 * np.max(np.abs(R)) * size)
    assert np.linalg.norm(A, 2) ** 2 == pytest.approx(np.sum(basis.data**2), rel=0.05)


def test_peaks_are_found_from_the_strongest_on_and_stay_apart() -> None:
    data = response()
    rows = np.ones(2 * F.size)
    left = data.basis(POLES[:0], ()).data / SIGMA
    light = data.select(outputs=[0], inputs=[0])
    found = strongest_peaks(light, left, rows, np.zeros(0, complex), 200.0, most=3)
    assert len(found) == 3
    nearest = [int(np.argmin(np.abs(POLES.imag - peak.pole.imag))) for peak in found]
    assert sorted(nearest) == [0, 1, 2]
    for k, peak in enumerate(found):
        assert abs(POLES[nearest[k]].imag - peak.pole.imag) < -POLES[nearest[k]].real
        assert np.linalg.norm(peak.shape) == pytest.approx(1)
    # what is known already is not taken again
    again = strongest_peaks(light, left, rows, np.array([found[0].pole]), 200.0, most=1)
    assert abs(again[0].pole - found[0].pole) > 0.5 * -found[0].pole.real


def test_error_that_is_a_part_of_the_response_follows_its_peaks() -> None:
    # one per cent of the response beside even noise: the deviation of a line is the root of both squares, also within a peak of few lines
    size = np.sqrt(np.mean(np.abs(clean() / SIGMA) ** 2, axis=(1, 2)))
    level = np.sqrt(1 + (0.03 * size) ** 2)
    floor = by_line(floor_of(response(level), POLES), F.size)
    ratio = floor.rows[: F.size] / level
    assert (
        np.std(np.log(ratio)) < 0.15
    )  # of 41 lines in 12 rows a level is known to 3 %, of a peak's top the fit takes part away


def test_of_a_peak_of_one_line_the_level_is_that_of_the_line() -> None:
    # squares that are .3 + .02 of the response's, exactly, and no neighbours that agree: the level is known without any smoothing
    data = np.ones(400)
    data[[100, 250, 251]] = [9.0, 5.0, 30.0]
    level = np.sqrt(0.3 + 0.02 * data**2)
    left = level * (-1.0) ** np.arange(data.size)
    told = by_line(
        replace(floor_of(response(), POLES), rows=np.ones(400), left=left[:, None, None], data=data[:, None, None]), 400
    )
    assert np.allclose(told.rows / told.rows[0], level / level[0], rtol=0.03)


@pytest.mark.parametrize("half", [0.5, 3.0, 60.0])
def test_a_resonance_stands_out_of_correlated_noise_as_repeated_noise_says(half: float) -> None:
    rho, count = 0.8, 1601
    lines = np.arange(count) - count // 2
    g = 1 / (half + 1j * lines)
    C = rho ** np.abs(np.subtract.outer(lines, lines))
    variance = (g.conj() @ C @ g).real / np.sum(np.abs(g) ** 2)
    told = (1 + rho) / (1 - rho) / gain_factor_in_correlated_noise(np.array([rho]), np.array([half]))[0]
    # the sum over lines stands for the integral where a resonance spans some: half a line is not resolved
    assert told == pytest.approx(variance, rel=0.35 if half < 1 else 0.03)


def faded(rate: float, seed: int = 3, declared: float = 0.0) -> ImpulseResponse:
    t = np.arange(600) / 100
    rng = np.random.default_rng(seed)
    clean = sum(np.exp(s * t).real[:, None, None] * rng.standard_normal((3, 2)) for s in POLES)
    e = 0.01 * rng.standard_normal((600, 3, 2))
    values = (clean + e) * np.exp(-rate * t)[:, None, None]
    return ImpulseResponse(values=values, sampling_rate=100.0, added_damping=declared, kind="dirac")


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_noise_that_fades_under_a_window_is_seen_to_whether_the_window_is_told_or_not(rate: float) -> None:
    for declared in (0.0, rate):
        rows = floor_of(faded(rate, declared=declared), POLES - rate).rows
        told = -np.polyfit(np.arange(600) / 100, np.log(rows), 1)[0]
        # 3600 numbers over six seconds know the rate to .007
        assert told == pytest.approx(rate, abs=0.03)


def test_noise_that_does_not_fade_is_even_whatever_window_is_told() -> None:
    for seed in range(3):
        assert np.all(floor_of(faded(0.0, seed), POLES).rows == 1)
        assert np.all(floor_of(faded(0.0, seed, declared=1.0), POLES).rows == 1)
