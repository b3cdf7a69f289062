"""The matrix fraction (LSCF): normal equations by the Fourier transform against the plain least-squares problem; all degrees."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import DataError, FrequencyResponse, identify
from modalscope.identification.fast.normal_equations import trigonometric_sums
from modalscope.identification.matrices.fraction import fraction
from tests.support import FIVE, add_noise, match_poles, random_system, relative

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.sampled_from([0, 7, 40]))
@settings(max_examples=20, deadline=None)
def test_one_transform_gives_the_sums(seed: int, start: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((50, 3)) + 1j * rng.standard_normal((50, 3))
    angles = np.pi * (start + np.arange(50)) / (start + 49)
    found = trigonometric_sums(values, angles, 12)
    expected = (np.exp(1j * np.outer(np.arange(-12, 13), angles)) @ values).real
    assert relative(found, expected) < 1e-12
    uneven = angles + 1e-3 * rng.uniform(size=50)
    expected = (np.exp(1j * np.outer(np.arange(-12, 13), uneven)) @ values).real
    assert relative(trigonometric_sums(values, uneven, 12), expected) < 1e-12


def plain_denominator(frf: FrequencyResponse, degree: int, base: float, interval: float, w: np.ndarray) -> np.ndarray:
    """Minimize the equation error itself: real unknowns beta of every output and A_1 ... A_p, A_0 = I."""
    lines, outputs, inputs = frf.values.shape
    z = np.exp(2j * np.pi * (frf.frequencies - base) * interval)[:, None] ** np.arange(degree + 1)
    level = np.sqrt(np.mean(np.abs(frf.values) ** 2, axis=(0, 2)))
    known, target = [], []
    for o in range(outputs):
        H = frf.values[:, o] / level[o]
        numerators = np.zeros((lines, outputs * (degree + 1)), complex)
        numerators[:, o * (degree + 1) : (o + 1) * (degree + 1)] = z
        moved = (z[:, :, None] * H[:, None, :]).reshape(lines, -1)
        known.append(w[:, None] * np.hstack([numerators, -moved[:, inputs:]]))
        target.append(w[:, None] * moved[:, :inputs])
    J, y = np.vstack(known), np.vstack(target)
    solution = np.linalg.lstsq(np.vstack([J.real, J.imag]), np.vstack([y.real, y.imag]), rcond=None)[0]
    return solution[outputs * (degree + 1) :]


@pytest.mark.parametrize("inputs", [1, 2, 3])
@pytest.mark.parametrize("band", [(0.0, 0.45), (0.31, 0.44)])
def test_the_reduced_normal_equations_of_every_degree_minimize_the_equation_error(
    inputs: int, band: tuple[float, float]
) -> None:
    rng = np.random.default_rng(inputs)
    ss = random_system(rng, outputs=3, inputs=inputs, modes=4, sampled=False)
    noisy = add_noise(ss.frequency_response(np.linspace(*band, 90)), rng=rng)
    w = rng.uniform(0.5, 2, 90)
    matrix = fraction(noisy, degree=7, weights=w)
    assert (matrix.base > 0) == (band[0] > 0)
    for degree in (1, 4, 7):
        expected = plain_denominator(noisy, degree, matrix.base, matrix.interval, w)
        # normal equations square the condition, about 1e4 here
        assert relative(matrix.denominator(degree), expected) < 1e-7


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_a_sampled_system_is_a_fraction_exactly(seed: int) -> None:
    """Degree p = n / m carries all n poles where m divides n; normal equations leave half of the digits."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, outputs=4, inputs=2, modes=2, damping=(0.005, 0.05), direct=True)
    frf = ss.frequency_response(np.linspace(0, 0.5, 120))
    found = identify(frf, method="lscf", order=2)
    truth = np.log(ss.poles)
    assert match_poles(found.modes.poles, truth[truth.imag > 0]).frequency_error < 1e-6
    assert found.fit_error < 1e-5


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("name", ["chain5", "ring5", "close4"])
def test_a_structure_is_approximated_as_the_degree_rises(name: str, quantity: str) -> None:
    s = FIVE[name]()
    frf = s.frequency_response(np.linspace(0.3, 8, 200), quantity=quantity)
    errors = [
        match_poles(identify(frf, method="lscf", order=degree).modes.poles, s.modes().poles).damping_error
        for degree in (10, 20)
    ]
    assert errors[1] < 0.1 * errors[0]
    assert errors[1] < 1e-4


def test_participation_and_shapes_belong_to_the_mode() -> None:
    s = FIVE["chain5"]()
    found = identify(s.frequency_response(np.linspace(0.3, 8, 200)), method="lscf", order=20).modes
    truth = s.modes()
    for j, k in enumerate(match_poles(found.poles, truth.poles).index):
        assert relative(found.residues[k], truth.residues[j]) < 1e-3


def test_a_narrow_band_is_counted_from_its_start() -> None:
    s = FIVE["chain5"]()
    frf = s.frequency_response(np.linspace(5, 6.6, 200))
    found = identify(frf, method="lscf", order=16)
    truth = s.modes().take(s.modes().frequencies > 5)
    assert "counted from 5 Hz" in str(found.notes[0])
    assert match_poles(found.modes.poles, truth.poles).frequency_error < 1e-3


def test_poles_go_to_the_fraction_and_back() -> None:
    matrix = fraction(FIVE["chain5"]().frequency_response(np.linspace(5, 6.6, 50)), degree=2)
    s = np.array([-0.1 + 35j, -0.1 - 35j, -0.2 + 39j])
    assert relative(matrix.to_s(matrix.from_s(s)), s) < 1e-12


def test_samples_are_transformed_with_a_note() -> None:
    ss = random_system(np.random.default_rng(4), outputs=3, inputs=2, modes=2, damping=(0.02, 0.05))
    decayed = ss.impulse_response(1500)
    found = identify(decayed, method="lscf", order=2)
    assert "as if nothing followed" in str(found.notes[0])
    truth = np.log(ss.poles)
    assert match_poles(found.modes.poles, truth[truth.imag > 0]).frequency_error < 1e-5


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"order": 200}, r"2 x lines x outputs >= \(p \+ 1\) x outputs"),
        ({"order": 10, "block_rows": 4}, r"'block_rows'"),
        ({"order": 10, "domain": "s"}, r"has only z"),
        ({"order": 10, "form": "observable"}, r"controllable"),
    ],
)
def test_what_a_fraction_cannot_do_is_an_error(options: dict[str, object], text: str) -> None:
    with pytest.raises(DataError, match=text):
        identify(FIVE["chain5"]().frequency_response(np.linspace(0.5, 7, 80)), method="lscf", **options)


def test_a_degree_without_a_stable_pole_gives_no_modes() -> None:
    """White noise at degree 1: whatever is found, nothing breaks."""
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((40, 2, 1)) + 1j * rng.standard_normal((40, 2, 1))
    found = identify(FrequencyResponse(values=noise, frequencies=np.arange(1.0, 41)), method="lscf", order=1)
    assert len(found.modes) <= 1
