"""Archives of arrays: a pickle is never loaded."""

import zipfile
from pathlib import Path

import numpy as np

import modalscope.io as mio
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
