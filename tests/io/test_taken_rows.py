"""Rows that are taken of tables, and accelerograms whose samples run on over the lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms

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
    with pytest.raises(ms.DataError, match=r"--rows 1-20"):
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
    with pytest.raises(ms.DataError, match=r"(?s)first in row 15.*--rows 6-14") as error:
        ms.read(path, rows="6-20")
    assert "leave the column out" not in str(error.value)
    assert ms.read(path, rows="6-14").samples == 9


def test_a_comment_that_names_a_count_and_a_step_is_no_head(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("# NPTS=5, DT=0.1\ntime,acc\n" + "\n".join(f"{k / 10},{k * k}" for k in range(5)) + "\n")
    assert ms.read(path).samples == 5
    path.write_text(f"{HEAD}NPTS= 3, DT= 1.0D-02 SEC\n.1 .2 .3\n")
    assert ms.read(path).sampling_rate == 100.0
