"""Shapes from the lines of a record: overlaid ones are estimated, all others stay as they are."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.data import ModalModel, Signals
from modalscope.functions.poles import poles_from
from modalscope.likelihood.line_shapes import line_shapes
from modalscope.modal.indicators import mac
from tests.judging.dominated import hidden_modes

F, ZETA = np.array([1.0, 1.5]), np.array([0.01, 0.01])
SHAPES = np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 0.5]])


def pair(ratio: float) -> Signals:
    rng = np.random.default_rng(5)
    # the error of the weak shape along the strong one is sqrt(S_strong / (S_weak n)): a third at 1 : .05 with 42 lines
    return hidden_modes(rng, F, ZETA, SHAPES, np.array([1.0, ratio]), 20.0).record


def started(bad: float) -> ModalModel:
    shapes = SHAPES.astype(complex)
    shapes[:, 1] += bad * shapes[:, 0]
    return ModalModel(poles=poles_from(F, ZETA), shapes=shapes)


def test_a_shape_that_a_stronger_mode_spoilt_is_found_again() -> None:
    modes = started(2.0)
    before = mac(modes.shapes[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0]
    found = line_shapes(pair(0.05), modes)
    assert before < 0.5
    assert mac(found[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0] > 0.85
    assert np.array_equal(found[:, 0], modes.shapes[:, 0])  # nothing overlays the strong one


def test_shapes_of_modes_that_stand_apart_stay_to_the_last_bit() -> None:
    modes = started(0.1)
    assert np.array_equal(line_shapes(pair(1.0), modes), modes.shapes)


@pytest.mark.parametrize(("part", "stays"), [(0.1, True), (0.4, False)])
def test_a_fifth_of_its_own_power_overlays_a_mode(part: float, stays: bool) -> None:
    """Its power is known by some twenty lines, to a quarter: both sides of the limit are twice as far."""
    r, z = F[1] / F[0], ZETA[0]
    skirt = (2 * z * r**2) ** 2 / ((1 - r**2) ** 2 + (2 * z * r) ** 2)
    # RMS^2 is the power at the peak times its width, f zeta
    ratio = np.sqrt(skirt / part * F[1] / F[0] * np.sum(SHAPES[:, 0] ** 2) / np.sum(SHAPES[:, 1] ** 2))
    modes = started(0.2)
    assert np.array_equal(line_shapes(pair(float(ratio)), modes)[:, 1], modes.shapes[:, 1]) == stays


def test_units_of_channels_do_not_matter() -> None:
    record, units = pair(0.02), np.array([1.0, 1e3, 1e-3])
    modes = started(2.0)
    scaled = ModalModel(poles=modes.poles, shapes=modes.shapes * units[:, None])
    one = line_shapes(record, modes)
    two = line_shapes(Signals(outputs=record.outputs * units, sampling_rate=20.0), scaled)
    assert mac(two / units[:, None], one).diagonal() == pytest.approx(1, abs=1e-6)


def test_a_machine_beside_a_mode_is_avoided() -> None:
    record, modes = pair(0.05), started(2.0)
    t = np.arange(record.samples) / 20.0
    loud = record.outputs + np.outer(np.sin(2 * np.pi * 1.51 * t), [1.0, 0.0, 0.0])
    found = line_shapes(Signals(outputs=loud, sampling_rate=20.0), modes, [(1.51, 0.004)])
    assert mac(found[:, 1:], SHAPES[:, 1:].astype(complex))[0, 0] > 0.85
