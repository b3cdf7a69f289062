"""MATLAB files: structures, foreign classes, and axes that MATLAB drops."""

import re
import struct
import zlib

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.interfaces.cli import main
from tests.io import samples
from tests.io.bombs import BOMBS, element
from tests.support import refused

h5py = pytest.importorskip("h5py")


def test_matlab_structures_are_dotted_and_foreign_classes_named(tmp_path):
    import scipy.io as sio
    import scipy.sparse as sparse

    path, frf = tmp_path / "a.mat", samples.frequency_response()
    for compressed in (False, True):
        test = {"H": frf.values, "f": frf.frequencies, "dofs": np.array(frf.output_dofs, dtype=object)}
        sio.savemat(path, {"test": test, "stiffness": sparse.eye_array(3)}, do_compression=compressed)
        rename = {"test.H": "values", "test.f": "frequencies", "test.dofs": "output_dofs"}
        for ignore in ((), ["stiffness"]):
            back = mio.read(path, rename=rename, ignore=ignore)
            np.testing.assert_array_equal(back.values, frf.values)
            assert back.output_dofs == frf.output_dofs
        (left,) = mio.survey(path, rename=rename).left
        assert left.reason == "stiffness is of class sparse, no plain array"
    sio.savemat(path, {"stiffness": sparse.eye_array(3)})
    refused("stiffness in a.mat: it is of class sparse, and without it", mio.read, path)


def variable(*elements: bytes) -> bytes:
    body = b"".join(elements)
    return struct.pack("<II", 14, len(body)) + body


@pytest.mark.parametrize("compressed", [False, True])
def test_an_object_in_a_workspace_is_left_by_name(tmp_path, compressed):
    """A table is opaque: its name and class stand where others have dimensions; a tf is an object with its class before its fields."""
    import scipy.io as sio

    path = tmp_path / "a.mat"
    sio.savemat(path, {"fs": 50.0, "acc": np.random.default_rng(0).standard_normal((40, 2))}, do_compression=compressed)
    texts = [element(1, text) for text in (b"results", b"MCOS", b"timetable")]
    table = variable(element(6, struct.pack("<II", 17, 0)), *texts, variable(element(6, struct.pack("<II", 13, 0))))
    head = element(6, struct.pack("<II", 3, 0)) + element(5, struct.pack("<2i", 1, 1))
    system = variable(head, element(1, b"sys"), element(1, b"tf"), element(5, struct.pack("<i", 8)))
    added = [table, system]
    if compressed:
        added = [struct.pack("<II", 15, len(packed)) + packed for packed in map(zlib.compress, added)]
    path.write_bytes(path.read_bytes() + b"".join(added))
    assert mio.read(path).outputs.shape == (40, 2)
    left = mio.survey(path).left
    assert {part.part: part.reason for part in left} == {
        "results": "results is of class timetable, no plain array",
        "sys": "sys is of class tf, no plain array",
    }
    assert mio.survey(path, ignore=["results", "sys"]).left == () or compressed


def test_an_object_of_7_3_is_left_by_name(tmp_path):
    def fill(file):
        file["fs"], file["acc"] = [[50.0]], np.random.default_rng(0).standard_normal((2, 40))
        file.create_dataset("results", data=np.zeros((1, 6), "u4")).attrs["MATLAB_class"] = np.bytes_("timetable")
        file.create_group("sys").attrs["MATLAB_class"] = np.bytes_("tf")

    matlab_7_3(tmp_path / "a.mat", fill)
    assert mio.read(tmp_path / "a.mat").outputs.shape == (40, 2)
    assert {part.part for part in mio.survey(tmp_path / "a.mat").left} == {"results", "sys"}


def test_matlab_drops_trailing_axes_and_they_come_back(tmp_path):
    import scipy.io as sio

    sio.savemat(
        tmp_path / "a.mat",
        {"frequencies": np.arange(1.0, 5), "values": np.arange(8.0).reshape(4, 2) * (1 - 1j)},
        oned_as="row",
    )
    assert mio.read(tmp_path / "a.mat").values.shape == (4, 2, 1)


