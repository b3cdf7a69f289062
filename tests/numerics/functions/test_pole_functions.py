"""Functions of poles by their plain definition: what a residue gives on lines, on the circle and on samples."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.numerics.functions import pole_functions
from modalscope.numerics.functions.pole_functions import line_functions, sample_functions
from modalscope.numerics.functions.poles import powers_of

POLES = np.array([-0.3 + 9.0j, -2.0 + 0j, -0.8 + 21.0j])
RESIDUES = np.array([1.0 - 2.0j, 3.0 + 0j, -0.5 + 0.7j])
F = np.linspace(0.3, 4.5, 40)


@pytest.mark.parametrize("rate", [None, 20.0])
def test_residues_times_functions_are_the_partial_fractions(rate: float | None) -> None:
    x, p = 2j * np.pi * F, POLES
    x, p = (x, p) if rate is None else (np.exp(x / rate), np.exp(p / rate))
    expected = sum(
        R / (x - s) + (np.conj(R) / (x - np.conj(s)) if s.imag else 0) for R, s in zip(RESIDUES, p, strict=True)
    )
    coefficients = np.stack([RESIDUES.real, RESIDUES.imag], axis=1).ravel()
    found = line_functions(F, rate, POLES) @ coefficients
    assert found == pytest.approx(np.concatenate([expected.real, expected.imag]), rel=1e-12, abs=1e-14)


def test_a_pole_at_half_the_sampling_rate_stands_alone() -> None:
    """z = -.8: exp(j pi) is not real to the last bit, and a column of rounding would take any size in a fit."""
    s, z = np.log(np.array([-0.8 + 0j])) * 20.0, np.exp(2j * np.pi * F / 20.0)
    made = line_functions(F, 20.0, s)
    expected = 1 / (z + 0.8)
    assert made[:, 0] == pytest.approx(np.concatenate([expected.real, expected.imag]), rel=1e-12)
    assert not np.any(made[:, 1])


def test_of_samples_they_are_decaying_oscillations() -> None:
    t = (np.arange(30) + 4) / 25.0
    expected = sum((2 if s.imag else 1) * (R * np.exp(s * t)).real for R, s in zip(RESIDUES, POLES, strict=True))
    coefficients = np.stack([RESIDUES.real, RESIDUES.imag], axis=1).ravel()
    assert sample_functions(25.0, 4, 30, POLES) @ coefficients == pytest.approx(expected, rel=1e-12)


def test_slopes_stand_behind_the_functions() -> None:
    for made in (line_functions(F, None, POLES, slopes=True), sample_functions(25.0, 0, 30, POLES, slopes=True)):
        assert made.shape[1] == 4 * len(POLES)
    assert np.array_equal(line_functions(F, None, POLES, slopes=True)[:, :6], line_functions(F, None, POLES))
    assert line_functions(F, None, POLES[:0], slopes=True).shape == (80, 0)
    assert sample_functions(25.0, 0, 30, POLES[:0]).shape == (30, 0)


@pytest.mark.parametrize("rate", [None, 20.0])
def test_functions_of_some_poles_at_a_time_are_those_of_all(
    rate: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = line_functions(F, rate, POLES, slopes=True)
    monkeypatch.setattr(pole_functions, "_NUMBERS_AT_A_TIME", 2 * F.size)
    np.testing.assert_array_equal(line_functions(F, rate, POLES, slopes=True), whole)


def test_a_pole_that_grows_beyond_all_numbers_has_functions_that_are_numbers() -> None:
    found = sample_functions(10.0, 0, 4000, np.array([5 + 3j, 1e5 + 0j, -0.1 + 4j]), slopes=True)
    assert np.all(np.isfinite(found))
    assert np.all(np.isfinite(found.T @ found))
    alone = sample_functions(10.0, 0, 4000, np.array([-0.1 + 4j]), slopes=True)
    np.testing.assert_array_equal(found[:, [4, 5, 10, 11]], alone)


def test_what_has_faded_is_zero_and_not_a_number_below_the_smallest_normal_one() -> None:
    # with such numbers processors reckon up to a hundred times slower; their squares are none
    slow, swift = -2 + 30j, -80 + 30j
    found = sample_functions(10.0, 2, 400, np.array([slow, swift, -1e5 + 30j]), slopes=True)
    t = (np.arange(400) + 2) / 10
    for k, s in ((0, slow), (2, swift)):
        expected = 2 * np.exp(s * t)
        kept = np.abs(expected) > 1e-140
        assert np.all(np.abs(found[kept, k] - expected.real[kept]) <= 1e-12 * np.abs(expected[kept]))
        assert not np.any(found[np.abs(expected) < 1e-155, k])
    assert np.all(found[:, 0] != 0)
    assert not np.any((found != 0) & (np.abs(found) < 1e-170))
    assert powers_of([0.5, 0.0], 4, rows=True).tolist() == powers_of([0.5, 0.0], 4).T.tolist()
