"""Channels that begin late or end early: what loses least is taken, and said in per cent; the words of the user go before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import survey
from tests.support import measured

ROWS = 400


def written(path: Path, **blank: slice) -> Path:
    """Write three channels, some of them blank in some rows."""
    rng = np.random.default_rng(0)
    channels = {name: rng.standard_normal(ROWS) for name in ("ax", "ay", "az")}
    for name, rows in blank.items():
        channels[name][rows] = np.nan
    lines = ["Time (s)," + ",".join(f"{name} (m/s^2)" for name in channels)]
    for k, row in enumerate(zip(*channels.values(), strict=True)):
        lines.append(f"{k / 100:.2f}," + ",".join("" if np.isnan(value) else f"{value:.6f}" for value in row))
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


@pytest.mark.parametrize(
    ("az", "samples", "outputs", "words"),
    [
        (slice(0, 0), 400, 3, ""),
        (slice(0, 60), 340, 3, "rows 61 to 400 of 400 are taken, 15 % are lost: column 4, 'az'"),
        (slice(300, None), 300, 3, "rows 1 to 300 of 400 are taken, 25 % are lost: column 4, 'az'"),
        (slice(266, None), 400, 2, "column 4, 'az' [m/s^2] ignored: with it 33.5 % of the rows would be lost"),
        (slice(267, None), 267, 3, "rows 1 to 267 of 400 are taken, 33.2 % are lost"),
        (slice(0, 205), 400, 2, "195 of 400 have it"),
        (slice(None), 400, 2, "column 4 (az) is empty"),
        (slice(1, None, 2), 400, 3, None),
        (np.flatnonzero(np.arange(ROWS) % 100), 400, 2, "with it 99 % of the rows would be lost, 4 of 400 have it"),
    ],
)
def test_what_loses_least_is_taken(az: Any, samples: int, outputs: int, words: str | None, tmp_path: Path) -> None:
    """Of three channels one is left where it has fewer than two thirds of the rows."""
    path = written(tmp_path / "a.csv", az=az)
    if words is None:  # half of the rows: the user decides
        with pytest.raises(ms.DataError, match="Fill these rows"):
            ms.read(path)
        return
    record, told = ms.read(path), "; ".join(survey(path).notes)
    assert record.outputs.shape == (samples, outputs)
    assert (words in told) if words else "lost" not in told


def test_what_a_note_says_works(tmp_path: Path) -> None:
    short = written(tmp_path / "a.csv", az=slice(100, None))
    assert '(to take it: --columns "time=1,out=2-4")' in "; ".join(survey(short).notes)
    assert ms.read(short, columns="time=1,out=2-4").outputs.shape == (100, 3)
    late = written(tmp_path / "b.csv", az=slice(0, 60))
    assert "(all rows without: --ignore az)" in "; ".join(survey(late).notes)
    assert ms.read(late, ignore="az").outputs.shape == (400, 2)
    two = written(tmp_path / "c.csv", ay=slice(0, 30), az=slice(0, 30))
    assert "(all rows without: --ignore ay --ignore az)" in "; ".join(survey(two).notes)
    assert ms.read(two, ignore=["ay", "az"]).outputs.shape == (400, 1)


def test_parts_of_a_response_are_left_together(tmp_path: Path) -> None:
    f = np.arange(1.0, 201)
    H = np.stack([1 / (g**2 - f**2 + 0.04j * g * f) for g in (40.0, 90.0)], axis=1) * 1e4
    lines = ["Frequency [Hz],Real 1Z/1Z,Imag 1Z/1Z,Real 3Z/1Z,Imag 3Z/1Z"]
    for k, (a, b) in enumerate(H):
        cells = [f[k], a.real, a.imag, b.real, b.imag]
        lines.append(",".join("" if j == 4 and k > 190 else f"{cell:.6f}" for j, cell in enumerate(cells)))
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", "utf-8")
    assert '--ignore "Real 3Z/1Z" --ignore "Imag 3Z/1Z"' in "; ".join(survey(tmp_path / "a.csv").notes)
    assert ms.read(tmp_path / "a.csv", ignore=["Real 3Z/1Z", "Imag 3Z/1Z"]).lines == 200


def test_rows_in_which_all_are_blank_are_no_loss_of_a_channel(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", ax=slice(390, None), ay=slice(390, None), az=slice(390, None))
    assert ms.read(path).samples == 390
    assert "2.5 % are lost: the others are blank" in "; ".join(survey(path).notes)


@pytest.mark.parametrize(
    ("file", "shape"),
    [
        ("stray_cells_csv/calc.csv", (4000, 3)),
        ("late_start/late.csv", (11400, 3)),
        ("dead_tail/tail.csv", (12000, 2)),
        ("lvm_slow_channels/slow.lvm", (20000, 2)),
        ("matlab_objects/workspace.mat", (20000, 3)),
    ],
)
def test_files_of_others(file: str, shape: tuple[int, int]) -> None:
    path = measured("standins", *file.split("/"))
    assert ms.read(path).outputs.shape == shape
    assert survey(path).left or "lost" in "; ".join(survey(path).notes)
