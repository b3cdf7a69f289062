"""Columns that are no sensors, heads with parts and units, axes in other units: by words, units and values."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import modalscope as ms

RATE, ROWS = 500, 3000
TIMES = np.arange(ROWS) / RATE
_RNG = np.random.default_rng(3)


def _mode(f: float, zeta: float, u: np.ndarray) -> np.ndarray:
    pole = np.exp(2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2)) / RATE)
    return np.asarray(lfilter([pole.imag], [1, -2 * pole.real, abs(pole) ** 2], u))


#: What drives a shaker, its force, and two accelerations.
DRIVE = _RNG.standard_normal(ROWS)
FORCE = lfilter([0.3], [1, -0.6], DRIVE) - 0.02 * _mode(23, 0.02, DRIVE)
A = _mode(23, 0.02, FORCE) + 0.4 * _mode(71, 0.01, FORCE)
B = 0.5 * _mode(23, 0.02, FORCE) - 0.6 * _mode(71, 0.01, FORCE)

F = 0.5 * np.arange(1, 121)
H = np.stack([1 / (1 - (F / 12) ** 2 + 0.04j * F / 12) + c / (1 - (F / 31) ** 2 + 0.03j * F / 31) for c in (0.3, -0.6)])


def _table(path: Path, head: str, *columns: np.ndarray, sep: str = ",") -> Path:
    rows = (sep.join(f"{value:.7g}" for value in row) for row in zip(*columns, strict=True))
    path.write_text(head + "\n" + "\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize(
    ("names", "columns", "outputs", "inputs"),
    [
        ("Drive (V),Force (N),A (g),B (g)", (DRIVE, FORCE, A, B), ("A", "B"), ("Force",)),
        ("AO0 [V],Load cell [lbf],A [g],B [g]", (DRIVE, FORCE, A, B), ("A", "B"), ("Load cell",)),
        ("Voltage [V],Force [N],A [g],B [g]", (DRIVE, FORCE, A, B), ("A", "B"), ("Force",)),
        ("Amplifier input [V],Head force [N],Head acc [g]", (DRIVE, FORCE, A), ("Head acc",), ("Head force",)),
        # a laser without its sensitivity answers the force as the sensors do, and without a force the drive is the input
        ("Voltage [V],Force [N],B [g]", (A, FORCE, B), ("Voltage", "B"), ("Force",)),
        ("Source [V],A [g],B [g]", (DRIVE, A, B), ("A", "B"), ("Source",)),
        ("Drive voltage [V],A [g],B [g]", (DRIVE, A, B), ("A", "B"), ("Drive voltage",)),
        ("Shaker voltage,A [g],B [g]", (DRIVE, A, B), ("A", "B"), ("Shaker voltage",)),
        ("Shaker voltage,Force,A [g],B [g]", (DRIVE, FORCE, A, B), ("A", "B"), ("Force",)),
        # a counter beside it follows nothing; what is called an output may be a generator's
        ("DAC 1 [V],A [g],B [g],Tacho", (DRIVE, A, B, np.arange(ROWS) % 17 < 3), ("A", "B"), ("DAC 1",)),
        ("Output 1 [V],Force [N],A [g],B [g]", (DRIVE, FORCE, A, B), ("A", "B"), ("Force",)),
        ("Output 1 [V],Force [N],B [g]", (A, FORCE, B), ("Output 1", "B"), ("Force",)),
    ],
)
def test_the_voltage_that_drives_a_shaker_is_no_channel_beside_its_force(
    tmp_path: Path, names: str, columns: Sequence[np.ndarray], outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> None:
    found = ms.read(_table(tmp_path / "a.csv", f"Time (s),{names}", TIMES, *columns))
    assert (found.output_dofs, found.input_dofs) == (outputs, inputs)


def test_a_drive_that_nothing_follows_is_left_and_the_note_names_it_as_an_input(tmp_path: Path) -> None:
    noise = np.random.default_rng(8).standard_normal(ROWS)
    found = ms.io.survey(_table(tmp_path / "a.csv", "Time (s),Source [V],A [g],B [g]", TIMES, noise, A, B))
    assert found.thing.output_dofs == ("A", "B")
    assert any('(else: --columns "time=1,in=2,out=3-4")' in str(note) for note in found.notes)


def test_counters_from_any_number_and_counts_are_no_sensors(tmp_path: Path) -> None:
    count, features = np.arange(ROWS), np.rint(80 + 5 * _RNG.standard_normal(ROWS))
    path = _table(tmp_path / "a.csv", "5,frame,Time,u,v,tracked", count + 6, count + 100, TIMES, A, B, features)
    found = ms.read(path)
    assert (found.output_dofs, found.input_dofs, found.sampling_rate) == (("u", "v"), (), RATE)
    # the counts of a converter are all whole, and take both signs
    whole = _table(tmp_path / "b.csv", "Time (s),u,v", TIMES, np.rint(1e3 * A), np.rint(1e3 * B))
    assert ms.read(whole).output_dofs == ("u", "v")


def test_batteries_and_weather_are_no_sensors_also_with_one_faulty_value(tmp_path: Path) -> None:
    battery, weather, bare = 12.6 - 1e-5 * np.arange(ROWS), np.full(ROWS, 21.5), 4 + 1e-4 * np.sin(TIMES)
    weather[700] = bare[400] = 85.0
    path = _table(tmp_path / "a.csv", "Time (s),A,B,BattV,T_ambient,c7", TIMES, A, B, battery, weather, bare)
    assert ms.read(path).output_dofs == ("A", "B")
    hit = np.full(ROWS, 0.01)
    hit[500:504] = (3, 9, 8, 2)  # of a force whose noise is below one step of its converter
    path = _table(tmp_path / "b.csv", "Time (s),A,B,c7", TIMES, _mode(23, 0.02, hit), _mode(71, 0.02, hit), hit)
    assert ms.read(path).input_dofs == ("c7",)


@pytest.mark.parametrize(
    "heads",
    [
        "Frequency [Hz],Pier (Real),Pier (Imag.),Deck (Real),Deck (Imag.)",
        "f/Hz,Real part of Pier,Imaginary part of Pier,Real part of Deck,Imaginary part of Deck",
        "Hz,Re[Pier],Im[Pier],Re[Deck],Im[Deck]",
        "Hz,Pier [Re],Pier [Im],Deck [Re],Deck [Im]",
        "Freq,Pier_R,Pier_I,Deck_R,Deck_I",
        "Freq (Hz),Partie reelle (Pier),Partie imaginaire (Pier),Partie reelle (Deck),Partie imaginaire (Deck)",
    ],
)
def test_the_part_is_cut_off_a_name_with_its_brackets(tmp_path: Path, heads: str) -> None:
    path = _table(tmp_path / "a.csv", heads, F, H[0].real, H[0].imag, H[1].real, H[1].imag)
    assert ms.read(path).output_dofs == ("Pier", "Deck")


@pytest.mark.parametrize(
    ("head", "factor", "sep"),
    [
        ("No\tName\tUnit\n1\tFrequency\trad/s\n2\tP real\tg/N\n3\tP imag\tg/N\n", 2 * np.pi, "\t"),
        ("Column 1: Frequency [kHz]\nColumn 2: P Real [g/N]\nColumn 3: P Imag [g/N]\n", 1e-3, "\t"),
        ("# 1, Speed, rpm\n# 2, P real, g/N\n# 3, P imag, g/N", 60, ","),
        ("freq (cpm)  real(P) (g/N)  imag(P) (g/N)", 60, "  "),
        ("# f Hz Re(P) g/N Im(P) g/N", 1, " "),
    ],
)
def test_a_list_of_columns_and_units_between_names_are_heads(
    tmp_path: Path, head: str, factor: float, sep: str
) -> None:
    found = ms.read(_table(tmp_path / "a.txt", head, factor * F, H[0].real, H[0].imag, sep=sep))
    assert (found.output_dofs, found.units) == (("P",), (("g",), ("N",)))
    np.testing.assert_allclose(found.frequencies, F, rtol=1e-6)
    np.testing.assert_allclose(found.values[:, 0, 0], H[0], atol=1e-5)
