"""Faults seeded on purpose: each must be named as the cause."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from modalscope import systems
from modalscope.analysis.comparing import Comparison, compare
from modalscope.analysis.comparing.data_causes import without_dead
from modalscope.data import FrequencyResponse, ImpulseResponse, Signals
from modalscope.signals.preprocess import estimate_correlation, merge

NOISE = 0.01
METHODS = ["era/time", "alternate/time", "prce/time"]
ON_LINES = ["era/s", "alternate/s", "alternate/z"]
ORDERS = range(6, 21, 2)


def chain(seed: int = 0) -> ImpulseResponse:
    return systems.chain5().impulse_response(300, noise=NOISE, seed=seed)


def chain_lines(seed: int = 0, quantity: str = "acceleration") -> FrequencyResponse:
    lines = np.linspace(0.3, 7.5, 300)
    return systems.chain5().frequency_response(lines, quantity=quantity, noise=NOISE, seed=seed)


def with_values(response: ImpulseResponse | FrequencyResponse, output: int, input: int | slice, factor: float):  # type: ignore[no-untyped-def]
    values = np.array(response.values)
    values[:, output, input] *= factor
    return replace(response, values=values)


def run(response: ImpulseResponse | FrequencyResponse, orders: range = ORDERS) -> Comparison:
    return compare(response, ON_LINES if isinstance(response, FrequencyResponse) else METHODS, orders=orders, workers=1)


def channels(c: Comparison, name: str) -> set[str]:
    return {cause.channel for cause in c.findings if cause.name == name}


@pytest.mark.slow
@pytest.mark.parametrize("make", [chain, chain_lines])
def test_no_fault_is_found_where_there_is_none(make) -> None:  # type: ignore[no-untyped-def]
    c = run(make())
    assert not c.findings
    assert all(t.trusted for t in c.trust)


@pytest.mark.parametrize("make", [pytest.param(chain, marks=pytest.mark.slow), chain_lines])
def test_a_channel_of_zeros_is_left_out_and_named(make) -> None:  # type: ignore[no-untyped-def]
    c = run(with_values(make(), 1, slice(None), 0.0))
    assert channels(c, "dead channel") == {"2:+X"}
    assert c.response.output_dofs == ("1:+X", "4:+X", "5:+X")
    assert c.response.input_dofs == ("2:+X", "5:+X")  # the input at the same place stays
    assert len(c.modes) == 5
    assert "Dead channel" in c.verdict


def test_a_channel_that_never_changes_is_dead() -> None:
    clean = chain()
    values = np.array(clean.values)
    values[:, 2] = 1.0
    assert channels(run(replace(clean, values=values)), "dead channel") == {"4:+X"}


def test_a_channel_that_is_dead_in_one_setup_alone_stays() -> None:
    rng = np.random.default_rng(0)
    first, second = (
        Signals(outputs=rng.standard_normal((500, 3)), sampling_rate=1.0, output_dofs=("1:+X", "2:+X", f"{k}:+X"))
        for k in (3, 4)
    )
    still = first.outputs.copy()
    still[:, 1:] = 0
    living, causes = without_dead(merge([replace(first, outputs=still), second]))
    assert [cause.channel for cause in causes] == ["3:+X"]
    assert "2:+X" in living.output_dofs


def test_a_channel_in_another_unit_is_not_dead() -> None:
    """How large others are says nothing of a channel: its own values change."""
    clean = chain()
    values = np.array(clean.values)
    values[:, 2] *= 1e-15
    compared = run(replace(clean, values=values))
    assert channels(compared, "dead channel") == set()
    assert len(compared.modes) == 5


def test_a_channel_of_noise_is_named_bad() -> None:
    clean = chain()
    values = np.array(clean.values)
    values[:, 2] = np.std(values) * np.random.default_rng(0).standard_normal(values[:, 2].shape)
    c = run(replace(clean, values=values))
    assert channels(c, "bad channel") == {"4:+X"}
    # noise of 300 samples is explained by chance, as little as its few parameters can
    assert re.search(r"fit error (99|100) %", c.findings[0].evidence)


@pytest.mark.parametrize("make", [chain, pytest.param(chain_lines, marks=pytest.mark.slow)])
def test_a_turned_sensor_is_found_at_its_driving_point(make) -> None:  # type: ignore[no-untyped-def]
    c = run(with_values(make(), 3, slice(None), -1.0))
    assert channels(c, "swapped sign") == {"5:+X"}
    assert "swapped sign" in c.causes


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["displacement", "velocity"])  # accelerations: above
def test_driving_points_are_judged_by_the_quantity_measured(quantity: str) -> None:
    response = chain_lines(quantity=quantity)
    assert not channels(run(response), "swapped sign")
    assert channels(run(with_values(response, 1, slice(None), -1.0)), "swapped sign") == {"2:+X"}


@pytest.mark.slow
def test_without_a_quantity_reciprocity_finds_a_turned_channel() -> None:
    response = replace(chain_lines(), quantity=None)
    assert not channels(run(response), "swapped sign")
    assert channels(run(with_values(response, 3, slice(None), -1.0)), "swapped sign")


@pytest.mark.slow
def test_one_turned_hit_is_found_by_what_all_others_say() -> None:
    c = run(with_values(chain_lines(), 2, 0, -1.0))
    assert channels(c, "swapped sign") == {"4:+X"}
    # with two inputs a sensor's one response cannot be told from its other one, so both are named
    assert "output 4:+X with input 2:+X or output 4:+X with input 5:+X" in next(
        x.evidence for x in c.findings if x.name == "swapped sign"
    )


def test_heavy_damping_is_named() -> None:
    c = run(systems.heavy4().impulse_response(400, noise=NOISE, seed=0))
    heavy = [k for k, g in enumerate(c.groups) if g.damping > 0.1]
    assert len(heavy) == 1
    assert "heavy damping" in {x.name for x in c.trust[heavy[0]].causes}


def test_a_close_pair_is_named() -> None:
    c = run(systems.close4().impulse_response(300, noise=NOISE, seed=0))
    named = [k for k, t in enumerate(c.trust) if "close pair" in {x.name for x in t.causes}]
    assert named == [2, 3]  # 5.150 and 5.159 Hz; the other pair lies 2.8 % apart, half bandwidths 1.2 %


@pytest.mark.slow
@pytest.mark.parametrize("make", [chain, chain_lines])
@pytest.mark.parametrize("largest", [4, 8])
def test_modes_that_too_few_orders_hide_are_found_in_what_these_leave(make, largest: int) -> None:  # type: ignore[no-untyped-def]
    """So more orders do not change what is reported, and no order is to blame."""
    c = run(make(), range(2, largest + 1, 2))
    assert np.allclose(c.modes.frequencies, systems.chain5().modes().frequencies, rtol=1e-3)
    assert "order too low" not in {x.name for x in c.findings}


@pytest.mark.parametrize("largest", [4, *(pytest.param(n, marks=pytest.mark.slow) for n in (6, 8))])
def test_too_low_an_order_of_ambient_data_is_named_and_nothing_is_trusted(largest: int) -> None:
    record = systems.chain5().simulate(inputs="ambient", samples=20000, sampling_rate=20.0, seed=0)
    c = run(estimate_correlation(record), range(2, largest + 1, 2))
    assert "order too low" in {x.name for x in c.findings}
    assert not any(t.trusted for t in c.trust)


def test_a_mode_that_hardly_shows_is_called_weak() -> None:
    """The fifth mode is scaled down until it makes up little of the response at its frequency; the noise is as low as at 60 dB."""
    modes = systems.chain5().modes()
    part = np.array(modes.participation)
    part[4] *= 0.03
    c = run(systems.add_noise(replace(modes, participation=part).impulse_response(400, 20.0), 0.001, 0))
    weak = [k for k, t in enumerate(c.trust) if "weak mode" in {x.name for x in t.causes}]
    assert [round(c.groups[k].frequency, 1) for k in weak] == [round(float(modes.frequencies[4]), 1)]


def test_no_channel_is_blamed_for_what_real_poles_carry() -> None:
    c = run(systems.over4().impulse_response(600, noise=NOISE, seed=0))
    assert not c.findings


@pytest.mark.slow
def test_a_noisy_channel_is_named_bad() -> None:
    clean = chain_lines()
    values = np.array(clean.values)
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((2, *values[:, 2].shape)) * np.std(values[:, 2]) * 0.5
    values[:, 2] += noise[0] + 1j * noise[1]
    assert channels(run(replace(clean, values=values)), "bad channel") == {"4:+X"}
