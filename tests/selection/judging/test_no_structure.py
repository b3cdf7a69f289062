"""Lines of machines and noise alone are no modes, unless asked; and an empty result says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging.evidence import Candidate
from modalscope.selection.judging.no_structure import (
    CORRELATED,
    with_note_on_errors,
    with_objections_of_record,
    without_unforced,
)
from modalscope.signals.preprocess.bands import driven_share
from modalscope.systems import chain5
from tests.selection.judging.ambient_records import beside_a_machine


@pytest.mark.slow
def test_harmonics_are_listed_and_the_mode_two_per_cent_below_one_is_kept() -> None:
    machine = beside_a_machine(101, 0)
    modes = ms.analyze(machine.record).modes
    assert np.allclose(modes.frequencies, machine.structure.frequencies, rtol=0.01)
    assert np.allclose([h.frequency for h in modes.harmonics], machine.lines, rtol=0.001)
    assert [h.order for h in modes.harmonics] == [1, 2, 3]


@pytest.mark.slow
def test_a_harmonic_is_reported_when_it_is_asked_for() -> None:
    machine = beside_a_machine(101, 0)
    taken = ms.stabilize(machine.record)
    assert "lines removed" in [note.kind for note in taken.notes]
    kept = ms.select(ms.stabilize(ms.estimate_correlation(machine.record)), frequencies=machine.lines[1:2])
    assert np.allclose(kept.frequencies, machine.lines[1], rtol=0.001)
    with pytest.raises(ms.DataError, match=r"rotating-machine line.*\n.*estimate_correlation\(record\)"):
        ms.select(taken, take=machine.lines[1:2])


@pytest.mark.slow
def test_modes_beside_a_wandering_machine_are_those_of_the_structure() -> None:
    machine = beside_a_machine(78107, 0.003)
    modes = ms.analyze(machine.record).modes
    # one mode lies 2 % below a line that is as strong as all vibration
    assert np.allclose(modes.frequencies, machine.structure.frequencies, rtol=0.01)
    assert [h.order for h in modes.harmonics] == [1, 2, 3]


def test_noise_alone_gives_no_mode_and_says_so() -> None:
    record = ms.Signals(outputs=np.random.default_rng(1).standard_normal((10_000, 3)), sampling_rate=50.0)
    result = ms.analyze(record)
    assert len(result.modes) == 0
    why = [note for note in result.notes if note.kind == "no modes"]
    assert len(why) == 1
    assert "Only noise in" in str(why[0])


def test_an_empty_result_of_any_data_says_why() -> None:
    response = ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)
    diagram = ms.stabilize(response, orders=[2])
    modes = ms.select(diagram, refuse=list(ms.select(diagram).frequencies) or ())
    assert len(modes) or [note.kind for note in modes.notes][-1] == "no modes"


def test_modes_of_samples_that_were_not_weighed_against_noise_are_told_to_be_so() -> None:
    response = chain5().state_space(dt=0.05).impulse_response(200)
    noise = 0.01 * response.values.std() * np.random.default_rng(0).standard_normal(response.values.shape)
    diagram = ms.stabilize(replace(response, values=response.values + noise), orders=range(2, 22, 2))
    weighed = ms.select(diagram)
    assert CORRELATED not in [note.kind for note in weighed.notes]
    counted = replace(weighed, reasons=tuple({"text": ""} for _ in weighed.reasons), left_out=())
    assert [note.kind for note in with_note_on_errors(counted, diagram).notes][-1] == CORRELATED
    assert CORRELATED not in [note.kind for note in with_note_on_errors(counted.take([]), diagram).notes]


def test_below_the_height_that_noise_reaches_there_is_no_peak_in_the_spectra() -> None:
    record = chain5().simulate(inputs="ambient", duration=60, sampling_rate=20.0, seed=0)
    diagram = replace(ms.stabilize(record, orders=[10, 12, 14]), notes=())
    heights = [{"peak_height": 1.0}, {"peak_height": 0.999}, {}]
    found = with_objections_of_record(diagram, [Candidate(np.zeros(0, int), 3.2, 0.01, facts, ()) for facts in heights])
    assert [c.against for c in found] == [(), ("no peak in the spectra of any combination of channels",), ()]


def test_a_mode_beside_a_wandering_line_is_wider_than_its_wandering() -> None:
    record = chain5().simulate(inputs="ambient", duration=60, sampling_rate=20.0, seed=0)
    line = ms.Note("harmonic", {"frequency_hz": 3.256, "spread_hz": 0.012, "level": 0.5}, "a line")
    diagram = replace(ms.stabilize(record, orders=[10, 12, 14]), notes=(line,))
    # half the width of a normal distribution of .012 Hz is .014 Hz; .6 % of 3.224 Hz is .019 Hz
    close = [Candidate(np.zeros(0, int), 3.224, damping, {}, ()) for damping in (0.006, 0.004)]
    mode, part_of_line = with_objections_of_record(diagram, close)
    assert mode.against == ()
    assert part_of_line.against == ("harmonic of a rotating machine: a line",)


def test_where_forces_have_no_power_no_mode_is_listed() -> None:
    """Forces that end at 6 Hz of 10; what a run begins and ends with fills the lines above it with 1e-5 of their power."""
    record = chain5().simulate(inputs="white", duration=200, sampling_rate=20.0, seed=0)
    U = np.fft.rfft(record.inputs, axis=0)
    U[np.fft.rfftfreq(record.samples, 1 / 20.0) > 6.0] = 0
    cut = slice(500, 3500)
    forces = np.fft.irfft(U, record.samples, axis=0)
    outputs = np.random.default_rng(0).standard_normal((3000, 2))
    diagram = ms.stabilize(ms.Signals(outputs=outputs, inputs=forces[cut], sampling_rate=20.0), orders=[4, 6, 8])
    share = driven_share(diagram.response, np.array([3.0, 5.8, 6.2, 8.0]))
    assert np.all(share[:2] > 0.1)
    assert np.all(share[2:] < 1e-9)
    f = np.array([5.8, 6.2, 8.0, 9.0])
    zeta = np.full(4, 0.01)
    modes = ms.ModalModel(
        poles=poles_from(f, zeta),
        shapes=np.eye(2)[:, [0, 1, 0, 1]],
        frequencies_std=1e-4 * f,
        damping_ratios_std=np.array([1.0, 1.0, 0.01, 1.0]) * zeta,
    )
    # of doubtful ones, those where forces act stay, and of those where none act, one that is known
    found = without_unforced(diagram, modes)
    assert found.frequencies == pytest.approx([5.8, 8.0])
    assert [c.frequency for c in found.left_out] == pytest.approx([6.2, 9.0])
    assert {c.reason for c in found.left_out} == {"forces have no power at its frequency"}
