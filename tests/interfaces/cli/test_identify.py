"""modalscope identify as a user runs it: tables on stdout, modes and reports in files."""

from __future__ import annotations

import html
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.interfaces.cli.identify import _print
from modalscope.interfaces.reporting.document import Origin, stabilization_sections
from modalscope.systems import chain5


def test_identify_writes_modes_that_read_back_as_they_were_printed(test_file, tmp_path, capsys):
    target = tmp_path / "modes.json"
    assert main(["identify", str(test_file), "--orders", "6:20:2", "-o", str(target)]) == 0
    out = capsys.readouterr().out
    document = json.loads(target.read_text())
    assert document["method"] == "alternate"
    assert document["domain"] == "s"
    modes = ms.read(target)
    assert isinstance(modes, ms.ModalModel)
    assert len(modes) == len(document["modes"]) == 5
    for mode, f in zip(document["modes"], modes.frequencies, strict=True):
        assert mode["frequency_hz"] == pytest.approx(f, rel=1e-12)
        assert 0 < mode["frequency_std_hz"] < 1e-4 * f
        assert mode["frequency_repeatability_hz"] is None  # two inputs are too few to disagree
        assert mode["reasons"]["orders_found"] >= 5
        assert f"{f:.6f}"[:5] in out


@pytest.mark.slow
def test_values_are_refined_unless_that_is_refused(test_file, tmp_path):
    refined, plain, orders = tmp_path / "refined.json", tmp_path / "plain.json", ["--orders", "6:20:2"]
    assert main(["identify", str(test_file), *orders, "-o", str(refined)]) == 0
    assert main(["identify", str(test_file), *orders, "--no-refine", "-o", str(plain)]) == 0
    first, second = (json.loads(path.read_text()) for path in (refined, plain))
    assert [mode["frequency_hz"] for mode in first["unrefined"]] == [mode["frequency_hz"] for mode in second["modes"]]
    assert second["unrefined"] is None
    assert (first["analysis"]["refine"], second["analysis"]["refine"]) == (True, False)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".json", ".csv", ".html", ".uff"])
def test_every_result_format_is_written(test_file, tmp_path, suffix):
    target = tmp_path / f"modes{suffix}"
    assert main(["identify", str(test_file), "--band", "0.5", "7", "--orders", "2:20:2", "-o", str(target)]) == 0
    assert target.stat().st_size > 200


@pytest.mark.slow
def test_progress_goes_to_stderr_and_results_to_stdout(test_file):
    words = ["identify", str(test_file), "--orders", "6:12:2", "--no-refine"]
    run = subprocess.run([sys.executable, "-m", "modalscope", *words], capture_output=True, text=True, check=True)
    assert "f [Hz]" in run.stdout
    assert "order/s" not in run.stdout


@pytest.mark.slow
def test_bands_given_one_by_one_are_merged_and_no_mode_stands_twice(test_file, tmp_path, capsys):
    target = tmp_path / "modes.json"
    bands = ["--band", "0.5", "4.5", "--band", "3.5", "7"]
    assert main(["identify", str(test_file), *bands, "-o", str(target)]) == 0
    assert len(ms.read(target)) == 5
    told = capsys.readouterr().out
    said = [line for line in told.splitlines() if line.startswith("  ")]
    assert told.count(", orders ") == 1  # both bands were done in one way
    assert said
    assert len(set(said)) == len(said)  # what both noted is said once


@pytest.mark.slow
def test_a_document_is_done_again(test_file, tmp_path, capsys):
    document, first, again = tmp_path / "a.analysis.json", tmp_path / "first.json", tmp_path / "again.json"
    result = ms.analyze(test_file, orders=range(2, 21, 2))
    ms.write(first, result)
    ms.write(document, result.analysis)
    assert main(["identify", str(document), "-o", str(again)]) == 0
    assert json.loads(again.read_text())["modes"] == json.loads(first.read_text())["modes"]


