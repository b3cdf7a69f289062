"""What a fit on the records' lines shows of how they were measured, and the picture that is drawn of them."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import Signals
from modalscope.data.record_residual import Excess, excess, excess_notes, pole_notes
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.systems import chain5

POLE = np.array([2j * np.pi * 10.0 - 2 * np.pi * 0.1])
LINES = np.arange(1, 4000) * 0.01


@pytest.mark.parametrize("times", [1.0, 2.0, 5.0])
def test_the_excess_is_what_is_left_near_a_mode_over_what_is_left_beside_it(times: float) -> None:
    left = np.ones((LINES.size, 2), complex)
    left[np.abs(LINES - 10) < 0.2 + 1e-9] *= times
    found = excess(LINES, np.abs(left) ** 2, 10 * np.ones_like(left), POLE, 0.01, np.ones(2))
    assert found.decibels == pytest.approx(20 * np.log10(times))
    assert found.share == pytest.approx(times / 10)


def test_it_is_told_from_six_decibels_and_a_hundredth_of_the_response_on() -> None:
    assert excess_notes(Excess(5.9, 0.5)) == ()
    assert excess_notes(Excess(20.0, 0.009)) == ()
    assert excess_notes(Excess(np.nan, np.nan)) == ()
    assert excess_notes(Excess(6.0, 0.01))[0].kind == "unmeasured forces"


def test_without_modes_or_without_lines_away_from_them_there_is_no_excess() -> None:
    left = np.ones((LINES.size, 1), complex)
    assert np.isnan(excess(LINES, np.abs(left) ** 2, left, POLE[:0], 0.01, np.ones(1)).decibels)
    assert np.isnan(excess(LINES, np.abs(left) ** 2, left, POLE, 100.0, np.ones(1)).decibels)


def test_a_drift_lies_at_zero_frequency_and_a_delay_at_zero() -> None:
    def kinds(*z: complex) -> list[str]:
        return [note.kind for note in pole_notes(np.array(z, complex), 10.0, 100.0)]

    assert kinds(0.9 + 0.2j) == []
    assert kinds(1 - 1e-4) == ["drift"]
    assert kinds(1 - 1e-2) == []
    assert kinds(0.0009) == ["delay"]
    assert kinds(0.03) == []
    assert kinds(-0.0037 + 4e-19j) == []  # one negative pole of noise, not two
    assert kinds(0.03 + 0.005j) == ["delay"]  # a pair: two samples, known to the square root
    late = pole_notes(np.array([0.03 + 0.005j]), 10.0, 100.0)[0]
    assert late.numbers["samples"] == 2


@pytest.mark.parametrize(("radius", "told"), [(0.34, True), (0.28, False)])
def test_small_poles_are_a_delay_where_the_next_ones_are_far(radius: float, told: bool) -> None:
    """Four in .1, the next four at .34: .38 are expected, and four or more have the chance 6e-4; with those at .28 .58 and 3e-3."""
    others = radius * np.exp(1j * np.linspace(0.1, 3.0, 10))
    found = pole_notes(np.array([0.1 * np.exp(0.7j), 0.1 * np.exp(2.1j), *others]), 10.0, 100.0)
    assert [note.numbers["samples"] for note in found] == ([4] if told else [])


@pytest.mark.parametrize(("other", "told"), [(0.6, True), (0.4, False)])
def test_a_small_real_pole_is_a_delay_where_the_next_one_is_far(other: float, told: bool) -> None:
    """One in 5e-4, the next one at .6: the chance is 8e-4; with that at .4 it is 1.25e-3."""
    assert [note.kind for note in pole_notes(np.array([5e-4 + 0j, -other]), 10.0, 100.0)] == (["delay"] if told else [])


def test_the_picture_of_white_records_is_near_the_response() -> None:
    model = chain5().state_space(dt=0.05)
    rng = np.random.default_rng(0)
    u = rng.standard_normal((40_000, model.B.shape[1]))
    record = Signals(outputs=model.simulate(u), inputs=u, sampling_rate=20.0)
    picture = record_spectra(Records(runs=(record,))).picture()
    exact = model.frequency_response(picture.frequencies).values
    assert picture.lines <= 4000
    # away from the sharpest peaks, which seven groups of lines round off; 35 lines with 2 inputs leave some 1/6 each
    apart = np.abs(picture.values - exact) / np.linalg.norm(exact, axis=(1, 2), keepdims=True)
    assert np.median(apart) < 1 / 6


def test_lines_are_those_of_the_whole_run_without_the_first_and_the_last() -> None:
    rng = np.random.default_rng(1)
    runs = [
        Signals(outputs=rng.standard_normal((n, 2)), inputs=rng.standard_normal((n, 1)), sampling_rate=10.0)
        for n in (20, 31)
    ]
    spectra = record_spectra(Records(runs=tuple(runs)))
    assert spectra.count == 9 + 15
    assert spectra.span == (pytest.approx(10 / 31), pytest.approx(15 * 10 / 31))
    assert np.allclose(spectra.values[9:, :, 0], np.fft.rfft(runs[1].outputs, axis=0)[1:] / np.sqrt(31))
    assert spectra.in_band((2.0, 4.0)).count == np.sum((spectra.frequencies >= 2) & (spectra.frequencies <= 4))
