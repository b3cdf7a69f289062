"""Rows that are taken of tables, and accelerograms whose samples run on over the lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import survey

HEAD = "RECORD\nACCELERATION TIME SERIES IN UNITS OF G\n"


def table(path: Path) -> Path:
    text = "\n".join(f"{k / 10},{k * k},{k}" for k in range(20))
    path.write_text("Time [s],a [m/s^2],b [m/s^2]\n" + text + "\n")
    return path


def test_rows_are_counted_from_one_with_both_ends(tmp_path: Path) -> None:
    taken = ms.read(table(tmp_path / "x.csv"), rows="3-7")
    assert taken.outputs[:, 1].tolist() == [2.0, 3.0, 4.0, 5.0, 6.0]
    assert ms.read(tmp_path / "x.csv", rows="-4").samples == 4
    assert ms.read(tmp_path / "x.csv", rows="16-").samples == 5


@pytest.mark.parametrize("asked", ["0-4", "4-4", "5-2", "1-21", "all", "3", ""])
def test_rows_that_are_not_there_are_refused(tmp_path: Path, asked: str) -> None:
    with pytest.raises(ms.DataError, match="rows='1-20'"):
        ms.read(table(tmp_path / "x.csv"), rows=asked)


def test_rows_of_named_arrays_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, outputs=np.eye(5), sampling_rate=3.0)
    with pytest.raises(ms.DataError, match="it is no table"):
        ms.read(path, rows="1-3")


@pytest.mark.parametrize("line", ["NPTS=  7, DT=   .0050 SEC,", "   7    0.0050    NPTS, DT", "NPTS= 7, DT= 5.0E-03"])
def test_heads_of_both_ages_are_known(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.at2"
    path.write_text(f"{HEAD}{line}\n .1 -.2 3E-1\n-.4D+00-.5 .6\n .7\n")  # two numbers without a blank between them
    record = ms.read(path)
    assert record.sampling_rate == 200.0
    assert record.outputs[:, 0].tolist() == [0.1, -0.2, 0.3, -0.4, -0.5, 0.6, 0.7]
    assert record.units[0] == ("g",)
    assert ms.read(path.rename(tmp_path / "a.txt")).samples == 7


@pytest.mark.parametrize("body", [".1 .2", ".1 .2 .3 .4", ".1\nno .3"])
def test_another_number_of_samples_than_counted_is_refused(tmp_path: Path, body: str) -> None:
    path = tmp_path / "a.at2"
    path.write_text(f"{HEAD}NPTS= 3, DT= .01\n{body}\n")
    with pytest.raises(ms.DataError, match=r"NPTS|'no \.3'"):
        ms.read(path)


def test_rows_that_a_message_names_are_those_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "hole.csv"
    path.write_text("Time [s],a [m/s^2]\n" + "\n".join(f"{k / 10},{'' if k == 14 else k}" for k in range(20)) + "\n")
    with pytest.raises(ms.DataError, match=r"(?s)first in row 15.*rows='6-14'") as error:
        ms.read(path, rows="6-20")
    assert "leave the column out" not in str(error.value)
    assert ms.read(path, rows="6-14").samples == 9


def test_a_comment_that_names_a_count_and_a_step_is_no_head(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("# NPTS=5, DT=0.1\ntime,acc\n" + "\n".join(f"{k / 10},{k * k}" for k in range(5)) + "\n")
    assert ms.read(path).samples == 5
    path.write_text(f"{HEAD}NPTS= 3, DT= 1.0D-02 SEC\n.1 .2 .3\n")
    assert ms.read(path).sampling_rate == 100.0


VALUES = np.round(np.random.default_rng(7).standard_normal(80), 4)


def lines_of(values: np.ndarray, width: int) -> str:
    return "".join(" ".join(f"{v:.4f}" for v in row) + "\n" for row in values.reshape(-1, width))


def timed(step: float = 0.01) -> np.ndarray:
    return np.column_stack([np.arange(40) * step, VALUES[:40]])


@pytest.mark.parametrize(
    "head", ["NPTS= 40, DT= 0.01", "# NPTS= 40, DT= 0.01", "NPTS= 80, DT= 0.01", "NPTS= 40\nDT= 0.01"]
)
def test_rows_with_their_time_below_a_count_are_a_table(tmp_path: Path, head: str) -> None:
    """Also where the head counts all numbers: nothing that is measured rises evenly by DT at every second sample."""
    path = tmp_path / "x.txt"
    path.write_text(f"{head}\n{lines_of(timed(), 2)}")
    record = ms.read(path)
    assert record.sampling_rate == 100.0
    assert np.array_equal(record.outputs[:, 0], VALUES[:40])


def test_as_many_rows_as_the_head_counts_samples_are_channels_at_its_step(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_text(f"NPTS= 40, DT= 0.01\n{lines_of(VALUES, 2)}")
    record = ms.read(path)
    assert (record.sampling_rate, record.outputs.shape) == (100.0, (40, 2))
    path.write_text(f"NPTS= 80, DT= 0.01\n{lines_of(VALUES, 2)}")  # as many numbers in all: they run on
    assert np.array_equal(ms.read(path).outputs[:, 0], VALUES)
    long = np.random.default_rng(8).standard_normal((3000, 3))  # longer than what is looked at first
    path.write_text(f"NPTS= 3000, DT= 0.01\n{lines_of(long, 3)}")
    assert ms.read(path).outputs.shape == (3000, 3)
    path.write_text(f"NPTS= 9000, DT= 0.01\n{lines_of(long, 3)}")
    assert ms.read(path).outputs.shape == (9000, 1)


def test_what_is_neither_is_refused_with_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_text(f"NPTS= 41, DT= 0.01\n{lines_of(VALUES, 2)}")
    with pytest.raises(ms.DataError, match=r"(?s)the 41 samples.*80 stand in the 40 lines.*skip=1"):
        ms.read(path)
    assert ms.read(path, skip=1, sampling_rate=100.0).outputs.shape == (40, 2)
    path.write_text(f"NPTS= 40, DT= 0.01\n{lines_of(VALUES, 40)}")
    with pytest.raises(ms.DataError, match="transpose=True"):
        ms.read(path)
    assert ms.read(path, transpose=True, sampling_rate=100.0).outputs.shape == (40, 2)


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (", DT= 0", "says DT= 0, which is no step"),
        (", DT= 1e-320", "1e-320"),
        (", DT= 1e400", "1e400"),
        ("", "says no step"),
    ],
)
def test_a_count_without_a_step_asks_for_the_rate(tmp_path: Path, step: str, said: str) -> None:
    path = tmp_path / "a.at2"
    path.write_text(f"{HEAD}NPTS= 80{step}\n{lines_of(VALUES, 5)}")
    with pytest.raises(ms.DataError, match=f"(?s){said}.*sampling_rate=HZ"):
        ms.read(path)
    assert np.array_equal(ms.read(path, sampling_rate=100.0).outputs[:, 0], VALUES)


def test_a_count_of_no_samples_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.at2").write_text(f"{HEAD}NPTS= 0, DT= .01\n{lines_of(VALUES, 5)}")
    with pytest.raises(ms.DataError, match=r"the 0 samples of its head \(NPTS\), but 80 stand"):
        ms.read(tmp_path / "a.at2")


def test_what_is_told_of_a_text_is_told_of_an_accelerogram(tmp_path: Path) -> None:
    (tmp_path / "a.at2").write_bytes(f"K\xf6ln\n{HEAD}NPTS= 80, DT= .01\n{lines_of(VALUES, 5)}".encode("cp1252"))
    assert "its text is not UTF-8: read as Windows-1252" in survey(tmp_path / "a.at2").notes
    for option in ({"transpose": True}, {"delimiter": ";"}, {"decimal": ","}):
        with pytest.raises(ms.DataError, match=f"(?s){next(iter(option))} of a.at2.*continued over"):
            ms.read(tmp_path / "a.at2", **option)


@pytest.mark.parametrize(
    ("written", "unit"),
    [("CM/SEC/SEC", "cm/s^2"), ("CM/S**2", "cm/s^2"), ("M/S/S", "m/s^2"), ("GAL", "gal"), ("MM/SEC2", "mm/s^2")],
)
def test_units_of_accelerograms_are_those_of_all_files(tmp_path: Path, written: str, unit: str) -> None:
    head = HEAD.replace(" G\n", f" {written}\n")
    (tmp_path / "a.at2").write_text(f"{head}NPTS= 80, DT= .01\n{lines_of(VALUES, 5)}")
    record = ms.read(tmp_path / "a.at2")
    assert (record.units[0], record.quantities) == ((unit,), ("acceleration",))


def test_the_word_of_a_series_is_its_quantity_where_the_unit_is_unknown(tmp_path: Path) -> None:
    head = HEAD.replace(" G\n", " FURLONGS\n").replace("ACCELERATION", "VELOCITY")
    (tmp_path / "a.vt2").write_text(f"{head}NPTS= 80, DT= .01\n{lines_of(VALUES, 5)}")
    assert ms.read(tmp_path / "a.vt2").quantities == ("velocity",)
