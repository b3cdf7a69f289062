"""Without noise every frequency-domain method is exact: whole bands and a band of 6 % around one mode, all quantities."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from modalscope import DataError, FrequencyResponse, Identification, StateSpace
from modalscope.identification.identify import assemble
from tests.support import EPS, FIVE, built, model_transfer, random_system

QUANTITIES = {"displacement": 0, "velocity": 1, "acceleration": 2}
METHODS = ("era", "polyreference", "alternate", "least_squares")
CELLS = [(method, domain) for domain in ("s", "z") for method in METHODS]

#: Responses rebuilt on the lines.
REBUILT = 1e-8


def identify_all(frf: FrequencyResponse, method: str, domain: str, order: int) -> Identification:
    """Identify at `order`, or at the largest order below that rounding leaves of it on a narrow band."""
    pipeline = built(frf, method=method, domain=domain, order=order)
    for n in range(min(order, pipeline.factors.rank), 1, -1):
        try:
            return assemble(pipeline, n)
        except DataError as error:  # a state at the edge of rounding, refused by the shift of one factor
            if "observability index" not in str(error):
                raise
    raise AssertionError("no order is left")


def check(frf: FrequencyResponse, truth: np.ndarray, order: int, cells: list[tuple[str, str]] = CELLS) -> None:
    """Poles to max(1e-9, 100 eps sigma_1 / sigma_n): what rounding of the data costs at this order."""
    low, high = frf.frequencies[[0, -1]]
    f = np.abs(truth) / (2 * np.pi)
    inside = truth[(f >= low) & (f <= high) & (truth.imag > 0)]
    for method, domain in cells:
        found = identify_all(frf, method, domain, order)
        d = found.singular_values
        tolerance = max(1e-9, 100 * EPS * d[0] / d[found.order - 1])
        poles = np.concatenate([found.poles, found.extraneous.poles])
        for s in inside:
            assert np.min(np.abs(poles - s)) / abs(s) < tolerance, (method, domain)
        # Shapes of modes far outside a narrow band are known to the same rounding, and their sum there is no better. Where it
        # hides states altogether (one input, modes six times the band's frequency) no model of the whole response is asked for.
        if found.order == order:
            assert found.fit_error < max(REBUILT, tolerance), (method, domain)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
def test_whole_bands(name: str, quantity: str) -> None:
    s = FIVE[name]()
    check(s.frequency_response(np.linspace(0.4, 8, 120), quantity=quantity), s.modes().poles, 2 * s.degrees)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
def test_a_band_of_six_percent_around_one_mode(name: str, quantity: str) -> None:
    s = FIVE[name]()
    oscillating = s.modes().poles[s.modes().poles.imag > 0]
    f0 = abs(oscillating[len(oscillating) // 2]) / (2 * np.pi)
    lines = np.linspace(0.97 * f0, 1.03 * f0, 100)
    check(s.frequency_response(lines, quantity=quantity), oscillating, 2 * s.degrees)


def as_quantity(ss: StateSpace, lines: np.ndarray, quantity: str) -> FrequencyResponse:
    """Derivatives of the impulse response of any system, with the direct term that an accelerance has."""
    power = QUANTITIES[quantity]
    direct = ss.C @ np.linalg.matrix_power(ss.A, power - 1) @ ss.B if power else 0
    return FrequencyResponse(values=model_transfer(ss, lines, power) + direct, frequencies=lines, quantity=quantity)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(QUANTITIES)), st.sampled_from(CELLS), st.booleans())
@settings(max_examples=60, deadline=None)
def test_random_systems(seed: int, quantity: str, cell: tuple[str, str], narrow: bool) -> None:
    """Damping up to 3 %, up to five modes, any channels."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, modes=int(rng.integers(1, 6)), damping=(0.001, 0.03), sampled=False)
    poles = ss.poles[ss.poles.imag > 0]
    f0 = np.abs(rng.choice(poles)) / (2 * np.pi)
    lines = np.linspace(0.97 * f0, 1.03 * f0, 120) if narrow else np.linspace(0.01, 0.5, 160)
    check(as_quantity(ss, lines, quantity), poles, ss.order, [cell])


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1), st.sampled_from(METHODS))
@settings(max_examples=15, deadline=None)
def test_sampled_systems_on_any_band(seed: int, method: str) -> None:
    """z by the exponential is exact for them, on the whole band and on half of it."""
    rng = np.random.default_rng(seed)
    ss = random_system(rng, modes=int(rng.integers(1, 5)), damping=(0.001, 0.03), direct=True)
    truth = np.log(ss.poles)
    check(ss.frequency_response(np.linspace(0.01, 0.49, 160)), truth, ss.order, [(method, "z")])
    check(ss.frequency_response(np.linspace(0.12, 0.35, 160)), truth, ss.order, [(method, "z")])


def test_shapes_and_participation_are_exact_too() -> None:
    s = FIVE["chain5"]()
    for method, domain in CELLS:
        found = identify_all(s.frequency_response(np.linspace(0.4, 8, 160)), method, domain, 10)
        truth = s.modes()
        assert np.abs(found.modes.residues - truth.residues).max() < 1e-9 * np.abs(truth.residues).max()
