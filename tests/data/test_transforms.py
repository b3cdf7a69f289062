"""From samples to lines and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, StateSpace
from tests.support import EPS, FIVE, random_systems, relative

quick = settings(max_examples=20, deadline=None)


@given(model=random_systems(direct=True), length=st.integers(8, 65))
@quick
def test_inverse_of_a_sampled_frequency_response_is_the_periodised_markov_sequence(
    model: StateSpace, length: int
) -> None:
    # on the DFT grid of M lines: sum over p of Y(k + p M) = C A^k (I - A^M)^-1 B, and sample 0 holds D + the sum of Y(p M - 1)
    response = model.frequency_response(np.fft.rfftfreq(length))
    samples = response.to_impulse_response()
    folded = np.linalg.inv(np.eye(model.order) - np.linalg.matrix_power(model.A, length)) @ model.B
    periodised = StateSpace(A=model.A, B=folded, C=model.C, dt=1.0).markov_parameters(length)
    tolerance = 1e-9 * np.abs(periodised).max()  # (I - A^M)^-1 is up to 1e3, on both routes
    np.testing.assert_allclose(samples.values, periodised[: length - 1], atol=tolerance)
    assert samples.feedthrough is not None
    np.testing.assert_allclose(samples.feedthrough, model.D + periodised[length - 1], atol=tolerance)
    assert (samples.kind, samples.sampling_rate, samples.samples) == ("pulse", 1.0, length - 1)


@given(model=random_systems(direct=True), length=st.integers(8, 65))
@quick
def test_a_sampled_response_goes_to_samples_and_back_unchanged(model: StateSpace, length: int) -> None:
    response = model.frequency_response(np.fft.rfftfreq(length))
    back = response.to_impulse_response().to_frequency_response()
    np.testing.assert_allclose(back.frequencies, response.frequencies, atol=EPS)
    assert relative(back.values, response.values) < 1e3 * EPS
    assert back.sampling_rate == 1.0


@given(model=random_systems(direct=True), length=st.integers(4, 65))
@quick
def test_samples_go_to_lines_and_back_unchanged(model: StateSpace, length: int) -> None:
    samples = model.impulse_response(length)
    back = samples.to_frequency_response().to_impulse_response()
    assert relative(back.values, samples.values) < 1e3 * EPS
    assert back.feedthrough is not None
    np.testing.assert_allclose(back.feedthrough, model.D, atol=1e-12)


def test_a_decayed_pulse_response_transforms_into_the_transfer_function_on_any_lines() -> None:
    model = FIVE["heavy4"]().state_space(dt=0.05, quantity="acceleration")
    samples = model.impulse_response(8000)  # the slowest mode is down to exp(-.0695 * .05 * 8000) = 1e-12
    f = np.array([0.0, 0.123, 4.5, 9.99])
    transformed = samples.to_frequency_response(f)
    assert relative(transformed.values, model.frequency_response(f).values) < 1e-10
    # default lines by FFT and given lines by sums are one transform
    few = model.impulse_response(50)
    grid = few.to_frequency_response()
    assert relative(few.to_frequency_response(grid.frequencies).values, grid.values) < 1e3 * EPS


def test_samples_of_a_continuous_response_transform_with_their_time_and_step() -> None:
    model = FIVE["heavy4"]().state_space()
    sampled = model.to_discrete(0.001, "dirac").impulse_response(200_000, kind="dirac")
    f = np.array([0.5, 3.0])
    # sum of dt Y(k) z^-k = integral + dt / 2 Y(0+) + O(dt^2) (Eq. 76), and a displacement starts at 0
    assert relative(sampled.to_frequency_response(f).values, model.frequency_response(f).values) < 1e-5


def test_a_continuous_response_comes_back_on_all_lines_but_the_last() -> None:
    response = FIVE["chain5"]().frequency_response(np.arange(0, 257) * 0.05)
    samples = response.to_impulse_response()
    assert (samples.kind, samples.first_sample) == ("dirac", 1)
    assert samples.sampling_rate == pytest.approx(2 * response.frequencies[-1])
    back = samples.to_frequency_response(response.frequencies)
    # the line at half the sampling rate keeps its real part only
    np.testing.assert_allclose(back.values[:-1], response.values[:-1], atol=1e-13)
    np.testing.assert_allclose(back.values[-1], response.values[-1].real, atol=1e-13)


def test_times_count_from_the_impulse() -> None:
    values = np.ones((3, 1, 1))
    pulse = ImpulseResponse(values=values, sampling_rate=10)
    late = ImpulseResponse(values=values, sampling_rate=10, kind="dirac", first_sample=4)
    np.testing.assert_allclose(pulse.times, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(late.times, [0.4, 0.5, 0.6])


def test_quantities_turn_into_each_other_and_back() -> None:
    structure, f = FIVE["close4"](), np.linspace(0.5, 8, 30)
    by_quantity = {q: structure.frequency_response(f, quantity=q) for q in ("displacement", "velocity", "acceleration")}
    for start, given_response in by_quantity.items():
        for wanted, expected in by_quantity.items():
            turned = given_response.as_quantity(wanted)
            assert relative(turned.values, expected.values) < 1e3 * EPS
            assert turned.quantity == wanted
            assert (turned.units == given_response.units) is (wanted == start)


def test_variance_turns_with_the_quantity() -> None:
    f = np.array([1.0, 2.0])
    response = FrequencyResponse(
        values=np.full((2, 1, 1), 1j), frequencies=f, quantity="displacement", variance=np.ones((2, 1, 1))
    )
    turned = response.as_quantity("acceleration")
    assert turned.variance is not None
    np.testing.assert_allclose(turned.variance[:, 0, 0], (2 * np.pi * f) ** 4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: r.at_lines(slice(0, 1)).to_impulse_response(), "needs a band of lines, but there is one line"),
        (lambda r: r.at_lines(np.array([0, 1, 3])).to_impulse_response(), "equally spaced lines on multiples"),
        (lambda r: r.as_quantity("velocity"), "quantity of the response is not known"),
        (lambda r: r.band(3, 2), "it does not increase"),
        (lambda r: r.band(0.6, 0.9), "the 10 lines lie from 0.5 to 5 Hz, none of them inside"),
    ],
)
def test_transforms_that_cannot_be_made_say_why(call, message: str) -> None:  # type: ignore[no-untyped-def]
    response = FrequencyResponse(values=np.full((10, 1, 1), 1j), frequencies=0.5 * np.arange(1, 11))
    with pytest.raises(DataError, match=message):
        call(response)


def test_a_sampled_response_on_lines_that_do_not_divide_the_rate_has_no_inverse() -> None:
    f = 0.3 * np.arange(1, 100)
    response = FIVE["chain5"]().state_space(dt=0.01).frequency_response(f)
    with pytest.raises(DataError, match=r"100 Hz is 333.333 times the line spacing of 0.3 Hz"):
        response.to_impulse_response()


def test_an_integrated_response_needs_its_first_line_above_0_hz() -> None:
    response = FrequencyResponse(values=np.full((3, 1, 1), 1j), frequencies=[0, 1, 2], quantity="velocity")  # type: ignore[arg-type]
    with pytest.raises(DataError, match="a line lies at 0 Hz"):
        response.as_quantity("displacement")
