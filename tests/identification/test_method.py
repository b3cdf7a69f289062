"""What rows of the table say of data, and what orders mean to them, case by case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.analysis.comparing.reservations import exact_on, has_decayed, reservation
from modalscope.data import ImpulseResponse
from modalscope.identification.method_names import find_method, methods
from modalscope.identification.orders import orders_compared, states_each
from modalscope.identification.suits import refusal
from modalscope.systems import chain5

SAMPLES = chain5().impulse_response(400)
MEASURED = chain5().frequency_response(np.arange(30, 751) * 0.01)
SAMPLED = chain5().state_space(dt=0.05).frequency_response(np.linspace(0, 10, 201))
CORRELATIONS = replace(SAMPLES, kind="correlation")


def row(name: str, domain: str):  # type: ignore[no-untyped-def]
    return find_method(name, domain, domain)


@pytest.mark.parametrize(
    ("response", "domains", "fraction"), [(SAMPLES, {"time", "z"}, False), (MEASURED, {"z", "s"}, True)]
)
def test_rows_on_transformed_data_are_told_from_those_on_the_data_themselves(response, domains, fraction) -> None:  # type: ignore[no-untyped-def]
    exact = [m for m in methods() if exact_on(m, response) and refusal(m, response, False) is None]
    assert {m.domain for m in exact} == domains
    assert (row("lscf", "z") in exact) is fraction


def test_all_lines_of_a_sampled_system_are_its_samples() -> None:
    assert exact_on(row("era", "time"), SAMPLED)
    assert not exact_on(row("era", "time"), SAMPLED.band(0.5, 9.0))
    assert "sampled system" in reservation(row("era", "s"), SAMPLED)


def test_what_does_not_suit_says_why() -> None:
    assert "records without inputs" in str(refusal(row("ssi-data", "time"), CORRELATIONS, False))
    assert refusal(row("ssi-data", "time"), CORRELATIONS, True) is None
    assert "no rational transform" in str(refusal(row("era", "s"), SAMPLES, False))
    assert "has not decayed" in reservation(row("lscf", "z"), chain5().impulse_response(60))
    assert reservation(row("lscf", "z"), chain5().impulse_response(12_000)) == ""
    assert "equally spaced" in reservation(row("era", "time"), MEASURED.at_lines(np.r_[0:300, 301:700]))


def test_a_response_has_decayed_when_a_thousandth_of_its_energy_is_left_at_the_end() -> None:
    """Of exp(-a t) over T the last tenth holds exp(-1.8 a T) - exp(-2 a T) over 1 - exp(-2 a T)."""
    t = np.linspace(0, 1, 10_001)[:, None, None]
    for a in (3.0, 3.5, 4.0):
        share = (np.exp(-1.8 * a) - np.exp(-2 * a)) / (1 - np.exp(-2 * a))
        assert has_decayed(ImpulseResponse(values=np.exp(-a * t), sampling_rate=10_000.0)) is bool(share < 1e-3)


def test_orders_are_states_degrees_or_whole_blocks() -> None:
    """Two inputs, four outputs."""
    states = (3, 4, 10, 20)
    assert orders_compared(row("era", "time").orders, states, SAMPLES) == (states, {})
    assert orders_compared(row("lscf", "z").orders, states, MEASURED) == ((2, 5, 10), {})
    assert orders_compared(row("prce", "time").orders, states, SAMPLES) == ((4, 10, 20), {})
    assert states_each(row("lscf", "z").orders, MEASURED) == 2
    assert states_each(row("era", "time").orders, SAMPLES) == 1
    # a canonical form on lines: at most 48 block rows, and every second of more than 30 orders
    orders, sizes = orders_compared(row("polyreference", "s").orders, range(2, 81, 2), MEASURED)
    assert sizes == {"block_rows": 48}
    assert orders == tuple(range(4, 81, 4))


@pytest.mark.parametrize("response", [SAMPLES, replace(SAMPLES, first_sample=3), MEASURED, SAMPLED])
def test_derivatives_are_the_limit_of_differences_of_the_basis(response) -> None:  # type: ignore[no-untyped-def]
    """Central differences of step h are good to h^2, about 1e-8 here, of functions whose scale is a half bandwidth."""
    s = chain5().modes().poles[:3]
    h = 1e-4 * np.abs(s.real)
    found = response.derivatives(s).reshape(-1, 3, 2)
    ahead, behind = (response.basis(s + sign * h).functions.reshape(-1, 3, 2) for sign in (1, -1))
    assert found == pytest.approx((ahead - behind) / (2 * h[:, None]), rel=1e-6, abs=1e-6 * np.abs(found).max())
