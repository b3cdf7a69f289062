"""Files and ranges as users write them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.interfaces.cli.reading import parse_orders


def test_both_ends_of_a_range_of_orders_belong_to_it():
    assert list(parse_orders("2:60:2")) == list(range(2, 61, 2))
    assert list(parse_orders("4:6")) == [4, 5, 6]


def test_arrays_with_other_names_and_axes_are_read(tmp_path):
    clean = ms.systems.chain5().frequency_response(np.linspace(0.3, 8, 200), quantity="acceleration")
    path = tmp_path / "other.npz"
    np.savez(path, freq=clean.frequencies, H=clean.values.transpose(2, 1, 0))
    words = ["--rename", "freq=frequencies", "--rename", "H=values", "--axes", "values=inputs,outputs,lines"]
    assert main(["identify", str(path), *words, "--quantity", "acceleration"]) == 0


def test_units_are_converted_and_what_is_not_known_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "run.npz"
    rng = np.random.default_rng(0)
    np.savez(place, outputs=rng.standard_normal((200, 2)), inputs=rng.standard_normal((200, 1)), sampling_rate=10.0)
    assert main(["info", str(place), "--units", "y1=100 mV/g,y2=furlong,inputs=lbf"]) == 0
    out = capsys.readouterr().out
    assert "y1 from 100 mV/g to m/s2 (times 0.0980665); u1 from lbf to N" in out
    assert "the unit furlong of y2 is not known" in out


def test_conjugated_responses_are_turned_by_the_option_that_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clean = ms.systems.chain5().frequency_response(
        np.linspace(0.3, 8, 200), quantity="acceleration", noise=0.01, seed=0
    )
    place = tmp_path / "turned.npz"
    ms.write(place, replace(clean, values=clean.values.conj()))
    assert main(["info", str(place)]) == 0
    (said,) = [line for line in capsys.readouterr().out.splitlines() if "conjugated:" in line]
    (option,) = [word.strip(",.") for word in said.split() if word.startswith("--")]
    assert main(["info", str(place), option]) == 0
    assert "conjugated:" not in capsys.readouterr().out
    assert np.array_equal(ms.read(place, conjugate=True).values, clean.values)
    records = tmp_path / "records.npz"
    ms.write(records, ms.Signals(outputs=np.ones((20, 1)) * np.arange(20)[:, None], sampling_rate=1.0))
    assert main(["info", str(records), "--conjugate"]) != 0
    assert "the options conjugate: the file gives records" in capsys.readouterr().err


def test_a_folder_is_answered_by_what_names_its_files_which_any_shell_may_hand_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "hits [1]" / "first"
    folder.mkdir(parents=True)
    for name in ("a.csv", "b.csv", ".hidden.csv"):
        (folder / name).write_text("time,acc\n" + "".join(f"{k / 100},{k * k % 17}\n" for k in range(99)))
    (folder / "notes").touch()
    monkeypatch.chdir(tmp_path)
    assert main(["info", "hits [1]"]) == 2
    said = capsys.readouterr().err
    assert "that is a folder. Name a file in it, such as 'hits [1]/first/a.csv', or several: 'hits [1]/first'/*" in said
    assert main(["info", "hits [1]/first/*.csv", "hits [1]/first/none*.csv"]) == 2
    assert "none*.csv': there is no such file" in capsys.readouterr().err
    assert main(["info", "hits [1]/first/*.csv"]) == 0
    assert "together: records: " in capsys.readouterr().out
    (tmp_path / "bare").mkdir()
    assert main(["info", "bare"]) == 2
    assert "Name a file; none in it has a suffix that is read." in capsys.readouterr().err
