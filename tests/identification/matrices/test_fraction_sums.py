"""What noise does to the poles of a matrix fraction: sums over few points of the arc are those over all lines."""

from __future__ import annotations

import numpy as np
import pytest

from modalscope import FrequencyResponse
from modalscope.identification.fast.few_points import Arc, moments_on, nodes_needed, weights_at
from modalscope.identification.fast.fraction_noise import FractionInfluence
from modalscope.identification.matrices.fraction import fraction
from modalscope.identification.matrices.influence import LineInfluence
from modalscope.identification.realizations.fraction_companion import fraction_companion
from modalscope.identification.realizations.sensitivity import influence_of
from tests.support import add_noise, random_system, relative


def response(inputs: int, low: float, high: float, snr: float = 40.0) -> FrequencyResponse:
    rng = np.random.default_rng(inputs)
    system = random_system(rng, outputs=4, inputs=inputs, modes=5, damping=(0.01, 0.05))
    clean = system.frequency_response(np.linspace(low, high, 1500))
    return add_noise(clean, snr, rng)


def influence(frf: FrequencyResponse, degree: int, weights: np.ndarray | None = None) -> FractionInfluence:
    matrix = fraction(frf, degree=degree + 3, weights=weights)
    realization = fraction_companion(matrix, matrix.factors)
    found = influence_of(realization, [(degree, realization.triple(degree).eigen())])
    assert isinstance(found, FractionInfluence)
    return found


def plain(gradient: FractionInfluence) -> LineInfluence:
    """The same line by line."""
    return LineInfluence(gradient.direct, gradient.mirrored, gradient.lines)


@pytest.mark.parametrize(("half", "degree"), [(1e-3, 5), (0.4, 1), (0.4, 60), (np.pi / 2, 120)])
def test_sums_over_an_arc_are_those_over_its_points(half: float, degree: int) -> None:
    """Of weights that are rough, times every polynomial of that degree."""
    rng, arc = np.random.default_rng(degree), Arc(1.6, half)
    angles = rng.uniform(1.6 - half, 1.6 + half, 5000)
    weights = rng.standard_normal((5000, 3))
    count = nodes_needed(arc, degree)
    few = weights_at(moments_on(arc, angles, weights, count + 7)[:count])
    for k in (0, degree // 2, degree):
        expected = weights.T @ np.exp(1j * k * angles)
        assert np.abs(few.T @ np.exp(1j * k * arc.angles(count)) - expected).max() < 1e-12 * np.abs(weights).sum()


@pytest.mark.parametrize("inputs", [1, 3])
@pytest.mark.parametrize(("low", "high"), [(0.01, 0.49), (0.1, 0.3)])
@pytest.mark.parametrize("weighted", [False, True])
def test_moments_are_those_of_every_line(inputs: int, low: float, high: float, weighted: bool) -> None:
    frf = response(inputs, low, high)
    weights = np.linspace(1, 2, 1500) if weighted else None
    rng = np.random.default_rng(0)
    for degree in (9, 14):
        gradient = influence(frf, degree, weights)
        for shape in ((4, inputs), frf.values.shape):
            variance = rng.uniform(1, 2, shape)
            few, whole = gradient.joint(gradient, variance), plain(gradient).joint(plain(gradient), variance)
            assert np.max(np.abs(few.size / whole.size - 1)) < 1e-7
            assert np.max(np.abs(few.square - whole.square) / np.abs(whole.size)) < 1e-7


def test_points_are_fewer_than_lines_and_taken() -> None:
    gradient = influence(response(1, 0.01, 0.49), 14)
    gradient.joint(gradient, np.ones((4, 1)))
    assert gradient.sums.nodes(14) < 120
    assert "_on_lines" not in vars(gradient)


def test_what_is_rounding_beside_its_terms_is_summed_line_by_line() -> None:
    """At 120 dB the equation leaves so little that a difference of sums has five digits of it."""
    gradient = influence(response(3, 0.01, 0.49, snr=120.0), 14)
    variance = np.random.default_rng(0).uniform(1, 2, (4, 3))
    found, whole = gradient.joint(gradient, variance), plain(gradient).joint(plain(gradient), variance)
    assert np.max(np.abs(found.size / whole.size - 1)) < 1e-7
    assert np.max(np.abs(found.square - whole.square) / np.abs(whole.size)) < 1e-7


def test_some_poles_are_those_of_all() -> None:
    gradient = influence(response(2, 0.01, 0.49), 9)
    index, variance = np.array([3, 0]), np.ones((4, 2))
    some, every = gradient.take(index), gradient.joint(gradient, variance)
    assert relative(some.joint(some, variance).size, every.size[index]) < 1e-9
