"""Pairs of modes: by frequency and shape together, each mode once, with differences in deviations."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope.analysis.workflow.pairing import comac, pair_modes
from modalscope.data import DataError, ModalModel

SHAPES = np.array([[1.0, 1.0, 1.0], [2.0, 0.5, -1.0], [3.0, -1.0, 0.5]])


def modes(frequencies: list[float], shapes: np.ndarray = SHAPES, **fields: object) -> ModalModel:  # type: ignore[type-arg]
    w = 2 * np.pi * np.array(frequencies)
    return ModalModel(poles=-0.01 * w + 1j * w * np.sqrt(1 - 1e-4), shapes=shapes, **fields)  # type: ignore[arg-type]


def test_shapes_decide_where_two_close_modes_have_changed_places() -> None:
    found = pair_modes(modes([10.0, 10.1, 20.0]), modes([10.05, 10.06, 20.2], SHAPES[:, [1, 0, 2]]))
    assert found.first.tolist() == [0, 1, 2]
    assert found.second.tolist() == [1, 0, 2]
    assert found.mac == pytest.approx(1)
    assert found.frequency_change == pytest.approx([0.006, -0.5 / 101, 0.01], rel=1e-9)


def test_frequencies_further_apart_than_the_tolerance_make_no_pair_whatever_the_shapes() -> None:
    found = pair_modes(modes([10.0, 20.0, 30.0]), modes([11.5, 20.0, 31.0]))
    assert found.first.tolist() == [1, 2]
    assert [left.tolist() for left in found.alone] == [[0], [0]]
    assert "only in a: mode 1, 10.0000 Hz" in found.table()
    assert len(pair_modes(modes([10.0, 20.0, 30.0]), modes([11.5, 20.0, 31.0]), tolerance=0.2).first) == 3


def test_only_common_outputs_count_in_whatever_order() -> None:
    a = modes([10.0, 20.0, 30.0], output_dofs=["1:+Z", "2:+Z", "3:+Z"])
    b = modes(
        [10.0, 20.0, 30.0], np.vstack([SHAPES[::-1], [9.0, 9.0, 9.0]]), output_dofs=["3:+Z", "2:+Z", "1:+Z", "4:+Z"]
    )
    assert pair_modes(a, b).mac == pytest.approx(1)
    with pytest.raises(DataError, match="no output in common"):
        pair_modes(a, modes([10.0, 20.0, 30.0], output_dofs=["7:+Z", "8:+Z", "9:+Z"]))


def test_differences_are_counted_in_deviations_of_the_difference_and_the_wider_of_two_counts() -> None:
    a = modes([10.0, 20.0, 30.0], frequencies_std=[0.03, 0.03, np.nan])
    b = modes([10.1, 20.0, 30.0], frequencies_std=[0.01, 0.04, 0.01], frequencies_repeatability=[0.04, 0.01, 0.01])
    away = pair_modes(a, b).deviations
    assert away["frequency"][:2] == pytest.approx([0.1 / np.hypot(0.03, 0.04), 0])
    assert np.isnan(away["frequency"][2])
    assert np.isnan(away["damping_ratio"]).all()


def test_nothing_is_paired_with_nothing() -> None:
    none = modes([10.0, 20.0, 30.0])[:0]
    assert pair_modes(none, modes([10.0, 20.0, 30.0])).first.size == 0


def test_the_criterion_by_output_names_the_one_that_moves_otherwise() -> None:
    other = SHAPES.copy()
    other[2] *= [1.0, 0.0, 1.5]
    found = comac(SHAPES, other)
    assert int(np.argmin(found)) == 2
    assert comac(SHAPES, SHAPES * np.array([2, -1j, 1 + 1j])) == pytest.approx(1)
    by_hand = np.array([1.0, 1.0]), np.array([1.0, -3.0])
    a, b = (np.array([x, [0.0, 0.0]]) for x in by_hand)  # one output moves, so that every shape has length one
    assert comac(a, b)[0] == pytest.approx(1)
    assert comac(a, b)[1] == 0
    with pytest.raises(DataError, match=r"the shapes are \(3, 3\) and \(3, 1\)"):
        comac(SHAPES, SHAPES[:, :1])  # one mode is not every mode
