"""Runs of one test that were driven at other places than their labels say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.cli import main
from modalscope.doctor import examine
from modalscope.doctor.places import Compared, differences, label_by_place, places_of
from modalscope.doctor.runs import _largest_product, place_numbers
from modalscope.identification.routes import usual_route
from modalscope.preprocess import estimate_frf
from modalscope.systems import chain5
from tests.doctor.roving import Roving, roving
from tests.support import random_system

DT = chain5().dt


def hits(place: int, count: int = 2, samples: int = 1024, noise: float = 1e-3, seed: int = 0) -> ms.Signals:
    """Return hits on one mass of a chain, each a short pulse of its own strength, and the answers of three others."""
    rng = np.random.default_rng([seed, place])
    force = np.zeros((count, samples, 1))
    for pulse in force:
        start = int(rng.integers(20, 40))
        pulse[start : start + 2, 0] = rng.uniform(1, 3) * np.array([1.0, 0.4])
    system = chain5().state_space(outputs=[0, 2, 3], inputs=[place], quantity="acceleration", dt=DT)
    outputs = np.stack([system.simulate(pulse) for pulse in force])
    outputs += noise * np.abs(outputs).max() * rng.standard_normal(outputs.shape)
    return ms.Signals(outputs=outputs, inputs=force, sampling_rate=1 / DT)


def test_hits_of_three_places_and_of_one() -> None:
    assert places_of([hits(0), hits(2), hits(4), hits(0, seed=1)]) == [0, 1, 2, 0]
    assert place_numbers(ms.merge([hits(0), hits(2), hits(4), hits(0, seed=1)])) == [0, 0, 1, 1, 2, 2, 0, 0]
    assert place_numbers(hits(3, count=6)) == [0] * 6


@pytest.mark.parametrize("spoil", ["turned", "exchanged"])
def test_channels_that_changed_in_a_run_are_no_other_place(spoil: str) -> None:
    record = hits(1, count=4)
    outputs = record.outputs.copy()
    outputs[2] = outputs[2] * [1, -1, 1] if spoil == "turned" else outputs[2][:, [1, 0, 2]]
    spoilt = ms.Signals(outputs=outputs, inputs=record.inputs, sampling_rate=record.sampling_rate)
    assert place_numbers(spoilt) == [0] * 4
    assert "places" not in {finding.kind for finding in examine(spoilt)}


def test_what_channels_as_they_are_turned_or_exchanged_explain() -> None:
    assert _largest_product(np.diag([2.0 + 0j, -1.0])) == 3.0
    assert _largest_product(np.array([[0, 2.0 + 0j], [2.0, 0]])) == 4.0
    assert _largest_product(np.diag([2.0 + 0j, 2.0])) == 4.0


def test_what_is_found_names_the_runs_and_nothing_else() -> None:
    found = examine(ms.merge([hits(0, samples=8192), hits(2, samples=8192)]))
    assert [finding.kind for finding in found] == ["places"]
    assert "runs 1, 2 | 3, 4 " in found[0].reason


def test_responses_at_several_places_are_told_apart_too() -> None:
    parts = [estimate_frf(hits(place), segment=960) for place in (0, 2, 0)]
    named, told = label_by_place(parts, ["a", "b", "c"])
    assert [part.input_dofs for part in named] == [("place 1",), ("place 2",), ("place 1",)]
    assert "place 1 (a, c); place 2 (b)" in str(told[0])
    assert label_by_place(parts[::2], ["a", "c"]) == (parts[::2], ())


@pytest.mark.parametrize(
    "parts",
    [
        [hits(0)],
        [hits(0), hits(0, seed=1)],
        [hits(0), ms.Signals(outputs=np.ones((9, 3)) * np.arange(9)[:, None], sampling_rate=1.0)],
    ],
)
def test_labels_stay_where_files_do_not_stand_for_places(parts: list[ms.Signals]) -> None:
    assert label_by_place(parts, [str(k) for k in range(len(parts))]) == (parts, ())


def test_a_file_that_holds_several_places_is_a_place_of_its_own_and_the_doctor_names_it() -> None:
    named, told = label_by_place([hits(0), ms.merge([hits(2), hits(4)])], ["a", "b"])
    assert [part.input_dofs for part in named] == [("place 1",), ("place 2",)]
    assert "place 1 (a); place 2 (b)" in str(told[0])
    assert any(finding.kind == "places" for finding in examine(ms.merge(named)))


def test_one_hit_a_file_is_weighed_by_the_quiet_samples_ahead_of_it() -> None:
    assert places_of([hits(place, count=1, seed=k) for k, place in enumerate((0, 2, 0, 4, 2))]) == [0, 1, 0, 2, 1]


def test_shaken_places_are_told_apart_and_repeated_runs_are_one() -> None:
    def shaken(place: int, seed: int) -> ms.Signals:
        record = chain5().simulate(
            inputs="white",
            at=[place],
            samples=12_000,
            sampling_rate=20.0,
            quantity="acceleration",
            noise=0.02,
            seed=seed,
        )
        return replace(record, input_dofs=["shaker"])

    assert places_of([shaken(0, 1), shaken(4, 2), shaken(0, 3)]) == [0, 1, 0]


@pytest.mark.parametrize(("apart", "places"), [(0.079, [0, 0]), (0.081, [0, 1])])
def test_what_differs_by_more_than_hits_repeat_is_another_place_and_asked(apart: float, places: list[int]) -> None:
    f = np.linspace(1, 2, 32)
    a = np.exp(1j * f)[:, None, None]
    ratio = (1 + apart / 2) / (1 - apart / 2)
    parts = [ms.FrequencyResponse(values=k * a, frequencies=f) for k in (1.0, ratio)]
    assert places_of(parts) == places
    _, told = label_by_place(parts, ["a", "b"])
    assert ["Are a and b one place? They differ by 8.1 %" in str(note) for note in told] == [True] * (
        len(set(places)) - 1
    )


def test_responses_of_opposite_sign_are_two_places() -> None:
    f = np.linspace(1, 2, 32)
    parts = [ms.FrequencyResponse(values=k * np.exp(1j * f)[:, None, None], frequencies=f) for k in (1.0, -1.0)]
    assert places_of(parts) == [0, 1]


def test_files_that_agree_with_one_of_a_place_only_do_not_join_it() -> None:
    f = np.linspace(1, 2, 32)
    parts = [ms.FrequencyResponse(values=k * np.exp(1j * f)[:, None, None], frequencies=f) for k in (1.0, 1.07, 1.14)]
    assert places_of(parts) == [0, 0, 1]


def test_files_of_noise_alone_agree_in_nothing() -> None:
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((2, 64, 1)) + 1j * rng.standard_normal((2, 64, 1))
    for variance, far in ((2.0, True), (1e-6, False)):
        compared = Compared(1 + 1e-4 * noise if not far else noise, np.full((2, 64, 1), variance), np.full(2, np.inf))
        assert np.isinf(differences(compared)[0, 1]) is np.bool_(far)


def test_hits_at_the_start_of_their_runs_have_one_sign() -> None:
    test = roving(37)
    first = [record for record, place in zip(test.files, test.places, strict=True) if place == 0]
    assert [finding.kind for finding in examine(ms.merge(first))] == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 14, 20])
def test_places_of_roving_tests_of_symmetric_structures_and_their_shapes(seed: int, tmp_path: Path) -> None:
    test = roving(seed)
    assert places_of(test.files) == test.places
    assert _least_mac(test, tmp_path) > 0.98


def _least_mac(test: Roving, folder: Path) -> float:
    """Return the least MAC of the shapes over the places, identified from the files as they are; 0 where a mode or a place is missing."""
    paths = []
    for k, record in enumerate(test.files):
        paths.append(folder / f"point{k + 1}.npz")
        ms.write(paths[-1], record)
    modes = ms.analyze(paths, refine=False).modes
    if len(modes) < len(test.frequencies) or len(modes.output_dofs) != len(test.shapes):
        return 0.0
    nearest = [int(np.argmin(np.abs(modes.frequencies - f))) for f in test.frequencies]
    return min(float(ms.indicators.mac(modes.shapes[:, [j]], test.shapes[:, [i]])[0, 0]) for i, j in enumerate(nearest))


def test_hits_of_labelled_places_give_responses_column_by_column() -> None:
    given = [
        ms.Signals(outputs=part.outputs, inputs=part.inputs, sampling_rate=part.sampling_rate, input_dofs=[label])
        for part, label in ((hits(0), "1:+X"), (hits(2), "3:+X"), (hits(4, samples=900), "5:+X"))
    ]
    records = ms.merge(given)
    assert usual_route(records) == "frf"
    response = ms.stabilize(records, orders=[4]).response
    assert response.input_dofs == ("1:+X", "3:+X", "5:+X")
    shortest = estimate_frf(given[2])
    assert np.array_equal(response.frequencies, shortest.frequencies)
    assert np.array_equal(response.values[:, :, 2], shortest.values[:, :, 0])
    samples = round(given[0].sampling_rate / (shortest.frequencies[1] - shortest.frequencies[0]))
    assert np.array_equal(response.values[:, :, 0], estimate_frf(given[0], segment=samples).values[:, :, 0])


@pytest.mark.slow
def test_a_hammer_test_of_one_file_a_place_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths, few = [], ["--orders", "10:30:4"]
    for place in (0, 2, 4):
        paths.append(str(tmp_path / f"point{place + 1}.npz"))
        ms.write(paths[-1], hits(place, count=3, samples=8192))
    out = tmp_path / "modes.json"
    assert main(["identify", *paths, *few, "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert "place 1 (point1); place 2 (point3); place 3 (point5)" in said.out
    modes = ms.read(out)
    assert modes.input_dofs == ("place 1", "place 2", "place 3")
    exact = chain5().modes().frequencies
    assert modes.frequencies == pytest.approx(exact, rel=1e-3)
    assert np.array_equal(ms.replay(out).modes.poles, modes.poles)
    named = tmp_path / "named.json"
    assert main(["identify", *paths, "--input-dofs", "1:+X", "3:+X", "5:+X", *few, "-q", "-o", str(named)]) == 0
    again = ms.read(named)
    assert again.input_dofs == ("1:+X", "3:+X", "5:+X")
    assert np.array_equal(again.poles, modes.poles)
    assert main(["identify", *paths, "--input-dofs", "1:+X", "3:+X", "-o", str(named)]) == 2
    assert "these are 2 items for 3 files" in capsys.readouterr().err


@pytest.mark.study("checks")
def test_two_hundred_pairs_of_each_kind(study) -> None:
    rng = np.random.default_rng(2026)
    apart = {True: 0, False: 0}
    for _ in range(200):
        system = random_system(
            rng, outputs=int(rng.integers(1, 7)), inputs=2, modes=int(rng.integers(3, 12)), damping=(0.002, 0.03)
        )
        noise = 10 ** (-rng.uniform(5, 60) / 20)
        for same in apart:
            runs = []
            for column in (0, 0 if same else 1):
                force = np.zeros((8192, 2))
                start = int(rng.integers(10, 30))
                force[start : start + 3, column] = rng.uniform(1, 3) * np.array([0.7, 1, 0.7])
                y = system.simulate(force)
                y += noise * y.std(axis=0).max() * rng.standard_normal(y.shape)
                runs.append(ms.Signals(outputs=y, inputs=force[:, [column]], sampling_rate=1 / system.dt))
            apart[same] += len(set(place_numbers(ms.merge(runs)))) > 1
    table = study("pairs of hits, at one place and at two", "200 pairs of each, seed 2026")
    table.row("at one place, taken for two", apart[True], most=0)
    table.row("at two places, told apart", apart[False], least=121)
    assert not table.missed


@pytest.mark.study("checks")
def test_a_hundred_roving_tests_of_symmetric_structures(study, tmp_path: Path) -> None:
    right, shapes = 0, 0
    for seed in range(100):
        test = roving(seed)
        right += places_of(test.files) == test.places
        shapes += _least_mac(test, tmp_path) > 0.98
    table = study("roving hammer tests, one sensor, 5 to 30 places of symmetric structures", "100 tests, seeds 0 to 99")
    table.row("places as they are, hits repeated to 1 % of their distance", right, least=98)
    table.row("with all modes listed, and every MAC over the places above .98", shapes, least=95)
    assert not table.missed
