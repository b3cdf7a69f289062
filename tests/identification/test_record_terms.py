"""Terms beside the modes of records: as many powers of the frequency as the data show, and intervals that hold with them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter, resample

import modalscope as ms
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import as_records
from modalscope.numerics.checks import RealArray
from modalscope.selection.likelihood.settling import Settled, settle, task_of
from tests.selection.judging.hard import QUANTITIES, random_structure
from tests.selection.judging.test_refine_records import runs_of, system
from tests.studies import Study

RATE, FASTER, HIGHEST = 100.0, 8, 38.0


def record(seed: int, memory: float, seconds: float = 82.0) -> tuple[ms.Signals, ms.ModalModel]:
    """Return a record under band-limited forces, which no sampled system is driven by, and the modes.

    Noise of 40 dB in every output, e(k) = memory e(k - 1) + white. Forces go on before and after the record.
    """
    structure = random_structure([seed, 300])
    p = QUANTITIES.index(structure.quantity)
    s = structure.poles * (HIGHEST / structure.top)
    R = structure.residues / (structure.poles**p)[:, None, None]
    rng = np.random.default_rng([seed, 301])
    samples, beside = round(seconds * RATE), round(20 * RATE)
    u = rng.standard_normal((samples + 2 * beside, R.shape[2]))
    U = np.fft.rfft(resample(u, len(u) * FASTER, axis=0), axis=0)
    x = 2j * np.pi * np.fft.rfftfreq(len(u) * FASTER, 1 / (RATE * FASTER))
    Y = np.zeros((x.size, R.shape[1]), complex)
    low = x.imag <= np.pi * RATE
    for pole, residue in zip(s, R, strict=True):
        for each, r in ((pole, residue), (pole.conj(), residue.conj())):
            Y[low] += (x[low] ** p / (x[low] - each))[:, None] * (U[low] @ r.T)
    y = np.fft.irfft(Y, len(u) * FASTER, axis=0)[::FASTER][beside : beside + samples]
    e = lfilter([1], [1, -memory], rng.standard_normal((samples + 2000, y.shape[1])), axis=0)[2000:]
    y = y + e / e.std(axis=0) * y.std(axis=0) * 0.01
    signals = ms.Signals(outputs=y, inputs=u[beside : beside + samples], sampling_rate=RATE)
    parts = [np.linalg.svd(r) for r in structure.residues]
    truth = ms.ModalModel(
        poles=s,
        shapes=np.array([U[:, 0] for U, _, _ in parts]).T,
        participation=np.array([Vh[0] for _, _, Vh in parts]),
        output_dofs=signals.output_dofs,
        input_dofs=signals.input_dofs,
    )
    return signals, truth


def settled(signals: ms.Signals, modes: ms.ModalModel, most: int = 60) -> Settled:
    response = record_spectra(as_records(signals), None)
    participation, _ = response.basis(modes.poles, response.outside_powers).fit_participation(modes.shapes)
    return settle(task_of(response, np.zeros(0), None, None), modes.poles, modes.shapes, participation, most)


def misses(seeds: range, memory: float) -> RealArray:
    """Return the errors of frequencies and of damping ratios of all modes in stated standard deviations, (2, n)."""
    found = []
    for seed in seeds:
        signals, truth = record(seed, memory)
        modes = ms.refine(signals, truth)
        apart = np.abs(modes.poles[:, None] - truth.poles)
        j = np.argmin(apart, axis=1)
        there = apart.min(axis=1) < -truth.poles.real[j]
        f = (modes.frequencies - truth.frequencies[j]) / modes.frequencies_std
        zeta = (modes.damping_ratios - truth.damping_ratios[j]) / modes.damping_ratios_std
        found.append(np.array([f[there], zeta[there]]))
    return np.hstack(found)


def test_forces_that_are_not_held_between_samples_need_more_powers_and_held_ones_do_not() -> None:
    signals, truth = record(0, 0.95)
    assert len(settled(signals, truth).powers) > 6
    model = system(2, 1)
    held = runs_of(model, [900], noise=0.01)
    assert settled(held.runs[0], ms.identify(held, route="records", order=6).modes).powers == tuple(range(6))


def test_powers_are_few_beside_the_lines_and_no_more_than_twenty() -> None:
    response = record_spectra(as_records(record(0, 0.0, seconds=10.0)[0]), None)
    # 499 lines, two inputs and the ends of one run: three terms a power, ten lines each
    assert (response.drives, response.count) == (3, 499)
    assert response.max_powers == 16
    assert record_spectra(as_records(record(0, 0.0)[0]), None).max_powers == 21
    few = record_spectra(as_records(record(0, 0.0, seconds=2.0)[0]), None)
    assert few.max_powers == len(few.refined_powers)


@pytest.mark.parametrize(("share", "powers"), [(0.999, 9), (1.001, 6)])
def test_powers_are_added_where_they_explain_more_than_noise_may(
    share: float, powers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bound is put just below and just above what three powers lower the squared misfit by, in variances of what they leave."""
    signals, truth = record(0, 0.95)
    ends = []
    for count in (6, 9):
        monkeypatch.setattr(RecordSpectra, "refined_powers", tuple(range(count)))
        monkeypatch.setattr(RecordSpectra, "max_powers", count)
        ends.append(settled(signals, truth, most=0))
    unknowns = 2 * len(truth) * (len(truth.output_dofs) + len(truth.input_dofs) + 1)
    cost = [end.descent.cost for end in ends]
    lower = (cost[0] - cost[1]) / cost[1] * (ends[1].descent.point.problem.freedom - unknowns)
    monkeypatch.setattr(RecordSpectra, "refined_powers", tuple(range(6)))
    monkeypatch.setattr(RecordSpectra, "max_powers", 9)
    monkeypatch.setattr("modalscope.selection.likelihood.settling.chi_squared_bound", lambda *_: share * lower)
    assert len(settled(signals, truth, most=0).powers) == powers


@pytest.mark.study("standard-deviations")
@pytest.mark.parametrize(("memory", "noise"), [(0.0, "white noise"), (0.95, "noise AR(.95)")])
def test_study_of_intervals_of_records_under_forces_that_are_not_held(
    memory: float, noise: str, study: Callable[[str, str], Study]
) -> None:
    """Of 750 modes a coverage of 95 % is known to .8 %."""
    found = study(f"records, forces not held between samples, {noise} of 40 dB", "100 structures, seeds 5000 to 5099")
    apart = misses(range(5000, 5100), memory)
    for name, values in zip(("f", "zeta"), apart, strict=True):
        covered = 100 * np.mean(np.abs(values) < 1.96)
        found.row(f"coverage of 95 % intervals, {name}", covered, form=".1f", unit=" %", least=91, most=98)
    assert not found.missed
