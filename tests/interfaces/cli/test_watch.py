"""The command `watch`: a folder into a store, and changes as lines of JSON."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.analysis.monitoring import History, Store
from modalscope.interfaces.cli import main
from modalscope.systems import chain5


def test_a_folder_goes_into_a_store(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ms.write(tmp_path / "20260601_0000.npz", chain5().impulse_response(150, noise=0.01, seed=0))
    (tmp_path / "20260601_0100.csv").write_text("spoilt\n")
    weather = tmp_path / "weather.table"
    weather.write_text("time,temperature\n2026-05-31,10\n2026-06-02,14\n")
    for path in tmp_path.iterdir():
        os.utime(path, (time.time() - 3600,) * 2)
    command = ["watch", str(tmp_path), "--store", str(tmp_path / "a.modes"), "--once", "--method", "era"]
    assert main([*command, "--covariates", str(weather)]) == 0
    told = capsys.readouterr()
    assert "1 stored, 0 known before, 1 cannot be used" in told.out
    assert "20260601_0100.csv" in told.err
    with Store(tmp_path / "a.modes") as store:
        assert store.history().covariates["temperature"].tolist() == [12.0]
    assert main(command) == 0
    assert "0 stored, 2 known before, 0 cannot be used" in capsys.readouterr().out


@pytest.fixture
def changed(tmp_path: Path) -> list[str]:
    """Return the command on an empty folder and a store of a month, at whose 20th day a frequency falls by 1 %."""
    hours = np.arange(720)
    f = np.array([1.0, 2.0]) * (1 + 5e-4 * np.random.default_rng(0).standard_normal((720, 2)))
    f[480:, 0] *= 0.99
    air = {"temperature": 10 + 5 * np.sin(hours / 4)}
    with Store(tmp_path / "a.modes") as store:
        store.add_modes(History(times=3600 * hours, record=np.repeat(hours, 2), frequencies=f.ravel(), covariates=air))
    (tmp_path / "records").mkdir()
    return ["watch", str(tmp_path / "records"), "--store", str(tmp_path / "a.modes"), "--once", "-q"]


@pytest.mark.slow
def test_a_change_is_a_line_of_json_an_exit_status_and_a_command(
    changed: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(changed) == 0
    command = f"cat > {tmp_path / 'told.json'}; exit 7"
    judged = [
        *changed,
        "--reference",
        "1970-01-01",
        "1970-01-15",
        "--chart",
        str(tmp_path / "a.png"),
        "--call",
        command,
        "-o",
        str(tmp_path / "a.html"),
    ]
    with pytest.raises(SystemExit) as stop:
        main(judged)
    assert stop.value.code == 3
    said = capsys.readouterr()
    (line,) = said.out.splitlines()
    assert "the command failed (status 7)" in said.err
    assert json.loads(line)["change"].startswith("1970-01-21")
    assert next(iter(json.loads(line)["tracks"])).startswith("1:")
    assert json.loads((tmp_path / "told.json").read_text()) == json.loads(line)
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert "1 at 1 false ones a year" in (tmp_path / "a.html").read_text()
    assert main(judged[:9]) == 0  # told once
    assert capsys.readouterr().out == ""


def test_it_waits_for_more_where_there_are_too_few_to_judge(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ms.write(tmp_path / "20260601_0000.npz", chain5().impulse_response(150, noise=0.01, seed=0))
    os.utime(tmp_path / "20260601_0000.npz", (time.time() - 3600,) * 2)

    def interrupted(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(time, "sleep", interrupted)
    command = ["watch", str(tmp_path), "--store", str(tmp_path / "a.modes"), "--method", "era"]
    assert main([*command, "--reference", "2026-01-01", "2026-07-01"]) == 130
    assert "Give more records" in capsys.readouterr().err


@pytest.mark.slow
def test_a_store_is_drawn(changed: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", changed[3], "-o", str(tmp_path / "tracks.png")]) == 0
    assert "written" in capsys.readouterr().out
    assert main(["plot", str(tmp_path / "b.modes"), "-o", str(tmp_path / "b.png")]) == 2
    assert "there is no such file" in capsys.readouterr().err


def test_a_folder_that_is_not_there_and_a_chart_without_a_reference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["watch", str(tmp_path / "x"), "--store", str(tmp_path / "a.modes"), "--once"]
    assert main(command) == 2
    assert "there is no such folder" in capsys.readouterr().err
    assert main([*command, "--chart", "a.png"]) == 2
    assert "needs --reference" in capsys.readouterr().err


@pytest.mark.slow
def test_the_workers_of_a_scheduler_identify(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed")
    for k in range(3):
        ms.write(tmp_path / f"20260601_0{k}00.npz", chain5().impulse_response(150, noise=0.01, seed=k))
        os.utime(tmp_path / f"20260601_0{k}00.npz", (time.time() - 3600,) * 2)
    store = tmp_path / "a.modes"
    command = ["watch", str(tmp_path), "--store", str(store), "--once", "--method", "era", "--scheduler", "local:1"]
    assert main(command) == 0
    assert "3 stored" in capsys.readouterr().out
