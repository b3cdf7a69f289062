"""Heads of columns: where the name ends and the unit begins, and what a column is by both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.columns.words import split_head

T = np.arange(200) / 100.0
FREQUENCIES = 1.0 + 0.25 * np.arange(200)
RESPONSE = 1 / (1 - (FREQUENCIES / 20) ** 2 + 0.02j)


def write(path: Path, head: str, *columns: np.ndarray, sep: str = ",") -> Path:
    """Write a table under a head; a semicolon between cells comes with decimal commas."""
    lines = (sep.join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
    body = "\n".join(lines)
    path.write_text(f"{head}\n{body.replace('.', ',') if sep == ';' else body}\n", "utf-8")
    return path


@pytest.mark.parametrize(
    ("head", "parts"),
    [
        ("ax[m/s2]", ("ax", "m/s2")),
        ("ax<mm/s>", ("ax", "mm/s")),
        ("ax{um/m}", ("ax", "um/m")),
        ("ax(m/s²)", ("ax", "m/s²")),
        ("a/x[m/s2]", ("a/x", "m/s2")),
        ("3Z/1Z[(m/s2)/N]", ("3Z/1Z", "(m/s2)/N")),
        ("Re{H11}[m/s2/N]", ("Re(H11)", "m/s2/N")),
        ("ax[m/s2] 1", ("ax 1", "m/s2")),
        ("omega[rad/s]", ("omega", "rad/s")),
        # strokes that part name and unit, or two channels, and brackets that hold places
        ("a(1)/(m/s2)", ("a(1)", "m/s2")),
        ("a[1]/g", ("a[1]", "g")),
        ("H[1]/F[2]", ("H[1]/F[2]", "")),
        ("H[2/1]", ("H[2/1]", "")),
    ],
)
def test_a_stroke_inside_of_brackets_parts_nothing(head: str, parts: tuple[str, str]) -> None:
    assert split_head(head) == parts


@pytest.mark.parametrize("signs", ["[]", "()", "<>", "{}"])
@pytest.mark.parametrize(("unit", "factor"), [("rad/s", 2 * np.pi), ("Hz", 1.0), ("kHz", 1e-3)])
def test_frequencies_keep_the_unit_that_stands_behind_them_without_a_blank(
    tmp_path: Path, signs: str, unit: str, factor: float
) -> None:
    head = f"Frequency{signs[0]}{unit}{signs[1]},H1 Real,H1 Imag"
    columns = (factor * FREQUENCIES, RESPONSE.real, RESPONSE.imag)
    found = ms.read(write(tmp_path / "a.csv", head, *columns))
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=1e-3)  # of six digits behind the sign


@pytest.mark.parametrize("sep", [",", ";", "\t"])
def test_units_of_a_record_without_blanks(tmp_path: Path, sep: str) -> None:
    head = sep.join(["Time[ms]", "F[N]", "ax[m/s2]", "ay[m/s²]"])
    found = ms.read(write(tmp_path / "a.txt", head, 1000 * T, np.sin(T), np.cos(T), np.cos(2 * T), sep=sep))
    assert (found.sampling_rate, found.output_dofs, found.input_dofs) == (100.0, ("ax", "ay"), ("F",))
    assert found.units == (("m/s2", "m/s²"), ("N",))
    assert found.quantity == "acceleration"
