"""Files as instruments and people write them, all of one record or one pair of frequency responses, so that what is read can be compared.

Each function writes one file and is registered with what the file is of: "record" (force and two accelerations, or as `columns` says),
or "lines". No file is stored: what they look like stands here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

RATE = 1024.0
ROWS = 150
TIMES = np.arange(ROWS) / RATE
_RNG = np.random.default_rng(5)
#: Force and two accelerations, of five digits behind the point.
CHANNELS = np.round(_RNG.standard_normal((ROWS, 3)) * [0.9, 3.0, 8.0], 5)
FREQUENCIES = 10.0 + 0.25 * np.arange(60)
RESPONSES = 1 / (1 - (FREQUENCIES[:, None] / [17.2, 20.1]) ** 2 + 0.04j)
RESPONSES = np.round(RESPONSES.real, 6) + 1j * np.round(RESPONSES.imag, 6)


@dataclass(frozen=True)
class Case:
    """A file: its suffix, how it is written, of what it is, and which channels are inputs and outputs."""

    suffix: str
    write: Callable[[Path], None]
    kind: str = "record"
    inputs: tuple[int, ...] = (0,)
    outputs: tuple[int, ...] = (1, 2)
    channels: np.ndarray = field(default_factory=lambda: CHANNELS)


CASES: dict[str, Case] = {}


def case(suffix: str, **options: object) -> Callable[[Callable[[], str]], Callable[[], str]]:
    """Register a function that returns the text of a file."""

    def add(make: Callable[[], str | bytes]) -> Callable[[], str | bytes]:
        def write(path: Path) -> None:
            text = make()
            path.write_bytes(text if isinstance(text, bytes) else text.encode())

        CASES[make.__name__.replace("_", " ")] = Case(suffix, write, **options)
        return make

    return add


def binary(suffix: str, **options: object) -> Callable[[Callable[[Path], None]], Callable[[Path], None]]:
    """Register a function that writes a file itself."""

    def add(write: Callable[[Path], None]) -> Callable[[Path], None]:
        CASES[write.__name__.replace("_", " ")] = Case(suffix, write, **options)
        return write

    return add


def rows(*columns: np.ndarray, sep: str = ",", form: str = "{:.6f}", decimal: str = ".", end: str = "\n") -> str:
    """Return columns as text."""
    lines = (sep.join(form.format(value).replace(".", decimal) for value in row) for row in zip(*columns, strict=True))
    return end.join(lines) + end


F, A, B = CHANNELS.T
H, G = RESPONSES.T


# ----------------------------------------------------------------------------------------------------------- records as text


@case(".csv")
def names_with_units_in_brackets() -> str:
    return "Time [s],Force [N],AccA [m/s^2],AccB [m/s^2]\n" + rows(TIMES, F, A, B)


@case(".csv")
def a_row_of_units() -> str:
    return "Time,Hammer,Acc1,Acc2\ns,N,g,g\n" + rows(TIMES, F, A, B)


@case(".csv")
def units_in_brackets_and_a_blank_line() -> str:
    return "Time,Ch1,Ch2,Ch3\n(s),(N),(m/s²),(m/s²)\n\n" + rows(TIMES, F, A, B)


@case(".csv")
def decimal_commas_and_semicolons() -> str:
    return "Zeit [s];Kraft [N];Beschl. 1 [m/s²];Beschl. 2 [m/s²]\r\n" + rows(
        TIMES, F, A, B, sep=";", decimal=",", end="\r\n"
    )


@case(".csv")
def a_header_of_keys_and_values() -> str:
    head = "Title: test 12\nOperator: M. K.\nDate: 2024-05-01\nSampling rate: 1024 Hz\nSamples: 150\n\n"
    return head + "Force [N],AccA [g],AccB [g]\n" + rows(F, A, B)


@case(".txt")
def milliseconds_of_few_digits() -> str:
    return "t [ms]\tF [N]\ta1 [g]\ta2 [g]\n" + rows(1000 * TIMES, F, A, B, sep="\t", form="{:.5f}")


@case(".txt")
def numpy_savetxt_with_a_comment_as_head() -> str:
    return "# time force acc_a acc_b\n" + rows(TIMES, F, A, B, sep=" ", form="{:.18e}")


@case(".txt", inputs=(), outputs=(0, 1, 2))
def three_bare_columns_without_a_rate() -> str:
    return rows(F, A, B, sep=" ")


@case(".txt")
def matlab_comments() -> str:
    return "% written by a script\n% fs = 1024\n% force, acc1, acc2\n" + rows(F, A, B, sep="  ", form="{:12.5e}")


@case(".dat")
def fortran_columns_of_fixed_width() -> str:
    return " TIME          FORCE         ACC 1         ACC 2\n" + rows(TIMES, F, A, B, sep="", form="{:16.7E}").replace(
        "E", "D"
    )


@case(".asc", inputs=(), outputs=(0, 1, 2))
def blanks_before_numbers_and_two_comment_lines() -> str:
    return "// rig B\n// rate 1024 Hz\n" + rows(TIMES, F, A, B, sep="   ", form="{:>12.6f}")


@case(".tsv")
def tabs_with_a_trailing_one() -> str:
    body = rows(TIMES, F, A, B, sep="\t").replace("\n", "\t\n")
    return "Time (s)\tForce (N)\tAcc 1 (m/s2)\tAcc 2 (m/s2)\t\n" + body


@case(".csv")
def time_stamps_of_iso() -> str:
    stamps = np.datetime64("2024-05-01T23:59:59.950000") + (TIMES * 1e6).round().astype("timedelta64[us]")
    lines = [f"{stamp},{f:.5f},{a:.5f},{b:.5f}" for stamp, f, a, b in zip(stamps, F, A, B, strict=True)]
    return "Timestamp,Force,AccA,AccB\n" + "\n".join(lines) + "\n"


@case(".csv")
def dates_and_times_of_day_in_two_columns() -> str:
    stamps = np.datetime64("2024-05-01T11:59:59.000000") + (TIMES * 1e6).round().astype("timedelta64[us]")
    split = [str(stamp).split("T") for stamp in stamps]
    lines = [
        f"{'.'.join(reversed(day.split('-')))};{clock.replace('.', ',')};{f:.5f};{a:.5f};{b:.5f}".replace(".", ",", 0)
        for (day, clock), f, a, b in zip(split, F, A, B, strict=True)
    ]
    return "Date;Time;Force;Acc1;Acc2\n" + "\n".join(lines) + "\n"


@case(".csv")
def times_printed_to_a_millisecond() -> str:
    return "Time,Force,AccA,AccB\n" + rows(np.round(TIMES, 3), F, A, B, form="{:.5f}")


@case(".csv")
def an_uneven_clock() -> str:
    jitter = np.random.default_rng(1).uniform(-0.3, 0.3, ROWS) / RATE
    return "Time,Force,AccA,AccB\n" + rows(TIMES + jitter, F, A, B, form="{:.9f}")


@case(".csv")
def a_clock_that_stood_still_once() -> str:
    late = TIMES + 37.4 / RATE * (np.arange(ROWS) >= ROWS // 3)
    return "Time,Force,AccA,AccB\n" + rows(late, F, A, B, form="{:.9f}")


@case(".csv")
def a_clock_of_another_rate_than_the_header() -> str:
    return "Sample rate: 512 Hz\nTime,Force,AccA,AccB\n" + rows(TIMES, F, A, B)


@case(".csv")
def units_behind_commas_in_quotes() -> str:
    return '"Time, s","Force, N","Accel 1, m/s^2","Accel 2, m/s^2"\n' + rows(TIMES, F, A, B)


@case(".csv", inputs=(), outputs=(1, 2))
def a_row_of_units_with_the_form_of_a_clock() -> str:
    lines = [f"00:00:{t:09.6f};{a:.6f};{b:.6f}" for t, a, b in zip(TIMES, A, B, strict=True)]
    return "Elapsed;Accel 1;Accel 2\nhh:mm:ss.ffffff;m/s2;m/s2\n" + "\n".join(lines) + "\n"


@case(".csv", inputs=(), outputs=(0, 1, 2))
def nanoseconds_since_1970_of_a_telephone() -> str:
    stamps = 1_709_290_800_000_000_000 + (TIMES * 1e9).round().astype(np.int64)
    lines = [
        f"{stamp},{t:.6f},{f:.5f},{a:.5f},{b:.5f}" for stamp, t, f, a, b in zip(stamps, TIMES, F, A, B, strict=True)
    ]
    return "time,seconds_elapsed,z,y,x\n" + "\n".join(lines) + "\n"


@case(".csv", inputs=(), outputs=(0, 1, 2))
def two_clocks_of_different_rates() -> str:
    return "time_ms,elapsed_s,a1,a2,a3\n" + rows(500 * TIMES, TIMES, F, A, B, form="{:.9f}")


@case(".csv")
def units_behind_a_stroke_without_blanks() -> str:
    return "t/s;F/N;a_1/(m/s^2);a_2/(m/s^2);\n" + rows(TIMES, F, A, B, sep=";").replace("\n", ";\n")


@case(".txt", inputs=(), outputs=(0, 1, 2))
def keys_and_values_parted_as_the_rows_are() -> str:
    head = "SESAME ASCII data format (saf) v. 1\nSAMP_FREQ = 1024\nNDAT = 150\nCH0_ID = V\nCH1_ID = N\nCH2_ID = E\n####----\n"
    return head + rows(F, A, B, sep=" ")


@case(".csv")
def an_index_before_the_columns() -> str:
    lines = rows(F, A, B).splitlines()
    return ",Force,AccA,AccB\n" + "".join(f"{k},{line}\n" for k, line in enumerate(lines))


@case(".csv")
def quoted_cells_and_excel_signs() -> str:
    body = rows(TIMES, F, A, B, sep='";"', decimal=",").splitlines()
    return '\ufeffsep=;\n"Time [s]";"Force [N]";"AccA [g]";"AccB [g]"\n' + "".join(f'"{line}"\n' for line in body)


@case(".csv")
def windows_1252_and_a_temperature() -> bytes:
    text = "Zeit (s);Kraft (N);a1 (m/s²);a2 (m/s²);Temperatur (°C)\n"
    return (text + rows(TIMES, F, A, B, 20 + 0 * F, sep=";", decimal=",")).encode("cp1252")


@case(".txt")
def utf_16_as_labview_writes_it() -> bytes:
    return ("Time [s]\tForce [N]\tAccA [g]\tAccB [g]\n" + rows(TIMES, F, A, B, sep="\t")).encode("utf-16")


@case(".lvm")
def a_labview_measurement_file() -> str:
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n***End_of_Header***\t\t\t\t\n\t\t\t\t\nChannels\t3\t\t\t\n"
    head += "Samples\t150\t150\t150\t\nY_Unit_Label\tN\tg\tg\t\n"
    head += "X_Dimension\tTime\tTime\tTime\t\nDelta_X\t9.765625E-4\t9.765625E-4\t9.765625E-4\t\n"
    head += "***End_of_Header***\t\t\t\t\nX_Value\tForce\tAcc1\tAcc2\tComment\n"
    return head + rows(TIMES, F, A, B, sep="\t").replace("\n", "\t\n")


@case(".csv")
def thousands_in_german() -> str:
    def form(value: float) -> str:
        return f"{value:,.5f}".replace(",", "_").replace(".", ",").replace("_", ".")

    lines = [
        ";".join([f"{t:.6f}".replace(".", ","), form(f), form(a), form(b)])
        for t, f, a, b in zip(TIMES, F, A, B, strict=True)
    ]
    return "Zeit [s];Kraft [N];Sensor 1 [g];Sensor 2 [g]\n" + "\n".join(lines) + "\n"


@case(".csv", inputs=(), outputs=(0,))
def one_column_of_decimal_commas() -> str:
    return rows(F, decimal=",", form="{:.5f}")


#: Of one digit behind the sign, and of three, which may be thousands.
TENTHS = np.abs(np.round(CHANNELS * 10)) + 0.5
THREE = np.round(1 + np.abs(CHANNELS) % 1 + 0.0004, 3)


@case(".csv", inputs=(), outputs=(0,), channels=TENTHS)
def one_column_of_commas_that_may_part_two() -> str:
    return rows(TENTHS[:, 0], decimal=",", form="{:.1f}")


@case(".csv")
def decimal_commas_and_commas_between() -> str:
    return "Time,Force,AccA,AccB\n" + rows(TIMES, F, A, B, decimal=",")


@case(".csv", inputs=(), outputs=(0, 1), channels=THREE)
def semicolons_and_numbers_that_may_be_thousands() -> str:
    return "AccA;AccB\n" + rows(THREE[:, 0], THREE[:, 1], sep=";", decimal=",", form="{:.3f}")


@case(".csv")
def every_row_a_channel_with_its_name() -> str:
    named = zip(("Time", "Force", "AccA", "AccB"), (TIMES, F, A, B), strict=True)
    return "".join(f"{name}," + ",".join(f"{value:.6f}" for value in values) + "\n" for name, values in named)


@case(".txt", inputs=(), outputs=(0, 1, 2))
def every_row_a_channel_without_a_name() -> str:
    return "".join(" ".join(f"{value:.6f}" for value in values) + "\n" for values in (F, A, B))


@case(".csv")
def a_column_with_holes() -> str:
    lines = rows(TIMES, F, A, B).splitlines()
    return "Time,Force,AccA,AccB,Aux\n" + "".join(f"{line},{'' if k % 3 else k}\n" for k, line in enumerate(lines))


@case(".csv", channels=CHANNELS[60:])
def a_gap_in_all_channels() -> str:
    lines = rows(TIMES, F, A, B).splitlines()
    gap = [f"{line.partition(',')[0]},NaN,NaN,NaN" if 40 <= k < 60 else line for k, line in enumerate(lines)]
    return "Time [s],Force,AccA,AccB\n" + "\n".join(gap) + "\n"


@case(".at2", inputs=(), outputs=(1,))
def an_accelerogram_whose_samples_run_on() -> str:
    head = "STRONG MOTION DATABASE RECORD\nSomewhere, 5/19/1940, Station 9, 180\nACCELERATION TIME SERIES IN UNITS OF M/S/S\n"
    cells = [f"{value:15.7E}" for value in A]
    return (
        head
        + f"NPTS=  {ROWS}, DT= {1 / RATE:.10f} SEC,\n"
        + "".join("".join(cells[k : k + 4]) + "\n" for k in range(0, ROWS, 4))
    )


@case(".csv")
def a_column_that_says_overload() -> str:
    lines = rows(TIMES, F, A, B).splitlines()
    return "Time,Force,AccA,AccB,Aux\n" + "".join(
        f"{line},{'OVL' if k == 140 else k}\n" for k, line in enumerate(lines)
    )


@case(".csv")
def lines_under_the_table() -> str:
    return "Time,Force,AccA,AccB\n" + rows(TIMES, F, A, B) + "\nEnd of data\nMax: 3.2\n"


@case(".csv")
def a_row_of_channel_names_and_a_row_label() -> str:
    head = "Channel,X,1,2,3\nName,Time,Force,AccA,AccB\nUnit,s,N,g,g\n"
    return head + rows(TIMES, F, A, B)


@case(".csv")
def times_twice() -> str:
    return "Time,Force,Time,AccA,Time,AccB\n" + rows(TIMES, F, TIMES, A, TIMES, B)


@case(".csv")
def names_that_repeat() -> str:
    return "Time [s],Force [N],Acc [g],Acc [g]\n" + rows(TIMES, F, A, B)


@case(".txt", inputs=(), outputs=(0, 1, 2))
def a_bare_first_column_that_rises_evenly() -> str:
    return rows(TIMES, F, A, B, sep="\t")


@case(".csv", inputs=(), outputs=(0, 1, 2))
def volts_of_a_daq_with_numbered_channels() -> str:
    return "Time (s),Dev1/ai0 (V),Dev1/ai1 (V),Dev1/ai2 (V)\n" + rows(TIMES, F, A, B)


# ----------------------------------------------------------------------------------------------------- frequency responses as text


@case(".csv", kind="lines")
def real_and_imaginary_parts() -> str:
    return "Frequency [Hz],H1 Real,H1 Imag,H2 Real,H2 Imag\n" + rows(FREQUENCIES, H.real, H.imag, G.real, G.imag)


@case(".txt", kind="lines")
def parts_with_the_names_of_pairs() -> str:
    head = "Freq(Hz)\tRe(3Z/1Z) [g/N]\tIm(3Z/1Z) [g/N]\tRe(4Z/1Z) [g/N]\tIm(4Z/1Z) [g/N]\n"
    return head + rows(FREQUENCIES, H.real, H.imag, G.real, G.imag, sep="\t")


@case(".csv", kind="lines")
def magnitudes_and_phases_in_degrees() -> str:
    polar = (np.abs(H), np.degrees(np.angle(H)), np.abs(G), np.degrees(np.angle(G)))
    return "f [Hz],|H1|,Phase H1 [°],|H2|,Phase H2 [°]\n" + rows(FREQUENCIES, *polar, form="{:.9f}")


@case(".csv", kind="lines")
def decibels_and_phases_without_a_unit() -> str:
    polar = (20 * np.log10(np.abs(H)), np.degrees(np.angle(H)), 20 * np.log10(np.abs(G)), np.degrees(np.angle(G)))
    return "Frequenz;H1 Mag dB;H1 Phase;H2 Mag dB;H2 Phase\n" + rows(
        FREQUENCIES, *polar, sep=";", decimal=",", form="{:.9f}"
    )


@case(".csv", kind="lines")
def phases_in_radians_by_their_range() -> str:
    polar = (np.abs(H), np.angle(H), np.abs(G), np.angle(G))
    return "Frequency,H1 Magnitude,H1 Phase,H2 Magnitude,H2 Phase\n" + rows(FREQUENCIES, *polar, form="{:.9f}")


@case(".csv", kind="lines")
def complex_literals() -> str:
    lines = [
        f"{f:.2f},{h.real:.6f}{h.imag:+.6f}i,{g.real:.6f}{g.imag:+.6f}i"
        for f, h, g in zip(FREQUENCIES, H, G, strict=True)
    ]
    return "Frequency,H11,H21\n" + "\n".join(lines) + "\n"


@case(".csv", kind="lines")
def complex_literals_of_python() -> str:
    lines = [
        f"{f:.2f};({h.real:.6f}{h.imag:+.6f}j);({g.real:.6f}{g.imag:+.6f}j)"
        for f, h, g in zip(FREQUENCIES, H, G, strict=True)
    ]
    return "freq;H11;H21\n" + "\n".join(lines) + "\n"


@case(".txt", kind="lines")
def bare_lines_of_real_and_imaginary_parts() -> str:
    return rows(FREQUENCIES, H.real, H.imag, G.real, G.imag, sep=" ")


@case(".csv", kind="lines")
def parts_in_a_second_row() -> str:
    return "Frequency,H1,H1,H2,H2\nHz,real,imag,real,imag\n" + rows(FREQUENCIES, H.real, H.imag, G.real, G.imag)


@case(".csv", kind="lines")
def real_imag_real_imag() -> str:
    return "Freq,Real,Imag,Real,Imag\n" + rows(FREQUENCIES, H.real, H.imag, G.real, G.imag)


@case(".txt", kind="lines")
def parts_below_a_title_of_as_many_words() -> str:
    body = rows(FREQUENCIES, H.real, H.imag, G.real, G.imag, sep="  ", form="{:.8e}")
    return "% one two three four five\n% FREQ  REAL  IMAG  REAL  IMAG\n" + body


@case(".dat", kind="lines")
def parts_in_braces() -> str:
    head = "# f[Hz]  Re{H_11}  Im{H_11}  Re{H_21}  Im{H_21}\n"
    return head + rows(FREQUENCIES, H.real, H.imag, G.real, G.imag, sep="  ", form="{:.8e}").replace("e", "D")


@case(".csv", kind="lines")
def kilohertz_and_coherences() -> str:
    one = np.full(len(FREQUENCIES), 0.9)
    head = "Frequency [kHz],H1 Real,H1 Imag,H1 Coherence,H2 Real,H2 Imag,H2 Coherence\n"
    return head + rows(FREQUENCIES / 1000, H.real, H.imag, one, G.real, G.imag, one)


# ------------------------------------------------------------------------------------------------------- arrays, sound, workbooks


@binary(".npy", inputs=(), outputs=(0, 1, 2))
def one_array_of_times_and_channels(path: Path) -> None:
    np.save(path, np.column_stack([TIMES, CHANNELS]))


@binary(".npy", inputs=(), outputs=(0, 1, 2))
def one_array_without_a_rate(path: Path) -> None:
    np.save(path, CHANNELS)


@binary(".npy", inputs=(), outputs=(0, 1, 2))
def one_array_with_channels_in_rows(path: Path) -> None:
    np.save(path, CHANNELS.T)


@binary(".npy")
def an_array_with_fields(path: Path) -> None:
    array = np.zeros(ROWS, dtype=[("time", "f8"), ("force", "f8"), ("acc", "f8", (2,))])
    array["time"], array["force"], array["acc"] = TIMES, F, CHANNELS[:, 1:]
    np.save(path, array)


#: A sound file of 16 bits holds whole parts of 32768.
SOUND = np.round(CHANNELS * 1000) / 32768


@binary(".wav", inputs=(), outputs=(0, 1, 2), channels=SOUND)
def sound_of_16_bits(path: Path) -> None:
    wavfile.write(path, int(RATE), np.round(CHANNELS * 1000).astype(np.int16))


@binary(".wav", inputs=(), outputs=(0, 1, 2))
def sound_of_floating_point(path: Path) -> None:
    wavfile.write(path, int(RATE), CHANNELS.astype(np.float32))


@binary(".npz")
def an_archive_with_time_force_and_acc(path: Path) -> None:
    np.savez(path, t=TIMES, force=F, acc=CHANNELS[:, 1:])


@binary(".npz")
def an_archive_with_fs_and_names(path: Path) -> None:
    np.savez(path, Fs=RATE, data=CHANNELS, channels=np.array(["Hammer [N]", "A1 [g]", "A2 [g]"]))


@binary(".npz", inputs=(), outputs=(0, 1, 2))
def an_archive_with_channels_in_rows(path: Path) -> None:
    np.savez(path, fs=RATE, data=CHANNELS.T)


@binary(".npz", kind="lines")
def an_archive_of_f_and_h(path: Path) -> None:
    np.savez(path, f=FREQUENCIES, H=RESPONSES)


@binary(".mat", kind="lines")
def a_matlab_file_of_omega_and_pages(path: Path) -> None:
    savemat(path, {"omega": 2 * np.pi * FREQUENCIES, "FRF": RESPONSES.T[:, None, :]})


@binary(".mat")
def a_matlab_file_with_a_time_column(path: Path) -> None:
    savemat(path, {"t": TIMES[:, None], "F": F[:, None], "acc": CHANNELS[:, 1:], "F_unit": "N"})


@binary(".mat")
def a_matlab_structure_with_dt(path: Path) -> None:
    savemat(path, {"test": {"dt": 1 / RATE, "force": F[None, :], "acc": CHANNELS[:, 1:].T, "date": "May"}})


@binary(".mat", inputs=(), outputs=(0, 1, 2))
def a_matlab_structure_of_start_and_increment(path: Path) -> None:
    x = {"start_value": 0.0, "increment": 1 / RATE, "number_of_values": float(ROWS), "quantity": {"label": "s"}}
    savemat(path, {"Signal_0": {"x_values": x, "y_values": {"values": CHANNELS}, "function_record": {"name": "run 1"}}})


@binary(".mat", kind="lines")
def a_matlab_structure_of_lines_by_increment(path: Path) -> None:
    x = {"start_value": FREQUENCIES[0], "increment": 0.25, "number_of_values": float(len(FREQUENCIES))}
    savemat(path, {"Signal": {"x_values": x, "y_values": {"values": RESPONSES}}})


#: Three hits of fifty samples, as columns or pages.
HITS = CHANNELS.reshape(3, 50, 3)


def structures(**fields: list[object]) -> np.ndarray:
    """Return an array of structures, as MATLAB keeps the runs of a test or its channels."""
    count = len(next(iter(fields.values())))
    array = np.empty((1, count), dtype=[(name, object) for name in fields])
    for name, members in fields.items():
        for k, member in enumerate(members):
            array[0, k][name] = member
    return array


def cells(members: list[np.ndarray]) -> np.ndarray:
    """Return a cell array."""
    array = np.empty((1, len(members)), dtype=object)
    for k, member in enumerate(members):
        array[0, k] = member
    return array


@binary(".mat", kind="hits")
def a_structure_for_each_hit(path: Path) -> None:
    times = [TIMES[:50, None]] * 3
    savemat(path, {"test": structures(t=times, force=list(HITS[:, :, :1]), acc=list(HITS[:, :, 1:]))})


@binary(".mat", kind="hits")
def cells_with_a_matrix_for_each_hit(path: Path) -> None:
    savemat(path, {"Fs": RATE, "force": cells(list(HITS[:, :, :1])), "acc": cells(list(HITS[:, :, 1:]))})


@binary(".mat")
def a_structure_for_each_channel(path: Path) -> None:
    told = {"name": ["Force", "AccA", "AccB"], "unit": ["N", "m/s^2", "m/s^2"]}
    savemat(path, {"channel": structures(**told, data=list(CHANNELS.T[:, :, None])), "dt": 1 / RATE})


@binary(".mat", kind="hits")
def a_new_structure_for_each_hit(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    fields = {"t": [TIMES[None, :50]] * 3, "force": HITS[:, :, :1], "acc": HITS[:, :, 1:]}
    with h5py.File(path, "w", userblock_size=512) as file:
        test = file.create_group("test")
        test.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, members in fields.items():
            parts = [file.create_dataset(f"#refs#/{name}{k}", data=np.atleast_2d(m.T)) for k, m in enumerate(members)]
            for part in parts:
                part.attrs["MATLAB_class"] = np.bytes_("double")
            if name == "t":  # a column in MATLAB is a row in the file
                assert parts[0].shape == (50, 1)
            test.create_dataset(name, data=np.array([[part.ref] for part in parts], h5py.ref_dtype))
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


@binary(".mat", kind="hits")
def hits_as_pages(path: Path) -> None:
    savemat(path, {"fs": RATE, "force": HITS[:, :, 0].T, "acc": np.moveaxis(HITS[:, :, 1:], 0, 2)})


@binary(".npz", kind="one hit each")
def hits_as_columns(path: Path) -> None:
    np.savez(path, t=TIMES[:50], force=HITS[:, :, 0].T, acc=HITS[:, :, 1].T)


@binary(".xlsx")
def a_workbook_with_units_and_a_title(path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    sheet = book.active
    for row in (["Test 12"], [], ["Time", "Force", "AccA", "AccB"], ["s", "N", "m/s²", "m/s²"]):
        sheet.append(row)
    for row in np.column_stack([TIMES, CHANNELS]):
        sheet.append([float(value) for value in row])
    book.create_sheet("Notes").append(["nothing here"])
    book.save(path)


@binary(".xlsx")
def a_workbook_of_two_tables(path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    for sheet, scale in ((book.active, 1.0), (book.create_sheet("Second run"), 2.0)):
        sheet.append(["Time [s]", "Force [N]", "AccA [g]", "AccB [g]"])
        for row in np.column_stack([TIMES, scale * CHANNELS]):
            sheet.append([float(value) for value in row])
    book.save(path)