def matlab_7_3(path, fill):
    """Write a file as MATLAB 7.3 does: HDF5 behind a head of 512 bytes, with the class of every variable."""
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def test_what_7_3_holds_beside_numbers_and_text_is_named(tmp_path):
    def fill(file):
        file.create_dataset("a", data=np.zeros(2, dtype=[("x", "f8"), ("y", "f8")])).attrs["MATLAB_class"] = np.bytes_(
            "table"
        )

    matlab_7_3(tmp_path / "a.mat", fill)
    refused("it is of class table", mio.read, tmp_path / "a.mat")


def test_characters_outside_of_two_bytes_come_back(tmp_path):
    """Two units of 16 bits are one character."""

    def fill(file):
        file["sampling_rate"], file["outputs"] = [[1.0]], np.ones((1, 4))
        units = np.frombuffer("m\N{GREEK SMALL LETTER MU}\U0001d4cd".encode("utf-16-le"), "u2")[:, None]
        item = file.create_dataset("#refs#/a", data=units)
        item.attrs["MATLAB_class"] = np.bytes_("char")
        cell = file.create_dataset("output_dofs", data=np.array([item.ref], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        cell.attrs["MATLAB_class"] = np.bytes_("cell")

    matlab_7_3(tmp_path / "a.mat", fill)
    assert mio.read(tmp_path / "a.mat").output_dofs == ("m\N{GREEK SMALL LETTER MU}\U0001d4cd",)


def test_texts_that_are_no_references_lead_to_no_other_array(tmp_path):
    """A text is a path in h5py's eyes."""

    def fill(file):
        file["fs"], file["y"] = [[50.0]], np.random.default_rng(0).standard_normal((3, 40))
        file.create_dataset("s", data=np.array(["y"], object), dtype=h5py.string_dtype())

    matlab_7_3(tmp_path / "a.mat", fill)
    refused(r"(?s)s in .*holds what MATLAB does not write.*ignore=\['s'\]", mio.read, tmp_path / "a.mat")
    assert mio.read(tmp_path / "a.mat", ignore="s").outputs.shape == (40, 3)


def test_references_without_a_class_are_a_list_under_their_name(tmp_path):
    def fill(file):
        file["fs"] = [[50.0]]
        parts = [file.create_dataset(f"#refs#/{k}", data=np.arange(40.0)[None] % (k + 3)) for k in range(2)]
        file.create_dataset("y", data=np.array([part.ref for part in parts], h5py.ref_dtype))

    matlab_7_3(tmp_path / "a.mat", fill)
    assert mio.read(tmp_path / "a.mat").outputs.shape == (40, 2)
    assert mio.read(tmp_path / "a.mat", ignore="y{2}").outputs.shape == (40, 1)
    refused("the arrays fs are unknown", mio.read, tmp_path / "a.mat", ignore="y")


def test_a_cell_that_stands_in_others_again_and_again_is_refused_at_once(tmp_path):
    path = tmp_path / "a.mat"
    BOMBS["cells of the same cell, eleven deep (7.3).mat"](path)
    refused("stands in several places", mio.read, path)


def test_what_unpacks_to_more_than_a_file_may_is_weighed_before_by_its_name_and_read_as_the_message_says(
    tmp_path, capsys
):
    import scipy.io as sio

    path = tmp_path / "quiet.mat"
    acc = np.round(np.random.default_rng(0).standard_normal((500, 2)), 1)
    sio.savemat(path, {"acc": acc, "fs": 100.0, "spare": np.zeros(300_000)}, do_compression=True)
    try:
        assert main(["info", str(path), "--max-memory", "4MB"]) == 2
        said = capsys.readouterr().err
        assert re.search(
            r"with spare its arrays take 2 MB of memory or more; those of a file of \d kB may take 1 MB", said
        )
        assert main(["info", str(path), "--max-memory", "4MB", "--ignore", "spare"]) == 0  # it is not unpacked
        (option,) = re.findall(r"raise the limit: (--max-memory \d+GB)", said)
        assert main(["info", str(path), *option.split(), "--ignore", "acc"]) == 0
    finally:
        mio.set_max_memory(None)


def test_compressed_data_that_are_more_than_they_say_are_damage(tmp_path):
    path = tmp_path / "a.mat"
    mio.write(path, samples.records())
    packed = zlib.compress(element(14, b"") + bytes(1000))
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<II", 15, len(packed)) + packed)
    refused("cut off, or more than they say", mio.read, path)
