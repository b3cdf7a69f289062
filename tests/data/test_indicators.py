"""Indicators of shapes and amplitudes: closed forms, ranges, and what they must not depend on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope import systems
from modalscope.data import DataError
from modalscope.data.indicators import (
    cluster_mpc,
    clusters,
    cmif,
    decay_step,
    mac,
    modal_singular_values,
    mpc,
    mpd,
    prominence,
)

RNG = np.random.default_rng(4)
SHAPES = RNG.standard_normal((6, 3)) + 1j * RNG.standard_normal((6, 3))

#: Complex factors, one a shape: none of what is tested may see them.
TURNS = np.array([2 - 1j, 0.1j, -3.0])


def test_modes_are_compared_where_a_tenth_of_them_is_left() -> None:
    evolution = np.array([0.5, 0.999]) ** np.arange(10)[:, None]
    assert decay_step(evolution).tolist() == [3, 9]  # .5^3 = .125


def test_singular_values_of_modes_sum_their_decay() -> None:
    c, b, z = np.array([[3.0], [4.0]]), np.array([[2.0]]), np.array([0.8 + 0j])
    total = sum(0.8**k for k in range(9))
    np.testing.assert_allclose(modal_singular_values(c, b, z, 10), np.sqrt(5 * 2 * total))
    np.testing.assert_allclose(modal_singular_values(c, b, np.array([1.2 + 0j]), 10), np.sqrt(5 * 2 * 9))


# --------------------------------------------------------------------------------------------------------------- shapes


def test_the_modal_assurance_criterion_is_the_squared_cosine_between_columns() -> None:
    a = np.array([[1, 0], [1, 1j], [0, 1]])
    b = np.array([[1, 1, 2j], [0, 0, 2j], [0, 1, 0]])
    # a1 = (1, 1, 0), a2 = (0, j, 1); b1 = (1, 0, 0), b2 = (1, 0, 1), b3 = 2j (1, 1, 0)
    assert np.allclose(mac(a, b), [[1 / 2, 1 / 4, 1], [0, 1 / 4, 1 / 4]])
    assert np.allclose(mac(a), [[1, 1 / 4], [1 / 4, 1]])
    assert mac(np.zeros(2), np.ones(2))[0, 0] == 0
    np.testing.assert_allclose(mac(SHAPES, SHAPES * TURNS), mac(SHAPES))
    with pytest.raises(DataError, match="6 and 2"):
        mac(SHAPES, np.ones(2))


@pytest.mark.parametrize(
    ("shape", "value"),
    [
        ([1, -2, 3], 1.0),
        ([1 + 1j, 2 + 2j, -3 - 3j], 1.0),
        ([1, 1j], 0.0),  # a travelling wave
        ([2, 1j], (9 / 25)),  # xx = 4, yy = 1, xy = 0
        ([1, 1 + 1j], 5 / 9),  # xx = 2, yy = 1, xy = 1: (1 + 4) / 9
        ([0, 0], 0.0),
    ],
)
def test_phase_collinearity(shape: list[complex], value: float) -> None:
    assert mpc(np.array(shape)[:, None])[0] == pytest.approx(value)
    for turn in TURNS:
        assert mpc(turn * np.array(shape)[:, None])[0] == pytest.approx(value)


#: Equal components 10 degrees to either side of a line through 25 degrees, one of them turned round.
ABOUT_A_LINE = np.exp(1j * np.radians([35, 15, 215, 15])).tolist()


@pytest.mark.parametrize(
    ("shape", "degrees"), [([1, -2], 0.0), ([1j, 2j], 0.0), ([2, 1j], 30.0), ([3, 1j], 22.5), (ABOUT_A_LINE, 10.0)]
)
def test_mean_phase_deviation_is_weighted_by_amplitude(shape: list[complex], degrees: float) -> None:
    # the line goes with the larger one: the other is at 90 degrees and weighs 1 of 3, or of 4
    assert mpd(np.array(shape)[:, None])[0] == pytest.approx(degrees)


def test_repeated_modes_are_collinear_together_whatever_their_basis() -> None:
    real = np.array([[1.0, 0], [0, 1], [1, 1]])
    mixed = real @ np.array([[1, 1j], [1j, 1]])
    assert mpc(mixed).max() < 0.9
    assert cluster_mpc(mixed) == pytest.approx(1)
    # [1, j]: real and imaginary part are of one size, so that s_2 / s_1 is one
    assert cluster_mpc(np.array([[1], [1j]])) == pytest.approx(0)
    assert cluster_mpc(np.array([[2], [1j]])) == pytest.approx(1 - 1 / 4)


def test_clusters_are_chains_of_neighbours() -> None:
    poles = 1j * np.array([100, 100.15, 100.3, 101, 0.0])
    assert [g.tolist() for g in clusters(poles)] == [[0, 1, 2], [3], [4]]
    assert [g.tolist() for g in clusters(poles, 1e-3)] == [[0], [1], [2], [3], [4]]
    ways = 1j * np.array([100.6, 100.0, 100.15, 200.0, 100.3, 200.1, 100.45])  # a chain that is met in any order
    assert [g.tolist() for g in clusters(ways)] == [[0, 1, 2, 4, 6], [3, 5]]


def test_the_indicator_function_is_the_singular_values_of_every_line() -> None:
    H = np.zeros((2, 2, 3), complex)
    H[0, 0, 2], H[0, 1, 0], H[1, 1, 1] = 3j, 4, 2
    assert np.allclose(cmif(H), [[4, 3], [2, 0]])


# --------------------------------------------------------------------------------------------------------- prominence

F = np.arange(0.0, 21.0)  # lines 1 Hz apart


def curve(**values: float) -> np.ndarray:
    """Return a flat curve of ones but at some lines, as in f7=3."""
    c = np.ones(F.size)
    for name, value in values.items():
        c[int(name[1:])] = value
    return c


def stands_out(*curves: np.ndarray, at: float = 10.0, zeta: float = 0.01) -> float:
    return prominence(np.stack(curves, axis=1), F, at, zeta)


def test_a_peak_stands_out_by_its_ratio_to_the_floor() -> None:
    assert stands_out(curve(f10=3.0)) == 3
    assert stands_out(curve()) == 1


def test_the_higher_of_two_saddles_counts() -> None:
    # to the left the way to 5 at 6 Hz leads over 2, to the right over 1.5 to 6 at 13 Hz
    assert stands_out(curve(f6=5, f7=2, f8=2.5, f9=2.5, f10=3, f11=1.5, f12=2, f13=6)) == pytest.approx(3 / 2)
    assert stands_out(curve(f7=6, f8=2, f9=1.5, f10=3, f11=2.5, f12=2.5, f13=2, f14=5)) == pytest.approx(3 / 2)


def test_what_lies_beyond_something_higher_is_no_saddle() -> None:
    # the floor of ones begins behind the higher neighbours
    assert stands_out(curve(f7=5, f8=2, f9=2, f10=3, f11=2, f12=2, f13=5)) == pytest.approx(3 / 2)
    # nothing higher: the floor counts
    assert stands_out(curve(f7=2.9, f8=2, f9=2, f10=3, f11=2, f12=2, f13=2.9)) == 3


def test_a_peak_is_looked_for_within_a_half_bandwidth_or_two_lines() -> None:
    assert stands_out(curve(f12=3.0)) == 3
    assert stands_out(curve(f13=3.0)) == 1
    assert stands_out(curve(f13=3.0), zeta=0.3) == 3


def test_saddles_are_looked_for_within_eight_half_bandwidths_or_eight_lines() -> None:
    def on_a_hill(width: int) -> np.ndarray:
        return np.where(F == 10, 3.0, np.where(np.abs(F - 10) <= width, 2.0, 1.0))

    assert stands_out(on_a_hill(8)) == pytest.approx(3 / 2)
    assert stands_out(on_a_hill(7)) == 3
    assert stands_out(on_a_hill(8), zeta=0.09 / 0.8) == 3  # nine lines


def test_the_best_of_several_curves_counts_and_slopes_and_ends_are_no_peaks() -> None:
    assert stands_out(curve(f10=2), curve(f10=3), curve()) == 3
    assert stands_out(np.linspace(1, 3, F.size)) == 0
    assert stands_out(curve(f0=3.0), at=0.5) == 0
    assert stands_out(curve(f10=3.0), at=100.0) == 0


def test_a_peak_over_nothing_stands_alone() -> None:
    assert stands_out(0 * curve() + np.where(F == 10, 1.0, 0.0)) == np.inf


def test_the_criterion_takes_modes_whose_outputs_are_the_same() -> None:
    modes = systems.chain5().modes()
    assert np.array_equal(mac(modes), mac(modes.shapes))
    assert np.array_equal(mac(modes, modes.take([0, 2])), mac(modes.shapes, modes.shapes[:, [0, 2]]))
    assert np.array_equal(mac(modes, modes.shapes), mac(modes))
    with pytest.raises(DataError, match="outputs differ: their order"):
        mac(modes, modes.select(outputs=[3, 2, 1, 0]))


@pytest.mark.parametrize("alike", [None, 1.0, 0.0], ids=["some", "equal", "orthogonal"])
def test_the_deviation_of_a_mac_is_that_of_many_draws(alike: float | None) -> None:
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((2, 5)) + 1j * rng.standard_normal((2, 5))
    b = {None: b, 1.0: a, 0.0: b - a * (np.vdot(a, b) / np.vdot(a, a))}[alike]
    deviations = 0.02 * rng.uniform(0.3, 2, (2, 5))
    errors = rng.standard_normal((2, 5, 5000)) + 1j * rng.standard_normal((2, 5, 5000))
    drawn = np.stack([a, b])[:, :, None] + deviations[:, :, None] * errors / np.sqrt(2)
    cross, (p, q) = np.abs(np.sum(drawn[0].conj() * drawn[1], axis=0)) ** 2, np.sum(np.abs(drawn) ** 2, axis=1)
    one, other = (
        ms.ModalModel(poles=[-1 + 100j], shapes=x[:, None], shapes_std=s[:, None])
        for x, s in zip((a, b), deviations, strict=True)
    )
    assert ms.mac_std(one, other)[0, 0] == pytest.approx((cross / (p * q)).std(), rel=0.06)
    assert ms.mac_std(one) == 0
    with pytest.raises(ms.DataError, match="modes_b has no standard deviations of its shapes"):
        ms.mac_std(one, replace(other, shapes_std=None))
