"""A result as a workbook: what was found stands in its cells as numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5
from tests.support import refused

openpyxl = pytest.importorskip("openpyxl", reason="the extra `excel` is not installed")


@pytest.fixture(scope="module")
def result() -> ms.Result:
    return ms.analyze(
        chain5().frequency_response(np.linspace(0.3, 7.5, 200), noise=0.01, seed=0), orders=range(8, 15, 2)
    )


def _rows(path: Path, sheet: str) -> list[list[Any]]:
    return [[cell.value for cell in row] for row in openpyxl.load_workbook(path)[sheet]]


def test_a_result_has_sheets_of_modes_shapes_mac_and_responses(result: ms.Result, tmp_path: Path) -> None:
    path = tmp_path / "r.xlsx"
    ms.write(path, result)
    assert openpyxl.load_workbook(path).sheetnames == ["modes", "shapes", "MAC", "responses"]
    head, *rows = _rows(path, "modes")
    assert [row[head.index("frequency_hz")] for row in rows] == pytest.approx(result.modes.frequencies.tolist())
    assert [row[head.index("grade")] for row in rows] == [mode.grade for mode in result.modes]
    shapes = np.array([row[1:] for row in _rows(path, "shapes")[1:]], dtype=float)
    np.testing.assert_allclose(shapes[:, ::2] + 1j * shapes[:, 1::2], result.modes.shapes, rtol=1e-12)
    mac = np.array([row[1:] for row in _rows(path, "MAC")[1:]], dtype=float)
    np.testing.assert_allclose(mac, ms.mac(result.modes, result.modes), rtol=1e-12)
    head, *rows = _rows(path, "responses")
    assert len(rows) == 200
    response = result.diagram.response
    output, column = head[1].partition(",")[0].split(" / ")
    values = response.values[:, response.output_dofs.index(output), response.input_dofs.index(column)]
    np.testing.assert_allclose([row[1] for row in rows], values.real, rtol=1e-12)


def test_what_is_not_known_is_an_empty_cell_and_a_label_no_formula(tmp_path: Path) -> None:
    modes = chain5().modes()
    odd = replace(modes, output_dofs=("=1+1", *modes.output_dofs[1:]), frequencies_std=np.array([np.nan, 1, 1, 1, 1]))
    path = tmp_path / "m.xlsx"
    ms.write(path, odd)
    assert "responses" not in openpyxl.load_workbook(path).sheetnames
    assert _rows(path, "shapes")[1][0] == "'=1+1"
    head, *rows = _rows(path, "modes")
    assert rows[0][head.index("frequency_std_hz")] is None
    assert rows[1][head.index("frequency_std_hz")] == 1


def test_what_has_no_modes_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    refused("has no modes", ms.write, tmp_path / "a.xlsx", chain5().impulse_response(20))
    refused("option", ms.write, tmp_path / "a.xlsx", chain5().modes(), dataset=55)
    assert not list(tmp_path.iterdir())
