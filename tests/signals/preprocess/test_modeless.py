"""Records that hold no modes are told as what they are, structures beside machines are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.modeless_records import KINDS, modeless
from modalscope.data.notes import Note
from modalscope.selection.judging.grades import grades
from modalscope.signals.preprocess.ambient_records import seen_record
from modalscope.signals.preprocess.spectral_peaks import noise_notes
from modalscope.systems import chain5, close4, heavy4, ring5

SAID = {"transformer": "Nothing but hum", "helicopter": "Nothing but hum", "static": "Quasi-static motion"}


def notes_of(record: ms.Signals) -> tuple[Note, ...]:
    return seen_record(record).modeless


@pytest.mark.parametrize("kind", KINDS)
def test_records_without_modes_are_told_as_what_they_are(kind: str) -> None:
    seen = seen_record(modeless(kind, 1))
    (note,) = seen.modeless or noise_notes(seen.levels)
    assert note.text.startswith(SAID.get(kind, ("Only noise", "No spectral peak")))
    if kind == "transformer":
        assert "lines at 120, 240, 360 Hz hold 98.4 % of the power" in note.text


def beside_hum(k: int) -> ms.Signals:
    """Return a structure in ambient vibration beside a machine that has up to all but a thousandth of the power."""
    rng = np.random.default_rng(k)
    structure = (chain5, ring5, heavy4, close4)[k % 4]()
    rate, quantity = (20.0, 40.0, 50.0)[k % 3], ("acceleration", "displacement")[k // 4 % 2]
    record = structure.simulate(
        inputs="ambient", samples=24_000, sampling_rate=rate, quantity=quantity, noise=0.05, seed=k
    )
    y = record.outputs
    t, f = np.arange(len(y)) / rate, rng.uniform(0.3, rate / 2.2) / 3
    hum = sum(np.real(np.outer(np.exp(2j * np.pi * n * f * t), rng.standard_normal(y.shape[1]))) for n in (1, 2, 3))
    share = float(rng.choice([0.6, 0.9, 0.99, 0.999]))
    size = np.sqrt(share / (1 - share)) * np.linalg.norm(y) / np.linalg.norm(hum)
    return replace(record, outputs=y + size * hum)


@pytest.mark.parametrize("k", [*(pytest.param(k, marks=pytest.mark.slow) for k in (0, 1)), 2, 3])
def test_structures_beside_machines_are_structures(k: int) -> None:
    assert not notes_of(beside_hum(k))


@pytest.mark.parametrize(("share", "told"), [(0.48, 0), (0.52, 1)])
def test_hum_has_most_of_the_power(share: float, told: int) -> None:
    noise = np.random.default_rng(0).standard_normal((30_000, 2))
    hum = np.sqrt(2 * share / (1 - share)) * np.sin(2 * np.pi * 12 * np.arange(30_000) / 50)[:, None]
    assert len(notes_of(ms.Signals(outputs=noise + hum, sampling_rate=50.0))) == told


@pytest.mark.parametrize(("share", "told"), [(0.45, 0), (0.55, 1)])
def test_quasi_static_motion_has_most_of_the_power_below_fifty_periods(share: float, told: int) -> None:
    rng = np.random.default_rng(0)
    noise, amplitudes = rng.standard_normal((30_000, 2)), rng.standard_normal((2, 40, 2))
    t = 2 * np.pi * np.outer(np.arange(30_000) / 30_000, np.arange(2, 42) + 0.3)
    slow = np.cos(t) @ amplitudes[0] + np.sin(t) @ amplitudes[1]
    size = np.sqrt(share / (1 - share)) * np.linalg.norm(noise) / np.linalg.norm(slow)
    assert len(notes_of(ms.Signals(outputs=noise + size * slow, sampling_rate=50.0))) == told


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_listed_where_there_are_no_modes(kind: str) -> None:
    assert len(ms.analyze(modeless(kind, 2)).modes) == 0


@pytest.mark.study("checks")
def test_forty_records_without_modes_and_a_hundred_beside_machines(study) -> None:
    told = listed = 0
    for kind in KINDS:
        for seed in range(10):
            record = modeless(kind, seed)
            seen = seen_record(record)
            told += bool(seen.modeless or noise_notes(seen.levels))
            listed += any(grade.word != "doubtful" for grade in grades(ms.analyze(record).modes))
    table = study(
        "records without modes: hum of transformers and helicopters, noise, quasi-static motion", "40 records"
    )
    table.row("told as what they are", told, least=39)
    table.row("with a mode that is graded better than doubtful", listed, most=0)
    beside = sum(bool(notes_of(beside_hum(k))) for k in range(100))
    table.row("of 100 structures beside machines, taken for hum", beside, most=0)
    assert not table.missed
