"""The arena: what it calls right, how it counts, and that a stranger's test, program and list work from the page alone."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from arena import child, judge, pages, programs, run, scores, sets
from arena.bounds import of_ambient, of_response
from arena.sets import FIELDS, Reference, all_sets
from modalscope.systems.listing import trial

KINDS = ("responses", "impulses", "records", "ambient", "decay", "earthquake", "setups", "months")
DOCS = pages.DOCS


def reference(f: list[float], zeta: float = 0.01, shapes: Any = None, complete: bool = True, **more: Any) -> Reference:
    known = np.array(f)
    told = {"damping": np.full(known.size, zeta), "tolerance": np.full(known.size, np.nan), "reach": zeta * known}
    return Reference(kind="exact", frequencies=known, shapes=shapes, complete=complete, **told | more)


def listed(f: list[float], zeta: float = 0.01, shapes: np.ndarray | None = None, **more: Any) -> dict[str, Any]:
    told = {"status": "done", "human": 0, "frequencies": f, "damping_ratios": [zeta] * len(f)}
    if shapes is not None:
        told |= {"shapes_real": shapes.T.real.tolist(), "shapes_imag": shapes.T.imag.tolist()}
    return told | more


def verdicts(known: Reference, found: dict[str, Any], band: tuple[float, float] | None = None) -> list[str]:
    return [mode["is"] for mode in scores.judged(known, (), band, found)["modes"]]


def test_one_missed_one_false_one_twice() -> None:
    known = reference([10.0, 20.0, 30.0])
    judged = scores.judged(known, (), None, listed([10.02, 10.05, 20.0, 25.0]))
    assert [mode["is"] for mode in judged["modes"]] == ["found", "twice", "found", "false"]
    assert judged["missed"] == [30.0]
    failed = {"status": "failed", "human": 2}
    told = scores.totals([({"known": [10.0, 20.0, 30.0]}, judged), ({"known": [1.0]}, failed)])
    counted = {"found": 2, "modes": 4, "missed": 2, "false": 1, "twice": 1, "wrong_without_a_word": 2, "reported": 4}
    assert told | counted | {"failed": 1, "human": 2} == told
    assert told["f_error"] == pytest.approx(0.1)  # medians of .2 and 0 half bandwidths
    not_all = scores.judged(reference([10.0, 20.0, 30.0], complete=False), (), None, listed([10.0, 25.0]))
    assert [mode["is"] for mode in not_all["modes"]] == ["found", "other"]
    assert scores.totals([({"known": [1.0]}, {"status": "cannot", "human": 0})])["sets"] == 0


def test_errors_stand_beside_the_least_that_anybody_can_reach() -> None:
    bound = [[0.02, 0.001, 1e-3], [0.05, 0.002, 1e-3], [None, None, None]]
    about = {"known": [10.0, 20.0, 30.0], "known_damping": [0.01] * 3, "bound": bound}
    judged = scores.judged(reference([10.0, 20.0, 30.0]), (), None, listed([10.05, 19.9, 30.0], zeta=0.012))
    over = [[x and round(x, 4) for x in scores.over_bound(about, mode)] for mode in judged["modes"]]
    assert over == [[2.5, 2.0, None], [2.0, 1.0, None], [None, None, None]]
    assert scores.totals([(about, judged)])["over_bound"] == [2.25, 1.5, None]
    assert scores.totals([({"known": [1.0]}, {"status": "failed", "human": 0})])["over_bound"] == [None] * 3


def test_the_bound_goes_with_the_noise_and_with_the_root_of_the_duration() -> None:
    built = ms.systems.ring5()
    clean = trial(built, "frf", samples=300)
    one, other = (of_response(built, trial(built, "frf", samples=300, snr_db=db, seed=1), clean) for db in (40, 20))
    assert np.isfinite(one[:, 0]).all()
    assert np.isnan(one[:, 1:]).all()  # two pairs of one frequency each
    assert other[:, 0] / one[:, 0] == pytest.approx([10, 10, 100], rel=1e-6)  # 1 - MAC goes with the square
    chain, data = ms.systems.chain5(), ms.systems.chain5().simulate(inputs="ambient", samples=4000, seed=0)
    longer = replace(data, outputs=np.tile(data.outputs, (4, 1)))
    short, long = of_ambient(chain, data, 0.1), of_ambient(chain, longer, 0.1)
    # lines near zero and the ends of what is integrated change a little with the distance of the lines
    assert short / long == pytest.approx(np.outer([2, 2, 4], np.ones(5)), rel=0.03)


@pytest.mark.slow
def test_errors_of_many_cases_are_those_of_the_bound() -> None:
    """Refined modes of 15 responses: the root mean square of 150 errors over their bound is 1 to 6 % (deviation), no less than .9."""
    built, clean = ms.systems.chain5(), trial(ms.systems.chain5(), "frf", samples=300)
    exact, found = built.modes(), []
    for seed in range(15):
        data = trial(built, "frf", samples=300, snr_db=40, seed=seed)
        modes, bound = ms.analyze(data).modes, of_response(built, data, clean)
        near = abs(modes.frequencies[:, None] - exact.frequencies).argmin(axis=0)
        errors = (modes.frequencies[near] - exact.frequencies, modes.damping_ratios[near] - exact.damping_ratios)
        found.append([error / least for error, least in zip(errors, bound[:2], strict=True)])
    assert 0.9 < float(np.sqrt(np.mean(np.square(found)))) < 1.15


@pytest.mark.parametrize(("f", "told"), [(10.0999, "found"), (10.1001, "false")])
def test_a_mode_is_found_within_the_half_bandwidth(f: float, told: str) -> None:
    assert verdicts(reference([10.0]), listed([f])) == [told]


@pytest.mark.parametrize(("mac", "told"), [(0.801, "found"), (0.799, "false")])
def test_a_mode_of_another_shape_is_another_mode(mac: float, told: str) -> None:
    known = reference([10.0], shapes=np.array([[1.0], [0.0]]))
    assert verdicts(known, listed([10.0], shapes=np.array([[np.sqrt(mac)], [1j * np.sqrt(1 - mac)]]))) == [told]


def test_any_shape_of_a_repeated_pair_is_right() -> None:
    turned = np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 0.0]]) / np.sqrt(2)
    for f, told in (([10.0, 10.0], "found"), ([10.0, 10.05], "false")):
        assert verdicts(reference(f, shapes=np.eye(3)[:, :2]), listed(f, shapes=turned)) == [told, told]


def test_two_close_modes_are_paired_by_shape() -> None:
    f, swapped = [10.0, 10.05], np.eye(3)[:, [1, 0]]
    judged = scores.judged(reference(f, shapes=np.eye(3)[:, :2]), (), None, listed(f, shapes=swapped))
    assert [mode["known"] for mode in judged["modes"]] == f[::-1]


def test_modes_beyond_the_band_count_for_nobody() -> None:
    assert verdicts(reference([10.0]), listed([4.9, 5.1, 10.0]), band=(5.0, 15.0)) == ["false", "found"]


def test_what_a_program_marks_or_its_interval_holds_is_no_silent_error() -> None:
    known = reference([10.0, 20.0])
    wide = {"damping_interval": [[0.005, 0.03], [0.015, 0.02]]}
    judged = scores.judged(known, (), None, listed([10.0, 20.0], zeta=0.016, **wide))
    assert [mode["wrong"] for mode in judged["modes"]] == [False, True]
    assert [mode["zeta_held"] for mode in judged["modes"]] == [True, False]
    assert scores.totals([({"known": [10.0, 20.0]}, judged)])["wrong_without_a_word"] == 1
    marked = scores.judged(known, (), None, listed([15.0], marked=[True]))
    assert scores.totals([({"known": [10.0, 20.0]}, marked)])["wrong_without_a_word"] == 0


def test_intervals_are_tried_where_modes_are_known_without_a_tolerance() -> None:
    ends = {"frequency_interval": [[9.9, 10.1]]}
    assert scores.judged(reference([10.0]), (), None, listed([10.0], **ends))["modes"][0]["f_held"]
    told = scores.judged(reference([10.0], tolerance=np.array([0.02])), (), None, listed([10.03], **ends))["modes"][0]
    assert "f_held" not in told
    assert told["f_within"] is False


@pytest.mark.parametrize(("zeta", "wrong"), [(0.01499, False), (0.01501, True)])
def test_damping_is_wrong_beyond_half_its_value(zeta: float, wrong: bool) -> None:
    assert scores.judged(reference([10.0]), (), None, listed([10.0], zeta=zeta))["modes"][0]["wrong"] is wrong


def test_intervals_of_shares() -> None:
    assert scores.wilson(8, 10) == pytest.approx([0.4902, 0.9433], abs=1e-4)  # E. B. Wilson 1927, tables of many books
    assert scores.wilson(0, 0) is None
    assert scores.share([3, 3, 3], [4, 4, 4]) == [0.75, 0.75]
    half = scores.share([0, 4] * 10, [4, 4] * 10)
    assert half == scores.share([0, 4] * 10, [4, 4] * 10)
    assert half == pytest.approx([0.5 - 0.98 / 20**0.5, 0.5 + 0.98 / 20**0.5], abs=0.03)  # binomial of 20 sets


@pytest.mark.parametrize("name", all_sets())
def test_a_set_says_all_that_a_reader_asks(name: str) -> None:
    one = all_sets()[name]
    told = one.about["reference"]
    assert one.about["field"] in FIELDS
    assert one.about["kind"] in KINDS
    assert all(one.about[key] for key in ("title", "source", "licence", "citation"))
    assert told["kind"] in (*sets.SCORED, *sets.UNSCORED)
    assert told["by"]
    assert all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in one.about.get("files", {}).values())
    if told["kind"] == "published":
        assert told["tolerance"]
    package = json.loads((sets.HERE / f"{name}.datapackage.json").read_text("utf-8"))
    entry = json.loads(pages.SCORES.read_text("utf-8"))["sets"][name]
    assert package == json.loads(json.dumps(pages.package(one, entry)))


def of_the_schema(held: Any) -> None:
    schema = json.loads(pages.ROOT.joinpath("scores.schema.json").read_text("utf-8"))
    pytest.importorskip("jsonschema").validate(held, schema)


@pytest.mark.slow
def test_the_scores_have_the_form_that_their_schema_says() -> None:
    of_the_schema(json.loads(pages.SCORES.read_text("utf-8")))


def test_the_pages_are_those_of_the_scores() -> None:
    held = json.loads(pages.SCORES.read_text("utf-8"))
    assert json.loads(pages.written(held)) == held
    assert (DOCS / "index.md").read_text("utf-8") == pages.index(pages.with_totals(held))
    for name, entry in held["sets"].items():
        assert (DOCS / "sets" / f"{name}.md").read_text("utf-8") == pages.set_page(name, entry)
        assert (DOCS / "pictures" / f"{name}.png").is_file()


@pytest.fixture
def arena(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An arena with nothing in it."""
    for name in ("sets", "contestants", "handed", "docs"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(sets, "HERE", tmp_path / "sets")
    monkeypatch.setattr(pages, "SETS", tmp_path / "sets")
    monkeypatch.setattr(pages, "DOCS", tmp_path / "docs")
    monkeypatch.setattr(pages, "SCORES", tmp_path / "scores.json")
    monkeypatch.setattr(pages, "TIMES", tmp_path / "times.json")
    monkeypatch.setattr(programs, "CONTESTANTS", tmp_path / "contestants")
    monkeypatch.setattr(programs, "HANDED", tmp_path / "handed")
    for module in (run, programs):
        monkeypatch.setattr(module, "PLACE", tmp_path)
    for cached in (all_sets, programs.all_contestants):
        cached.cache_clear()
    yield tmp_path
    monkeypatch.undo()
    for cached in (all_sets, programs.all_contestants):
        cached.cache_clear()


def blocks(kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", (DOCS / "add.md").read_text("utf-8"), re.DOTALL)


@pytest.mark.slow
def test_a_stranger_adds_a_test_a_program_and_a_list_from_the_page_alone(arena: Path) -> None:
    (test, handed), (reader, program), (modes,) = blocks("toml"), blocks("python"), blocks("text")
    (arena / "sets" / "my_beam.toml").write_text(test)
    (arena / "sets" / "my_beam.py").write_text(reader)
    (arena / "contestants" / "mine.py").write_text(program)
    (arena / "handed" / "artemis").mkdir()
    (arena / "handed" / "artemis" / "program.toml").write_text(handed)
    (arena / "handed" / "artemis" / "my_beam.csv").write_text(modes)
    assert len((test + reader).splitlines()) <= 40
    (asked,) = re.findall(r"make arena SET=(my_beam) PROGRAM=(\w+)", (DOCS / "add.md").read_text("utf-8"))
    for name in (asked[1], "ARTeMIS"):
        run.main(["--set", asked[0], "--program", name, "--no-pictures"])
    with pytest.raises(SystemExit):
        run.main(["--program", "nobody"])
    first = (arena / "scores.json").read_text("utf-8")
    told = json.loads(first)
    peaks, theirs = (told["totals"]["decay"][name] for name in ("peaks", "ARTeMIS"))
    assert peaks | {"found": 3, "false": 0, "human": 1} == peaks
    assert theirs | {"found": 0, "false": 2, "human": 2, "wrong_without_a_word": 1} == theirs  # one is marked
    assert "3 of 3" in (arena / "docs" / "sets" / "my_beam.md").read_text("utf-8")
    assert "Nothing false or twice: peaks found 3 of 3 (1 number by a person)." in pages.index(told)
    of_the_schema(told)
    (arena / "contestants" / "mine.py").touch()  # the same text: what is there counts, and nothing differs
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "_run", lambda *_: pytest.fail("it was run again"))
        run.main(["--no-pictures"])
    assert (arena / "scores.json").read_text("utf-8") == first


def test_a_program_that_fails_or_cannot_is_told_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, result = tmp_path / "data.npz", tmp_path / "result.json"
    about = {"kind": "decay", "band": None, "quantity": None, "labels": [["1"]], "answers": {"modes": None}}
    np.savez(path, about=np.array(json.dumps(about)), outputs=np.zeros((4, 1)), sampling_rate=2.0)
    monkeypatch.setattr(child, "limited", lambda: None)
    monkeypatch.setitem(__import__("sys").modules, "child", child)
    for body, told in (
        ("raise ValueError('no')", {"status": "failed", "text": "ValueError: no", "human": 0}),
        ("test.human('modes')", {"status": "cannot", "human": 0}),
        ("raise MemoryError", {"status": "limit", "human": 0}),
        (
            "return {'frequencies': [2, float('nan'), 0], 'damping_ratios': 3 * [.1]}",
            {"human": 0, "frequencies": [2.0]},
        ),
    ):
        (tmp_path / "one.py").write_text(f"REQUIRES = ()\ndef run(test, variant):\n    {body}\n")
        monkeypatch.setattr("sys.argv", ["child.py", str(tmp_path / "one.py"), "one", str(path), str(result)])
        child.main()
        found = json.loads(result.read_text())
        assert found | told == found


def test_a_person_counts_where_there_is_something_to_find() -> None:
    test = object.__new__(child.Test)
    test.sampling_rate, test.told, outputs = 10.0, 0, np.arange(40.0)[:, None]
    test._answers = {"decimation": 1, "start": 0}
    assert test.slower(outputs)[0] is not None
    assert test.told == 0
    test._answers = {"decimation": 2, "start": 1.0}
    later, rate = test.slower(outputs)
    assert (len(later), rate, test.told) == (15, 5.0, 2)
    assert later[5:10, 0] == pytest.approx(np.arange(20.0, 30.0, 2.0), rel=0.01)


def test_modes_of_a_model_in_discrete_time() -> None:
    known = ms.systems.chain5().modes().take([0, 1])
    z = np.exp(known.poles / 20.0)
    A, V = np.diag([*z, *z.conj()]), np.hstack([known.shapes, known.shapes.conj()])
    told = child.modes_of(A, V, 20.0)
    assert told["frequencies"] == pytest.approx(known.frequencies)
    assert told["damping_ratios"] == pytest.approx(known.damping_ratios)
    assert told["shapes"] == pytest.approx(known.shapes)


def test_our_own_row_falls_by_more_than_chance_or_not() -> None:
    assert judge.chance(6, 0) == 1 / 64
    assert judge.chance(3, 3) == pytest.approx(42 / 64)
    known = reference([10.0, 20.0, 30.0], shapes=np.eye(3))

    def runs(f: list[float], columns: list[int]) -> dict[str, Any]:
        return scores.judged(known, (), None, listed(f, shapes=np.eye(3)[:, columns]))

    all_right, one_lost = runs([10.0, 20.0, 30.0], [0, 1, 2]), runs([10.0, 20.0], [0, 1])
    one_false = runs([10.0, 10.0, 20.0, 30.0], [0, 0, 1, 2])

    def fallen(before: dict[str, Any], now: dict[str, Any], names: str = "abcdef") -> list[str]:
        return judge.fallen(dict.fromkeys(names, before), dict.fromkeys(names, now))

    assert fallen(all_right, all_right) == []
    assert fallen(all_right, one_lost) == ["found: 6 worse, 0 better"]
    assert fallen(all_right, one_lost, "abcde") == []  # five of five
    assert fallen(one_lost, all_right) == []
    assert fallen(all_right, one_false) == [
        "false or twice: 6 worse, 0 better",
        "wrong without a word: 6 worse, 0 better",
    ]

    def told(shape_error: float, f_held: bool) -> dict[str, Any]:
        return {"modes": [mode | {"shape_error": shape_error, "f_held": f_held} for mode in all_right["modes"]]}

    worse = [score for score, count in judge.changes(told(0.01, True), told(0.1, False)) if count > 0]
    assert sorted(worse) == 3 * ["intervals that hold"] + 3 * ["shapes"]


def test_another_file_than_the_set_names_is_refused(arena: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (arena / "x.npy").write_bytes(b"another")
    monkeypatch.setattr(sets, "PLACES", (arena,))
    one = sets.ArenaSet("x", {"files": {"x.npy": 64 * "0"}, "source": "nowhere"})
    with pytest.raises(sets.Missing, match="differs"):
        one.paths()
    with pytest.raises(sets.Missing, match="from: nowhere"):
        sets.ArenaSet("x", {"files": {"y.npy": 64 * "0"}, "source": "nowhere"}).paths()
