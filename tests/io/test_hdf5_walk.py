"""What the walk through an HDF5 file refuses, found in this process; that other files are never opened."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modalscope.io.hdf5_walk import Refused, walk
from tests.io import corpus
from tests.io.bombs import BOMBS

h5py = pytest.importorskip("h5py")

LEFT = 125_000_000

#: Parts of the bombs' names, and of what is said about them.
SAID = {
    "a terabyte that is not there": "takes 1000000 MB of memory, and may take 125 MB",
    "a piece larger": "comes in pieces",
    "pieces without number": "10000000 pieces of 0 bytes",
    "a link to another file": "is a link to another file",
    "a soft link through": "is a link to another file",
    "numbers in another file": "lie in another file",
    "a view of another file": "is a view of other files",
    "a group in itself": "is linked twice",
    "groups that double": "is linked twice",
    "groups a thousand deep": "deeper than 32",
    "a soft link to itself": "damaged or not HDF5",
    "lists of their own length": "neither numbers nor texts",
    "a million times one text": "has 100000 cells",
}


@pytest.mark.parametrize("name", [name for name in BOMBS if any(name.startswith(part) for part in SAID)])
def test_what_leads_out_or_cannot_be_is_refused(tmp_path, name):
    path = tmp_path / name.replace(" (7.3)", "")
    BOMBS[name](path)
    said = next(text for part, text in SAID.items() if name.startswith(part))
    with pytest.raises(Refused, match=said):
        walk(str(path), LEFT)


def test_whole_files_pass(tmp_path):
    passed = [path for path in corpus.write(tmp_path) if path.suffix == ".h5" or "73" in path.name]
    for path in passed:
        walk(str(path), LEFT)
    assert len(passed) >= 8


def test_texts_are_counted_as_they_are_read(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["output_dofs"] = ["x" * 1000] * 50
    walk(str(tmp_path / "a.h5"), 100_000)
    with pytest.raises(Refused, match="the texts of /output_dofs take more memory"):
        walk(str(tmp_path / "a.h5"), 40_000)


def test_filters_that_are_seldom_used_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("outputs", data=np.arange(100), chunks=(10,), scaleoffset=0)
    with pytest.raises(Refused, match="packed by the filter 6"):
        walk(str(tmp_path / "a.h5"), LEFT)


def test_large_attributes_and_empty_references_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("output", data=np.arange(3)).attrs["CLASS"] = np.zeros(5000)
    with pytest.raises(Refused, match="the attribute CLASS of /output has 40000 bytes"):
        walk(str(tmp_path / "a.h5"), LEFT)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file.create_dataset("cell", (2,), h5py.ref_dtype)
    with pytest.raises(Refused, match="a cell of /cell leads nowhere"):
        walk(str(tmp_path / "b.h5"), LEFT)


def test_a_dataset_of_nothing_takes_no_memory(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["nothing"] = h5py.Empty("f8")
    walk(str(tmp_path / "a.h5"), 0)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["something"] = 1.0
    with pytest.raises(Refused):
        walk(str(tmp_path / "a.h5"), 0)


def test_the_walk_imports_nothing_of_the_package():
    text = Path(walk.__code__.co_filename).read_text(encoding="utf-8")
    assert "from modalscope" not in text
    assert "import modalscope" not in text
