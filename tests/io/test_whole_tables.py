"""Our own tables are whole or refused: rows that are missing, in the middle or at an end, are never passed over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from tests.support import refused

CHAIN = ms.systems.chain5()
IMPULSE = replace(CHAIN.impulse_response(20, noise=0.01, seed=0), feedthrough=None)
LINES = CHAIN.frequency_response(np.linspace(0.5, 6, 20), quantity="acceleration", noise=0.01, seed=0)
RECORD = CHAIN.simulate(samples=20, sampling_rate=20.0, noise=0.01, seed=0)
DATA = {"impulse": IMPULSE, "lines": LINES, "record": RECORD}


@pytest.fixture
def table(tmp_path: Path) -> Callable[[str], Path]:
    def write(name: str) -> Path:
        ms.write(tmp_path / "a.csv", DATA[name])
        return tmp_path / "a.csv"

    return write


def as_of_0_2_0(path: Path) -> list[str]:
    """Return the lines as 0.2.0 wrote them."""
    return [line for line in path.read_text().splitlines() if not line.startswith("# rows")]


def without(lines: list[str], *rows: int) -> str:
    """Return a table without rows under the header."""
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    return "\n".join(line for k, line in enumerate(lines) if k - head - 1 not in rows) + "\n"


@pytest.mark.parametrize("name", DATA)
@pytest.mark.parametrize("rows", [(0,), (10,), (19,), (3, 11, 12)])
def test_a_row_that_is_missing_is_told(table: Callable[[str], Path], name: str, rows: tuple[int, ...]) -> None:
    path = table(name)
    path.write_text(without(path.read_text().splitlines(), *rows))
    refused(f"needs 20 rows, as its header says, but it has {20 - len(rows)}", ms.read, path)


@pytest.mark.parametrize("name", ["impulse", "record"])
def test_tables_of_0_2_0_are_checked_by_their_times(table: Callable[[str], Path], name: str) -> None:
    path = table(name)
    lines = as_of_0_2_0(path)
    path.write_text(without(lines))
    assert ms.read(path).samples == 20
    path.write_text(without(lines, 10))
    refused("needs evenly sampled times .* the longest at row 11", ms.read, path)
    path.write_text(without(lines, 0))
    if name == "impulse":  # its header says where it begins
        refused("row 1 under the header", ms.read, path)


def test_modes_that_are_missing_are_told_by_their_numbers(tmp_path: Path) -> None:
    """Without comments, so that every program reads it; the last rows are not missed."""
    path = tmp_path / "a.csv"
    ms.write(path, CHAIN.modes())
    lines = path.read_text().splitlines()
    assert not ms.io.survey(path).notes
    for row, gone in ((1, "1"), (3, "3")):
        path.write_text("\n".join(lines[:row] + lines[row + 1 :]))
        assert len(ms.read(path)) == 4
        assert f"edited since it was written: without mode {gone}" in ms.io.survey(path).notes
    path.write_text("\n".join(lines[:4]))
    assert not ms.io.survey(path).notes


def test_times_lie_within_a_fiftieth_of_a_step_as_in_any_table(tmp_path: Path) -> None:
    for shift, good in ((0.019, True), (0.021, False)):
        rows = "".join(f"{k / 100 + (shift / 100 if k == 7 else 0):.6f},{k % 5}\n" for k in range(20))
        (tmp_path / "a.csv").write_text(f"# sampling_rate: 100\ntime_s,out 1:+Z [m]\n{rows}")
        if good:
            assert ms.read(tmp_path / "a.csv").samples == 20
        else:
            refused("evenly sampled times .* at row 8", ms.read, tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text("# sampling_rate: 100\ntime_s,out 1:+Z [m]\n5.0,1\n5.01,2\nnan,3\n")
    refused("1 of its 3 times are missing", ms.read, tmp_path / "a.csv")


@pytest.mark.parametrize("name", DATA)
def test_text_of_universal_files_is_whole_or_refused(tmp_path: Path, name: str) -> None:
    ms.write(tmp_path / "a.uff", DATA[name], text=True)
    lines = (tmp_path / "a.uff").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.strip() == "58")
    rows = [k for k in range(first + 12, len(lines)) if lines[k].count(".") > 1]  # numbers
    assert len(rows) > 20
    for k in rows[:: len(rows) // 20]:
        (tmp_path / "b.uff").write_text("\n".join(lines[:k] + lines[k + 1 :]) + "\n")
        refused(".", ms.read, tmp_path / "b.uff")


def test_numbers_that_are_no_characters_are_damage(tmp_path: Path) -> None:
    ms.write(tmp_path / "a.npz", LINES)
    arrays: dict[str, Any] = dict(np.load(tmp_path / "a.npz"))
    for name in ("output_dofs", "quantity", "geometry_nodes", "units", "processing"):
        if name in arrays and arrays[name].dtype.kind == "U" and arrays[name].size and arrays[name].dtype.itemsize:
            for code in (0x110000, 0x7FFFFFFF):
                damaged = np.atleast_1d(arrays[name]).copy()
                damaged.view(np.uint32)[..., -1] = code
                np.savez(tmp_path / "b.npz", **{**arrays, name: damaged.reshape(arrays[name].shape)})
                refused("no characters", ms.read, tmp_path / "b.npz")


def test_pieces_of_zarr_that_hold_no_characters_are_damage(tmp_path: Path) -> None:
    zarr = pytest.importorskip("zarr")
    group = zarr.open_group(str(tmp_path / "a.zarr"), mode="w", zarr_format=2)
    group.create_array("outputs", shape=(64, 2), chunks=(32, 2), dtype=float)[...] = np.ones((64, 2))
    labels = group.create_array("output_dofs", shape=(2,), chunks=(2,), dtype="U4", compressors=None)
    labels[...] = np.array(["1:+Z", "2:+Z"])
    assert ms.read(tmp_path / "a.zarr", sampling_rate=8.0).output_dofs == ("1:+Z", "2:+Z")
    piece = tmp_path / "a.zarr" / "output_dofs" / "0"
    piece.write_bytes(piece.read_bytes()[:-4] + b"\0\0\x11\0")
    refused("no characters", ms.read, tmp_path / "a.zarr", sampling_rate=8.0)
