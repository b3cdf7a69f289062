"""Modes of several bands as one result: what lies in two of them is reported once, by the band it lies deeper in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from modalscope import DataError
from modalscope.data.modes import ModalModel
from modalscope.data.sameness import log_ratios
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.bands import merge_bands
from tests.selection.judging.made import NUDGE, at_angle


def modes(f: list[float], zeta: float = 0.001, shapes: Any = None, **more: Any) -> ModalModel:
    n = len(f)
    return ModalModel(
        poles=poles_from(f, np.full(n, zeta)),
        shapes=np.array([[1.0] * n, [0.0] * n]) if shapes is None else np.array(shapes, dtype=float).T,
        participation=np.ones((n, 3)) * np.arange(1, n + 1)[:, None],
        **more,
    )


LOW, HIGH = (0.0, 10.0), (8.0, 20.0)


def merged(a: ModalModel, b: ModalModel, low: Any = LOW, high: Any = HIGH, **how: float) -> list[float]:
    return merge_bands([a, b], [low, high], **how).frequencies.round(9).tolist()


def test_modes_outside_their_own_band_are_left_out_and_those_on_its_ends_are_in_it() -> None:
    low, high = modes([1, 10, 10.001]), modes([7.999, 8, 15])
    ends = float(low.frequencies[1]), float(high.frequencies[1])  # 10 and 8 Hz, to rounding
    assert merged(low, high, (0, ends[0]), (ends[1], 20)) == [1, 8, 10, 15]


def test_one_mode_seen_in_two_bands_is_that_of_the_band_it_lies_deeper_in() -> None:
    # 8.5 Hz is 0.5 Hz inside the upper band and 1.5 Hz inside the lower, 9.5 Hz the other way round
    assert merged(modes([8.51]), modes([8.5])) == [8.51]
    assert merged(modes([9.51]), modes([9.5])) == [9.5]


def test_the_nearer_end_of_a_band_counts() -> None:
    # 0.4 Hz above the lower end of its own band, 0.5 Hz below the upper end of the other's
    assert merged(modes([9.5]), modes([9.5001]), high=(9.1, 99)) == [9.5]
    assert merged(modes([9.5]), modes([9.5001]), high=(8.9, 99)) == [9.5001]


def limit(zeta: float, other: float, tolerance: float = 0.005) -> float:
    """Return how far above 8.5 Hz a mode of one shape is the same just so, relative to it."""

    def ratio(apart: float) -> float:
        return float(log_ratios(modes([8.5], zeta), modes([8.5 * (1 + apart)], other), tolerance)[0, 0])

    return brentq(ratio, 0, 0.2)


@pytest.mark.parametrize(("zeta", "other"), [(1e-4, 1e-4), (0.04, 0.02), (0.02, 0.04)])
@pytest.mark.parametrize(("side", "count"), [(-1, 1), (1, 2)])
def test_modes_that_are_the_same_rather_are_one(zeta: float, other: float, side: int, count: int) -> None:
    apart = 8.5 * (1 + limit(zeta, other) * (1 + side * NUDGE))
    assert len(merged(modes([8.5], zeta), modes([apart], other))) == count
    assert len(merged(modes([apart], other), modes([8.5], zeta))) == count


def test_modes_of_unlike_shapes_are_two() -> None:
    turned = [len(merged(modes([8.5]), modes([8.5], shapes=[at_angle(like)]))) for like in (0.9, 0.0)]
    assert turned == [1, 2]


def test_a_tolerance_can_be_given() -> None:
    near, far = limit(1e-4, 1e-4), limit(1e-4, 1e-4, 0.01)
    assert near < far
    apart = 8.5 * (1 + (near + far) / 2)
    assert len(merged(modes([8.5], 1e-4), modes([apart], 1e-4))) == 2
    assert len(merged(modes([8.5], 1e-4), modes([apart], 1e-4), tolerance=0.01)) == 1


def test_modes_of_one_band_are_never_merged_with_each_other() -> None:
    assert len(merged(modes([5, 5]), modes([15, 15]))) == 4
    # repeated modes in both bands: each of one finds the other of its shape, and both stay
    both = modes([9.5, 9.5], shapes=[(1, 0), (0, 1)])
    assert len(merged(both, both)) == 2


def test_what_belongs_to_a_mode_goes_with_it_and_what_belongs_to_a_band_goes() -> None:
    def marked(f: list[float], start: int, **more: Any) -> ModalModel:
        n = start + np.arange(len(f), dtype=float)
        return modes(
            f,
            shapes=[at_angle(1 - v / 100) for v in n],
            frequencies_spread=n,
            indicators={"emac": n / 10, **more},
            reasons=tuple({"text": str(int(v))} for v in n),
            feedthrough=np.ones((2, 3)),
            scaling=f"as of {start}",
        )

    a = marked([9.6, 2], 0, mpc=np.zeros(2))
    b = marked([9.6, 15], 5)
    both = merge_bands([a, b], [LOW, HIGH])
    assert np.allclose(both.frequencies, [2, 9.6, 15])
    assert both.frequencies_spread is not None
    assert both.frequencies_spread.tolist() == [1, 5, 6]
    assert both.indicators.keys() == {"emac"}
    assert np.allclose(both.indicators["emac"], [0.1, 0.5, 0.6])
    assert [r["text"] for r in both.reasons] == ["1", "5", "6"]
    assert both.participation is not None
    assert both.participation[:, 0].tolist() == [2, 1, 2]
    assert np.allclose(both.shapes.T, [at_angle(0.99), at_angle(0.95), at_angle(0.94)])
    assert both.feedthrough is None
    assert both.scaling == "as in each part"
    assert merge_bands([a, a], [LOW, HIGH]).scaling == "as of 0"
    assert "merged from bands 0 to 10 Hz, 8 to 20 Hz" in both.processing[-1]


def test_what_only_one_band_knows_of_its_modes_is_left_out() -> None:
    known = modes([2], frequencies_spread=np.ones(1), reasons=({"text": "x"},))
    both = merge_bands([known, modes([15])], [LOW, HIGH])
    assert both.frequencies_spread is None
    assert both.reasons == ()


def test_what_cannot_be_merged() -> None:
    with pytest.raises(DataError, match="one band for each"):
        merge_bands([modes([2])], [LOW, HIGH])
    with pytest.raises(DataError, match="outputs or inputs differ"):
        merge_bands([modes([2]), modes([15], shapes=[(1, 0, 0)])], [LOW, HIGH])
    with pytest.raises(DataError, match="each result of a band"):
        merge_bands([1], [LOW])  # type: ignore[list-item]
