"""The whole job on an ordinary file, as a user does it: refused with an option, and with that option done."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from modalscope.interfaces.cli import main
from modalscope.systems import chain5


@pytest.mark.slow
def test_a_table_of_a_recorder_gives_the_modes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = chain5().simulate(samples=3000, sampling_rate=20.0, seed=1)
    rows = np.column_stack([record.inputs, record.outputs])
    heads = ["Kraft 1", "Kraft 2", *(f"Sensor {k}" for k in range(1, 5))]
    lines = [";".join(f"{value:.6f}".replace(".", ",") for value in row) for row in rows]
    path = tmp_path / "test.txt"
    path.write_text(";".join(heads) + "\n" + ";".join(["N", "N", *["m/s²"] * 4]) + "\n" + "\n".join(lines) + "\n")
    assert main(["identify", str(path)]) == 2
    assert "--sampling-rate HZ" in capsys.readouterr().err
    target = tmp_path / "modes.json"
    assert main(["identify", str(path), "--sampling-rate", "20", "--no-refine", "-o", str(target)]) == 0
    document = json.loads(target.read_text())
    found = [mode["frequency_hz"] for mode in document["modes"]]
    np.testing.assert_allclose(found, chain5().modes().frequencies, rtol=1e-3)
    assert document["analysis"]["files"][0]["reading"] == {"sampling_rate": 20.0}


def test_info_tells_the_evidence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "test.csv"
    path.write_text(
        "Rate: 100 Hz\nForce [N];AccA [g];Temp [°C]\n" + "".join(f"{k % 7},5;{k % 5},25;20\n" for k in range(60))
    )
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    for line in (
        "cells: parted by semicolons, decimal comma",
        "line 2: names of columns",
        "line 1: sampling rate: Rate 100 Hz",
        "column 1: Force [N] (its unit is that of a force, N)",
        "column 3: Temp [°C] - left: °C is no vibration",
    ):
        assert line in told
