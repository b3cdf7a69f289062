"""What a comparison asks of responses and methods, against the definitions and case by case."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modalscope.comparing.questions import (
    basis_of,
    default_orders,
    derivatives,
    domains_of,
    exact_on,
    has_decayed,
    method_orders,
    states_per_order,
    unsuited,
)
from modalscope.identification.table import find_method, methods
from modalscope.model import FrequencyResponse, ImpulseResponse
from modalscope.systems import chain5

LINES = np.arange(30, 751) * 0.01
SAMPLES = chain5().impulse_response(400)
MEASURED = chain5().frequency_response(LINES)
SAMPLED = chain5().state_space(dt=0.05).frequency_response(np.linspace(0, 10, 201))
CORRELATIONS = replace(SAMPLES, kind="correlation")


@pytest.mark.parametrize("response", [SAMPLES, replace(SAMPLES, first_sample=3), MEASURED, SAMPLED])
def test_derivatives_are_the_limit_of_differences_of_the_basis(response: ImpulseResponse | FrequencyResponse) -> None:
    """Central differences of step h are good to h^2, about 1e-8 here, of functions whose scale is a half bandwidth."""
    s = chain5().modes().poles[:3]
    h = 1e-4 * np.abs(s.real)
    found = derivatives(response, s).reshape(-1, 3, 2)
    ahead, behind = (basis_of(response, s + sign * h).functions.reshape(-1, 3, 2) for sign in (1, -1))
    assert found == pytest.approx((ahead - behind) / (2 * h[:, None]), rel=1e-6, abs=1e-6 * np.abs(found).max())


def test_methods_of_transformed_data_are_told_from_those_of_the_data_themselves() -> None:
    def exact(response: ImpulseResponse | FrequencyResponse) -> set[str]:
        return {str(m) for m in methods() if exact_on(m, response) and unsuited(m, response, records=False) is None}

    domains = lambda names: {n.partition(" (")[2].rstrip(")") for n in names}  # noqa: E731
    assert domains(exact(SAMPLES)) == {"time", "z"}
    assert "lscf (z)" not in exact(SAMPLES)
    assert domains(exact(MEASURED)) == {"z", "s"}
    assert "lscf (z)" in exact(MEASURED)
    # all lines of a sampled system are its samples; an untruncated form has no rank that could tell the difference
    assert domains(exact(SAMPLED)) == {"time", "z"}
    assert "prce (time)" not in exact(SAMPLED)


def test_what_does_not_suit_says_why() -> None:
    records, s, lscf, era = (
        find_method(*cell, "time") for cell in (("ssi-data", "time"), ("era", "s"), ("lscf", "z"), ("era", "time"))
    )
    assert "there are none" in str(unsuited(records, CORRELATIONS, records=False))
    assert unsuited(records, CORRELATIONS, records=True) is None
    assert "no rational function" in str(unsuited(s, SAMPLES, records=False))
    assert "sampled system" in str(unsuited(s, SAMPLED, records=False))
    assert "has not decayed" in str(unsuited(lscf, chain5().impulse_response(60), records=False))
    assert unsuited(lscf, chain5().impulse_response(12_000), records=False) is None
    assert "domain time left out" in str(unsuited(era, MEASURED.at_lines(np.r_[0:300, 301:700]), records=False))


def test_a_response_has_decayed_when_a_thousandth_of_its_energy_is_left_at_the_end() -> None:
    """Of exp(-a t) over T the last tenth holds exp(-1.8 a T) - exp(-2 a T) over 1 - exp(-2 a T)."""
    t = np.linspace(0, 1, 10_001)[:, None, None]
    for a in (3.0, 3.5, 4.0):
        share = (np.exp(-1.8 * a) - np.exp(-2 * a)) / (1 - np.exp(-2 * a))
        assert has_decayed(ImpulseResponse(values=np.exp(-a * t), sampling_rate=10_000.0)) is bool(share < 1e-3)


def test_orders_are_states_degrees_or_whole_blocks() -> None:
    """Two inputs, four outputs."""
    states = (3, 4, 10, 20)
    assert method_orders(find_method("era", "time", "time"), SAMPLES, states) == (states, {})
    assert method_orders(find_method("lscf", "z", "z"), MEASURED, states) == ((2, 5, 10), {})
    assert method_orders(find_method("prce", "time", "time"), SAMPLES, states) == ((4, 10, 20), {})
    assert states_per_order(find_method("lscf", "z", "z"), 2) == 2
    assert states_per_order(find_method("era", "time", "time"), 2) == 1
    # a canonical form on lines: at most 48 block rows, and every second of more than 30 orders
    orders, sizes = method_orders(find_method("polyreference", "s", "s"), MEASURED, tuple(range(2, 81, 2)))
    assert sizes == {"block_rows": 48}
    assert orders == tuple(range(4, 81, 4))


def test_defaults_depend_on_what_was_measured() -> None:
    assert [default_orders(r)[-1] for r in (MEASURED, SAMPLES, CORRELATIONS)] == [80, 60, 40]
    assert [domains_of(r) for r in (MEASURED, SAMPLED, SAMPLES)] == [("z", "s"), ("z",), ("time", "z")]
