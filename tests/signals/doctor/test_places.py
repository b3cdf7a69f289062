"""Runs of one test that were driven at other places than their labels say."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from benchmarks.records.placed import one_place, repeated_places, several_places
from benchmarks.records.roving import Roving, roving
from modalscope.identification.routes import usual_route
from modalscope.interfaces.cli import main
from modalscope.signals.doctor import examine
from modalscope.signals.doctor.one_place import _repeats, decide, white_noise
from modalscope.signals.doctor.places import against_labels, label_by_place, placed, with_hits
from modalscope.signals.doctor.runs import changed_runs
from modalscope.signals.preprocess import estimate_frf
from modalscope.systems import chain5
from tests.support import measured, random_system

DT = chain5().dt
#: Resonances in Hz, apart.
GRID = np.array([50.0, 110, 180, 260, 350, 450])


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
    twice = [hits(place, seed=k) for k in range(2) for place in (0, 2, 4)]
    assert placed(twice).places == [0, 1, 2, 0, 1, 2]
    assert placed([hits(0), hits(2), hits(4)]).places == [0, 1, 2]
    one = placed([hits(0, seed=k) for k in range(5)])
    assert (one.kind, one.places) == ("one", [0] * 5)
    (found,) = changed_runs(ms.merge([hits(0), hits(2), hits(4), hits(0, seed=1)]))
    assert "runs 1, 2, 7, 8 | 3, 4 | 5, 6 look like 3 drive points" in found.reason
    assert changed_runs(hits(3, count=6)) == []


@pytest.mark.parametrize("spoil", ["turned", "exchanged"])
def test_channels_that_changed_in_a_run_are_no_other_place(spoil: str) -> None:
    record = hits(1, count=4)
    outputs = record.outputs.copy()
    outputs[2] = outputs[2] * [1, -1, 1] if spoil == "turned" else outputs[2][:, [1, 0, 2]]
    spoilt = ms.Signals(outputs=outputs, inputs=record.inputs, sampling_rate=record.sampling_rate)
    assert "places" not in {finding.kind for finding in examine(spoilt)}


def test_what_is_found_names_the_runs_and_nothing_else() -> None:
    found = examine(ms.merge([hits(0, samples=8192), hits(2, samples=8192)]))
    assert [finding.kind for finding in found] == ["places"]
    assert "runs 1, 2 | 3, 4 " in found[0].reason


def test_responses_at_several_places_are_told_apart_too() -> None:
    parts = [estimate_frf(hits(place), segment=960) for place in (0, 2, 0, 2)]
    named, told = label_by_place(parts, ["a", "b", "c", "d"])
    assert [part.input_dofs for part in named] == [("place 1",), ("place 2",), ("place 1",), ("place 2",)]
    assert "place 1 (a, c); place 2 (b, d)" in str(told[0])
    same, told = label_by_place(parts[::2], ["a", "c"])
    assert same == parts[::2]
    assert "2 files were driven at one place (amplitudes at" in str(told[0])
    assert told[0].text.endswith("If places: --input-dofs 1 2")


def test_many_files_of_one_place_are_not_all_counted_in_the_remedy() -> None:
    parts = [hits(0, count=1, seed=k) for k in range(13)]
    (note,) = label_by_place(parts, [str(k) for k in range(13)])[1]
    assert note.text.endswith("13 labels, one per file: --input-dofs")


def test_what_data_say_against_the_names_of_a_user_is_told() -> None:
    def named(*places: int, labels: str) -> list[ms.Signals]:
        return [
            replace(hits(p, seed=k), input_dofs=[label])
            for k, (p, label) in enumerate(zip(places, labels, strict=True))
        ]

    assert against_labels(named(0, 2, 0, labels="aba")) == ()
    assert "2 files named 'a' are averaged as one place, but" in str(against_labels(named(0, 2, 0, labels="aab"))[0])
    assert "2 drive points as asked, but" in str(against_labels(named(0, 0, 0, labels="aab"))[0])
    assert against_labels([hits(0)]) == ()


def test_a_file_without_a_usable_hit_is_left_out_by_name() -> None:
    good, quiet = hits(0), hits(0, seed=1)
    force = np.zeros((1, 1024, 1))
    force[:, 30:34] = 2.0
    overloaded = ms.Signals(outputs=good.by_run()[0][:1], inputs=force, sampling_rate=good.sampling_rate)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(force.shape)
    kept, told = with_hits([good, overloaded, replace(overloaded, inputs=noise), quiet], ["a", "b", "c", "d"])
    assert kept == [0, 3]
    assert [str(note).partition(" (")[0] for note in told] == [
        "b: left out, no usable hit",
        "c: left out, no usable hit",
    ]
    assert "overloaded" in str(told[0])
    assert with_hits([overloaded, overloaded], ["a", "b"]) == ([0, 1], ())
    assert placed([overloaded, good]).kind == "unknown"


@pytest.mark.parametrize(
    "parts",
    [
        [hits(0)],
        [replace(hits(0), input_dofs=["a"]), replace(hits(2), input_dofs=["b"])],
        [hits(0), ms.Signals(outputs=np.ones((9, 3)) * np.arange(9)[:, None], sampling_rate=1.0)],
    ],
)
def test_labels_stay_where_files_do_not_stand_for_places(parts: list[ms.Signals]) -> None:
    assert label_by_place(parts, [str(k) for k in range(len(parts))]) == (parts, ())


def test_a_file_that_holds_several_places_is_a_place_of_its_own_and_the_doctor_names_it() -> None:
    named, told = label_by_place([hits(0), ms.merge([hits(2), hits(4)])], ["a", "b"])
    assert [part.input_dofs for part in named] == [("a",), ("b",)]
    assert "named after their files" in str(told[0])
    assert any(finding.kind == "places" for finding in examine(ms.merge(named)))


def test_one_hit_a_file_is_enough() -> None:
    assert placed([hits(place, count=1, seed=k) for k, place in enumerate((0, 2, 0, 4, 2, 4))]).places == [
        0,
        1,
        0,
        2,
        1,
        2,
    ]


@pytest.mark.parametrize(("sizes", "planned"), [((3, 2, 2, 1, 1, 1), True), ((2, 2, 2, 1, 1, 1, 1), False)])
def test_repeats_are_planned_where_seven_of_ten_files_have_one(sizes: tuple[int, ...], planned: bool) -> None:
    place = np.repeat(np.arange(len(sizes)), sizes)
    far = 1 + 0.01 * np.abs(np.subtract.outer(place, place))
    distances = np.where(place[:, None] == place, 0.05 * (1 - np.eye(10)), far)
    assert _repeats(distances) == (place.tolist() if planned else list(range(10)))


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

    assert placed([shaken(0, 1), shaken(4, 2), shaken(0, 3), shaken(4, 4)]).places == [0, 1, 0, 1]
    first = shaken(0, 1)
    assert placed([first, replace(first, inputs=np.zeros_like(first.inputs)), first]).kind == "unknown"


def modes_at(*amplitudes: list[float], noise: float = 0.0) -> np.ndarray:
    """Return responses of one output whose modes have these amplitudes in each file, (files, lines, 1)."""
    f = np.linspace(1, 20, 4000)
    lines = [f**2 / (g**2 - f**2 + 0.02j * g * f) for g in np.linspace(2, 18, len(amplitudes[0]))]
    rng = np.random.default_rng(0)
    scatter = rng.standard_normal((len(amplitudes), f.size, 2)) @ [1, 1j]
    return np.asarray((np.array(amplitudes) @ np.array(lines) + noise * scatter)[:, :, None])


def decided(*amplitudes: list[float], noise: float = 0.0) -> object:
    H = modes_at(*amplitudes, noise=noise)
    return decide(H, white_noise(H))


@pytest.mark.parametrize(
    ("apart", "kind"), [(0.0, "one"), (0.24, "one"), (0.26, "ask"), (0.49, "ask"), (0.51, "several"), (1.41, "several")]
)
def test_the_distance_of_two_files_is_that_of_their_amplitudes(apart: float, kind: str) -> None:
    """Amplitudes (1 + e, 1 - e) over four modes against (1 - e, 1 + e) have cos = (1 - e^2) / (1 + e^2)."""
    cosine = 1 - apart**2 / 2
    e = np.sqrt((1 - cosine) / (1 + cosine))
    found = decided([1 + e, 1 - e, 1 + e, 1 - e], [1 - e, 1 + e, 1 - e, 1 + e])
    assert found.kind == kind
    assert found.apart == pytest.approx(apart, abs=0.01)


@pytest.mark.parametrize(
    ("modes", "gain", "kind"),
    [
        (4, 1.3, "one"),
        (4, 1.34, "one"),
        (4, 2.0, "ask"),
        (6, 2.0, "size"),
        (2, 1.02, "ask"),
        (2, -1.0, "several"),
        (5, -1.0, "several"),
    ],
)
def test_a_gain_is_scatter_up_to_a_third_then_another_size_and_a_sign_another_place(
    modes: int, gain: float, kind: str
) -> None:
    assert decided([1.0] * modes, [gain] * modes).kind == kind


def test_a_file_of_another_size_is_named_and_few_resonances_are_told() -> None:
    f = np.linspace(1, 20, 4000)
    for rows, text in (
        (([1.0] * 6, [1.0] * 6, [2.0] * 6), "but c is 2 x as large (overload, range or unit?): taken as one"),
        (
            ([1.0, 1.0], [1.0, 0.9], [1.0, 1.0]),
            "3 files look like one place (amplitudes at only 2 resonances differ by",
        ),
    ):
        parts = [ms.FrequencyResponse(values=H[:, :, None], frequencies=f) for H in modes_at(*rows)]
        same, told = label_by_place(parts, ["a", "b", "c"])
        assert same == parts
        assert text in str(told[0])


def test_noise_takes_no_part_in_the_distance() -> None:
    found = decided([1.0] * 5, [1.0] * 5, [1.0] * 5, noise=6.0)
    assert (found.kind, found.apart) == ("one", 0.0)  # .13 with the noise


def test_a_mode_with_a_node_at_the_place_has_no_sign_of_its_own() -> None:
    """The skirts of other modes are all that is there; their sign would make two places of one."""
    rows = [[1.0, 1e-3 * sign, 1.0, -1.0] for sign in (1, -1, 1, -1)]
    found = decided(*rows, [1.0, 1.0, -1.0, 1.0], [1.0, 1.0, -1.0, 1.0])
    assert found.places == [0, 0, 0, 0, 1, 1]


def test_files_of_noise_alone_keep_their_labels() -> None:
    f = np.linspace(1, 2, 64)
    noise = np.random.default_rng(0).standard_normal((2, 64, 1, 1, 2)) @ [1, 1j]
    parts = [ms.FrequencyResponse(values=values, frequencies=f) for values in noise]
    same, told = label_by_place(parts, ["a", "b"])
    assert same == parts
    assert "no resonance shows their places" in str(told[0])
    assert placed([part.at_lines(f < 1.02) for part in parts]).kind == "unknown"


@pytest.mark.parametrize(("sensors", "moved"), [(1, True), (2, False)])
def test_files_of_one_sensor_may_be_places_of_it(sensors: int, moved: bool) -> None:
    """A response says not which of its two places it is that moved: the option for either is printed."""
    chain, f = chain5(), np.linspace(0.5, 8, 600)
    H = chain.frequency_response(f, inputs=[0, 2, 4], outputs=list(range(sensors)), noise=0.003, seed=1).values
    parts = [ms.FrequencyResponse(values=H[:, :, [k]], frequencies=f) for k in range(3)]
    (told,) = label_by_place(parts, ["a", "b", "c"])[1]
    assert "if one place: --input-dofs 1" in told.text
    assert ("if the sensor moved: --output-dofs 1 2 3" in told.text) is moved


def _responses(*amplitudes: list[float]) -> list[ms.FrequencyResponse]:
    f = np.linspace(1, 20, 4000)
    return [ms.FrequencyResponse(values=H[:, :, None], frequencies=f) for H in modes_at(*amplitudes)]


@pytest.mark.parametrize(
    ("amplitudes", "places"),
    [
        (([1.0, 1.0], [1.0, 0.5]), 2),  # two resonances that differ by a third tell little
        (([1.0, 1.0], [1.0, 0.9]), 1),  # but that they agree is no chance
        (([1.0], [0.95]), 2),  # at one resonance it may be
        (([1.0, -1.0, 1.0, 1.0, 1.0], [1.0, 1.0, -1.0, 1.0, 1.0]), 2),
        (([1.0] * 3, [1.02] * 3), 1),
        (([1.0] * 5, [1.3, 0.7, 1.3, 0.7, 1.3]), 1),  # near one place, and five resonances are enough
        (([1.0] * 6, [2.0] * 6), 1),  # the same place, larger
    ],
)
def test_names_of_files_say_the_places_unless_data_show_one(amplitudes: tuple[list[float], ...], places: int) -> None:
    parts = _responses(*amplitudes)
    named, notes = label_by_place(parts, ["P1", "P2"], said={"": ("P1", "P2")})
    assert len({part.input_dofs for part in named}) == places
    assert ("the names of the files say" in notes[0].text) == (places == 2)
    assert ("If places: --input-dofs P1 P2" in notes[0].text) == (places == 1)
    assert label_by_place(parts, ["a", "b"])[0][0].input_dofs != ("P1",)


def test_hyphens_that_may_be_signs_of_directions_are_said_with_the_way_out() -> None:
    parts = _responses([1.0, -1.0], [1.0, 1.0])
    said = {"": ("P1:-Z", "P2:-Z"), "unsigned": ("P1:+Z", "P2:+Z")}
    named, (note,) = label_by_place(parts, ["P1-Z", "P2-Z"], said=said)
    assert [part.input_dofs for part in named] == [("P1:-Z",), ("P2:-Z",)]
    assert "if the hyphens are no signs: --input-dofs P1:+Z P2:+Z" in note.text
    assert "hyphens" not in label_by_place(parts, ["P1-Z", "P2-Z"], 3, said)[1][0].text  # a file was left out


def test_names_say_which_of_the_two_moved() -> None:
    parts = _responses([1.0, -1.0], [1.0, 1.0])
    named, (note,) = label_by_place(parts, ["acc1", "acc2"], said={"output": ("acc1", "acc2")})
    assert [(p.output_dofs, p.input_dofs) for p in named] == [(("acc1",), ("u1",)), (("acc2",), ("u1",))]
    assert "outputs acc1, acc2" in note.text
    assert "if the force moved: --input-dofs 1 2" in note.text
    pair = {"output": ("1:+Z", "2:+Z"), "input": ("5:+Z", "5:+Z")}
    both = label_by_place(parts, ["1Z_5Z", "2Z_5Z"], said=pair)[0]
    assert [(p.output_dofs, p.input_dofs) for p in both] == [(("1:+Z",), ("5:+Z",)), (("2:+Z",), ("5:+Z",))]
    wide = [
        ms.FrequencyResponse(values=np.tile(p.values, (1, 2, 1)), frequencies=p.frequencies, output_dofs=["a", "b"])
        for p in parts
    ]
    assert label_by_place(wide, ["acc1", "acc2"], said={"output": ("acc1", "acc2")})[0][0].output_dofs == ("a", "b")


@pytest.mark.parametrize(
    ("shift", "apart", "refused"), [(0.02, 0.3, True), (0.02, 0.0, False), (0.0, 0.3, False), (0.0, 0.0, False)]
)
def test_files_whose_resonances_shift_are_asked_about_before_they_are_averaged(
    shift: float, apart: float, refused: bool
) -> None:
    f = np.linspace(20, 500, 2401)
    sizes = np.cos(np.arange(6)) * apart
    of = [
        np.sum([a * g**2 / (g**2 - f**2 + 0.02j * g * f) for a, g in zip(1 + s, g0, strict=True)], axis=0)
        for s, g0 in ((-sizes, GRID), (sizes, GRID * (1 + shift * np.cos(3 * np.arange(6)))))
    ]
    parts = [ms.FrequencyResponse(frequencies=f, values=h[:, None, None]) for h in of]
    if not refused:
        labelled, (note,) = label_by_place(parts, ["P1", "P2"])
        assert len({part.input_dofs for part in labelled}) == 1
        assert ("if structures of their own: --each" in note.text) == bool(shift or apart)
        return
    with pytest.raises(
        ms.DataError, match=r"resonances shift from file to file .* amplitudes at 6 resonances differ"
    ) as error:
        label_by_place(parts, ["P1", "P2"], said={"": ("P1", "P2")})
    assert error.value.args[0].endswith(
        "--each; if one place: --input-dofs 1; if places: --input-dofs P1 P2; if the sensor moved: --output-dofs 1 2"
    )


@pytest.mark.slow
def test_a_measured_beam_with_other_masses_in_every_file_is_asked_about() -> None:
    paths = sorted(measured("beam_masses", "P-1.txt").parent.glob("P-*.txt"))
    with pytest.raises(ms.DataError, match="one line shape gives 81 % of their energy"):
        ms.analyze(paths)


def test_runs_by_their_names_are_one_place_where_few_resonances_differ() -> None:
    two, five = _responses([1.0, -1.0], [1.0, 1.0]), _responses([1.0, -1.0] * 3, [1.0, 1.0] * 3)
    same, (note,) = label_by_place(two, ["run1", "run2"], said={"run": ("run1", "run2")})
    assert same == two
    assert "are runs by their names (amplitudes at only 2 resonances differ by" in note.text
    assert len({p.input_dofs for p in label_by_place(five, ["run1", "run2"], said={"run": ("run1", "run2")})[0]}) == 2


def test_places_of_one_name_that_data_tell_apart_are_averaged_and_said() -> None:
    parts = _responses([1.0, -1.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, 1.0])
    named, notes = label_by_place(parts, ["P1_1", "P1_2", "P2_1"], said={"": ("P1", "P1", "P2")})
    assert [part.input_dofs for part in named] == [("P1",), ("P1",), ("P2",)]
    assert "2 files named 'P1' are averaged as one place, but" in notes[1].text


def test_hits_at_the_start_of_their_runs_have_one_sign() -> None:
    test = roving(37)
    first = [record for record, place in zip(test.files, test.places, strict=True) if place == 0]
    assert [finding.kind for finding in examine(ms.merge(first))] == []


@pytest.mark.slow
def test_measured_hits_on_one_place_and_on_several() -> None:
    plates = [ms.read(measured("standins", "repeated_hits", f"plate_9_{k}.csv")) for k in range(1, 6)]
    held = np.load(measured("impact_hits", "impacts.npz"))
    rate = float(held["fs"])
    raw = [
        ms.Signals(outputs=acc[:, None], inputs=force[:, None], sampling_rate=rate)
        for acc, force in zip(held["acc"], held["force"], strict=True)
    ]
    assert with_hits(raw, ["1", "2", "3", "4", "5"])[0] == [1, 2, 3, 4]
    for files in (plates, raw[1:]):
        assert {placed(files).kind} | {placed(pair).kind for pair in itertools.combinations(files, 2)} == {"one"}
    beam = np.load(measured("beam_hammer", "beam_mimo_frf.npz"))["H"].transpose(0, 2, 1)
    assert decide(beam, white_noise(beam)).places == list(range(6))
    assert decide(beam[:2], white_noise(beam[:2])).kind == "several"
    roving_pair = ms.read(measured("roving_pair", "roving.uff")).values.transpose(2, 0, 1)
    for sensors in (slice(None), slice(1), slice(1, 2)):
        H = roving_pair[:, :, sensors]
        assert decide(H, white_noise(H)).places == list(range(15))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 14, 20])
def test_places_of_roving_tests_of_symmetric_structures_and_their_shapes(seed: int, tmp_path: Path) -> None:
    test = roving(seed)
    assert placed(test.files).places == test.places
    assert _least_mac(test, tmp_path) > 0.98


def _least_mac(test: Roving, folder: Path) -> float:
    """Return the least MAC of the shapes over the places, identified from the files as they are; 0 where a mode or a place is missing."""
    paths = []
    for k, record in enumerate(test.files):
        paths.append(folder / f"file{k + 1}.npz")  # names that say no place
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
        ms.write(paths[-1], hits(place, count=3, samples=4096))
    out = tmp_path / "modes.json"
    assert main(["identify", *paths, *few, "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert "names of the files say, inputs point1, point3, point5" in said.out
    modes = ms.read(out)
    assert modes.input_dofs == ("point1", "point3", "point5")
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
            apart[same] += len(changed_runs(ms.merge(runs)))
    table = study("pairs of hits, at one place and at two", "200 pairs of each, seed 2026")
    table.row("at one place, taken for two", apart[True], most=0)
    table.row("at two places, told apart", apart[False], least=180)
    assert not table.missed


@pytest.mark.study("checks")
def test_a_hundred_roving_tests_of_symmetric_structures(study, tmp_path: Path) -> None:
    right, shapes = 0, 0
    for seed in range(100):
        test = roving(seed)
        right += placed(test.files).places == test.places
        shapes += _least_mac(test, tmp_path) > 0.98
    table = study("roving hammer tests, one sensor, 5 to 30 places of symmetric structures", "100 tests, seeds 0 to 99")
    table.row("places as they are, hits repeated to 1 % of their distance", right, least=98)
    table.row("with all modes listed, and every MAC over the places above .98", shapes, least=95)
    assert not table.missed


@pytest.mark.study("checks")
def test_three_hundred_tests_at_one_place_at_several_and_at_repeated_ones(study) -> None:
    """Seeds that nothing was developed on; the table of what the data can tell, with files of all sizes of scatter."""
    seeds = range(70000, 70300)
    one, several, repeated = [], [], []
    for seed in seeds:
        H = one_place(seed)
        one.append(decide(H, white_noise(H)).kind)
        H = several_places(seed)
        several.append(decide(H, white_noise(H)).places == list(range(len(H))))
        H, places = repeated_places(seed)
        repeated.append(decide(H, white_noise(H)).places == places)
    table = study(
        "responses of files at one place, at several and at repeated ones", "300 of each, seeds 70000 to 70299"
    )
    table.row("at one place, taken as one", one.count("one"), least=225)
    table.row("at one place, asked", one.count("ask") + one.count("size"))
    table.row("at one place, taken for several", one.count("several"), most=18)
    table.row("at several places, every file a place", sum(several), least=294)
    table.row("at 2 to 4 places with 1 to 4 hits each, places as they are", sum(repeated), least=210)
    assert not table.missed
