"""Tell what a file is by its first bytes, where its suffix says nothing, or something else: text is text whatever it is called."""

from __future__ import annotations

import gzip
import os
import re
import zipfile
from pathlib import Path

from modalscope.io.contents import DAMAGED, damage_as_error, unreadable
from modalscope.io.limits import Room

#: What files begin with, and the suffix of their format.
_BEGINNINGS = {
    b"\x89HDF\r\n\x1a\n": ".h5", b"MATLAB 5": ".mat", b"TDSm": ".tdms", b"MDF ": ".mdf", b"CDF\x01": ".nc", b"CDF\x02": ".nc",
    b"RIFF": ".wav", b"\x93NUMPY": ".npy", b"PAR1": ".parquet", b"\x1f\x8b": ".gz", b"LabVIEW Measurement": ".lvm",
}  # fmt: skip
#: Suffixes that name one container, and those whose files are no text.
_HDF5 = {".h5", ".hdf5", ".mat", ".nc", ".med", ".mf4", ".mdf"}
_BINARY = {*_HDF5, ".npy", ".npz", ".xlsx", ".wav", ".tdms", ".parquet", ".sac", ".mseed", ".miniseed", ".msd", ".gz", ".zip"}  # fmt: skip
#: Files of programs that are not read: what they begin with, their suffixes, the program, and what it exports.
_PROGRAMS = (
    (b"|CF,", (), "imc FAMOS", "ASCII (.csv) or universal file (.uff)"),
    ((b"\x91\x13", b"\x92\x13", b"\x93\x13", b"\x94\x13"), (), "HBM catman", "ASCII (.asc), MATLAB (.mat) or MDF4 (.mf4)"),
    (b"DWSoft", (".dxd", ".d7d", ".d7z", ".dxz"), "Dewesoft X", "text (.csv), MATLAB (.mat), UFF58 (.uff) or HDF5 (.h5)"),
    (b"\x1aE\xdf\xa3", (".ide",), "enDAQ", "CSV, or MATLAB (.mat) from enDAQ Lab"),
    (b"KMI", (".evt", ".kmi"), "Kinemetrics", "miniSEED (.mseed), SAC, or text"),
    ((b"\x55\x3a", b"\x3a\x55"), (".sg2", ".seg2"), "a SEG-2 seismograph", "text, SAC or miniSEED"),
    ((b"<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"no\" ?>\n<usi:tdm", b"DIAEXTENDEDHEADER", b"#BEGINGLOBALHEADER"),
     (".tdm", ".tdx", ".r64", ".r32"), "NI DIAdem", "TDMS (.tdms) or text (.csv)"),
    (b"", (".lms", ".sdd", ".ldsf", ".tdf"), "LMS / Simcenter Testlab", "universal file (.uff, datasets 55, 58 and 15) or MATLAB (.mat)"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", (), "an older office program (.xls, .doc)", "workbook (.xlsx) or text (.csv)"),
)  # fmt: skip
_UNIVERSAL = re.compile(rb"\s{0,4}-1[ \t]*\r?\n\s{0,5}\d{1,5}b?\b")
_BYTES_EXAMINED, _MIN_ROWS = 1 << 14, 3
_ROW = re.compile(rb"^[ \t\"'(\[]*[-+]?(?:\d|\.\d)[^\r\n]*$", re.MULTILINE)


def told_by_bytes(path: Path) -> str:
    """Return the suffix of the format that a file is of by its first bytes, where that is not the one of its name; else nothing.

    Raises `DataError`: the file of a program that is not read here; the message says what that program exports.
    """
    with path.open("rb") as file:
        head = file.read(_BYTES_EXAMINED)
    suffix = path.suffix.lower()
    told = next((form for start, form in _BEGINNINGS.items() if head.startswith(start)), "")
    told = ".uff" if _UNIVERSAL.match(head) and suffix != ".unv" else told
    if head.startswith(b"PK\x03\x04"):
        told = _of_members(path)
    if told:
        return "" if told == suffix or {told, suffix} <= _HDF5 else told
    for starts, suffixes, program, exports in _PROGRAMS:
        if (starts and head.startswith(starts)) or suffix in suffixes:
            fault = f"it is a file of {program}, in a form of its own"
            raise unreadable(path.name, fault, f"Export it there as {exports}.")
    text = head.startswith((b"\xff\xfe", b"\xfe\xff")) or not re.search(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]", head)
    return ".txt" if text and len(_ROW.findall(head)) >= _MIN_ROWS else ""


def replaces(told: str, suffix: str, known: bool) -> bool:
    """Whether what the bytes tell goes before the suffix: of text only where the suffix is unknown or one of no text."""
    return bool(told) and (not known or (told != ".zip" and (told != ".txt" or suffix in _BINARY)))


def _of_members(path: Path) -> str:
    """Return what a packed file is by the names of its members."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except DAMAGED:  # also a version of zip that Python does not know
        return ""
    if "[Content_Types].xml" in names:
        return ".xlsx" if any(name.startswith("xl/") for name in names) else ""
    return ".npz" if names and all(name.endswith(".npy") for name in names) else ".zip"


def unpacked(path: Path, folder: Path, space: Room) -> Path:
    """Return the one file that is packed in another, written into a folder.

    Raises `DataError`: several files, a damaged one, or more than the room.
    """
    with damage_as_error(f"{path.name} as a packed file"):
        if not zipfile.is_zipfile(path):
            with path.open("rb") as file:
                file.seek(-4, os.SEEK_END)  # where the size stands, of files below 4 GB
                size = int.from_bytes(file.read(), "little")
            return _written(gzip.open(path), folder / Path(path.stem).name, space, size)
        with zipfile.ZipFile(path) as archive:
            names = [each for each in archive.namelist() if not each.endswith("/") and not each.startswith("__MACOSX")]
            if len(names) != 1:
                fault = f"it holds {len(names)} files ({', '.join(Path(each).name for each in names[:6])})"
                raise unreadable(path.name, fault, "Unpack it.")
            size = archive.getinfo(names[0]).file_size
            return _written(archive.open(names[0]), folder / Path(names[0]).name, space, size)


def _written(file: object, target: Path, space: Room, size: int) -> Path:
    with file as stream, target.open("wb") as out:  # type: ignore[attr-defined]
        data = stream.read(space.left + 1)
        space.take("what is packed in it", max(size, len(data)))
        out.write(data)
    return target
