"""LabVIEW measurement files, written here after National Instruments' specification of the layout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import read, survey
from tests.support import DATA

STEP, COUNT = 0.01, 40
TIMES = STEP * np.arange(COUNT)
VALUES = np.round(np.stack([np.sin(3 * TIMES), np.cos(5 * TIMES)], axis=1), 6)


def written(
    *segments: np.ndarray,
    x: str = "One",
    sign: str = "\t",
    decimal: str = ".",
    comments: bool = False,
    start: float = 0.0,
) -> str:
    """A file of two channels in g; segments go on from each other unless `start` is negative."""
    names = {"\t": "Tab", ",": "Comma"}
    head = {
        "Writer_Version": "2",
        "Separator": names[sign],
        "Decimal_Separator": decimal,
        "Multi_Headings": "Yes",
        "X_Columns": x,
    }
    lines = [f"LabVIEW Measurement{sign}", *(f"{key}{sign}{value}" for key, value in head.items())]
    lines += [f"***End_of_Header***{sign}", sign]
    for number, values in enumerate(segments):
        two = [("Channels", "2"), ("Samples", str(len(values)), str(len(values))), ("Date", "2026/01/02", "2026/01/02")]
        two += [("Y_Unit_Label", "g", "g"), ("X_Dimension", "Time", "Time"), ("Delta_X", f"{STEP}", f"{STEP}")]
        lines += [sign.join(line) for line in two] + [f"***End_of_Header***{sign * 3}"]
        lines.append(sign.join(["X_Value", "Acc A", *(["X_Value"] if x == "Multi" else []), "Acc B", "Comment"]))
        times = STEP * (np.arange(len(values)) + (0 if start < 0 else number * len(values)))
        for time, row in zip(times, values, strict=True):
            t = "" if x == "No" else f"{time:.6f}"
            cells = [t, f"{row[0]:.6f}", *([t] if x == "Multi" else []), f"{row[1]:.6f}"] + ["note"] * comments
            lines.append(sign.join(cells).replace(".", decimal))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("x", ["One", "Multi", "No"])
@pytest.mark.parametrize("comments", [False, True])
@pytest.mark.parametrize(("sign", "decimal"), [("\t", "."), ("\t", ","), (",", ".")])
def test_names_units_and_rate_stand_in_the_header(
    tmp_path: Path, x: str, comments: bool, sign: str, decimal: str
) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(
        written(VALUES, x=x, sign=sign, decimal=decimal, comments=comments).replace(
            f"Delta_X{sign}0.01{sign}0.01", f"Delta_X{sign}0{decimal}01{sign}0{decimal}01"
        )
    )
    found = read(path)
    assert found.output_dofs == ("Acc A", "Acc B")
    assert found.units[0] == ("g", "g")
    assert found.sampling_rate == pytest.approx(1 / STEP)
    np.testing.assert_array_equal(found.outputs, VALUES)


def test_segments_that_go_on_are_one_record_and_others_are_runs(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(written(VALUES, 2 * VALUES))
    np.testing.assert_array_equal(read(path).outputs, np.concatenate([VALUES, 2 * VALUES]))
    path.write_text(written(VALUES, 2 * VALUES, start=-1.0))
    found = survey(path)
    np.testing.assert_array_equal(found.thing.outputs, np.stack([VALUES, 2 * VALUES]))
    assert any("2 segments are as many runs" in note for note in found.notes)


def test_a_row_that_is_no_number_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(written(VALUES).replace(f"{VALUES[3, 1]:.6f}", "broken", 1))
    with pytest.raises(ms.DataError, match=r"needs 3 numbers in every row.*broken"):
        read(path)
    path.write_text(written())
    with pytest.raises(ms.DataError, match="no rows of numbers"):
        read(path)


@pytest.mark.skipif(not (DATA / "footbridge").is_dir(), reason="the measured set footbridge is not there")
def test_a_measured_hammer_record_has_its_names_units_and_rate() -> None:
    found = read(DATA / "footbridge" / "impulse_VI0.txt")
    assert found.output_dofs == ("Acceleration_0", "Acceleration_1", "Acceleration_2")
    assert found.units[0] == ("g", "g", "g")
    assert found.sampling_rate == pytest.approx(7314.29, abs=0.01)


@pytest.mark.skipif(not (DATA / "labview_spectrum").is_dir(), reason="the set labview_spectrum is not there")
def test_a_spectrum_in_the_form_of_a_record_is_refused_as_what_it_is() -> None:
    with pytest.raises(ms.DataError, match="a spectrum in dB: the phase between signals is gone"):
        read(DATA / "labview_spectrum" / "FFT_data.lvm")


def test_units_of_channels_with_an_x_value_each_stand_at_every_second_place(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    path.write_text(written(VALUES, x="Multi").replace("Y_Unit_Label\tg\tg", "Y_Unit_Label\tN\t\tg\t"))
    found = read(path)
    assert (found.input_dofs, found.units) == (("Acc A",), (("g",), ("N",)))


def test_channels_of_different_steps_are_asked_about_unless_a_column_of_times_agrees(tmp_path: Path) -> None:
    path = tmp_path / "a.lvm"
    text = written(VALUES, x="No").replace("Delta_X\t0.01\t0.01", "Delta_X\t1.000000\t0.01")
    path.write_text(text)
    with pytest.raises(ms.DataError, match=r"its header says several: 'Delta_X 1.000000 0.01'"):
        read(path)
    times = (f"\t{row[0]:.6f}\t{row[1]:.6f}" for row in VALUES)
    for k, row in enumerate(times):
        text = text.replace(row, f"\t{k * STEP:.6f}\t{VALUES[k, 1]:.6f}", 1)
    path.write_text(text.replace("Acc A", "time").replace("Y_Unit_Label\tg", "Y_Unit_Label\ts"))
    assert read(path).sampling_rate == pytest.approx(100)
    assert not any("all channels are taken at" in note for note in survey(path).notes)


@pytest.mark.parametrize(("step", "told"), [("0.010009", False), ("0.0125", True), ("1.000000", False)])
def test_channels_of_another_step_than_the_times_are_told_of(tmp_path: Path, step: str, told: bool) -> None:
    """Steps are one within a thousandth; 1 stands for values without times."""
    path = tmp_path / "a.lvm"
    rows = "".join(f"\t{0.01 * k:.2f}\t{np.sin(k):.6f}\t{np.cos(k):.6f}\n" for k in range(400))
    text = written(VALUES, x="No").partition("Channels")[0]
    text += f"Channels\t3\nSamples\t400\t400\t400\nX_Dimension\tTime\tTime\tTime\nDelta_X\t1.000000\t0.01\t{step}\n"
    path.write_text(text + "***End_of_Header***\t\t\t\nX_Value\ttime\tAcc A\tAcc B\tComment\n" + rows)
    found = [note for note in survey(path).notes if "all channels are taken at 100 Hz" in note]
    assert read(path).sampling_rate == pytest.approx(100)
    assert [note.partition(" by")[0] for note in found] == ([f"Acc B: {1 / float(step):.6g} Hz"] if told else [])
