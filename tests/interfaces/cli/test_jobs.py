"""Commands for the jobs around an identification, run as a user runs them."""

from __future__ import annotations

import json
import re
import subprocess
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.interfaces.cli.commands import names
from modalscope.io.atomic import is_ours
from modalscope.systems import chain5


@pytest.fixture
def runs(tmp_path: Path) -> list[str]:
    """Return two runs of one test with inputs."""
    paths = [str(tmp_path / f"run{k}.npz") for k in (1, 2)]
    for seed, path in enumerate(paths):
        words = ["simulate", "chain5", "--kind", "records", "--samples", "1000", "--noise", "50", "--seed", str(seed)]
        assert main([*words, "-o", path]) == 0
    return paths


@pytest.mark.slow
def test_runs_of_one_test_are_identified_together_and_repeated_by_the_document(
    runs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = [tmp_path / name for name in ("r.json", "r.csv")]
    words = ["identify", *runs, "--orders", "8:16:2", *(w for place in places for w in ("-o", str(place)))]
    assert main(words) == 0
    assert "2 runs" in capsys.readouterr().out
    written = json.loads(places[0].read_text())
    assert [Path(file["path"]).name for file in written["analysis"]["files"]] == ["run1.npz", "run2.npz"]
    again = ms.replay(places[0])
    assert np.array_equal(again.modes.poles, ms.read(places[0]).poles)
    assert len(again.data.by_run()[0]) == 2
    assert len(places[1].read_text().splitlines()) == 1 + len(again.modes)


@pytest.mark.slow
def test_a_run_that_has_changed_is_refused_when_the_document_is_replayed(runs: list[str], tmp_path: Path) -> None:
    place = tmp_path / "r.json"
    assert main(["identify", *runs, "--orders", "8:12:2", "-q", "-o", str(place)]) == 0
    assert main(["simulate", "chain5", "--kind", "records", "--samples", "1000", "--seed", "9", "-o", runs[1]]) == 0
    with pytest.raises(ms.DataError, match=r"run2\.npz were expected"):
        ms.replay(place)


def test_json_alone_is_on_stdout_where_that_is_asked(test_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["identify", str(test_file), "--orders", "10:14:2", "--no-refine", "-o", "-"]) == 0
    out, err = capsys.readouterr()
    assert len(json.loads(out)["modes"]) == 5
    assert "damping [%]" in err


@pytest.mark.parametrize(
    "words",
    [["-q"], ["-vq"], ["-qq"], ["--verbose"], ["--config", "x.toml"], ["--config=x.toml", "-q"], ["--log", "x.log"]],
)
def test_what_every_command_takes_may_stand_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text("[methods]\n")
    assert main([*words, "methods"]) == 0
    assert "polyreference" in capsys.readouterr().out


@pytest.mark.slow
def test_quiet_says_the_result_alone_and_verbose_what_was_chosen(
    test_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {}
    for how in ("-q", "", "-v"):
        capsys.readouterr()
        assert main(["identify", str(test_file), "--orders", "8:14:2", *([how] if how else [])]) == 0
        said[how] = capsys.readouterr().out
    assert "FD-subspace" not in said["-q"]
    assert "damping [%]" in said["-q"]
    assert "FD-subspace" in said[""]
    assert "block_rows=" not in said[""]
    assert "block_rows=" in said["-v"]


def test_each_file_is_a_test_of_its_own_and_modes_stand_beside_those_of_the_first(
    runs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    words = [
        "identify",
        "--orders",
        "10:14:2",
        "--no-refine",
        "-o",
        str(tmp_path / "m.json"),
        "--each",
        *runs,
        str(tmp_path / "no.npz"),
    ]
    with pytest.raises(SystemExit, match="4"):
        main(words)
    out, err = capsys.readouterr()
    rows = [line for line in out.splitlines() if re.match(r" *\d  ", line)]
    assert len(rows) == 5
    assert all(row.count("Hz") == 2 for row in rows)
    assert len(err.splitlines()) == 2
    assert "no.npz: " in err
    assert "1 of 3 files failed: no.npz" in err
    assert (tmp_path / "m_run1.json").exists()
    assert (tmp_path / "m_run2.json").exists()


@pytest.mark.slow
def test_each_file_is_paired_with_a_reference_where_one_is_given(
    runs: list[str], modes_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(["identify", "--each", "--reference", str(modes_file), "--orders", "8:24:2", "-q", *runs]) == 0
    out = capsys.readouterr().out
    rows = [line for line in out.splitlines() if re.match(r" *\d  ", line)]
    assert len(rows) == len(ms.read(modes_file))
    assert all(row.count("Hz") == 3 for row in rows)


@pytest.mark.slow
def test_options_come_from_a_file_and_the_command_line_counts_more(
    test_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml = tmp_path / "options.toml"
    toml.write_text('[identify]\norders = "6:8:2"\nno-refine = true\nband = [[0.5, 3], [3, 7]]\n')
    capsys.readouterr()
    assert main(["identify", str(test_file), "--config", str(toml)]) == 0
    out = capsys.readouterr().out
    assert out.count("orders 6 to 8") == 1  # said once for both bands
    assert main(["identify", str(test_file), f"--config={toml}", "--orders", "10:12:2"]) == 0
    assert "orders 10 to 12" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[identfy]\n", "'identfy' is no table of a command"),
        ("identify = 3\n", "is no table"),
        ("[identify\n", "it is no TOML"),
        ('[identify]\nordres = "2:4"\n', "did you mean --orders"),
    ],
)
def test_a_file_of_options_that_is_wrong_says_where(
    text: str, words: str, test_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml = tmp_path / "options.toml"
    toml.write_text(text)
    with suppress(SystemExit):
        assert main(["identify", str(test_file), "--config", str(toml)]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_frequency_responses_are_estimated_written_and_drawn(runs: list[str], tmp_path: Path) -> None:
    places = [tmp_path / name for name in ("H.uff", "H.npz", "H.png", "H.svg", "H.pdf")]
    words = ["frf", *runs, "--segment", "500", "--band", "0.5", "8", "--estimator", "hv"]
    assert main([*words, *(w for place in places for w in ("-o", str(place)))]) == 0
    found = ms.read(places[1])
    expected = ms.estimate_frf(ms.merge([ms.read(run) for run in runs]), estimator="hv", segment=500).band(0.5, 8)
    assert np.array_equal(found.values, expected.values)
    assert all(is_ours(place) for place in places)


def test_parts_of_a_test_become_one_file(runs: list[str], tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    assert main(["merge", *runs, "-o", str(tmp_path / "both.h5")]) == 0
    assert ms.read(tmp_path / "both.h5").runs == 2


def test_two_sets_of_modes_stand_beside_each_other(
    modes_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ms.write(tmp_path / "other.npz", ms.read(modes_file)[1:])
    capsys.readouterr()
    assert main(["mac", str(modes_file), str(tmp_path / "other.npz"), "-o", str(tmp_path / "mac.png")]) == 0
    out = capsys.readouterr().out
    assert len(re.findall(r"1\.000 +0\.0 ", out)) == 4
    assert "only in a: mode 1" in out
    assert is_ours(tmp_path / "mac.png")
    assert main(["mac", str(modes_file), str(tmp_path / "other.npz"), "-o", str(tmp_path / "mac.json")]) == 2


@pytest.mark.slow
def test_a_model_is_realized_and_read_back_from_every_format(runs: list[str], tmp_path: Path) -> None:
    pytest.importorskip("h5py")
    places = [tmp_path / f"model.{suffix}" for suffix in ("mat", "npz", "h5", "json")]
    assert main(["realize", runs[0], "--order", "10", *(w for place in places for w in ("-o", str(place)))]) == 0
    models = [ms.read(place) for place in places]
    expected = ms.realize(ms.read(runs[0]), order=10)
    for model in models:
        assert isinstance(model, ms.StateSpace)
        assert all(np.array_equal(getattr(model, name), getattr(expected, name)) for name in "ABCD")
        assert model.dt == expected.dt


@pytest.mark.slow
def test_a_model_is_validated_on_a_record_and_modes_on_responses(
    test_file: Path, modes_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, other = (tmp_path / f"{name}.npz" for name in ("first", "other"))
    for seed, place in enumerate((first, other)):
        ms.write(place, chain5().simulate(inputs="white", samples=800, sampling_rate=20.0, noise=0.02, seed=seed))
    model = tmp_path / "model.mat"
    assert main(["realize", str(first), "--order", "10", "--method", "n4sid", "-q", "-o", str(model)]) == 0
    capsys.readouterr()
    poles = tmp_path / "poles.png"
    assert main(["plot", str(model), "-o", str(poles)]) == 0
    assert is_ours(poles)
    picture = tmp_path / "fit.svg"
    assert main(["validate", str(model), str(other), "-o", str(picture)]) == 0
    assert is_ours(picture)
    groups = [each.get("id", "") for each in ElementTree.parse(picture).getroot().iter()]
    assert sum(name.startswith("axes_") for name in groups) == 4  # three outputs, one from near
    out = capsys.readouterr().out
    assert "errors of prediction" in out
    seen = ms.validate(ms.read(model), ms.read(other))
    assert seen.free_run.min() > 99
    assert all(f"{value:.1f}" in out for value in seen.free_run)
    assert seen.table_of_outputs() in out
    assert main(["validate", str(modes_file), str(test_file), "--leaving", "outputs", "-q"]) == 0
    assert "left out" in capsys.readouterr().out
    assert main(["validate", str(first), str(other)]) == 2


def test_a_model_has_no_place_in_files_of_measurements(tmp_path: Path) -> None:
    model = chain5().state_space(dt=0.05)
    for suffix in ("uff", "csv"):
        with pytest.raises(ms.DataError, match="StateSpace as"):
            ms.write(tmp_path / f"model.{suffix}", model)


def test_modes_are_refined_from_files(test_file: Path, modes_file: Path, tmp_path: Path) -> None:
    place = tmp_path / "refined.json"
    assert main(["refine", str(test_file), "--modes", str(modes_file), "-q", "-o", str(place)]) == 0
    assert np.allclose(ms.read(place).frequencies, ms.read(modes_file).frequencies, rtol=1e-3)
    assert main(["refine", str(test_file), "--modes", str(test_file), "-q", "-o", str(place)]) == 2


def test_deflection_shapes_are_written_and_listed(
    test_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "shapes.uff"
    assert main(["ods", str(test_file), "--frequency", "0.91", "2.64", "-o", str(place)]) == 0
    found = ms.ods(ms.read(test_file), [0.91, 2.64])
    assert np.allclose(ms.read(place).shapes, found.shapes, rtol=1e-4)
    out = capsys.readouterr().out
    assert all(f"{f:.4f}" in out for f in found.frequencies)
    assert main(["ods", str(test_file), "--order", "1"]) == 2


def test_spectra_show_their_peaks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records, picture = tmp_path / "ambient.npz", tmp_path / "psd.png"
    assert main(["simulate", "chain5", "--kind", "ambient", "-o", str(records)]) == 0
    capsys.readouterr()
    assert main(["psd", str(records), "--peaks", "3", "-o", str(picture)]) == 0
    out = capsys.readouterr().out
    assert len(re.findall(r"^ +\d  +\d+\.\d+  +(\d+\.\d+|-)$", out, re.MULTILINE)) == 3  # frequency and damping
    assert is_ours(picture)


@pytest.mark.slow
def test_what_files_hold_is_drawn(test_file: Path, modes_file: Path, tmp_path: Path) -> None:
    ms.write(tmp_path / "diagram.npz", ms.stabilize(ms.read(test_file), orders=range(6, 13, 2)))
    ms.write(tmp_path / "node.json", ms.realize(ms.read(test_file), order=10))
    for name, more in (
        (test_file, ["--modes", str(modes_file), "--band", "0.5", "7"]),
        (modes_file, ["--mode", "2"]),
        (tmp_path / "diagram.npz", ["--modes", str(modes_file)]),
        (tmp_path / "node.json", []),
    ):
        place = tmp_path / f"{name.stem}.png"
        assert main(["plot", str(name), *more, "-o", str(place)]) == 0
        assert is_ours(place)
    assert main(["plot", str(modes_file)]) == 2


@pytest.mark.slow
def test_a_saved_result_becomes_a_report(modes_file: Path, test_file: Path, tmp_path: Path) -> None:
    assert main(["report", str(modes_file), "-o", str(tmp_path / "r.html"), "--title", "The tower"]) == 0
    assert "The tower" in (tmp_path / "r.html").read_text()
    moved = tmp_path / "moved.uff"
    test_file.rename(moved)
    assert main(["report", str(modes_file), "-o", str(tmp_path / "s.html")]) == 2
    assert main(["report", str(modes_file), "--data", str(moved), "-o", str(tmp_path / "s.html")]) == 0


def test_a_report_keeps_to_the_memory_that_reading_may_take(
    modes_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["report", str(modes_file), "-o", str(tmp_path / "r.html")]
    try:
        assert main([*words, "--max-memory", "100kB"]) == 2
    finally:
        ms.io.set_max_memory(None)
    assert "raise the limit: --max-memory" in capsys.readouterr().err


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_shells_complete_every_command(shell: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("shtab")
    assert main(["completion", shell]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in names())
    if shell == "bash":
        script = tmp_path / "completion.bash"
        script.write_text(text)
        assert subprocess.run(["bash", "-n", str(script)], check=False).returncode == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--order", "20"], "unknown: --order 20 (did you mean --orders"),
        (["--orders", "4", "20"], "unknown: 20 (written --orders A:B:STEP"),
        (["--band", "1", "2", "3"], "unknown: 3 ("),
    ],
)
def test_words_are_taken_whole_and_the_nearest_or_how_an_option_is_written_is_named(
    test_file: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["identify", str(test_file), *words])
    assert stop.value.code == 2
    assert said in capsys.readouterr().err


def test_two_tests_of_one_name_do_not_share_a_file(
    test_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other").mkdir()
    other = tmp_path / "other" / test_file.name
    other.write_bytes(test_file.read_bytes())
    assert main(["identify", str(test_file), str(other), "--each", "-o", str(tmp_path / "m.json")]) == 2
    assert f"m_{test_file.stem}.json would be written for several" in capsys.readouterr().err


def test_a_file_of_options_that_is_nested_without_end_is_one_line(
    test_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deep = tmp_path / "deep.toml"
    deep.write_text(f"[identify]\nband = {'[' * 5000}{']' * 5000}\n")
    assert main(["identify", str(test_file), "--config", str(deep)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
