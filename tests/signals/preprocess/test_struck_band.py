"""The band of hits, sweeps and bursts: what they put force into, by a spectrum that is known."""

import numpy as np
import pytest

from modalscope.data import Signals
from modalscope.identification.prepare import measure
from modalscope.io import read, write
from modalscope.signals.preprocess.bands import driven_band, struck_band, swept_band
from modalscope.signals.preprocess.merging import merge
from modalscope.systems import chain5

RATE = 64.0


def struck(width, noise=0.0):
    """Three hits of half a sine of `width` samples on a chain of five masses (modes from .09 to 1 Hz), one a run."""
    u = np.zeros((3, 6000, 1))
    u[:, 40 : 40 + width, 0] = np.sin(np.pi * (np.arange(width) + 0.5) / width)
    record = chain5().simulate(inputs=u, at=[0], sampling_rate=RATE, noise=noise)
    return Signals(outputs=record.outputs, inputs=u, sampling_rate=RATE)


@pytest.mark.parametrize("width", [8, 16, 32])
def test_a_half_sine_has_a_hundredth_of_its_power_at_the_known_frequency(width):
    """|U(f)| ~ |cos(pi f T)| / |1 - (2 f T)^2|: a tenth of its largest value at f T = 1.27."""
    T = width / RATE
    f = np.linspace(0, RATE / 2, 4096)
    with np.errstate(divide="ignore", invalid="ignore"):
        power = (np.cos(np.pi * f * T) / (1 - (2 * f * T) ** 2)) ** 2
    expected = f[np.nan_to_num(power, nan=1.0) >= 0.01 * power[0]].max()
    band, note = struck_band([struck(width)])
    assert band[0] == 0
    assert band[1] == pytest.approx(expected, rel=0.02)
    assert f"limited to {band[1]:g} Hz" in note.text
    assert f"--band {band[1]:g} {min(2 * band[1], RATE / 2):g}" in note.text


def test_the_band_of_hits_is_that_of_the_settings_and_of_the_lines():
    found = measure(struck(32), route="frf")
    assert found.band is not None
    assert found.response.frequencies[-1] <= found.band[1] < RATE / 4
    assert found.notes[0].text.startswith(f"Band limited to {found.band[1]:g} Hz")
    asked = measure(struck(32), band=(0.0, 2.0), route="frf")
    assert asked.band == (0.0, 2.0)
    assert len(asked.notes) == 1


def test_a_band_that_was_asked_is_kept_and_what_of_it_was_not_struck_is_said():
    end = struck_band([struck(32)])[0][1]
    found = measure(struck(32), band=(0.0, 10.0))
    assert found.band == (0.0, 10.0)
    assert f"less than 1 % of their power above {end:g} Hz" in found.notes[0].text
    assert f"--band {end:g} {2 * end:g}" in found.notes[0].text
    assert struck_band([struck(32)], (0.0, end)) is None
    assert struck_band([struck(32)], (end, 10.0)) is None


def test_no_band_is_chosen_where_the_force_fills_it_or_is_no_hit():
    assert struck_band([struck(1)]) is None
    rng = np.random.default_rng(0)
    noise = Signals(outputs=rng.standard_normal((500, 2)), inputs=rng.standard_normal((500, 1)), sampling_rate=1.0)
    assert struck_band([noise]) is None
    assert struck_band([struck(16), noise]) is None


def swept(first, last, dofs=None):
    """A sweep of two minutes between two frequencies, Hz, at rest before and behind, on the chain of five masses."""
    t = np.arange(0, 120, 1 / RATE)
    u = np.where((t > 4) & (t < 110), np.sin(2 * np.pi * (first + (last - first) / 2 * (t - 4) / 106) * (t - 4)), 0.0)
    record = chain5().simulate(inputs=u[:, None], at=[0], sampling_rate=RATE, noise=0.01)
    which = [0, 1, 2, 3] if dofs is None else dofs
    return Signals(
        outputs=record.outputs[:, which], inputs=record.inputs, sampling_rate=RATE, output_dofs=[str(k) for k in which]
    )


def test_the_band_of_sweeps_is_what_they_pass():
    """A linear sweep has one power between its ends, and falls off within some Fresnel widths, sqrt(rate of the sweep)."""
    (low, high), note = swept_band([swept(1.0, 12.0)])
    width = np.sqrt(11 / 106) + RATE / 200  # and the smoothing, a hundredth of the band
    assert (low, high) == (pytest.approx(1.0, abs=2 * width), pytest.approx(12.0, abs=2 * width))
    assert note.text.startswith(f"Band {low:g} to {high:g} Hz")
    assert low < 1 < 12 < high


def test_roving_sensors_under_a_sweep_are_identified_on_the_lines_that_it_drives(tmp_path):
    parts = [swept(1.0, 12.0, dofs) for dofs in ((0, 1), (2, 3))]
    low, high = driven_band(parts)[0]
    merged = merge(parts)
    assert merged.excited == (low, high)
    assert merged.frequencies[-1] > high  # all lines are there
    found = measure(merged)
    assert found.band == (low, high)
    assert found.response.frequencies[0] >= low
    assert found.response.frequencies[-1] <= high
    assert "less than 1 % of their largest power outside" in found.notes[0].text
    assert measure(merged, band=(0.0, 20.0)).band == (0.0, 20.0)
    assert measure(merged.in_band((2.0, 10.0))).band is None  # all of it is driven
    assert merge(parts, segment=parts[0].samples).excited is None
    write(tmp_path / "merged.npz", merged)
    assert read(tmp_path / "merged.npz").excited == merged.excited


def test_sweeps_that_fill_the_band_and_other_forces_choose_none():
    assert swept_band([swept(0.0, 31.0)]) is None
    assert swept_band([struck(16)]) is None
    assert swept_band([swept(1.0, 12.0), struck(16)]) is None
