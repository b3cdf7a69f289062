"""A stand-in is read as its original is, and holds none of its names and measured numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from modalscope.extras.stand_in import Names, _half_power, stand_in
from modalscope.interfaces.cli import main
from modalscope.systems import build
from tests.support import measured as shared

STRUCTURE = build("iasc_asce")


def made(source: Path, folder: Path) -> tuple[Path, str]:
    """Return a stand-in and what is read of it, which is what is read of the file."""
    target = folder / f"stand_in{source.suffix}"
    original, copy = (line.partition(": ")[2] for line in stand_in(source, target, STRUCTURE))
    assert copy == original
    return target, copy


TABLE = """# Meridian Bridge, span 417.25 m, logger QX-4417
Operator: Ada Quill
Sampling rate: 204.8 Hz
Date: 2024-05-17 14:03:09
Time [s];Hammer [N];DeckNorth_acc [m/s^2];Pylon17 [m/s2]
{}
"""


def table(count: int = 1024, sign: str = ",") -> str:
    rng = np.random.default_rng(5)
    forces = np.where(np.arange(count) % 300 == 7, 812.5, 0.0) + rng.normal(0, 0.01, count)
    rows = np.column_stack([np.arange(count) / 204.8, forces, rng.normal(0, 3.3, (count, 2))])
    return TABLE.format("\n".join(";".join(f"{x:.7f}" for x in row) for row in rows)).replace(".", sign)


def test_a_table_keeps_its_layout_clock_and_units_and_nothing_else(tmp_path: Path) -> None:
    source = tmp_path / "meridian.csv"
    source.write_text(table(), encoding="utf-8")
    target, read = made(source, tmp_path)
    assert read == "records: 1024 samples at 204.8 Hz, 2 outputs (acceleration), 1 input"
    before, after = (path.read_text(encoding="utf-8").splitlines() for path in (source, target))
    assert len(before) == len(after)
    head = "\n".join(after[:5])
    for name in (
        "Meridian",
        "Bridge",
        "QX",
        "4417",
        "417",
        ",25",
        "Ada",
        "Quill",
        "2024",
        "14:03",
        "Deck",
        "North",
        "Pylon17",
    ):
        assert name not in head
    assert "Sampling rate: 204,8 Hz" in head
    assert re.fullmatch(r"Time \[s\];Hammer \[N\];P\d+_acc \[m/s\^2\];P\d+ \[m/s2\]", after[4])
    old, new = (np.array([line.split(";") for line in lines[5:]]) for lines in (before, after))
    assert (old[:, 0] == new[:, 0]).all()
    assert not (old[:, 1:] == new[:, 1:]).any()
    assert {len(cell.partition(",")[2]) for cell in new[:, 2]} == {7}  # as many decimals


#: File in shared/data, names in it, and what it is read as.
MEASURED = [
    ("beam_masses/P-1.txt", (), "frequency responses: 6400 lines from 0.3125 to 2000 Hz, 1 output, 1 input"),
    (
        "footbridge/impulse_VI0.txt",
        ("localuser", "2022", "16:02"),
        "records: 88800 samples at 7314.29 Hz, 3 outputs (acceleration), no inputs",
    ),
    (
        "kyowa_frame/imp_ham_set2_nomass.CSV",
        ("PCD-400A", "2026", "2.022", "97.55"),
        "records: 9120 samples at 50 Hz, 4 outputs (acceleration), 1 input",
    ),
    (
        "labview_beam/acceleration.lvm",
        ("Domen", "2018"),
        "records: 50030 samples at 50000 Hz, 1 output (acceleration), 1 input",
    ),
    (
        "beam_uff/beam_2kHz.uff",
        ("NewModel", "Decription", "modaldata", "Open Modal", "Jan"),
        "frequency responses (acceleration): 20001 lines from 0 to 2000 Hz, 3 outputs, 1 input",
    ),
    ("ruler_mat/jw_tf_coh.mat", ("yspec",), "frequency responses: 513 lines from 0 to 1000 Hz, 1 output, 1 input"),
]


def cells(path: Path) -> list[list[str]]:
    lines = path.read_bytes().decode("latin-1").splitlines()
    return [re.split(r"[,\t]", line) if "\t" not in line else line.split("\t") for line in lines]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "names", "read"), MEASURED, ids=[name for name, _, _ in MEASURED])
def test_a_stand_in_of_a_measured_file_is_read_as_the_file(
    name: str, names: tuple[str, ...], read: str, tmp_path: Path
) -> None:
    source = shared(*name.split("/"))
    target, copy = made(source, tmp_path)
    assert copy == read
    before, after = (path.read_bytes()[:1500] for path in (source, target))  # further digits come by chance
    for word in names:
        assert word.encode() in before
        assert word.encode() not in after
    if source.suffix not in (".uff", ".mat"):
        pairs = list(zip(cells(source), cells(target), strict=True))
        body = [(a, b) for a, b in pairs[40:] if len(a) > 1]
        for n in range(1, max(len(a) for a, _ in body)):  # the first column is the clock, or empty
            of_column = [(a[n], b[n]) for a, b in body if n < len(a) and a[n].strip()]
            assert sum(a == b for a, b in of_column) < 0.01 * len(of_column) + 1  # by chance, of few digits
        assert all(a[0] == b[0] for a, b in body)


@pytest.mark.slow
def test_payloads_and_arrays_have_no_number_of_the_file(tmp_path: Path) -> None:
    from scipy.io import loadmat

    from modalscope.io.limits import room
    from modalscope.io.uff.scan import scan

    source = shared("beam_uff", "beam_2kHz.uff")
    target, _ = made(source, tmp_path)
    before, after = (scan("x", p.read_bytes(), room("x", p.stat().st_size)) for p in (source, target))
    for a, b in zip(before, after, strict=True):
        assert (a.dataset, len(a.records), len(a.payload or b"")) == (b.dataset, len(b.records), len(b.payload or b""))
        said, simulated = (set(re.findall(rb"\d+\.\d{4,}", b" ".join(each.records[11:]))) for each in (a, b))
        assert a.dataset == 164 or not (said & simulated) - {b"0.0000000000000000"}
        if a.payload:
            old, new = (np.frombuffer(each.payload or b"").reshape(-1, 3) for each in (a, b))
            assert (old[:, 0] == new[:, 0]).all()  # lines, uneven
            assert not (old[1:, 1:] == new[1:, 1:]).any()
    source = shared("ruler_mat", "jw_tf_coh.mat")
    target, _ = made(source, tmp_path)
    (found,) = (value for name, value in loadmat(source).items() if name == "yspec")
    (copy,) = (value for value in loadmat(target).values() if getattr(value, "shape", ()) == found.shape)
    assert not np.isin(copy[copy.imag != 0], found).any()


@pytest.mark.slow
def test_a_workbook_and_its_sheets_have_a_stand_in(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl", reason="the extra `excel` is not installed")
    book = openpyxl.Workbook()
    book.active.title = "Meridian"
    book.properties.creator = "Ada Quill"
    book.active.append(["Time [s]", "Force [N]", "Pylon17 [m/s2]"])
    rng = np.random.default_rng(0)
    for k, row in enumerate(rng.normal(0, 4.4, (200, 2))):
        book.active.append([k / 64, *row.tolist()])
    source = tmp_path / "meridian.xlsx"
    book.save(source)
    target, read = made(source, tmp_path)
    assert read == "records: 200 samples at 64 Hz, 1 output (acceleration), 1 input"
    copy = openpyxl.load_workbook(target)
    assert copy.sheetnames == ["P1"]
    assert copy.properties.creator != "Ada Quill"
    old, new = (np.array(list(b.active.iter_rows(min_row=2, values_only=True)), float) for b in (book, copy))
    assert (old[:, 0] == new[:, 0]).all()
    assert not np.isin(new[:, 1:], old[:, 1:]).any()


UNEVEN = """    -1
    58
