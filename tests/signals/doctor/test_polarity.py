"""Signs: one rule for lines and samples, from driving points and reciprocity."""

from dataclasses import replace

import numpy as np
import pytest

from modalscope.signals.doctor.examine import examine
from modalscope.signals.doctor.findings import dead_channels, sides_of
from modalscope.signals.doctor.polarity import check_polarity
from modalscope.systems import chain
from tests.support import FIVE

QUANTITIES = ["displacement", "velocity", "acceleration"]
LINES = np.linspace(0.02, 9.9, 1000)
#: A chain whose three masses are all measured and all driven.
ALL = chain([1.0] * 3, [400.0] * 3, [0.4] * 3)


def lines(structure=ALL, quantity="acceleration", **options):
    return structure.frequency_response(LINES, quantity=quantity, **options)


def samples(structure=ALL, quantity="acceleration", **options):
    return structure.impulse_response(600, sampling_rate=20.0, quantity=quantity, **options)


def turned(response, outputs=(), inputs=()):
    values = np.array(response.values)
    for i in outputs:
        values[:, i] *= -1
    for j in inputs:
        values[:, :, j] *= -1
    return replace(response, values=values)


def found(response):
    return [(f.kind, f.channels) for f in check_polarity(response)]


def kinds(data):
    return [(f.kind, f.channels) for f in examine(data)]


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", FIVE)
@pytest.mark.parametrize("make", [lines, samples])
def test_a_structure_takes_energy_whatever_is_measured(make, name, quantity):
    """At 20 dB, on lines and on samples, a held input's too."""
    structure = FIVE[name]()
    for seed in range(3):
        assert found(make(structure, quantity, noise=0.1, seed=seed)) == []
    assert found(structure.impulse_response(600, sampling_rate=20.0, quantity=quantity, input="dirac")) == []


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_lines_of_a_sampled_system_are_taken_at_the_middle_of_the_held_step(quantity):
    """Up to the Nyquist frequency, where half a sample is a quarter of a turn."""
    model = ALL.state_space(dt=1 / 12.0, quantity=quantity)  # modes up to 5.7 Hz
    dofs = ("1", "2", "3")
    response = model.frequency_response(
        np.linspace(0.02, 5.99, 800), quantity=quantity, output_dofs=dofs, input_dofs=dofs
    )
    assert found(response) == []
    assert found(turned(response, [1])) == [("polarity", ("2",))]


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("make", [lines, samples])
@pytest.mark.parametrize("side", ["outputs", "inputs"])
def test_one_turned_sensor_or_hammer_is_one_finding(make, side, quantity):
    """Reciprocity would show it again at two pairs: what the driving point says explains them."""
    response = turned(make(quantity=quantity, noise=0.1, seed=0), **{side: [1]})
    assert found(response) == [("polarity", (response.output_dofs[1],))]


@pytest.mark.parametrize("make", [lines, samples])
def test_without_a_quantity_the_channel_turned_against_most_others_is_it(make):
    response = replace(turned(make(noise=0.1, seed=0), [2]), quantity=None)
    assert found(response) == [("polarity", (response.output_dofs[2],))]
    pair = response.select(outputs=[1, 2], inputs=[1, 2])
    assert found(pair) == [("polarity", pair.output_dofs)]  # of two either may be it


def test_a_sensor_and_its_force_both_turned_are_the_other_two_turned():
    """H_ii stays, H_ij and H_ji turn together: neither energy nor reciprocity can tell, and nothing is said."""
    assert found(turned(lines(), [0], [0])) == []


def test_correlations_cannot_show_a_sign():
    response = replace(samples(), kind="correlation")
    assert found(turned(response, [1])) == []


def test_examine_applies_the_same_rule_to_samples():
    response = turned(samples(noise=0.1, seed=0), [1])
    assert kinds(response) == [("polarity", (response.output_dofs[1],))]


def test_dead_inputs_of_a_response_are_findings_too():
    response = lines()
    values = np.array(response.values)
    values[:, :, 1] = 0
    response = replace(response, values=values)
    dead = [(side, f.channels) for side, x, labels in sides_of(response) for f in dead_channels(x, labels)]
    assert dead == [("input", (response.input_dofs[1],))]


def test_a_dead_output_with_the_label_of_a_live_input_leaves_the_record_to_be_examined():
    """Only the output is at rest: the force at the same place still drives, and a noisy output is still seen."""
    record = ALL.simulate(samples=20_000, sampling_rate=20.0, noise=0.01)
    outputs = np.array(record.outputs)
    outputs[:, 0] = 0
    assert kinds(replace(record, outputs=outputs)) == [("dead", ("1:+X",))]
    outputs[:, 1] *= -1
    assert kinds(replace(record, outputs=outputs)) == [("dead", ("1:+X",)), ("polarity", ("2:+X",))]


def test_a_dead_input_that_is_no_output_is_a_finding_and_no_failure():
    record = FIVE["chain5"]().simulate(samples=20_000, sampling_rate=20.0, noise=0.01)
    inputs = np.array(record.inputs)
    inputs[:, 0] = 0
    record = replace(record, inputs=inputs, input_dofs=("shaker 1", "shaker 2"))
    assert kinds(record) == [("dead", ("shaker 1",))]


def scattered(response, seed, level):
    """A response with noise of one size on all lines, and its variance."""
    noise = np.random.default_rng(seed).standard_normal((2, *response.values.shape)) * level / np.sqrt(2)
    values = response.values + noise[0] + 1j * noise[1]
    return replace(response, values=values, variance=np.full(values.shape, level**2))


@pytest.mark.parametrize("seed", range(3))
def test_a_turned_driving_point_is_told_from_an_exchanged_one_under_noise_too(seed):
    exact = turned(lines(), outputs=[1])
    level = 0.7 * np.sqrt(np.mean(np.abs(exact.values) ** 2))
    noisy = scattered(exact, seed, level)
    assert ("polarity", ("2:+X",)) in found(noisy)
    assert "swapped" not in [kind for kind, _ in found(noisy)]


def test_a_difference_on_a_line_or_two_is_leakage_and_not_a_want_of_reciprocity():
    exact = scattered(lines(), 0, 1e-4)
    values = np.array(exact.values)
    top = int(np.argmax(np.abs(values[:, 0, 1])))
    values[top - 1 : top + 2, 0, 1] *= 3.0  # most of the power, on three lines
    assert found(replace(exact, values=values)) == []
    everywhere = np.array(exact.values)
    everywhere[:, 0, 1] *= 3.0
    assert [kind for kind, _ in found(replace(exact, values=everywhere))] == ["reciprocity"]
