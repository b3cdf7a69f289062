"""Bad files and places are answered by a DataError of three parts, and leave nothing behind."""

import pytest

import modalscope.io as mio
from tests.io import samples
from tests.support import refused


def test_a_missing_file_a_folder_and_an_empty_file(tmp_path):
    refused("there is no such file", mio.read, tmp_path / "none.uff")
    (tmp_path / "folder.npz").mkdir()
    refused("that is a folder", mio.read, tmp_path / "folder.npz")
    for suffix in mio.FORMATS:
        (tmp_path / f"empty{suffix}").touch()
        refused("the file is empty", mio.read, tmp_path / f"empty{suffix}")


def test_names_that_no_file_can_have(tmp_path):
    refused("file name too long|no such file", mio.read, "a" * 300 + ".uff")  # Python 3.14 asks no further
    refused("file name too long", mio.write, tmp_path / ("a" * 300 + ".uff"), samples.records())
    for name in ("a\0b.uff", "\ud800.uff"):
        refused("the name of a file", mio.read, name)
        refused("the name of a file", mio.write, name, samples.records())


def test_unknown_suffixes_name_the_known_ones(tmp_path):
    refused(r"the suffix '.xyz' is unknown(.|\n)*\.npz, \.uff", mio.read, tmp_path / "a.xyz")
    refused("it has no suffix", mio.write, tmp_path / "a", samples.records())
    error = refused("suffix '.docx' is unknown", mio.write, tmp_path / "a.docx", samples.records())
    assert ".xlsx" in error.change
    assert ".wav" not in error.change


def test_unknown_options_name_the_known_ones(tmp_path):
    mio.write(tmp_path / "a.uff", samples.records())
    refused("with colour(.|\n)*want, repeated", mio.read, tmp_path / "a.uff", colour=1)
    refused("with rename", mio.read, tmp_path / "a.uff", rename={"y": "outputs"})
    refused("with binary(.|\n)*text, dataset", mio.write, tmp_path / "b.uff", samples.records(), binary=1)
    refused("dataset='56'", mio.write, tmp_path / "b.uff", samples.modes(), dataset=56)
    refused("want='time'", mio.read, tmp_path / "a.uff", want="time")
    refused("kind(.|\n)*no such field", mio.read, tmp_path / "a.uff", kind="dirac")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".uff", ".unv", ".npz", ".json", ".csv", ".mat", ".h5"])
@pytest.mark.parametrize(
    "data",
    [
        b"a text file\nof two lines\n",
        b"\x00\x01\x02\xff" * 500,
        b"    -1",
        b"PK\x03\x04",
        b"{}",
        b"[1, 2]",
        b"\x89HDF\r\n\x1a\n",
    ],
)
def test_foreign_contents_are_refused_by_every_reader(tmp_path, suffix, data):
    (tmp_path / f"a{suffix}").write_bytes(data)
    refused(": |needs", mio.read, tmp_path / f"a{suffix}")
