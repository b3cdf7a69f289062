"""The command `watch`: a folder into a store."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

import modalscope as ms
from modalscope.cli import main
from modalscope.systems import chain5


def test_a_folder_goes_into_a_store(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ms.write(tmp_path / "20260601_0000.npz", chain5().impulse_response(150, noise=0.01, seed=0))
    (tmp_path / "20260601_0100.csv").write_text("spoilt\n")
    weather = tmp_path / "weather.txt.table"
    weather.write_text("time,temperature\n2026-05-31,10\n2026-06-02,14\n")
    for path in tmp_path.iterdir():
        os.utime(path, (time.time() - 3600,) * 2)
    command = ["watch", str(tmp_path), "--store", str(tmp_path / "a.modes"), "--once", "--method", "era"]
    assert main([*command, "--covariates", str(weather)]) == 0
    told = capsys.readouterr()
    assert "1 stored, 0 known before, 1 cannot be used" in told.out
    assert "20260601_0100.csv" in told.err
    with ms.monitoring.Store(tmp_path / "a.modes") as store:
        assert store.history().covariates["temperature"].tolist() == [12.0]
    assert main(command) == 0
    assert "0 stored, 2 known before, 0 cannot be used" in capsys.readouterr().out


def test_a_folder_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["watch", str(tmp_path / "x"), "--store", str(tmp_path / "a.modes"), "--once"]) == 2
    assert "there is no such folder" in capsys.readouterr().err