Meridian Bridge
NONE
17-May-24 14:03:09
NONE
NONE
    1         0    0         0       Deck         0   3       NONE         0   0
         2         6         0  0.00000E+00  0.00000E+00  0.00000E+00
        17    0    0    0                 NONE                 NONE
        12    0    0    0         DeckNorth a                 m/s^2
         0    0    0    0                 NONE                 NONE
         0    0    0    0                 NONE                 NONE
  0.00000E+00  1.23450E+00  1.10000E-01 -2.34560E+00  2.30000E-01  3.45670E+00
  3.10000E-01 -4.56780E+00  4.20000E-01  5.67890E+00  5.50000E-01 -6.78900E+00
    -1
"""


def test_functions_in_text_keep_places_and_times_and_their_columns(tmp_path: Path) -> None:
    source = tmp_path / "m.uff"
    source.write_text(UNEVEN, encoding="ascii")
    stand_in(source, tmp_path / "s.uff", STRUCTURE)
    before, after = UNEVEN.splitlines(), (tmp_path / "s.uff").read_text(encoding="ascii").splitlines()
    assert [len(line) for line in before] == [len(line) for line in after]
    assert before[8] == after[8]
    assert after[10].split()[-1] == "m/s^2"
    for name in ("Meridian", "Bridge", "Deck", "North", "May", "14:03"):
        assert name not in "\n".join(after)
    old, new = (" ".join(lines[13:15]).split() for lines in (before, after))
    assert old[::2] == new[::2]
    assert not set(old[1::2]) & set(new)


def test_words_between_and_behind_the_sets_of_a_universal_file_go(tmp_path: Path) -> None:
    source = tmp_path / "m.uff"
    source.write_text(f"{UNEVEN}Deck of the Meridian Bridge\n{UNEVEN}Pylon seventeen\n", encoding="ascii")
    stand_in(source, tmp_path / "s.uff", STRUCTURE)
    after = (tmp_path / "s.uff").read_text(encoding="ascii")
    assert after.count("    -1\n    58\n") == 2
    for name in ("Meridian", "Bridge", "Pylon", "seventeen"):
        assert name not in after


@pytest.mark.parametrize(
    ("value", "size"), [(0.0, 0.0), (5.7, 10.0), (5.5, 10**0.5), (1.79, 10**0.5), (1.77, 1.0), (-0.31, -(10**-0.5))]
)
def test_of_a_number_its_half_power_of_ten_is_left(value: float, size: float) -> None:
    assert _half_power(value) == pytest.approx(size, rel=1e-14)


def test_columns_stay_within_half_powers_of_ten_around_their_ends(tmp_path: Path) -> None:
    """A coherence of .2 to 1 stays one; gravity of 12.1 to 12.6 stays no constant."""
    rng, source = np.random.default_rng(3), tmp_path / "m.csv"
    rows = np.column_stack([np.arange(400) / 64, rng.uniform(0.2, 1.0, 400), rng.uniform(12.1, 12.6, 400)])
    source.write_text("Time [s],Quality,Deck\n" + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows), "utf-8")
    stand_in(source, tmp_path / "s.csv", STRUCTURE)
    new = np.loadtxt(tmp_path / "s.csv", delimiter=",", skiprows=1)
    assert new[:, 1].min() >= 0.099
    assert new[:, 1].max() < 1
    assert np.ptp(new[:, 2]) == pytest.approx(10**-0.5, rel=1e-5)


def test_lists_that_begin_with_minus_one_are_no_universal_file(tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text("-1\t0\t3\n0\t1\t0\n1\t0\t0\n2\t0\t7\n", encoding="ascii")
    stand_in(tmp_path / "m.txt", tmp_path / "s.txt", STRUCTURE)
    assert len((tmp_path / "s.txt").read_text(encoding="ascii").splitlines()) == 4


def test_structures_and_cells_of_matlab_have_a_stand_in(tmp_path: Path) -> None:
    from scipy.io import loadmat, savemat

    rng = np.random.default_rng(0)
    cell = np.empty((1, 2), object)
    cell[0, :] = ["Meridian deck", "Pylon"]
    test = {"acc": rng.normal(0, 2, (500, 2)), "fs": 512.0, "span": 417.25, "names": cell}
    savemat(tmp_path / "m.mat", {"Meridian": test})
    stand_in(tmp_path / "m.mat", tmp_path / "s.mat", STRUCTURE)
    found = {name: value for name, value in loadmat(tmp_path / "s.mat").items() if name[0] != "_"}
    ((name, value),) = found.items()
    fields = {field: value[field][0, 0] for field in value.dtype.names}
    assert name == "P1"
    assert fields["acc"].shape == (500, 2)
    assert not np.isin(fields["acc"], test["acc"]).any()
    assert fields["fs"] == 512
    assert 417.25 not in [each.item() for each in fields.values() if each.size == 1]
    assert [str(text[0]) for text in fields["names"][0]] == ["P1 P3", "P4"]


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("Sampling Rate(Hz)", "Sampling Rate(Hz)"),
        ("Hammer_2 [kN]", "Hammer_2 [kN]"),
        ("cm/s2", "cm/s2"),
        ("PylonNorth17", "P1"),
        ("Acceleration_114", "Acceleration_P1"),
        ("no. 4417", "no. 1111"),
        ("Brücke", "P1"),
    ],
)
def test_words_of_readers_stay_and_names_go(text: str, kept: str) -> None:
    assert Names()(text) == kept


@pytest.mark.slow
def test_what_has_no_stand_in_is_told_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "meridian.csv"
    source.write_text(table(64), encoding="utf-8")
    (tmp_path / "a.npz").write_bytes(b"PK" + bytes(40))
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(200))
    asked = [
        (["none.csv", "-o", "b.csv"], "there is no such file"),
        (["a.npz", "-o", "b"], "it holds bytes that no text has"),
        (["a.mat", "-o", "b"], "Save it with -v7"),
        (["meridian.csv", "-o", "meridian.csv"], "never overwritten"),
        (["meridian.csv", "-o", "b.txt"], "the formats are .csv"),
    ]
    for words, fault in asked:
        paths = [str(tmp_path / word) if word != "-o" else word for word in words]
        assert main(["anonymize", *paths]) == 2
        assert fault in capsys.readouterr().err
    assert main(["anonymize", str(source), "-o", str(tmp_path / "b")]) == 0
    said = capsys.readouterr().out
    assert "its stand-in: records: 64 samples at 204.8 Hz" in said
    assert (tmp_path / "b.csv").is_file()
