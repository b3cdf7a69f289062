"""Modes in records with inputs refined on the records' own lines: exact without noise, at the bound with it, for any runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms
from benchmarks.records.shaker import shaker
from modalscope.data.mode_fields import joined
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records, as_records
from modalscope.numerics.functions.poles import poles_from
from modalscope.selection.judging import refine
from modalscope.selection.likelihood.descent import Astray
from modalscope.selection.likelihood.driven import whitened_records
from modalscope.selection.likelihood.information import normal
from tests.selection.judging.driven_bound import record_bound
from tests.support import match_poles, random_system, refused


def runs_of(model: ms.StateSpace, lengths: list[int], seed: int = 0, noise: float = 0.0) -> Records:
    """White inputs, unknown states at either end of every run."""
    rng = np.random.default_rng(seed)
    runs = []
    for samples in lengths:
        u = rng.standard_normal((samples + 50, model.B.shape[1]))
        y = model.simulate(u)[50:]
        y = y + noise * y.std(axis=0) * rng.standard_normal(y.shape)
        runs.append(ms.Signals(outputs=y, inputs=u[50:], sampling_rate=1.0))
    return Records(runs=tuple(runs))


def system(outputs: int, inputs: int) -> ms.StateSpace:
    rng = np.random.default_rng(3)
    return random_system(rng, outputs=outputs, inputs=inputs, modes=3, damping=(0.005, 0.03), direct=True)


def started(records: Records, order: int = 6) -> ms.ModalModel:
    """Modes of the records, astray by part of their decay rate."""
    modes = ms.identify(records, route="records", order=order).modes
    turned = np.exp(2j * np.pi * np.random.default_rng(1).uniform(size=len(modes)))
    return replace(modes, poles=modes.poles + 0.05 * np.abs(modes.poles.real) * turned)


@pytest.mark.slow
@pytest.mark.parametrize(("outputs", "inputs"), [(4, 1), (3, 2), (2, 3), (1, 1)])
@pytest.mark.parametrize("lengths", [[600], [500, 350], [300, 420, 250, 510]])
def test_without_noise_it_goes_back_to_the_truth(outputs, inputs, lengths):
    model = system(outputs, inputs)
    records = runs_of(model, lengths)
    found = ms.refine(records, started(records))
    assert found.converged
    # the misfit is held to 1e-14 of the data, and poles are seen at about 1e-3 of that
    assert match_poles(found.poles, np.log(model.poles)).frequency_error < 1e-10
    assert np.allclose(found.feedthrough, model.D, atol=1e-8 * np.abs(model.D).max())
    assert found.participation.shape == (3, inputs)


def test_the_slope_and_the_information_are_those_of_the_squared_misfit():
    """Second route: differences of the squared misfit along every unknown."""
    records = record_spectra(runs_of(system(3, 2), [300, 250], noise=0.05))
    rng = np.random.default_rng(0)
    poles = np.array([-0.02 + 0.5j, -0.01 + 1.1j])
    sides = rng.standard_normal((2, 4)) + 1j * rng.standard_normal((2, 4))
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    problem = whitened_records(
        records, np.zeros(0), records.refined_powers, np.ones(2 * records.count), np.array([1.0, 2.0, 0.5])
    )
    point = problem.at(poles, sides)
    slope = normal(point, point.fitted())[1]

    def cost(step: np.ndarray) -> float:
        there = problem.at(*point.moved((step[::2] + 1j * step[1::2]).reshape(2, 4)))
        return there.cost(there.fitted())

    e = 1e-6 * np.eye(slope.size)
    # the cost falls by twice slope times step; differences of 1e-6 leave 1e-6 of it
    numeric = np.array([(cost(-each) - cost(each)) / (2 * each.sum()) / 2 for each in e])
    assert np.allclose(numeric, slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max())


def test_a_run_may_have_one_input_alone():
    model = system(3, 2)
    each = [runs_of(replace(model, B=model.B * keep, D=model.D * keep), [400]).runs[0] for keep in np.eye(2)]
    one, two = (run.select(inputs=[k]) for k, run in enumerate(each))
    records = as_records([one, two])
    found = ms.refine(records, started(records))
    assert match_poles(found.poles, np.log(model.poles)).frequency_error < 1e-10


def test_runs_are_the_groups_that_tell_how_far_the_test_repeats():
    records = runs_of(system(3, 1), [300] * 8, noise=0.05)
    begun = started(records)
    found = ms.refine(records, begun)
    # equal runs differ by their noise alone: eight of them know a deviation to a quarter, six ratios scatter by two of these and more
    for between, noise in (
        (found.frequencies_repeatability, found.frequencies_std),
        (found.damping_ratios_repeatability, found.damping_ratios_std),
    ):
        assert np.all((between / noise > 0.3) & (between / noise < 2))
    assert ms.refine(records, begun, groups=None).frequencies_repeatability is None
    refused("8 labels, one per run", ms.refine, records, begun, groups=["a", "b"])


@pytest.mark.parametrize("lengths", [pytest.param([900], marks=pytest.mark.slow), [500, 350]])
def test_a_mode_that_is_missed_is_found_in_what_the_others_leave(lengths):
    records = runs_of(system(4, 2), lengths, noise=0.02)
    modes = ms.identify(records, route="records", order=6).modes
    whole = ms.refine(records, modes)
    for missed in range(3):
        found = ms.refine(records, modes.take(np.delete(np.arange(3), missed)), complete=True)
        # the same optimum, where the descent stops
        assert np.allclose(np.sort(found.frequencies), whole.frequencies, rtol=1e-6)
        assert np.allclose(found.damping_ratios[np.argsort(found.frequencies)], whole.damping_ratios, rtol=1e-4)
        assert "Modes added" in " ".join(str(note) for note in found.notes)


@pytest.mark.slow
def test_a_mode_under_coloured_noise_is_found_beside_what_is_left_around_it():
    """Noise that grows towards 0 Hz has the highest peaks of the residual; the mode is the highest relative to its surroundings."""
    records = runs_of(system(4, 2), [3000])
    (run,) = records.runs
    rng = np.random.default_rng(5)
    walk = lfilter([1], [1, -0.98], rng.standard_normal(run.outputs.shape), axis=0)
    noisy = Records(
        runs=(replace(run, outputs=run.outputs + 0.02 * run.outputs.std(axis=0) * walk / walk.std(axis=0)),)
    )
    modes = ms.identify(records, route="records", order=6).modes
    found = ms.refine(noisy, modes.take([0, 1]), complete=True)
    assert len(found) == 3
    assert found.frequencies == pytest.approx(modes.frequencies, rel=1e-3)
    assert f"Modes added at peaks of the residual: {found.frequencies[2]:.5g} Hz" in [str(note) for note in found.notes]


def test_noise_gives_no_mode_to_add():
    """The bar lets noise pass once in a thousand searches."""
    records = runs_of(system(4, 2), [900], noise=0.02)
    modes = ms.identify(records, route="records", order=6).modes
    assert len(ms.refine(records, modes, complete=True)) == 3


@pytest.mark.slow
def test_analyze_refines_records_by_any_route_and_under_unmeasured_forces():
    test = shaker(0, modes=4, outputs=4, seconds=4.0)
    result = ms.analyze(test.signals)
    assert result.modes.unrefined is not None
    assert result.modes.converged
    # four deviations; forces are held eight times a sample, which turns residues and moves no pole
    assert np.all(np.abs(result.modes.damping_ratios - test.damping_ratios) < 4 * result.modes.damping_ratios_std)
    assert np.all(np.abs(result.modes.frequencies - test.frequencies) < 4 * result.modes.frequencies_std)
    past = ms.analyze(test.signals, route="subspace").modes
    hidden = ms.analyze(shaker(0, modes=4, outputs=4, seconds=4.0, unmeasured=0.5).signals, route="records").modes
    # neither the way of identification nor unmeasured forces withhold refinement
    assert past.unrefined is not None
    assert hidden.unrefined is not None


def ratios(seed: int) -> np.ndarray:
    """Errors over the bound of the diagram's modes and of the refined ones: (2, frequency and damping, modes)."""
    test = shaker(seed)
    refined = ms.analyze(test.signals).modes
    assert len(refined) == test.frequencies.size, seed
    assert refined.unrefined is not None, [str(note) for note in refined.notes]
    records = record_spectra(
        as_records(test.signals)
    ).continuous()  # what was measured through filters is of a continuous structure
    poles = poles_from(test.frequencies, test.damping_ratios)
    sides, _ = records.basis(poles).fit_participation(test.shapes.astype(complex))
    rms = np.sqrt(np.mean(test.signals.outputs**2, axis=0))
    least = np.stack(record_bound(records, poles, test.shapes, sides, 0.01 * rms / np.sqrt(2)))
    truth = np.stack([test.frequencies, test.damping_ratios])
    return np.stack(
        [(np.stack([m.frequencies, m.damping_ratios]) - truth) / least for m in (refined.unrefined, refined)]
    )


