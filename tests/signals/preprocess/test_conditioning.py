"""Conditioning: closed forms of sinusoids, what filters leave alone, and that the caller's record is untouched."""

import numpy as np
import pytest

from modalscope.data import DataError, Signals
from modalscope.signals.preprocess import decimate, detrend, differentiate, estimate_frf, filter_band, integrate
from modalscope.systems import chain5

RATE = 100.0
TIME = np.arange(4000) / RATE


def sines(*frequencies, quantity=None):
    y = np.stack([np.sin(2 * np.pi * f * TIME + 0.3) for f in frequencies], axis=1)
    return Signals(outputs=y, sampling_rate=RATE, quantities=quantity)


def amplitude(y, f, rate):
    """Least squares of a sinusoid of known frequency on the middle half."""
    k = np.arange(y.size)[y.size // 4 : -y.size // 4]
    basis = np.exp(2j * np.pi * f * k / rate)
    both = np.stack([basis.real, basis.imag], axis=1)
    return np.hypot(*np.linalg.lstsq(both, y[k], rcond=None)[0])


def test_detrend_removes_what_it_says_run_by_run():
    t = np.arange(50.0)[:, None]
    record = Signals(outputs=np.stack([3 + 2 * t, 1 - t]), inputs=np.stack([t, 5 + 0 * t]), sampling_rate=1.0)
    flat = detrend(record)
    assert np.abs(flat.outputs).max() < 1e-12  # rounding of values up to 100
    assert np.abs(flat.inputs).max() < 1e-12
    centred = detrend(record, kind="constant")
    assert np.allclose(centred.outputs[0], 2 * (t - t.mean()))
    assert record.outputs[0, 0, 0] == 3
    assert "trend" in flat.processing[-1]


@pytest.mark.parametrize("zero_phase", [False, True])
def test_a_band_keeps_what_is_inside_and_removes_what_is_outside(zero_phase):
    record = sines(0.1, 2.0, 20.0)
    cut = filter_band(record, 1.0, 4.0, zero_phase=zero_phase)
    rate = cut.sampling_rate
    assert rate == RATE / 10  # 2.5 samples a period of 4 Hz
    # Butterworth of order 4 at 0.8 Hz: (2 / .8)^8 = 1500, so 3e-4 below one; twice 0.05 dB of ripple are 1.2 %
    assert amplitude(cut.outputs[:, 1], 2.0, rate) == pytest.approx(1, abs=0.013)
    assert np.abs(cut.outputs[100:-100, 0]).max() < 4e-4  # (0.1 / 0.8)^4 = 2.4e-4
    assert np.abs(cut.outputs[100:-100, 2]).max() < 1e-5  # order 8, five times the edge: T_8 = 4e7 * 0.1
    assert "1-4 Hz" in cut.processing[-1]


def test_filters_start_as_if_the_first_sample_had_always_been_there():
    record = Signals(outputs=np.full((300, 2), 7.0), inputs=np.full((300, 1), -2.0), sampling_rate=10.0)
    cut = filter_band(record, 0, 1.0, decimate=False)
    assert np.allclose(cut.outputs, 7 * 10 ** (-0.05 / 20), atol=1e-9)  # even order: the ripple's lower end at 0 Hz
    high = filter_band(record, 0.5, 1.0)
    assert np.abs(high.inputs).max() < 1e-9


def test_filtering_both_sides_leaves_the_frequency_response_alone():
    record = chain5().simulate(samples=40000, sampling_rate=20.0)
    whole = estimate_frf(record, segment=4000).band(1.0, 3.0)
    cut = estimate_frf(filter_band(record, 0.8, 3.2), segment=2000).band(1.0, 3.0)
    assert np.allclose(cut.frequencies, whole.frequencies)
    # the estimates differ by leakage and by what folds back, 37 dB down or more
    assert np.linalg.norm(cut.values - whole.values) < 0.03 * np.linalg.norm(whole.values)


def test_decimation_keeps_low_frequencies_and_leaves_no_aliases():
    few = decimate(sines(1.0, 18.0), 5)
    assert few.sampling_rate == 20.0
    assert amplitude(few.outputs[:, 0], 1.0, 20.0) == pytest.approx(1, abs=0.007)  # 0.05 dB
    assert np.abs(few.outputs[100:, 1]).max() < 1e-4  # 18 Hz over the edge of 8 Hz
    assert decimate(few, 1) is few


def test_derivative_and_integral_of_sinusoids():
    w = 2 * np.pi * 2.0
    displacement = Signals(outputs=np.sin(w * TIME)[:, None], sampling_rate=RATE, quantities="displacement")
    velocity = differentiate(displacement)
    acceleration = differentiate(displacement, times=2)
    assert velocity.quantity == "velocity"
    assert acceleration.quantity == "acceleration"
    inner = slice(200, -200)
    # the mirrored record has kinks in its second derivative: errors die away from the ends
    assert np.allclose(velocity.outputs[inner, 0], w * np.cos(w * TIME[inner]), atol=2e-3 * w)
    assert np.allclose(acceleration.outputs[inner, 0], -(w**2) * np.sin(w * TIME[inner]), atol=5e-3 * w**2)
    back = integrate(acceleration, times=2, lowest=1.0)
    assert back.quantity == "displacement"
    # the record is cut at its ends as it stands: what that spreads over the lines near 1 Hz stays
    assert np.allclose(back.outputs[inner, 0], np.sin(w * TIME[inner]), atol=0.02)


def test_units_and_inputs_of_a_derivative():
    record = Signals(
        outputs=np.sin(TIME)[:, None],
        inputs=np.cos(TIME)[:, None],
        sampling_rate=RATE,
        units=("m", "N"),
        quantities="displacement",
    )
    changed = differentiate(record)
    assert changed.units == (("",), ("N",))
    assert np.array_equal(changed.inputs, record.inputs)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda s: filter_band(s, 4, 1), "the band 4 to 1 Hz"),
        (lambda s: filter_band(s, 1, 60), "contains 0 to 50 Hz"),
        (lambda s: decimate(s, 0), "factor needs a whole number"),
        (lambda s: decimate(s, 3000), "one sample in 3000"),
        (lambda s: detrend(s, kind="liner"), "Did you mean 'linear'"),
        (differentiate, "the quantity of output y1 is acceleration"),
        (lambda s: integrate(s, times=3), "integrated 3 times"),
        (lambda s: integrate(s, lowest=-1), "lowest needs a positive number"),
    ],
)
def test_what_cannot_be_done_is_said(call, text):
    with pytest.raises(DataError, match=text):
        call(sines(1.0, quantity="acceleration"))