@pytest.mark.slow
def test_a_delay_is_taken_out_unless_the_command_line_refuses(tmp_path, capsys):
    run = ms.systems.chain5().simulate(
        inputs="white", samples=1500, sampling_rate=16.0, quantity="acceleration", seed=3
    )
    late, file = 12, tmp_path / "late.csv"
    table = np.column_stack([np.arange(1500 - late) / 16.0, run.inputs[late:], run.outputs[:-late]])
    names = ["t [s]", *(f"F{i} [N]" for i in range(run.inputs.shape[1])), *(f"a{i} [m/s2]" for i in range(4))]
    np.savetxt(file, table, delimiter=",", header=",".join(names), comments="")
    words = ["realize", str(file), "--order", "10", "-o"]
    assert main([*words, str(tmp_path / "back.npz")]) == 0
    assert "shifted back by 12 samples, their delay after the forces" in capsys.readouterr().out
    assert main([*words, str(tmp_path / "left.npz"), "--delays", "none"]) == 0
    assert "taken out" not in capsys.readouterr().out
    assert main([*words, str(tmp_path / "known.npz"), "--delays", *(f"a{i}={late}" for i in range(4))]) == 0
    models = {name: ms.read(tmp_path / f"{name}.npz") for name in ("back", "left", "known")}
    np.testing.assert_array_equal(models["back"].A, models["known"].A)
    assert not np.allclose(models["back"].A, models["left"].A)


@pytest.mark.parametrize("kind", ["frf", "ambient"])
def test_the_terminal_says_of_merged_bands_what_the_report_says(kind, capsys):
    made = chain5()
    if kind == "frf":  # two sensors beside each other: shapes are alike
        full = made.frequency_response(np.linspace(0.3, 7.5, 300), noise=0.01, seed=0)
        few = {"values": full.values[:, :2], "output_dofs": full.output_dofs[:2], "units": (("", ""), full.units[1])}
        data, bands = replace(full, **few), ((0.3, 3.4), (3.4, 7.5))
    else:
        data = made.simulate(inputs="ambient", samples=4000, sampling_rate=20.0, noise=0.05, seed=0)
        bands = ((0.5, 3.4), (3.4, 7.5))
    result = ms.analyze(data, band=bands, orders=range(4, 13, 4), refine=False)
    _print(result)
    out = capsys.readouterr().out
    summary = next(stabilization_sections(result.modes, result.diagram, Origin(diagrams=result.diagrams))).body
    words = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", summary)).split())
    start = r"Unexplained: |Graded: |WARNING: |No force was measured"
    said = [line for line in out.replace(" Graded: ", "\nGraded: ").splitlines() if re.match(start, line)]
    assert any("of the response" in line for line in said)
    assert any("are alike (MAC" in line for line in said) == (kind == "frf")
    assert any("taken as ambient" in line for line in said) == (kind == "ambient")
    assert all(line in words for line in said)
    assert len(said) == len(re.findall(start, words))


def test_a_free_decay_is_said_and_may_be_taken_as_ambient(tmp_path, capsys):
    path = tmp_path / "plucked.csv"
    decay = chain5().free_decay(1200, displacement=[0.2, 0.4, 1, -0.3, 0.1], sampling_rate=20.0).values[:, :, 0]
    noisy = decay + 1e-3 * np.random.default_rng(0).standard_normal(decay.shape)
    table = np.column_stack([np.arange(1200) / 20, noisy])
    np.savetxt(path, table, delimiter=",", header="time [s],a [m],b [m],c [m],d [m],e [m]", comments="")
    assert main(["identify", str(path), "--no-refine", "--orders", "10:10"]) == 0
    assert "Taken as a free decay from 0 s on" in "".join(capsys.readouterr())
    assert main(["identify", str(path), "--no-refine", "--orders", "10:10", "--route", "correlation"]) == 0
    assert "Taken as a free decay" not in "".join(capsys.readouterr())


def test_the_data_matrix_may_be_chosen(tmp_path, capsys):
    data = chain5().impulse_response(120, noise=0.01, seed=0)
    ms.write(tmp_path / "decay.npz", data)
    expert = ["--method", "era", "--row-shifts", "0,1,2,4,8", "--block-columns", "40"]
    out = tmp_path / "modes.json"
    assert main(["identify", str(tmp_path / "decay.npz"), *expert, "--no-refine", "-o", str(out)]) == 0
    same = ms.analyze(data, method="era", row_shifts=[0, 1, 2, 4, 8], block_columns=40, refine=False)
    assert np.array_equal(ms.read(out).frequencies, same.modes.frequencies)
    assert main(["identify", str(tmp_path / "decay.npz"), "--row-shifts", "0,x"]) == 2
    assert "Write them as 0,1,2,4" in capsys.readouterr().err
