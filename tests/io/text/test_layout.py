"""Facts above a table: keys and values as cells, and how rates are written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.text.cells import Dialect
from modalscope.io.text.dialect import dialect_of
from modalscope.io.text.layout import Layout, layout_of
from tests.io.columns.test_words import T, write
from tests.support import measured, refused

MOTION = (np.sin(T), np.cos(T), np.cos(2 * T))


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("Sample rate:,4096", 4096), ("Sample rate:,4096,,", 4096), ("Sampling rate: ,4096,Hz", 4096), ("Sample rate,,4096", 4096),
        ('"Sample rate:",4096', 4096), ('"Sampling Rate (Hz)","4096"', 4096), ("Fs=,4096", 4096), ("Sample rate [kHz]:,4.096", 4096),
        ("Sampling frequency,4096,4096,4096", 4096), ("Sample interval:,0.001", 1000), ("Sample rate:,.5", 0.5),
        # in one cell, thousands may be parted
        ("Sampling rate: 1,024 Hz", 1024), ("Sampling rate: 51,200.5 Hz", 51200.5), ("Sample rate: 1.024 kHz", 1024),
        ("Sample rate: 1,024 kHz", 1024),
    ],
)  # fmt: skip
def test_a_rate_above_a_table_of_commas(tmp_path: Path, line: str, rate: float) -> None:
    path = write(tmp_path / "a.csv", f"{line}\nForce [N],a [g],b [g]", *MOTION)
    assert ms.read(path).sampling_rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize(
    ("line", "rate"),
    [
        ("Sampling frequency;4096", 4096), ("Sample rate:;4096;;", 4096), ("Abtastrate;1024,5;Hz", 1024.5), ("dt;0,001", 1000),
        ("Abtastrate: 51.200 Hz", 51200), ("Abtastrate: 1.024,5 Hz", 1024.5), ("Sample rate: 51.2 Hz", 51.2),
        # of steps and of kHz three digits behind a point are decimals
        ("Delta Time: 0.001 s", 1000), ("dt: 1.250 ms", 800), ("Sampling rate: 1.024 kHz", 1024),
    ],
)  # fmt: skip
def test_a_rate_above_a_table_of_semicolons_and_decimal_commas(tmp_path: Path, line: str, rate: float) -> None:
    path = write(tmp_path / "a.csv", f"{line}\nForce [N];a [g];b [g]", *MOTION, sep=";")
    assert ms.read(path).sampling_rate == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize("line", ["Sample rate:\t4096", "Sample rate:\t\t4096\tHz", "Sample rate\t4096"])
def test_a_rate_above_a_table_of_tabs(tmp_path: Path, line: str) -> None:
    assert ms.read(write(tmp_path / "a.txt", f"{line}\nF [N]\ta [g]\tb [g]", *MOTION, sep="\t")).sampling_rate == 4096


@pytest.mark.parametrize("line", ["Sample rate,100,200", "Sample rate,100,100,200", "fs: 2 000"])
def test_rates_that_differ_from_channel_to_channel_are_asked_for(tmp_path: Path, line: str) -> None:
    path = write(tmp_path / "a.csv", f"{line}\nForce [N],a [g],b [g]", *MOTION)
    refused("(?s)its header says several.*sampling_rate=HZ", ms.read, path)
    assert ms.read(path, sampling_rate=100.0).sampling_rate == 100


# ------------------------------------------------------------------------------------------------------- rows about channels

HEAD = "CH No.,{}\nRange,2000,1000,5\nOffset,-97.5,-1025.0,-13.2\nUnit,cm/s2,cm/s2,V"


@pytest.mark.parametrize("names", ["CH2,CH3,CH8", "2,3,8"])
def test_rows_of_ranges_and_offsets_are_no_names(tmp_path: Path, names: str) -> None:
    found = ms.read(write(tmp_path / "a.csv", HEAD.format(names), T, *MOTION))
    assert found.output_dofs == tuple(names.split(","))
    assert found.units[0] == ("cm/s2", "cm/s2", "V")
    assert found.sampling_rate == 100.0


@pytest.mark.parametrize(("row", "units"), [("Unit,N,A,C", ("A", "C")), ("Units:,lbf,g,", ("g", ""))])
def test_behind_the_name_of_a_row_of_units_any_unit_is_one(tmp_path: Path, row: str, units: tuple[str, ...]) -> None:
    found = ms.read(write(tmp_path / "a.csv", f"Zeit,Kraft,a1,a2\n{row}", T, *MOTION), columns="time=1,in=2,out=3-")
    assert (found.input_dofs, found.output_dofs, found.units[0]) == (("Kraft",), ("a1", "a2"), units)


@pytest.mark.parametrize("which", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_measured_frame_as_its_logger_writes_it(which: int) -> None:
    found = ms.read(measured("kyowa_frame", f"imp_ham_set{which}_nomass.CSV"))
    assert (found.output_dofs, found.input_dofs) == (
        ("CH2", "CH3", "CH5", "CH6"),
        ("CH8",),
    )  # a hit that all others answer
    assert found.units == (("cm/s2",) * 4, ("V",))
    assert found.sampling_rate == 50.0


def _layout(text: str, delimiter: str = ",") -> Layout:
    found = layout_of(text.splitlines(), Dialect(delimiter=delimiter))
    assert found is not None
    return found


_ROWS = "\n0,1,2\n1,2,3\n2,3,5"


@pytest.mark.parametrize(
    ("above", "names"),
    [
        ("Sampling rate,50,Hz", ("", "", "")),
        ("Filter,400 Hz low pass,", ("", "", "")),
        ("Comment,none", ("", "", "")),
        ("ID,PCD-400A", ("", "", "")),
        ("Comment,second try,", ("", "", "")),
        ("Time,Acc,", ("Time", "Acc", "")),
        ("Force,Acc", ("", "Force", "Acc")),
        ("Time,Force,Acc,Comment", ("Time", "Force", "Acc")),
    ],
)
def test_statements_are_no_names_and_names_may_be_one_too_few_or_many(above: str, names: tuple[str, ...]) -> None:
    assert _layout(above + _ROWS).names == names


def test_a_section_is_no_unit_and_own_units_go_before_those_of_a_row() -> None:
    assert _layout("[Date]\nax (g)\n1\n2\n3", "\t").units == ("g",)
    assert _layout("t ax\n[Test]\n 1 2\n 2 3\n 3 5", "").units == ("", "")
    assert _layout("t ax\n[s]\n 1 2\n 2 3\n 3 5", "").units == ("s", "")
    found = _layout("[Test]   [x]\nax/(m/s2)  ay/(m/s2)\n 1  2\n 1  3\n 4  5", "")
    assert found.units == ("m/s2", "m/s2")


def test_units_stand_over_their_names_where_blanks_part_cells() -> None:
    text = "     [kHz]     [g/N]               [V]\nFrecuencia        H2   |a|     Drive\n"
    text += "\n".join(f"{k}  {k}.1234567+0.1234567i  {k}.1  {k}.5" for k in range(1, 5))
    assert _layout(text, "").units == ("kHz", "g/N", "", "V")


def test_a_time_behind_a_date_has_no_name_wherever_the_date_stands() -> None:
    rows = "\n".join(f" {k}  2021-03-14  10:12:0{k}  0.{k}  1.{k}" for k in range(1, 5))
    found = _layout("Index  Date  ax  ay\n  g  g\n" + rows, "")
    assert found.names == ("Index", "Date", "", "ax", "ay")


def test_a_column_of_remarks_does_not_hide_the_sign_that_parts_cells() -> None:
    lines = ["Response 1 [g]\tComment", "0.5\tstart of test", *(f"{k}.25\t" for k in range(8))]
    assert dialect_of("a.csv", lines).delimiter == "\t"


def test_decimal_commas_between_blanks_part_no_cells() -> None:
    lines = [f"  {2000 * k},00    0,{1879 + k}195    0,{k:02d}000000" for k in range(9)]
    found = dialect_of("a.txt", lines)
    assert (found.delimiter, found.decimal) == ("", ",")


@pytest.mark.parametrize(("semicolons", "sign"), [(49, ","), (51, ";")])
def test_the_first_hundred_lines_of_digits_say_what_parts_cells(semicolons: int, sign: str) -> None:
    """Lines of text before them are none of these, however many."""
    lines = ["Remark"] * 120 + ["1.5;2.5"] * semicolons + ["1.5,2.5"] * 300
    assert dialect_of("a.csv", lines).delimiter == sign
