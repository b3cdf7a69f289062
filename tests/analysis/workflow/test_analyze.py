"""The whole job in one call: the steps apart give the same, and every choice counts."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import FrequencyResponse, ImpulseResponse
from modalscope.data.whitening import levelling
from tests.selection.judging.hard import frequency_response, impulse_response, random_structure
from tests.support import BEAM

BAND = (100.0, 1200.0)
ORDERS = range(8, 21, 4)


@pytest.fixture(scope="module")
def samples() -> ImpulseResponse:
    return ms.systems.chain5().impulse_response(300, noise=0.01, seed=0)


@pytest.fixture(scope="module")
def result(samples: ImpulseResponse) -> ms.Result:
    return ms.analyze(samples)


@pytest.fixture(scope="module")
def lines() -> FrequencyResponse:
    return ms.systems.add_noise(ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 400)), 0.01, 0)


def same(a: ms.ModalModel, b: ms.ModalModel) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("poles", "shapes", "participation"))


def test_it_gives_the_modes_of_its_steps(samples: ImpulseResponse, result: ms.Result) -> None:
    """On channels of one level: others are brought to it, which moves no optimum."""
    even = levelling(samples.values).of_response(samples)
    selected = ms.select(ms.stabilize(even))
    refined = ms.refine(even, selected)
    for found, steps in ((ms.analyze(samples, refine=False).modes, selected), (result.modes, refined)):
        assert found.poles == pytest.approx(steps.poles, rel=1e-9)
    assert result.modes.frequencies_std == pytest.approx(refined.frequencies_std, rel=1e-6)
    assert ms.refine(samples, ms.select(ms.stabilize(samples))).poles == pytest.approx(refined.poles, rel=1e-6)
    assert result.data is samples
    assert len(result.settings) == 1
    assert result.settings[0] is result.diagram.settings


@pytest.mark.parametrize("kind", ["impulse", pytest.param("frequency", marks=pytest.mark.slow)])
def test_no_unit_of_a_channel_changes_a_mode_an_interval_or_a_grade(kind: str) -> None:
    rng = np.random.default_rng(7)
    structure = random_structure(94002)
    made = frequency_response if kind == "frequency" else impulse_response
    response, _ = made(structure, 30, 94002)
    u, v = (10.0 ** rng.uniform(-4, 4, count) for count in response.values.shape[1:])
    one = ms.analyze(response).modes
    other = ms.analyze(dataclasses.replace(response, values=response.values * u[:, None] * v)).modes
    assert len(one) == len(other)
    assert other.poles == pytest.approx(one.poles, rel=1e-9)
    for name in ("frequencies_std", "damping_ratios_std"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-5)
    assert [mode.words for mode in other] == [mode.words for mode in one]
    assert np.diag(ms.mac(other.shapes / u[:, None], one.shapes)) == pytest.approx(1)


def test_the_words_of_the_user_on_channels_are_those_of_the_channels_as_they_are(
    samples: ImpulseResponse, result: ms.Result
) -> None:
    weights = np.ones(samples.values.shape[1])
    assert result.diagram.whitening is not None
    assert ms.analyze(samples, block_rows=20, row_weights=np.tile(weights, 20), orders=[10]).diagram.whitening is None


def test_a_path_is_read_as_the_options_say(tmp_path: Path, lines: FrequencyResponse) -> None:
    path = tmp_path / "lines.npz"
    np.savez(path, values=lines.values, frequencies=lines.frequencies)
    result = ms.analyze(path, reading={"quantity": "velocity"}, band=(0.5, 5))
    assert result.modes.quantity == "velocity"
    assert result.analysis.files[0].path == str(path)
    assert result.analysis.files[0].size == path.stat().st_size
    with pytest.raises(ms.DataError, match="are FrequencyResponse already"):
        ms.analyze(lines, reading={"quantity": "velocity"})


@pytest.mark.slow
def test_modes_are_taken_and_refused_by_hand(samples: ImpulseResponse) -> None:
    whole = ms.analyze(samples, orders=ORDERS).modes
    less = ms.analyze(samples, orders=ORDERS, refuse=[whole.frequencies[1]]).modes
    assert np.allclose(less.frequencies, np.delete(whole.frequencies, 1))
    again = ms.analyze(samples, orders=ORDERS, refuse=whole.frequencies[:2], take=[whole.frequencies[0]]).modes
    assert np.allclose(again.frequencies, np.delete(whole.frequencies, 1))
    one = ms.analyze(samples, orders=ORDERS, frequencies=[whole.frequencies[2]]).modes
    assert np.allclose(one.frequencies, whole.frequencies[2])
    with pytest.raises(ms.DataError, match=r"a mode at 9\.5 Hz"):
        ms.analyze(samples, orders=ORDERS, refuse=[9.5])
    with pytest.raises(ms.DataError, match="frequencies already states the whole list"):
        ms.analyze(samples, orders=ORDERS, frequencies=[0.9], take=[2.6])


@pytest.mark.slow
def test_several_bands_are_identified_one_by_one(lines: FrequencyResponse) -> None:
    result = ms.analyze(lines, band=[(0.3, 3.4), (3.4, 8)], orders=ORDERS)
    assert len(result.diagrams) == len(result.settings) == 2
    assert np.allclose(result.modes.frequencies, ms.systems.chain5().modes().frequencies, rtol=0.01)
    assert result.analysis.bands == ((0.3, 3.4), (3.4, 8.0))


def test_little_explained_is_told_loudly(samples: ImpulseResponse) -> None:
    strong = ms.analyze(samples, orders=ORDERS)
    assert not [note for note in strong.notes if note.kind == "little explained"]
    weak = ms.analyze(samples, orders=ORDERS, frequencies=[strong.modes.frequencies[-1]])
    note = next(note for note in weak.notes if note.kind == "little explained")
    assert note.numbers["share"] < 0.7
    assert "WARNING" in str(note)


def test_what_the_examination_finds_is_told(samples: ImpulseResponse) -> None:
    values = np.array(samples.values)
    values[:, 2] = values[:, 1]
    result = ms.analyze(ImpulseResponse(values=values, sampling_rate=20.0))
    assert result.findings
    assert any(note.kind.startswith("data: ") for note in result.notes)


def test_what_is_seen_in_channels_that_were_left_out_is_not_told_again(samples: ImpulseResponse) -> None:
    values = samples.values.copy()
    values[:, 1] = 0
    dead = dataclasses.replace(samples, values=values)
    for out in (samples.output_dofs[1], 1):
        result = ms.analyze(dead, exclude=[out], orders=range(2, 21, 2))
        assert "dead" not in [finding.kind for finding in result.findings]
        assert not any(note.kind == "data: dead" for note in result.notes)


@pytest.mark.parametrize("suffix", [".json", ".csv", ".npz", ".uff"])
def test_a_result_is_written_as_its_modes(tmp_path: Path, result: ms.Result, suffix: str) -> None:
    path = tmp_path / f"r{suffix}"
    ms.write(path, result)
    assert path.stat().st_size > 0
    if suffix == ".json":
        read = ms.read(path)
        assert same(read, result.modes)
        assert {str(note) for note in read.notes} == {str(note) for note in result.notes}


@pytest.mark.slow
def test_the_demo_file_gives_its_modes_with_nothing_but_a_band() -> None:
    result = ms.analyze(BEAM / "beam_hammer.uff", band=BAND)
    # and weak ones at 570 Hz, which disjoint hammer points give, too, and at 1019 and 1143 Hz, which stay open
    known = np.array([177.0, 477.4, 570.0, 933.1, 1019.5, 1143.2])
    assert {mode.grade for mode in result.modes if mode.frequency > 1000} == {"doubtful"}
    apart = np.abs(result.modes.frequencies[:, None] - known)
    assert np.all(apart.min(axis=1) < 1)
    assert np.all(apart.min(axis=0)[[0, 1, 3]] < 0.2)


@pytest.mark.parametrize("channels", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_runs_without_forces_are_identified_as_one_record(channels: int) -> None:
    """Their lines refine modes run by run: they once were taken as one, which broke off."""
    chain = ms.systems.chain5()
    record = chain.simulate(inputs="ambient", samples=4000, sampling_rate=20.0, runs=2, noise=0.01, seed=5)
    found = ms.analyze(record.select(outputs=list(range(channels))), orders=[10, 14, 18, 22, 26]).modes
    assert len(found) >= 3
    assert np.abs(found.frequencies[:, None] / chain.modes().frequencies - 1).min(axis=1).max() < 0.02
