"""Heads of columns: where the name ends and the unit begins, and what a column is by both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.columns.weights import counts_rows, goes_one_way
from modalscope.io.columns.words import short_unit, split_head
from tests.support import refused

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


# ---------------------------------------------------------------------------------------------------------- units in words


@pytest.mark.parametrize(
    ("unit", "short"),
    [
        ("Newtons", "N"), ("newtons", "N"), ("NEWTON", "N"), ("Kilonewtons", "kN"), ("Pounds", "lbf"), ("pound-force", "lbf"),
        ("Pounds Force", "lbf"), ("LBF", "lbf"), ("lbf", "lbf"), ("kips", "kip"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("head", ["Ch1 [{}]", "Ch1 ({})", "Ch1[{}]"])
def test_forces_in_words_are_forces(tmp_path: Path, unit: str, short: str, head: str) -> None:
    found = ms.read(write(tmp_path / "a.csv", f"Time [s],{head.format(unit)},Ch2 [g's]", T, np.sin(T), np.cos(T)))
    assert (found.input_dofs, found.output_dofs, found.units) == (("Ch1",), ("Ch2",), (("g",), (short,)))


def test_a_row_of_units_in_words(tmp_path: Path) -> None:
    found = ms.read(write(tmp_path / "a.csv", "Time,A,B,C\nSeconds,Pounds,g's,g's", T, np.sin(T), np.cos(T), T % 0.3))
    assert (found.sampling_rate, found.input_dofs, found.units) == (100.0, ("A",), (("g", "g"), ("lbf",)))
    assert found.in_si().units == (("m/s2", "m/s2"), ("N",))


@pytest.mark.parametrize("word", ["furlongs", "gain", "poundage", "Ns"])
def test_what_is_no_word_for_a_unit_stays_as_it_is(word: str) -> None:
    assert short_unit(word) == word


@pytest.mark.parametrize(
    ("head", "parts"),
    [("elapsed micros", ("elapsed micros", "us")), ("millis", ("millis", "ms")), ("micrometers", ("micrometers", ""))],
)
def test_a_name_that_ends_in_a_part_of_a_second_says_the_unit(head: str, parts: tuple[str, str]) -> None:
    assert split_head(head) == parts


# ------------------------------------------------------------------------------------------------------ values beside words


@pytest.mark.parametrize("heads", ["t,N,m/s2,m/s2", "Time (s),N,g,g", "s,N,m/s^2,m/s^2", "Zeit;N;m/s²;m/s²", ",N,g,g"])
def test_newtons_among_units_are_a_force(tmp_path: Path, heads: str) -> None:
    sep = ";" if ";" in heads else ","
    found = ms.read(write(tmp_path / "a.csv", heads, T, np.sin(T), np.cos(T), np.cos(2 * T), sep=sep))
    assert found.units[1] == ("N",)
    assert found.quantity == "acceleration"
    assert found.sampling_rate == 100.0
    np.testing.assert_allclose(found.inputs[:, 0], np.sin(T), atol=1e-6)


def test_names_above_units_with_a_heading_are_the_names(tmp_path: Path) -> None:
    found = ms.read(write(tmp_path / "a.csv", "Zeit,Hammer,A1,A2\nt,N,g,g", T, np.sin(T), np.cos(T), np.cos(2 * T)))
    assert (found.input_dofs, found.output_dofs, found.units) == (("Hammer",), ("A1", "A2"), (("g", "g"), ("N",)))


@pytest.mark.parametrize("heads", ["N,Time,Acc1,Acc2", "N,s,m/s2,m/s2", "n,t,a,b"])
def test_what_counts_rows_is_no_force(tmp_path: Path, heads: str) -> None:
    path = tmp_path / "a.csv"
    lines = (f"{k},{t:.2f},{np.sin(t):.6f},{np.cos(t):.6f}" for k, t in enumerate(T, 1))
    path.write_text("\n".join([heads, *lines]) + "\n")
    found = ms.read(path)
    assert found.inputs is None
    assert found.outputs.shape == (len(T), 2)


@pytest.mark.parametrize(("heads", "outputs"), [("Time,N,E,Z", ("N", "E", "Z")), ("t,F,A,C", ("A", "C"))])
def test_directions_and_letters_of_channels_are_no_units(tmp_path: Path, heads: str, outputs: tuple[str, ...]) -> None:
    found = ms.read(write(tmp_path / "a.csv", heads, T, np.sin(T), np.cos(T), np.cos(2 * T)))
    assert found.output_dofs == outputs
    assert found.units[0] == ("",) * len(outputs)


def test_values_that_turn_in_a_quarter_of_their_steps_are_no_times() -> None:
    for turns, times in ((25, True), (26, False)):
        steps = np.ones(100)
        steps[:turns] = -1
        assert goes_one_way(np.r_[0.0, np.cumsum(steps)]) is times
    assert goes_one_way(np.zeros(9))  # a clock that stands still is no vibration


def test_a_counter_has_one_step() -> None:
    assert counts_rows(np.arange(5.0, 50.0, 5.0))
    assert not counts_rows(np.array([1.0, 2.0, 4.0]))
    assert not counts_rows(np.array([0.5, 1.5, 2.5]))
    assert not counts_rows(np.ones(4))


# ------------------------------------------------------------------------------------------------------ columns of times


@pytest.mark.parametrize(
    ("heads", "outputs"),
    [
        ("Time,Time_chan_1,Time_chan_2", ("Time_chan_1", "Time_chan_2")),
        ("Time [s],Time history 1 [g],Time history 2 [g]", ("Time history 1", "Time history 2")),
        ("Time_chan_1,Time_chan_2,Time", ("Time_chan_1", "Time_chan_2")),
    ],
)
def test_responses_named_after_time_are_kept(tmp_path: Path, heads: str, outputs: tuple[str, ...]) -> None:
    motion = (np.sin(30 * T), np.cos(20 * T))
    columns = (*motion, T) if heads.endswith("Time") else (T, *motion)
    found = ms.read(write(tmp_path / "a.csv", heads, *columns))
    assert (found.sampling_rate, found.output_dofs) == (100.0, outputs)
    np.testing.assert_allclose(found.outputs, np.stack(motion, axis=1), atol=1e-6)


def test_a_clock_before_each_channel_is_left(tmp_path: Path) -> None:
    heads = "Time_a,Force,Time_b,Acc1,Time_c,Acc2"
    found = ms.read(write(tmp_path / "a.csv", heads, T, np.sin(T), T + 1e-4, np.cos(T), T + 2e-4, np.cos(2 * T)))
    assert (found.input_dofs, found.output_dofs) == (("Force",), ("Acc1", "Acc2"))


@pytest.mark.parametrize("uneven", [0.0, 0.4])
@pytest.mark.parametrize("heads", ["Time_1,Time_2", "Time [s],Temp [degC]"])
def test_where_no_channel_is_left_the_message_names_what_may_be_one(tmp_path: Path, heads: str, uneven: float) -> None:
    times = T + uneven / 100 * np.random.default_rng(0).uniform(size=len(T))
    path = write(tmp_path / "a.csv", heads, times, times**2)
    refused(r"(?s)needs a column of measured values.*columns='time=1,out=2'", ms.read, path)
    assert ms.read(path, columns="time=1,out=2", resample="auto").outputs.shape[1] == 1


@pytest.mark.parametrize(
    ("heads", "options", "text"),
    [
        ("Time", {}, "Export the measured channels"),
        ("Frequency [Hz],Temp [degC]", {}, "Export real and imaginary parts with"),
        ("Time,a", {"ignore": "a"}, "Leave fewer columns out with ignore"),
        ("Temp [degC],rpm", {}, "columns='out=1-2', sampling_rate=HZ"),
    ],
)
def test_where_nothing_is_measured_the_message_says_what_to_do(
    tmp_path: Path, heads: str, options: dict[str, str], text: str
) -> None:
    path = write(tmp_path / "a.csv", heads, *(T, np.sin(T))[: heads.count(",") + 1])
    refused(f"(?s)needs a column of measured values.*{text}", ms.read, path, **options)
