"""The commands as a user runs them: files in, tables on stdout, files out."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import modalscope as ms
from modalscope.cli import main


@pytest.fixture
def test_file(tmp_path):
    path = tmp_path / "test.uff"
    assert main(["simulate", "chain5", "--noise", "40", "-o", str(path)]) == 0
    return path


def test_identify_writes_modes_that_read_back_as_they_were_printed(test_file, tmp_path, capsys):
    target = tmp_path / "modes.json"
    assert main(["identify", str(test_file), "-o", str(target)]) == 0
    out = capsys.readouterr().out
    document = json.loads(target.read_text())
    assert document["method"] == "alternate"
    assert document["domain"] == "s"
    modes = ms.read(target)
    assert isinstance(modes, ms.ModalModel)
    assert len(modes) == len(document["modes"]) == 5
    for mode, f in zip(document["modes"], modes.frequencies, strict=True):
        assert mode["frequency_hz"] == pytest.approx(f, rel=1e-12)
        assert mode["frequency_std_hz"] is None
        assert mode["reasons"]["orders_found"] >= 5
        assert f"{f:.4f}" in out


@pytest.mark.parametrize("suffix", [".json", ".csv", ".html", ".uff"])
def test_every_result_format_is_written(test_file, tmp_path, suffix):
    target = tmp_path / f"modes{suffix}"
    assert main(["identify", str(test_file), "--band", "0.5", "7", "--orders", "2:40:2", "-o", str(target)]) == 0
    assert target.stat().st_size > 200


def test_progress_goes_to_stderr_and_results_to_stdout(test_file):
    run = subprocess.run(
        [sys.executable, "-m", "modalscope", "identify", str(test_file)], capture_output=True, text=True, check=True
    )
    assert "f [Hz]" in run.stdout
    assert "order/s" not in run.stdout


def test_info_tells_what_was_taken_and_how_good_it_is(test_file, capsys):
    assert main(["info", str(test_file)]) == 0
    said = capsys.readouterr().out
    assert "frequency responses" in said
    assert "quality" in said


def test_convert_keeps_every_number(test_file, tmp_path):
    target = tmp_path / "test.npz"
    assert main(["convert", str(test_file), str(target)]) == 0
    assert np.array_equal(ms.read(target).values, ms.read(test_file).values)


def test_methods_prints_the_whole_table(capsys):
    assert main(["methods"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 1 + len(ms.methods())


@pytest.mark.parametrize("kind", ["frf", "impulse", "records", "ambient"])
def test_every_kind_of_simulated_test_is_identified(kind, tmp_path):
    path = tmp_path / "test.npz"
    assert main(["simulate", "heavy4", "--kind", kind, "-o", str(path)]) == 0
    assert main(["identify", str(path)]) == 0


def test_bands_given_one_by_one_are_merged_and_no_mode_stands_twice(test_file, tmp_path, capsys):
    target = tmp_path / "modes.json"
    bands = ["--band", "0.5", "4.5", "--band", "3.5", "7"]
    assert main(["identify", str(test_file), *bands, "-o", str(target)]) == 0
    assert len(ms.read(target)) == 5
    assert "2 bands merged" in capsys.readouterr().out


def test_arrays_with_other_names_and_axes_are_read(tmp_path):
    clean = ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 200), quantity="acceleration")
    path = tmp_path / "other.npz"
    np.savez(path, freq=clean.frequencies, H=clean.values.transpose(2, 1, 0))
    words = ["--rename", "freq=frequencies", "--rename", "H=values", "--axes", "values=inputs,outputs,lines"]
    assert main(["identify", str(path), *words, "--quantity", "acceleration"]) == 0


def test_what_a_universal_file_cannot_hold_of_modes_is_said(test_file, tmp_path, capsys):
    kept, lost = tmp_path / "modes.json", tmp_path / "modes.uff"
    assert main(["identify", str(test_file), "-o", str(kept)]) == 0
    assert main(["convert", str(kept), str(lost)]) == 0
    assert "participation, spreads, indicators and reasons are left out" in capsys.readouterr().out


def test_info_on_a_file_of_geometry_tells_its_nodes(tmp_path, capsys):
    path = tmp_path / "geometry.uff"
    ms.write(path, ms.systems.chain5().geometry)
    assert main(["info", str(path)]) == 0
    assert "nodes" in capsys.readouterr().out
