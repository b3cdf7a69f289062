"""Poles beside a band that tell the out-of-band poles of modes outside it: where they lie, what they tell, and what they do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.numerics.checks import ComplexArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.likelihood.settling import out_of_band_poles

F = np.linspace(10, 20, 1001)
EMPTY = FrequencyResponse(values=np.zeros((F.size, 1, 1)), frequencies=F)


def left_of(mode: complex, beside: ComplexArray) -> float:
    """Return the part of a mode that poles with free residues, and the residual terms, leave on the lines."""
    basis = EMPTY.basis(np.append(beside, mode), EMPTY.outside_powers)
    columns = np.hstack([basis.terms, basis.by_pole[:, :-1].reshape(len(basis.terms), -1)])
    Q = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    own = basis.by_pole[:, -1]
    return float(np.linalg.norm(own - Q @ (Q.T @ own)) / np.linalg.norm(own))


def test_poles_lie_at_halved_distances_off_both_ends_and_eight_lines_off_at_the_nearest() -> None:
    found = out_of_band_poles(EMPTY) / (2 * np.pi)
    # 10 Hz, 5 Hz, ... .156 Hz; the next would be less than .08 Hz off
    away = 10 / 2.0 ** np.arange(7)
    assert np.allclose(np.sort(np.abs(found[found.imag < 15] - 10j)), np.sort(away))
    assert np.allclose(np.sort(np.abs(found[found.imag > 15] - 20j)), np.sort(away))
    assert np.allclose(found.real, -np.where(found.imag < 15, 10 - found.imag, found.imag - 20))


@pytest.mark.parametrize("frequency", [5.0, 9.0, 9.8, 20.2, 23.0, 60.0])
def test_skirts_of_modes_outside_are_told_where_residual_terms_alone_leave_most_of_them(frequency: float) -> None:
    mode = complex(poles_from(frequency, 0.005))
    assert left_of(mode, out_of_band_poles(EMPTY)) < 1e-3
    assert left_of(mode, out_of_band_poles(EMPTY)[:0]) > 0.15


def test_modes_inside_are_not_told() -> None:
    for frequency in (11.0, 15.0, 19.0):
        assert left_of(complex(poles_from(frequency, 0.003)), out_of_band_poles(EMPTY)) > 0.7


def test_no_pole_lies_below_zero_or_above_half_the_sampling_rate() -> None:
    wide = FrequencyResponse(values=np.zeros((500, 1, 1)), frequencies=np.linspace(1, 20, 500), sampling_rate=44.0)
    f = out_of_band_poles(wide).imag / (2 * np.pi)
    assert f.min() > 0
    assert 20 < f.max() < 22


def test_poles_are_those_of_a_structure_whose_data_decay_faster() -> None:
    assert np.allclose(out_of_band_poles(replace(EMPTY, added_damping=3.0)), out_of_band_poles(EMPTY) + 3.0)


def test_samples_and_few_lines_have_none() -> None:
    assert out_of_band_poles(ImpulseResponse(values=np.zeros((100, 1, 1)), sampling_rate=50.0)).size == 0
    assert out_of_band_poles(EMPTY.at_lines(slice(0, 15))).size == 0
    assert out_of_band_poles(EMPTY.at_lines(slice(0, 17))).size > 0
