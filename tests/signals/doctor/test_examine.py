"""The measurement doctor: nothing on clean data, and each fault by its name and channel."""

from dataclasses import replace

import numpy as np
import pytest

from modalscope.data import DataError, FrequencyResponse, Signals
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.findings import KINDS
from modalscope.signals.preprocess import estimate_frf
from modalscope.systems import chain5, close4, heavy4, iasc_asce, over4, ring5

STRUCTURES = [chain5, close4, heavy4, over4, ring5]
QUANTITIES = ["displacement", "velocity", "acceleration"]


def kinds(data):
    return [(finding.kind, finding.channels) for finding in examine(data)]


def shaker(structure=None, quantity="acceleration", **options):
    structure = chain5() if structure is None else structure
    return structure.simulate(samples=20_000, sampling_rate=20.0, quantity=quantity, noise=0.01, **options)


def exact(quantity="acceleration"):
    return chain5().frequency_response(np.linspace(0.02, 9.9, 2000), quantity=quantity)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("build", STRUCTURES)
def test_clean_responses_and_records_have_no_findings(build, quantity):
    structure = build()
    assert kinds(structure.frequency_response(np.linspace(0.02, 9.9, 1000), quantity=quantity)) == []
    assert kinds(shaker(structure, quantity, seed=1)) == []


@pytest.mark.slow
@pytest.mark.parametrize("build", [*STRUCTURES, iasc_asce])
def test_clean_ambient_records_have_no_findings(build):
    assert kinds(build().simulate(inputs="ambient", samples=20_000, sampling_rate=20.0, noise=0.05)) == []


def change(record, i, samples, side="outputs"):
    array = np.array(getattr(record, side))
    array[..., i] = samples
    return replace(record, **{side: array})


def test_a_dead_channel():
    assert kinds(change(shaker(), 2, 0.5)) == [("dead", ("4:+X",))]
    assert kinds(change(shaker(), 0, 0.0, "inputs")) == [("dead", ("2:+X",))]


def test_a_clipped_channel():
    record = shaker()
    limit = 2 * record.outputs[:, 1].std()
    found = examine(change(record, 1, np.clip(record.outputs[:, 1], -limit, limit)))
    assert ("clipped", ("2:+X",)) in [(f.kind, f.channels) for f in found]
    assert "wider range" in found[0].change


def test_a_square_wave_is_not_clipped():
    u = np.sign(np.random.default_rng(0).standard_normal((20_000, 2)))
    assert kinds(chain5().simulate(inputs=u, sampling_rate=20.0, noise=0.01)) == []


def test_a_noisy_channel():
    record = shaker()
    noise = np.random.default_rng(0).standard_normal(20_000) * 3 * record.outputs[:, 3].std()
    assert kinds(change(record, 3, record.outputs[:, 3] + noise)) == [("noisy", ("5:+X",))]
    ambient = chain5().simulate(inputs="ambient", samples=20_000, sampling_rate=20.0)
    assert kinds(change(ambient, 0, noise)) == [("noisy", ("1:+X",))]


def test_a_channel_recorded_twice():
    record = shaker()
    assert kinds(change(record, 3, -2 * record.outputs[:, 0]))[0] == ("duplicate", ("1:+X", "5:+X"))


def test_exchanged_outputs_break_reciprocity():
    frf = exact()
    # inputs at 2 and 5, which are outputs 1 and 3: exchange their columns
    swapped = replace(frf, values=frf.values[:, [0, 3, 2, 1]])
    found = [f for f in examine(swapped) if f.kind == "swapped"]
    assert found
    assert set(found[0].channels) <= {"2:+X", "5:+X"}


@pytest.mark.parametrize("data", [exact, lambda: estimate_frf(shaker())])
def test_a_turned_sensor_is_seen_at_a_driving_point(data):
    frf = data()
    turned = replace(frf, values=frf.values * np.array([1, -1, 1, 1])[:, None])
    found = kinds(turned)
    assert ("polarity", ("2:+X",)) in found or ("polarity", ("2:+X", "5:+X")) in found


def test_labels_of_opposite_direction_are_no_fault():
    frf = exact()
    turned = replace(
        frf, values=frf.values * np.array([1, -1, 1, 1])[:, None], output_dofs=("1:+X", "2:-X", "4:+X", "5:+X")
    )
    assert kinds(turned) == []


@pytest.mark.parametrize("true", QUANTITIES)
@pytest.mark.parametrize("given", QUANTITIES)
def test_a_wrong_quantity_is_seen_from_slope_and_driving_point(true, given):
    frf = replace(exact(true), quantity=given)
    found = [f for f in examine(frf) if f.kind == "wrong quantity"]
    if true == given:
        assert found == []
    elif {true, given} == {"displacement", "acceleration"} and not found:
        # 0 below the first resonance is a free structure's acceleration, too: then the sign at the driving points tells
        assert any(f.kind == "polarity" for f in examine(frf))
    else:
        assert all(f'quantity="{true}"' in f.change for f in found)
        assert found


def test_responses_that_are_not_reciprocal():
    frf = exact()
    values = np.array(frf.values)
    values[:, 1, 1] = frf.values[:, 0, 0] * 3
    assert "reciprocity" in [kind for kind, _ in kinds(replace(frf, values=values))]