@pytest.mark.study("inputs")
def test_the_error_is_that_of_the_bound_on_the_shaker_test(study) -> None:
    """24 records of twelve modes: 288 errors tell a root mean square to 4 %."""
    errors = np.array([ratios(seed) for seed in range(24)])
    rms = np.sqrt(np.mean(errors**2, axis=(0, 3)))
    each = np.sqrt(np.mean(errors**2, axis=0))
    table = study("shaker test, 12 modes, 20 outputs, 2 forces, 40 dB", "24 records, seeds 0 to 23")
    for name, whole, modes, most in zip(("selected", "refined"), rms, each, (None, 1.15), strict=True):
        for value, what in zip(whole, ("f", "zeta"), strict=True):
            table.row(f"error over the bound, {what}, {name}", value, most=most, form=".2f")
        table.row(f"error over the bound, zeta, mode by mode, {name}", modes[1], form=".2f")
    assert not table.missed


def test_a_mode_that_is_added_and_leaves_for_the_place_of_another_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    model = system(3, 1)
    records = runs_of(model, [400], noise=1e-3)
    start = started(records)
    own = start.take([0])
    # ten half bandwidths beside a mode there is nothing: it would be fitted to that mode
    beside = replace(own, poles=own.poles.real + 1j * (own.poles.imag - 10 * own.poles.real))
    monkeypatch.setattr(refine, "completed", lambda task, modes, settled: joined([modes, beside]))
    found = refine.refinement(records, start, complete=True, confined=True)
    assert found.added == 0
    assert len(found.start) == len(start)
    # of a mode that was given the place is told
    moved = replace(start, poles=np.append(start.poles[:-1], beside.poles))
    with pytest.raises(Astray):
        refine.refinement(records, moved, complete=True, confined=True)


@pytest.mark.parametrize("further", [pytest.param("still", marks=pytest.mark.slow), "sum"])
def test_an_input_that_tells_nothing_changes_no_deviation(further: str) -> None:
    run = runs_of(system(4, 2), [1000], noise=0.05).runs[0]
    more = np.zeros(len(run.inputs)) if further == "still" else run.inputs.sum(axis=1)
    beside = ms.Signals(outputs=run.outputs, inputs=np.column_stack([run.inputs, more]), sampling_rate=1.0)
    one, other = (ms.refine(data, ms.identify(data, route="records", order=6).modes) for data in (run, beside))
    for name in ("frequencies", "frequencies_std", "damping_ratios_std", "shapes_std"):
        assert np.allclose(getattr(other, name), getattr(one, name), rtol=1e-5), name
