"""Spoilt records and responses are named, sound ones are not: a short form, and a study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms
from benchmarks.records import faulty_records
from benchmarks.records.faulty_records import FAULTS, is_found, sound
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.delays import delayed, exchanged
from modalscope.signals.doctor.prediction import _gaps, prediction_of
from modalscope.signals.doctor.responses import no_complex_values
from modalscope.signals.doctor.samples import wraps
from modalscope.signals.preprocess.impacts import clipped_samples
from modalscope.systems import chain5, over4
from tests.studies import Study


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_strong_fault_is_found(name: str) -> None:
    fault = FAULTS[name]
    assert is_found(fault, 1, fault.strengths[2])


@pytest.mark.slow
def test_sound_records_of_every_kind_are_not_named() -> None:
    for k, (name, record) in enumerate(sound()):
        if k % 5 == 2:
            assert examine(record) == (), name


@pytest.mark.study("checks")
@pytest.mark.parametrize("name", FAULTS)
def test_faults_that_move_a_mode_by_its_deviation_are_found(name: str, study: Callable[[str, str], Study]) -> None:
    """Strengths and their effects are listed in docs/validation/spoilt-data.md."""
    fault = FAULTS[name]
    table = study(f"fault: {name}, strength {fault.strengths[2]:g}", "10 records, seeds 0 to 9")
    count = sum(is_found(fault, seed, fault.strengths[2]) for seed in range(10))
    table.row("found, of 10", count, least=faulty_records.FOUND.get(name, 10))
    assert not table.missed


@pytest.mark.study("checks")
def test_forty_sound_records_are_not_named(study: Callable[[str, str], Study]) -> None:
    found = {name: examine(record) for name, record in sound()}
    table = study("sound records of every kind", f"{len(found)} records")
    table.row("records with a finding", sum(map(bool, found.values())), most=0)
    assert {name for name, findings in found.items() if findings} == set()


def test_three_equal_extremes_are_enough_where_the_steps_are_fine() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(5000)
    limit = np.sort(x)[-3]
    assert clipped_samples(np.minimum(x, limit)) == 3
    assert clipped_samples(x) == 0
    assert clipped_samples(np.tile(x, 4)) == 0  # of four periods every level stands there four times


def test_coarse_steps_are_not_clipped() -> None:
    rng = np.random.default_rng(1)
    for bits in range(2, 12):
        x = rng.standard_normal(20_000)
        coarse = np.round(x / np.abs(x).max() * 2**bits) / 2**bits
        assert clipped_samples(coarse) == 0
        clipped = np.clip(coarse, -0.25, 0.25)
        if bits > 4:  # of a few levels the last is not rarer than those before it
            assert clipped_samples(clipped) == np.count_nonzero(np.abs(clipped) == 0.25)


@pytest.mark.parametrize("samples", [-1.5, 0.4, 3.0])
def test_a_delay_is_told_in_seconds_with_its_sign(samples: float) -> None:
    record = faulty_records.late(faulty_records.ambient(0), samples, np.random.default_rng(0))
    (found,) = delayed(record)
    assert found.channels == (record.output_dofs[1],)
    told = float(found.reason.split("s, ")[1].split()[0])
    # delays are told to a thirty-second of a sample
    assert told == pytest.approx(abs(samples), abs=0.1)
    assert ("later" in found.reason) is (samples > 0)


def test_what_dampers_do_is_no_delay() -> None:
    for quantity in ("displacement", "acceleration"):
        record = over4().simulate(inputs="ambient", samples=20_000, sampling_rate=20.0, quantity=quantity, noise=0.02)
        assert delayed(record) == []


def test_a_force_among_the_outputs_is_found_and_named() -> None:
    record = faulty_records.exchanged(faulty_records.shaken(3), 0.0, np.random.default_rng(0))
    (found,) = exchanged(record)
    assert record.output_dofs[1] in found.channels
    assert exchanged(faulty_records.shaken(3)) == []


def test_a_hit_whose_force_lost_its_top_is_told_by_its_outputs() -> None:
    record = faulty_records.overloaded(faulty_records.hit(3), 0.9, np.random.default_rng(0))
    (found,) = examine(record)
    assert found.kind == "overload"
    assert "hit 3: outputs " in found.reason
    assert examine(faulty_records.hit(3)) == ()


def test_noise_of_half_a_channel_is_seen_in_what_nothing_else_tells() -> None:
    record = faulty_records.ambient(1)
    assert examine(record) == ()
    (found,) = examine(faulty_records.noisy(record, 0.5, np.random.default_rng(0)))
    assert found.kind == "noisy"
    assert "is predicted by no other sample" in found.reason


def test_a_burst_that_leaves_most_of_a_record_quiet_does_not_overflow() -> None:
    rng = np.random.default_rng(0)
    for _ in range(600):
        noise = np.convolve(rng.standard_normal(6000), [1, *rng.uniform(0, [1, 0.5])], "same")
        assert wraps(noise * np.r_[np.ones(300), np.full(5700, 1e-3)]).size == 0
    smooth = np.sin(np.arange(600) / 7) * np.r_[np.ones(300), np.full(300, 1e-3)]
    assert wraps((smooth + 0.9) % 1.8 - 0.9).size > 0


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
def test_blocks_that_were_lost_are_found_and_blows_are_none(quantity: str) -> None:
    record = chain5().simulate(inputs="ambient", samples=12_000, sampling_rate=50.0, quantity=quantity, noise=0.001)
    y = record.outputs
    assert _gaps(prediction_of(y[None]).first) == []
    short = y
    for k in range(11_000, 900, -1000):
        short = np.delete(short, np.s_[k : k + 5], axis=0)
    found = _gaps(prediction_of(short[None]).first)
    places = [1000 * (j + 1) - 5 * j for j in range(11)]
    assert sum(any(abs(place - slip.sample) <= 2 for slip in found) for place in places) >= 9
    assert int(np.median([slip.missing for slip in found])) == 5


def test_blows_are_no_missing_samples() -> None:
    structure = chain5()
    given = {"samples": 12_000, "sampling_rate": 50.0, "quantity": "displacement"}
    y = np.array(structure.simulate(inputs="ambient", noise=0.001, **given).outputs)
    blow = structure.free_decay(600, velocity=np.arange(1.0, 6.0), sampling_rate=50.0).values[:, :, 0]
    for k, size in zip(range(1000, 11_000, 1000), np.geomspace(0.3, 30, 10), strict=True):
        y[k : k + 600] += size * blow * y[:1000].std() / np.abs(blow).max()
    assert _gaps(prediction_of(y[None]).first) == []


def test_a_sample_is_weighed_against_all_others_as_the_inverse_covariance_does() -> None:
    rng = np.random.default_rng(5)
    y = np.asarray(lfilter([1.0], [1.0, -1.6, 0.8], rng.standard_normal((6000, 2)), axis=0)) @ [[1.0, 0.4], [0.2, 1.0]]
    noise = 0.3 * y[:, 1].std()
    y[:, 1] += noise * rng.standard_normal(6000)
    part = prediction_of(y[None]).unexplained
    assert part[1] > noise**2 / y[:, 1].var()  # no estimate of a sample is better than its own noise
    assert part[1] < 2 * noise**2 / y[:, 1].var()
    # the spectrum says the same: of one channel alone it is the harmonic mean over the arithmetic one
    a = y[:, :1]
    level = np.abs(1 / np.polyval([0.8, -1.6, 1.0], np.exp(-2j * np.pi * np.arange(4096) / 4096))) ** 2
    assert prediction_of(a[None]).unexplained[0] == pytest.approx(1 / np.mean(1 / level) / np.mean(level), rel=0.5)


def test_one_number_that_was_added_is_told_with_what_it_should_be() -> None:
    record = faulty_records.ambient(2)
    y = np.array(record.outputs)
    y[7000, 1] += 2 * y[:, 1].std()
    (found,) = prediction_of(y[None]).isolated
    assert (found.sample, found.channel) == (7000, 1)
    mean = y[:, 1].mean()
    assert found.value + mean == pytest.approx(y[7000, 1], rel=1e-9)
    assert found.expected + mean == pytest.approx(record.outputs[7000, 1], abs=0.5 * y[:, 1].std())
    assert examine(replace(record, outputs=y)) == ()  # a single one moves nothing


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_sound_phases_are_not_odd(quantity: str) -> None:
    for noise in (0.001, 0.1, 0.5):
        response = chain5().frequency_response(faulty_records.LINES, quantity=quantity, noise=noise, seed=0)
        assert no_complex_values(response) == []


def test_a_finding_about_lines_outside_the_band_says_so() -> None:
    response = faulty_records.outlier(faulty_records.lines(0), 100.0, np.random.default_rng(3))
    (found,) = [finding for finding in examine(response) if finding.kind == "lone lines"]
    lowest = min(found.frequencies)
    assert "no line of the band 0.2 to 0.25 Hz is concerned" in found.beside([(0.2, 0.25)]).reason
    assert found.beside([(lowest - 0.1, lowest + 0.1)]) is found
    assert found.beside([]) is found
    result = ms.analyze(response, band=(0.5, 1.5), orders=[4, 6], refine=False)
    told = [finding.reason for finding in result.findings if finding.kind == "lone lines"]
    assert len(told) == 1
    assert ("no line of the band" in told[0]) is not any(0.5 <= f <= 1.5 for f in found.frequencies)
