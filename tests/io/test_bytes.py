"""What a file is by its first bytes, whatever it is called."""

from __future__ import annotations

import gzip
import zipfile
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms

T = np.arange(400) / 100
A = np.sin(9 * T) * np.exp(-T / 3)
TEXT = "time (s),a1 (g),a2 (g)\n" + "".join(f"{t:.2f},{a:.5f},{-a:.5f}\n" for t, a in zip(T, A, strict=True))


@pytest.mark.parametrize("name", ["a.log", "a", "a.EW", "a.xls", "a.mat"])
def test_text_is_read_as_text_whatever_it_is_called(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(TEXT)
    assert ms.read(tmp_path / name).output_dofs == ("a1", "a2")


@pytest.mark.parametrize(("suffix", "other"), [(".xlsx", ".csv"), (".uff", ".txt"), (".mat", ".bin"), (".npz", ".dat")])
def test_a_format_is_known_by_its_bytes(suffix: str, other: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    if suffix == ".xlsx":
        openpyxl = pytest.importorskip("openpyxl")
        book = openpyxl.Workbook()
        for line in TEXT.split():
            book.active.append([line] if line.startswith("t") else line.split(","))
        book.active.delete_rows(1, 3)
        book.save(path)
    else:
        ms.write(path, ms.Signals(outputs=np.stack([A, -A], 1), sampling_rate=100.0))
    found = ms.read(path.rename(tmp_path / f"a{other}"), sampling_rate=100.0)
    assert found.outputs.shape[1] == 2


@pytest.mark.parametrize("name", ["a.csv.gz", "a.gz", "b.dat", "a.zip"])
def test_one_packed_file_is_read_under_its_own_name(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if path.suffix == ".zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("folder/a.csv", TEXT)
    else:
        path.write_bytes(gzip.compress(TEXT.encode()))
    found = ms.read(path, quantity="velocity")
    assert (found.output_dofs, found.quantities[0], found.source_path) == (("a1", "a2"), "velocity", path)


def test_a_bomb_and_several_files_are_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.csv", TEXT)
        archive.writestr("b.csv", TEXT)
    with pytest.raises(ms.DataError, match=r"holds 2 files \(a.csv, b.csv\)"):
        ms.read(tmp_path / "a.zip")
    (tmp_path / "a.csv.gz").write_bytes(60 * gzip.compress(bytes(10_000_000), 1))
    with pytest.raises(ms.DataError, match="may take"):
        ms.read(tmp_path / "a.csv.gz")
    (tmp_path / "b.csv.gz").write_bytes(gzip.compress(TEXT.encode())[:-40])
    with pytest.raises(ms.DataError, match="damaged"):
        ms.read(tmp_path / "b.csv.gz")


@pytest.mark.parametrize(
    ("name", "start", "program"),
    [
        ("a.dat", b"|CF,2,1,1;", "imc"),
        ("a.bin", b"\x92\x13", "catman"),
        ("a.dxd", b"", "Dewesoft"),
        ("a.dat", b"\x1aE\xdf\xa3", "enDAQ"),
        ("a.evt", b"", "Kinemetrics"),
        ("a.dat", b"\x55\x3a\x01\x00", "SEG-2"),
        ("a.lms", b"", "Testlab"),
        ("a.tdm", b"", "DIAdem"),
        ("a.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "office"),
    ],
)
def test_the_message_on_another_programs_file_says_what_to_export(
    name: str, start: bytes, program: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(start + bytes(64))
    with pytest.raises(ms.DataError, match=rf"(?s){program}.*Export it there as"):
        ms.read(tmp_path / name)