def hits(faults=()):
    """Five hits, one a run, with two per cent of noise on nothing but the sensors."""
    rng = np.random.default_rng(0)
    u = np.zeros((5, 8000, 1))
    pulse = np.sin(np.pi * np.arange(1, 6) / 6)
    for k in range(5):
        u[k, 50:55, 0] = (1 + 0.1 * k) * pulse
        if ("double", k) in faults:
            u[k, 80:85, 0] = 0.4 * pulse
    record = chain5().simulate(inputs=u, at=[1], sampling_rate=20.0, noise=1e-3)
    forces = np.array(record.inputs) + 1e-5 * rng.standard_normal(u.shape)
    for fault, k in faults:
        if fault == "overload":
            forces[k, 51:54] = 20.0
    return replace(record, inputs=forces)


def test_clean_hits():
    assert kinds(hits()) == []


def test_an_overloaded_hit_is_named_and_left_out():
    record = hits([("overload", 2)])
    found = examine(record)
    assert [f.kind for f in found] == ["overload"]
    assert "hit 3" in found[0].reason
    assert "left out: 3" in estimate_frf(record).processing[-1].replace("hits 1, 2, 4, 5 (", "")


def test_a_double_hit_is_named():
    found = examine(hits([("double", 1)]))
    assert [f.kind for f in found] == ["double hit"]
    assert "hit 2" in found[0].reason
    assert "hits=[1, 3, 4, 5]" in found[0].change


def test_a_run_that_ends_too_early_leaks():
    record = hits()
    short = replace(record, outputs=record.outputs[:, :400], inputs=record.inputs[:, :400])
    found = [f for f in examine(short) if f.kind == "leakage"]
    assert {f.channels[0] for f in found} == set(record.output_dofs)
    assert "exponential" in found[0].change
    assert "route records" in found[0].change
    assert "route decays" in found[0].change  # in words: where only files are looked at there is no such option


def test_a_record_too_short_for_its_damping():
    """The first mode of chain5 decays in about a minute."""
    record = chain5().simulate(inputs="ambient", samples=4000, sampling_rate=20.0, quantity="displacement")
    found = [f for f in examine(record) if f.kind == "short record"]
    assert found
    assert "0.9" in found[0].reason


@pytest.mark.slow
def test_a_run_with_other_sign_or_exchanged_outputs():
    record = shaker(runs=4, at=[1])
    outputs = np.array(record.outputs)
    outputs[2, :, 0] *= -1
    assert ("polarity", ("1:+X",)) in kinds(replace(record, outputs=outputs))
    outputs = np.array(record.outputs)
    outputs[1, :, [0, 2]] = outputs[1, :, [2, 0]]
    assert ("swapped", ("1:+X", "4:+X")) in kinds(replace(record, outputs=outputs))


def test_findings_read_as_sentences_of_known_kinds():
    finding = examine(change(shaker(), 2, 0.5))[0]
    assert finding.kind in KINDS
    assert str(finding).startswith("dead: 4:+X: it never changes. Check cable")


def test_low_coherence_of_a_response_from_a_file():
    frf = estimate_frf(shaker())
    low = replace(frf, coherence=np.full((frf.lines, 4), 0.4))
    assert [kind for kind, _ in kinds(low)].count("low coherence") == 4


def test_resolution_of_estimates_from_short_segments():
    frf = estimate_frf(shaker(quantity="displacement"), segment=400)
    exact_lines = FrequencyResponse(values=frf.values, frequencies=frf.frequencies)
    assert "short record" not in [kind for kind, _ in kinds(exact_lines)]


def test_what_cannot_be_examined_is_said():
    with pytest.raises(
        DataError,
        match="expected FrequencyResponse, ImpulseResponse, Signals, StoredSignals, StoredResponse, Records or Setups, got list",
    ):
        examine([1, 2])


def test_more_channels_than_samples_are_rows_taken_for_columns() -> None:
    record = Signals(outputs=np.random.default_rng(0).standard_normal((3, 40)), sampling_rate=10.0)
    (finding,) = examine(record)
    assert (finding.kind, "outputs=y.T" in finding.change) == ("transposed", True)
    assert "transposed" not in {one.kind for one in examine(Signals(outputs=record.outputs.T, sampling_rate=10.0))}


def test_a_hum_is_no_resonance_that_decays_slowly():
    """The line lasts as long as the record; the modes of the chain are damped by 1 % and more."""
    record = chain5().simulate(inputs="ambient", samples=20000, sampling_rate=20.0, quantity="acceleration")
    hum = 5 * np.std(record.outputs) * np.sin(2 * np.pi * 5.0 * np.arange(20000) / 20.0)
    loud = replace(record, outputs=record.outputs + hum[:, None])
    assert [f.kind for f in examine(loud)] == [f.kind for f in examine(record)] == []


@pytest.mark.parametrize("samples", range(2, 12))
def test_a_record_of_a_few_samples_is_examined_without_a_fault(samples: int) -> None:
    assert [f.kind for f in examine(Signals(outputs=np.sin(np.arange(samples))[:, None], sampling_rate=200.0))] == []
