"""Weather is taken out: slopes are those that were put in, with their deviations, knees, lags and errors of what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.records.years import KNEE, NOISE, SLOPES, tracked
from modalscope.analysis.monitoring import History, Tracks, explain
from modalscope.analysis.monitoring.weather import in_common, inflation
from modalscope.data import DataError
from modalscope.numerics.checks import RealArray

HOURS = np.arange(1500.0)
AIR = 6 + 9 * np.sin(2 * np.pi * HOURS / 700) + 4 * np.sin(2 * np.pi * HOURS / 24)


def tracks(f: RealArray, **covariates: RealArray) -> Tracks:
    """Return tracks of given frequencies (R, T), all seen."""
    record, mode = np.nonzero(np.isfinite(f))
    history = History(times=3600 * np.arange(len(f)), record=record, frequencies=f[record, mode], covariates=covariates)
    return Tracks(
        history=history,
        track=mode,
        mode_probability=np.ones(mode.size),
        double=np.zeros(mode.size, bool),
        levels=f,
        scatter=np.full(f.shape[1], 1e-4),
        believed=np.zeros(f.shape[1], bool),
    )


def moved(part: RealArray, count: int = 1, seed: int = 0) -> RealArray:
    return (1 + part)[:, None] * (1 + 1e-4 * np.random.default_rng(seed).standard_normal((part.size, count)))


def test_slopes_above_and_below_the_knee_are_those_of_the_structure() -> None:
    part = np.where(AIR > 0, -2e-4, -6e-4) * AIR
    found = explain(tracks(moved(part, 8), temperature=AIR))
    assert found.regressors == ("constant", "temperature", "temperature below 0")
    true = np.array([-2e-4, -4e-4]) / (1 + np.median(part))
    away = (found.coefficients[:, 1:] - true) / found.coefficients_std[:, 1:]
    assert np.sqrt(np.mean(away**2)) == pytest.approx(1, abs=0.4)
    assert np.allclose(found.residual_std, 1e-4, rtol=0.1)
    assert found.part_explained.min() > 0.98


@pytest.mark.parametrize(
    ("name", "air", "knees"), [("temperature", AIR + 9.5, 0), ("temperature", AIR, 1), ("wind", AIR, 0)]
)
def test_a_knee_needs_a_temperature_on_both_of_its_sides(name: str, air: RealArray, knees: int) -> None:
    found = explain(tracks(moved(-1e-4 * air), **{name: air}))
    assert len(found.regressors) == 2 + knees


def test_the_lag_of_heat_is_found() -> None:
    felt = np.zeros(HOURS.size)
    felt[0] = AIR[0]
    for k in range(1, HOURS.size):
        felt[k] = felt[k - 1] + (1 - np.exp(-1 / 8)) * (AIR[k] - felt[k - 1])
    found = explain(tracks(moved(-3e-4 * felt), air=AIR))
    assert "lag of 8 h" in found.notes[0]
    assert found.coefficients[0, 1] == pytest.approx(-3e-4, rel=0.01)


def test_errors_of_a_covariate_take_nothing_from_its_slope() -> None:
    """Errors of 4 degrees take 4^2 / (4^2 + 9^2 / 2) of it where records are so far apart that no lag averages them."""
    slow = 9 * np.sin(2 * np.pi * HOURS / 700)
    measured = slow + 4 * np.random.default_rng(3).standard_normal(slow.size)
    near = tracks(moved(-3e-4 * slow), air=measured)
    record = replace(near, history=replace(near.history, times=360_000 * HOURS))
    plain, right = (explain(record, deviations=given) for given in (None, {"air": 4.0}))
    assert plain.coefficients[0, 1] == pytest.approx(-3e-4 * (1 - 16 / 56.5), rel=0.1)
    assert right.coefficients[0, 1] == pytest.approx(-3e-4, rel=0.05)


def test_spoilt_records_move_nothing() -> None:
    f = moved(-2e-4 * AIR)
    f[::20] *= 1.02
    found = explain(tracks(f, air=AIR))
    assert found.coefficients[0, 1] == pytest.approx(-2e-4, abs=4 * found.coefficients_std[0, 1])
    assert found.residual_std[0] < 1.2e-4


def test_what_tracks_have_in_common_is_taken_out_where_nothing_was_measured() -> None:
    """Two components move five tracks; a mean of noise over what is left of five."""
    draw = np.random.default_rng(4)
    f = 1 + np.outer(AIR, -1e-4 * np.arange(1.0, 6)) + np.outer(np.cos(HOURS / 50), [5e-4, 0, -5e-4, 0, 5e-4])
    f = f * (1 + 1e-4 * draw.standard_normal(f.shape))
    f[::20] *= 1 + 1e-3 * draw.standard_normal((75, 5))
    f[draw.random(f.shape) < 0.05] = np.nan
    found = explain(tracks(f))
    assert "2 principal components" in found.notes[0]
    assert np.median(found.residual_std) == pytest.approx(1e-4 * np.sqrt(3 / 5), rel=0.15)


def test_what_tracks_have_in_common_goes_no_further_than_in_the_reference() -> None:
    swing = 5e-3 * np.sin(2 * np.pi * HOURS / 24)
    f = (1 + swing - 0.02 * (HOURS >= 1000))[:, None] * moved(0 * HOURS, 5)
    found = explain(tracks(f), during=HOURS < 900)
    assert np.abs(found.residual[:1000]).max() < 1e-3
    assert -0.025 < np.median(found.residual[1000:]) < -0.012
    assert found.common.shape == (1500, 1)


def test_a_simulated_year_is_explained_down_to_its_noise() -> None:
    found = explain(tracked(4000, 0, spoilt=0.05), deviations={"temperature": 0.3})
    true = np.column_stack([SLOPES, SLOPES * (KNEE - 1)])
    away = (found.coefficients[:, 1:] - true) / found.coefficients_std[:, 1:]
    assert np.sqrt(np.mean(away**2)) < 1.6
    # a disturbance of .3 and errors of the temperature of .3 degrees stay
    floor = np.sqrt(NOISE**2 * 1.09 + (0.3 * SLOPES) ** 2)
    assert (np.abs(found.residual_std / floor - 1) < 0.2).all()


def test_residuals_that_follow_each_other_count_as_fewer() -> None:
    white = np.random.default_rng(0).standard_normal(20000)
    slow = np.zeros(white.size)
    for k in range(1, white.size):
        slow[k] = 0.9 * slow[k - 1] + white[k]
    assert inflation(white) < 1.5
    assert inflation(slow) == pytest.approx((1 + 0.9) / (1 - 0.9), rel=0.4)


def test_what_cannot_be_explained_is_said() -> None:
    with pytest.raises(DataError, match="no track stands in 10 records a coefficient"):
        explain(tracks(moved(AIR[:15] * 0), air=AIR[:15]))
    with pytest.raises(DataError, match="there are none then"):
        explain(tracks(moved(AIR * 0), air=AIR), during=("2030-01-01", "2031-01-01"))
    f = np.hstack([moved(AIR * 0), moved(AIR * 0, seed=1)])
    f[19:, 1] = np.nan
    found = explain(tracks(f, air=AIR))
    assert "seen in too few records to be explained: 2: 1 Hz" in found.notes, found.notes
    assert np.isnan(found.coefficients[1]).all()


def test_a_component_goes_no_further_than_the_reference_took_it_though_every_track_stays_in_its_range() -> None:
    """Two components move every track: where all stand at their own largest at once, the first would be larger than it ever was."""
    rng = np.random.default_rng(5)
    a, b = 60 * rng.uniform(-1, 1, 300), 40 * rng.uniform(-1, 1, 300)
    z = a[:, None] + np.outer(b, np.tile([1.0, -1.0], 6)) + rng.standard_normal((300, 12))
    z = np.vstack([z, z.max(axis=0)])
    inside = np.arange(301) < 300
    found = in_common(z, np.ones(12), inside)
    first = found.design[:, 1:][:, -1]
    assert found.design.shape[1] == 3
    assert np.abs(found.common[-1]).max() > 1.3 * np.abs(first[inside]).max()
    assert np.abs(first[-1]) <= np.abs(first[inside]).max() + 3.0
