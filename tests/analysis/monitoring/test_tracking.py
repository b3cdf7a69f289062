"""Tracks: each mode in its own through crossings, gaps, doubles and bad days; what is in doubt is said."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.records.years import judged, year
from modalscope.analysis.monitoring import History, read_history, track
from modalscope.data import DataError
from modalscope.numerics.checks import RealArray
from tests.support import DATA

HOUR = 3600.0
ORTHOGONAL = np.linalg.qr(np.random.default_rng(5).standard_normal((6, 6)))[0]


def history(f: RealArray, **more: object) -> History:
    """Return records of some modes each, hour by hour; NaN where a mode was not found."""
    record, mode = np.nonzero(np.isfinite(f))
    shapes = ORTHOGONAL[: f.shape[1]][mode] + 0.01 * np.random.default_rng(1).standard_normal((mode.size, 6))
    given = {"shapes": shapes, "damping_ratios": np.full(mode.size, 0.01)} | more
    return History(times=HOUR * np.arange(len(f)), record=record, frequencies=f[record, mode], **given)  # type: ignore[arg-type]


def scattered(middle: list[float], records: int = 80, deviation: float = 1e-3, seed: int = 0) -> RealArray:
    draw = np.random.default_rng(seed)
    return np.array(middle) * (1 + deviation * draw.standard_normal((records, len(middle))))


def test_modes_that_cross_keep_their_tracks_by_their_shapes() -> None:
    f = scattered([1.0, 1.0]) * (1 + 0.01 * np.linspace(-1, 1, 80)[:, None] * [1, -1])
    found = track(history(f))
    assert len(found) == 2
    first = int(found.track[0])
    assert np.array_equal(found.frequencies[:, [first, 1 - first]], f)


def test_modes_of_one_shape_keep_their_tracks_by_their_frequencies_and_say_where_they_cannot() -> None:
    """One channel: where the two are as near as they scatter, either may be either."""
    distance = np.abs(np.linspace(-1, 1, 101))[:, None] * [1, -1] * 0.02
    f = scattered([1.0, 1.0], 101) * (1 + distance)
    found = track(history(f, shapes=None))
    assert len(found) == 2
    chances = found.probability
    assert np.nanmin(chances[:30]) > 0.99
    assert np.nanmin(chances[48:53]) < 0.9
    assert max(int(row[-1]) for row in found.rows()[1:]) > 0


def test_a_mode_that_is_lost_for_days_goes_on_and_one_that_ends_is_said_to() -> None:
    f = scattered([1.0, 2.0, 3.0], 200)
    f[50:120, 1], f[120:, 2] = np.nan, np.nan
    found = track(history(f))
    assert np.array_equal(found.frequencies, f, equal_nan=True)
    assert [row[5] for row in found.rows()[1:]] == ["1970-01-09 07:00", "1970-01-09 07:00", "1970-01-05 23:00"]


@pytest.mark.slow
def test_stated_deviations_are_believed_until_the_scatter_contradicts_them() -> None:
    f = scattered([1.0, 2.0], 250)
    for factor, believed in ((1.2, True), (0.85, True), (2.0, False), (0.5, False)):
        found = track(history(f, frequencies_std=factor * 1e-3 * f.ravel()))
        assert found.believed.tolist() == [believed] * 2
        assert np.allclose(found.frequencies_std, (factor if believed else 1) * 1e-3 * np.array([1.0, 2.0]), rtol=0.15)
        assert any("times the scatter" in note for note in found.notes) is not believed


def test_a_mode_that_stands_twice_is_told_and_left_out() -> None:
    f = np.hstack([scattered([1.0, 2.0]), np.full((80, 1), np.nan)])
    f[10:20, 2] = f[10:20, 0] * 1.0005
    mode = np.nonzero(np.isfinite(f))[1]
    found = track(history(f, shapes=ORTHOGONAL[[0, 1, 0]][mode]))
    assert len(found) == 2
    assert np.count_nonzero(found.double) == 10
    assert (found.track[mode == 2] == 0).all()
    assert sum(int(row[6]) for row in found.rows()[1:]) == 10


def test_close_modes_of_other_shapes_are_no_doubles() -> None:
    f = scattered([1.0, 1.0005, 2.0])
    found = track(history(f))
    assert (len(found), np.count_nonzero(found.double)) == (3, 0)


def test_modes_of_no_track_stay_alone() -> None:
    draw = np.random.default_rng(2)
    f = np.hstack(
        [scattered([1.0, 2.0], 150), np.where(draw.random((150, 1)) < 0.3, draw.uniform(0.5, 4, (150, 1)), np.nan)]
    )
    mode = np.nonzero(np.isfinite(f))[1]
    shapes = np.where((mode == 2)[:, None], draw.standard_normal((mode.size, 6)), ORTHOGONAL[mode])
    found = track(history(f, shapes=shapes))
    assert len(found) == 2
    assert (found.track[mode == 2] < 0).mean() > 0.95
    assert (found.track[mode < 2] >= 0).all()


def test_tracks_go_on_with_the_channels_that_are_left() -> None:
    f = scattered([1.0, 1.0]) * (1 + 0.01 * np.linspace(-1, 1, 80)[:, None] * [1, -1])
    whole = history(f)
    shapes = np.array(whole.shapes)
    shapes[whole.record >= 30, 2] = np.nan
    found = track(history(f, shapes=shapes))
    first = int(found.track[0])
    assert np.array_equal(found.frequencies[:, [first, 1 - first]], f)


def test_a_jump_of_all_frequencies_is_followed() -> None:
    f = scattered([1.0, 2.0], 200) * np.where(np.arange(200) < 100, 1, 0.98)[:, None]
    found = track(history(f))
    assert np.array_equal(found.frequencies, f)
    assert np.allclose(found.levels[[60, 140]] / [1.0, 2.0], [[1, 1], [0.98, 0.98]], atol=1e-3)


def test_too_few_records_are_refused() -> None:
    with pytest.raises(DataError, match="there are 1 records with 2 modes"):
        track(history(scattered([1.0, 2.0], 1)))


@pytest.mark.slow
def test_a_simulated_month_with_spoilt_records_stays_in_its_tracks() -> None:
    """Of eight ways, one of which is a clock that is 1 % wrong; two of a pair are exchanged where swapped sensors make it look so."""
    drawn = year(500, seed=3)
    right, modes, swaps, more = judged(drawn, track(drawn.history).track)
    assert right >= 0.99
    assert modes >= 0.998
    assert (swaps <= 4, more) == (True, 0)


def test_tables_have_a_row_a_track_and_a_column_a_track() -> None:
    pytest.importorskip("pandas")
    found = track(history(scattered([1.0, 2.0])))
    assert found.table().splitlines()[1].split()[0] == "1"
    assert list(found.to_pandas().columns) == ["1: 1 Hz", "2: 2 Hz"]
    assert len(found) == 2


@pytest.mark.study("monitoring")
def test_tracks_of_simulated_years(study) -> None:  # type: ignore[no-untyped-def]
    """A mode whose shape is nearer to that of the other of its pair, at one frequency, is the other by all that was measured."""
    rows = [judged(drawn := year(seed=seed), track(drawn.history).track) for seed in range(1, 4)]
    table = study("simulated years, 8760 records of 8 modes, two pairs that cross, 5 % spoilt", "3 years, seeds 1 to 3")
    right, modes, swaps, more = zip(*rows, strict=True)
    table.row("records with all tracks right", 100 * np.array(right), least=99.0, form=".2f", unit=" %")
    table.row("modes in the right track", 100 * np.array(modes), least=99.9, form=".3f", unit=" %")
    table.row("modes in the track of another", swaps)
    table.row("tracks beside those of the modes", more, most=0)


MAST = DATA / "mast_months" / "modal_accel.nc"


@pytest.mark.slow
@pytest.mark.skipif(not MAST.exists(), reason="needs ../shared/data/mast_months")
def test_the_strong_resonances_of_a_mast_are_one_track_each() -> None:
    """The pairs near .35 and .62 Hz turn with the wind, and stand two and three times in a record."""
    pytest.importorskip("h5py")
    found = track(read_history(MAST))
    seen = np.isfinite(found.frequencies).mean(axis=0)
    middle = np.nanmedian(found.frequencies[:, seen >= 0.3], axis=0)
    assert np.allclose(middle[:4], [0.352, 0.3545, 0.6202, 0.6255], atol=0.0007)
    for place, count in ((0.345, 0), (0.62, 1), (1.31, 1), (2.045, 1)):
        assert (
            np.count_nonzero(np.abs(np.nanmedian(found.frequencies[:, seen >= 0.2], axis=0) / place - 1) < 0.005)
            == count
        )
    assert np.isfinite(found.frequencies[:, found.scatter < 0.0015]).mean(axis=0).max() > 0.75
    assert sum("times the scatter" in note for note in found.notes) >= 6


@pytest.mark.parametrize(
    ("part", "mac", "absent"),
    [
        *(pytest.param(part, 1.0, 0, marks=pytest.mark.slow) for part in (0.05, 0.12)),
        *((0.4, 1.0, 0), (0.05, 0.6, 0), (0.05, 1.0, 60)),
    ],
)
def test_a_mode_that_jumps_keeps_its_track(part: float, mac: float, absent: int) -> None:
    """However far, and with a shape that is nearer to what it was than to a right angle."""
    f = scattered([1.0, 2.0], 240)
    f[150:, 0] *= 1 - part
    f[150 : 150 + absent, 0] = np.nan
    record, mode = np.nonzero(np.isfinite(f))
    shapes = ORTHOGONAL[mode]
    after = (record >= 150) & (mode == 0)
    shapes[after] = np.sqrt(mac) * ORTHOGONAL[0] + np.sqrt(1 - mac) * ORTHOGONAL[4]
    noise = 0.01 * np.random.default_rng(1).standard_normal(shapes.shape)
    found = track(history(f, shapes=shapes + noise))
    assert len(found) == 2
    assert np.array_equal(found.frequencies, f, equal_nan=True)


def test_a_mode_that_jumps_twice_keeps_its_first_track() -> None:
    f = scattered([1.0, 2.0], 240)
    f[80:, 0] *= 0.95
    f[160:, 0] *= 0.95
    assert np.array_equal(track(history(f)).frequencies, f)
