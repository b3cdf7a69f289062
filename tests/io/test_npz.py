"""Archives of arrays: a pickle is never loaded."""

import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.io import npz
from modalscope.io.limits import room
from tests.support import refused


def test_a_pickle_in_an_archive_is_never_loaded(tmp_path):
    np.savez(tmp_path / "a.npz", outputs=np.array([{"a": 1}], dtype=object), sampling_rate=1.0)
    refused("pickled objects", mio.read, tmp_path / "a.npz")
    (tmp_path / "b.npz").write_bytes(bytes(range(256)))
    refused("it is not one", mio.read, tmp_path / "b.npz")
    with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive:
        archive.writestr("notes.txt", "text")
    refused("not an array|damaged|unknown", mio.read, tmp_path / "c.npz")


def test_long_numbers_of_python_2_are_refused_in_words(tmp_path: Path) -> None:
    """NumPy reads them with a warning of its own; so it does of a damaged head."""
    place = tmp_path / "a.npy"
    np.save(place, np.zeros((6, 2)))
    place.write_bytes(place.read_bytes().replace(b"(6, 2), }  ", b"(6L, 2L), }"))
    refused("long numbers of Python 2", mio.read, place, sampling_rate=10.0)


def test_a_version_of_zip_that_python_does_not_know_is_damage(tmp_path):
    path = tmp_path / "later.npz"
    np.savez(path, y=np.ones((100, 2)), fs=10.0)
    raw = bytearray(path.read_bytes())
    raw[raw.find(b"PK\x01\x02") + 6] = 239  # the version that is needed, ten times
    path.write_bytes(raw)
    refused("zip file version 23.9", mio.read, path)


@pytest.mark.parametrize(
    "array",
    [
        *(
            np.array(3.5),
            np.arange(6.0).reshape(2, 3),
            np.asfortranarray(np.arange(24).reshape(2, 3, 4)),
            np.zeros((0, 2)),
        ),
        *(np.arange(3, dtype=">f4"), np.array(["a", "bc"]), np.array(["", ""]), np.array([True]), np.array([1 + 2j])),
        *(np.zeros(3, dtype=[("t", "f8"), ("y", "i2", (2,)), ("größe", "f4")]), np.ones((700, 300))),
    ],
)
def test_arrays_are_those_that_numpy_reads(tmp_path: Path, array: np.ndarray) -> None:
    np.savez_compressed(tmp_path / "a.npz", a=array)
    np.save(tmp_path / "a.npy", array)
    found = npz._arrays(tmp_path / "a.npz", room("a", 10**6))["a"]
    with (tmp_path / "a.npy").open("rb") as file:
        alone = npz._array(file, "a", "a", (tmp_path / "a.npy").stat().st_size, room("a", 10**6))
    for each in (found, alone):
        assert (each.dtype, each.shape) == (array.dtype, array.shape)
        assert np.array_equal(each, array)


def test_each_member_is_opened_once_and_its_head_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez(tmp_path / "a.npz", outputs=np.ones((9, 2)) * np.arange(9)[:, None], sampling_rate=4.0)
    opened: list[str] = []
    heads: list[str] = []
    really_open, really_evaluate = zipfile.ZipFile.open, npz.literal_eval
    monkeypatch.setattr(
        zipfile.ZipFile, "open", lambda *given: (opened.append(given[1].filename), really_open(*given))[1]
    )
    monkeypatch.setattr(npz, "literal_eval", lambda text: (heads.append(text), really_evaluate(text))[1])
    assert mio.read(tmp_path / "a.npz").samples == 9
    assert opened == ["outputs.npy", "sampling_rate.npy"]
    assert len(heads) == 2


@pytest.mark.parametrize(
    ("head", "fault"),
    [
        ("5", "no type and no shape"),
        ("{'descr': 5, 'fortran_order': False, 'shape': (1,)}", "no type and no shape|data type"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': 1}", "no type and no shape"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (1.0,)}", "no type and no shape"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}", "has the shape"),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (2,)}", "has the shape"),
        ("{'descr': '<f8', 'shape': (1,)}", "fortran_order"),
        ("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", "pickled objects"),
        ("{[]: 1}", "no type and no shape"),
        ("(" * 300, "long numbers of Python 2, or is damaged"),
    ],
)
def test_heads_that_are_none_are_refused(tmp_path: Path, head: str, fault: str) -> None:
    for version, form in ((1, "<H"), (2, "<I"), (3, "<I")):
        begin = b"\x93NUMPY" + bytes([version, 0]) + struct.pack(form, len(head)) + head.encode()
        (tmp_path / "a.npy").write_bytes(begin + np.zeros(1).tobytes())
        refused(fault, mio.read, tmp_path / "a.npy", sampling_rate=1.0)
    (tmp_path / "a.npy").write_bytes(begin.replace(b"Y\3", b"Y\4") + np.zeros(1).tobytes())
    refused("damaged", mio.read, tmp_path / "a.npy", sampling_rate=1.0)
    (tmp_path / "a.npy").write_bytes(begin[:9])
    refused("damaged", mio.read, tmp_path / "a.npy", sampling_rate=1.0)


def test_an_array_that_ends_early_in_its_archive_is_damage(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", outputs=np.arange(300_000.0), sampling_rate=4.0)
    raw = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(raw[:1_000_000] + b"!" + raw[1_000_001:])
    refused("damaged(.|\n)*CRC", mio.read, tmp_path / "a.npz")
