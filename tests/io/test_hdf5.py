"""HDF5 files are proved before they are read: by their own checksum, or by a walk in another process."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import modalscope.io as mio
from benchmarks.exports.verdict import dead_ends
from modalscope.io import apart, hdf5, hdf5_walk
from modalscope.io.limits import room
from tests.io import samples
from tests.support import refused

h5py = pytest.importorskip("h5py")


@pytest.fixture
def ours(tmp_path):
    mio.write(tmp_path / "a.h5", samples.frequency_response())
    return tmp_path / "a.h5"


@pytest.fixture
def foreign(tmp_path):
    frf = samples.frequency_response()
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["values_real"], file["values_imag"] = frf.values.real, frf.values.imag
        file["frequencies"], file["output_dofs"] = frf.frequencies, list(frf.output_dofs)
    return tmp_path / "foreign.h5"


def counted(monkeypatch):
    """Count the walks in another process."""
    calls, apart = [], hdf5._apart
    monkeypatch.setattr(
        hdf5, "_apart", lambda path, room, streamed="": calls.append(path) or apart(path, room, streamed)
    )
    return calls


def test_a_file_of_ours_needs_no_other_process_and_a_foreign_one_does(ours, foreign, monkeypatch):
    calls = counted(monkeypatch)
    mio.read(ours)
    assert calls == []
    mio.read(foreign)
    assert calls == [foreign]


def test_one_damaged_bit_anywhere_in_a_file_of_ours_is_found(ours):
    data, rng = ours.read_bytes(), np.random.default_rng(0)
    for place in rng.integers(0, len(data) - 200, 40):
        ours.write_bytes(data[:place] + bytes([data[place] ^ 1 << int(rng.integers(8))]) + data[place + 1 :])
        refused("do not match its checksum", mio.read, ours)


def test_a_damaged_number_is_found_by_hdf5_itself_where_the_seal_is_gone(ours):
    data = ours.read_bytes()
    with h5py.File(ours) as file:
        place = file["values_real"].id.get_chunk_info(0).byte_offset
    bare = bytearray(data[: data.index(b"\nmodalscope sha256")])
    ours.write_bytes(bare)
    assert samples.differences(mio.read(ours), samples.frequency_response()) == []
    bare[place + 3] ^= 1
    ours.write_bytes(bare)
    refused("damaged", mio.read, ours)


def test_the_same_data_give_the_same_file(tmp_path):
    for name in ("a.h5", "b.h5"):
        mio.write(tmp_path / name, samples.modes())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_a_seal_does_not_open_the_way_out_of_a_file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["outputs"] = h5py.ExternalLink(str(tmp_path / "b.h5"), "/x")
    hdf5.seal(path)
    refused("/outputs is a link to another file", mio.read, path)


@pytest.mark.skipif(sys.platform == "win32", reason="the end of a process by a signal")
@pytest.mark.parametrize(
    ("program", "found"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "its reader fails"),
        ("import sys; sys.exit(3)", "status 3"),
        ("import time; time.sleep(60)", "did not end"),
    ],
)
def test_a_walk_that_breaks_off_or_hangs_is_an_error_of_the_file(foreign, tmp_path, monkeypatch, program, found):
    (tmp_path / "walk.py").write_text(program)
    monkeypatch.setattr(hdf5_walk, "__file__", str(tmp_path / "walk.py"))
    monkeypatch.setitem(apart.LIMITS, "h5py", ((2, 10**9), (2, 10**9), 3))
    refused(found, mio.read, foreign)


def test_inside_of_another_program_the_walk_is_made_here(foreign, monkeypatch):
    calls = counted(monkeypatch)
    monkeypatch.setattr(sys, "executable", "/opt/matlab/bin/glnxa64/MATLAB")
    assert mio.read(foreign).output_dofs == samples.OUTPUTS
    assert calls == []


def test_the_program_says_what_the_function_finds(foreign, tmp_path):
    space = room("a", foreign.stat().st_size)
    assert hdf5._apart(foreign, space, "") == hdf5_walk.refusal(str(foreign), space.left, "") == []
    (tmp_path / "b.h5").write_bytes(foreign.read_bytes()[:500])
    here = hdf5_walk.refusal(str(tmp_path / "b.h5"), space.left, "")
    assert hdf5._apart(tmp_path / "b.h5", space, "") == here != []


def test_attributes_are_statements_and_groups_are_read(tmp_path):
    rng = np.random.default_rng(2)
    acc, force = rng.standard_normal((400, 2)), rng.standard_normal(400)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["sampling_rate"], file.attrs["operator"] = 512.0, "M. K."
        group = file.create_group("measurement")
        group.create_dataset("acc", data=acc).attrs["units"] = "m/s^2"
        group.create_dataset("force", data=force).attrs["units"] = "kN"
        group["acc"].attrs["notes"] = np.zeros(6000)  # too large to be a statement, and not looked at
    record = mio.read(tmp_path / "a.h5")
    np.testing.assert_array_equal(record.outputs, acc)
    np.testing.assert_array_equal(record.inputs[:, 0], force)
    assert (record.sampling_rate, record.units) == (512.0, (("m/s^2", "m/s^2"), ("kN",)))


def test_of_several_experiments_one_is_asked_for(tmp_path):
    rng = np.random.default_rng(3)
    arrays = {name: rng.standard_normal((400, 2)) for name in ("baseline", "damaged")}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, acc in arrays.items():
            group = file.create_group(name)
            group.attrs["fs"] = 512.0
            group["acc"], group["force"] = acc, acc[:, 0]
    message = refused("sheet='baseline' or sheet='damaged'", mio.read, tmp_path / "a.h5").args[0]
    assert not dead_ends(tmp_path / "a.h5", message)
    np.testing.assert_array_equal(mio.read(tmp_path / "a.h5", sheet="damaged").outputs, arrays["damaged"])
    refused("its experiments are baseline, damaged", mio.read, tmp_path / "a.h5", sheet="other")
