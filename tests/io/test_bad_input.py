"""Bad files and places are answered by a DataError of three parts, and leave nothing behind."""

import io
import zipfile

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.io import atomic
from modalscope.model import DataError, Signals
from tests.io import samples


def refused(text, call, *arguments, **options):
    with pytest.raises(DataError, match=text) as error:
        call(*arguments, **options)
    assert all((error.value.asked, error.value.found, error.value.change))
    return error.value


def test_a_missing_file_a_folder_and_an_empty_file(tmp_path):
    refused("there is no such file", mio.read, tmp_path / "none.uff")
    (tmp_path / "folder.npz").mkdir()
    refused("that is a folder", mio.read, tmp_path / "folder.npz")
    for suffix in mio.FORMATS:
        (tmp_path / f"empty{suffix}").touch()
        refused("the file is empty", mio.read, tmp_path / f"empty{suffix}")


def test_unknown_suffixes_name_the_known_ones(tmp_path):
    refused(r"the suffix '.xyz' is unknown(.|\n)*\.npz, \.uff", mio.read, tmp_path / "a.xyz")
    refused("it has no suffix", mio.write, tmp_path / "a", samples.records())


def test_unknown_options_name_the_known_ones(tmp_path):
    mio.write(tmp_path / "a.uff", samples.records())
    refused("with colour was asked(.|\n)*want, repeated", mio.read, tmp_path / "a.uff", colour=1)
    refused("with rename was asked", mio.read, tmp_path / "a.uff", rename={"y": "outputs"})
    refused("with binary was asked(.|\n)*text, dataset", mio.write, tmp_path / "b.uff", samples.records(), binary=1)
    refused("dataset='56' was asked", mio.write, tmp_path / "b.uff", samples.modes(), dataset=56)
    refused("want='time' was asked", mio.read, tmp_path / "a.uff", want="time")
    refused("kind were asked(.|\n)*no such field", mio.read, tmp_path / "a.uff", kind="dirac")


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
    refused("was asked|needs", mio.read, tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat", ".json", ".csv"])
def test_truncations_and_flips_raise_nothing_but_data_errors(tmp_path, suffix):
    path, rng = tmp_path / f"a{suffix}", np.random.default_rng(7)
    mio.write(path, samples.modes() if suffix == ".json" else samples.records())
    data = path.read_bytes()
    cuts = [data[:k] for k in rng.integers(1, len(data), 60)]
    for place, change in zip(rng.integers(0, len(data), 60), rng.integers(1, 256, 60), strict=True):
        cuts += [data[:place] + bytes([data[place] ^ int(change)]) + data[place + 1 :]]
    for changed in cuts:
        path.write_bytes(changed)
        try:
            mio.read(path)
        except DataError as error:
            assert error.change  # noqa: PT017 - any other exception fails the test by itself


def test_a_pickle_in_an_archive_is_never_loaded(tmp_path):
    np.savez(tmp_path / "a.npz", outputs=np.array([{"a": 1}], dtype=object), sampling_rate=1.0)
    refused("pickled objects", mio.read, tmp_path / "a.npz")
    np.save(tmp_path / "b.npy", np.zeros(3))
    (tmp_path / "b.npy").rename(tmp_path / "b.npz")
    refused("it is not one", mio.read, tmp_path / "b.npz")
    with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive:
        archive.writestr("notes.txt", "text")
    refused("not an array|damaged|unknown", mio.read, tmp_path / "c.npz")


def test_unknown_arrays_are_named_with_the_way_out(tmp_path):
    np.savez(tmp_path / "a.npz", y=np.zeros((4, 2)), fs=10.0)
    error = refused("the arrays y, fs are unknown", mio.read, tmp_path / "a.npz")
    assert "rename={'y': 'outputs', 'fs': 'sampling_rate'}" in error.change
    np.savez(tmp_path / "b.npz", outputs=np.ones((4, 2)), sampling_rate=10.0, notes="x")
    refused("the arrays notes are unknown beside those of Signals", mio.read, tmp_path / "b.npz")
    assert mio.read(tmp_path / "b.npz", ignore="notes").samples == 4
    np.savez(tmp_path / "c.npz", outputs=np.ones((4, 2)))
    refused("sampling_rate are missing", mio.read, tmp_path / "c.npz")
    assert mio.read(tmp_path / "c.npz", sampling_rate=5.0).sampling_rate == 5.0
    refused("rename or ignore of z", mio.read, tmp_path / "c.npz", rename={"z": "inputs"})


def test_arrays_of_the_wrong_sort_are_named(tmp_path):
    path = tmp_path / "a.npz"
    for arrays, text in (
        ({"outputs": np.array(["a", "b"])}, "outputs in a.npz needs numbers"),
        ({"outputs": np.ones((4, 1)), "output_dofs": np.array([1.0])}, "output_dofs in a.npz needs text"),
        ({"outputs": np.ones((4, 1)), "sampling_rate": np.array([1.0, 2.0])}, "sampling_rate in a.npz needs one entry"),
        ({"outputs": np.array([[1.0], [np.nan]])}, "outputs needs finite numbers"),
        ({"outputs": np.ones((4, 1)), "geometry_nodes": np.array(["1"])}, "geometry_nodes and geometry_coordinates"),
        ({"outputs": np.ones((4, 2)), "output_dofs": np.array(["a", "a"])}, "different labels"),
    ):
        np.savez(path, **({"sampling_rate": 10.0} | arrays))
        refused(text, mio.read, path)
    np.savez(path, frequencies=[1.0, 2.0], values=np.ones((2, 1, 1)))
    refused("magnitudes", mio.read, path)


def test_axes_put_arrays_in_order(tmp_path):
    path, rng = tmp_path / "a.npz", np.random.default_rng(0)
    H = rng.normal(size=(2, 3, 5)) + 1j * rng.normal(size=(2, 3, 5))
    np.savez(path, freq=np.arange(1.0, 6), H=H)
    options = {"rename": {"freq": "frequencies", "H": "values"}}
    frf = mio.read(path, **options, axes={"values": "inputs outputs lines"})
    np.testing.assert_array_equal(frf.values, H.transpose(2, 1, 0))
    refused("transpose", mio.read, path, **options)
    refused("its axes may be lines, outputs, inputs", mio.read, path, **options, axes={"values": "inputs outputs"})
    refused("its axes may be lines, outputs, inputs", mio.read, path, **options, axes={"values": "inputs outputs runs"})
    hits = rng.normal(size=(5, 20))
    np.savez(path, acc=hits, force=hits, fs=10.0)
    options = {
        "rename": {"acc": "outputs", "force": "inputs", "fs": "sampling_rate"},
        "axes": {"outputs": "runs samples", "inputs": "runs samples"},
    }
    record = mio.read(path, **options, quantity="acceleration", units=("m/s2", "N"))
    assert (record.runs, record.samples, record.outputs.shape) == (5, 20, (5, 20, 1))
    assert (record.quantity, record.units) == ("acceleration", (("m/s2",), ("N",)))
    np.testing.assert_array_equal(record.outputs[:, :, 0], hits)


def test_a_failed_write_keeps_the_earlier_file(tmp_path, monkeypatch):
    target = tmp_path / "a.npz"
    mio.write(target, samples.records())
    before = target.read_bytes()

    def broken(file, **arrays):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", broken)
    refused("no space left", mio.write, target, samples.records())
    assert target.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_an_interrupted_write_leaves_nothing(tmp_path):
    def interrupted():
        with atomic.replacing(tmp_path / "a.csv") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_places_that_cannot_be_written(tmp_path):
    refused("no such file or directory", mio.write, tmp_path / "none" / "a.npz", samples.records())
    (tmp_path / "a.npz").mkdir()
    refused("that is a folder", mio.write, tmp_path / "a.npz", samples.records())
    (tmp_path / "file").touch()
    refused("the system refuses", mio.write, tmp_path / "file" / "a.npz", samples.records())


def test_new_files_have_ordinary_rights(tmp_path):
    (tmp_path / "plain").touch()
    mio.write(tmp_path / "a.npz", samples.records())
    assert (tmp_path / "a.npz").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,out y1\n0,1\n", "there is one sample"),
        ("time_s,out y1\n0,1\n1,x\n", r"row 2 under the header is \['1', 'x'\]"),
        ("time_s,out y1\n0,1\n1\n", "needs 2 numbers in every row"),
        ("time_s,out y1\n0,1\n1,nan\n2,3\n", "outputs needs finite numbers"),
        ("time_s,out y1\n0,1\n1,1\n5,1\n", "evenly sampled"),
        ("when,out y1\n0,1\n1,1\n", "its first column is 'when'"),
        ("frequency_hz,real a / b\n1,1\n", "missing: imag a / b"),
        ("frequency_hz,something\n1,1\n", "there is 'something'"),
        ("mode,frequency_hz,damping_ratio,kind\n1,2,3,mode\n", "table of modes, which is only written"),
        ("# sampling_rate: fast\ntime_s,out y1\n0,1\n1,1\n", "sampling_rate in a.csv needs a number"),
    ],
)
def test_csv_tables_that_do_not_read(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    refused(message, mio.read, tmp_path / "a.csv")


def test_csv_reads_what_people_write(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s;out 3:+Z [m/s2];in hammer [N]\n0;1;2\n0.1;2;3\n0.2;3;4\n")
    record = mio.read(path, quantity="acceleration")
    assert isinstance(record, Signals)
    assert (record.sampling_rate, record.units, record.input_dofs) == (
        pytest.approx(10),
        (("m/s2",), ("N",)),
        ("hammer",),
    )
    path.write_text("# quantity: velocity\nfrequency_hz,real a / b [m/s / N],imag a / b\n1,1,2\n2,3,4\n")
    assert mio.read(path).quantity == "velocity"
    path.write_text("time_s,1:+Z / 2:+Z\n0,1\n1,2\n2,3\n")
    assert mio.read(path).kind == "dirac"


def test_a_table_of_modes_has_its_numbers_and_shapes(tmp_path):
    import csv

    modes = samples.modes()
    mio.write(tmp_path / "modes.csv", modes)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "modes.csv").read_text())))
    assert [float(row["frequency_hz"]) for row in rows] == modes.frequencies.tolist()
    assert [float(row["imag 12:-X"]) for row in rows] == modes.shapes[2].imag.tolist()
    assert [float(row["emac"]) for row in rows] == modes.indicators["emac"].tolist()


def test_modes_json_without_poles_is_read_by_frequency_and_damping(tmp_path):
    path = tmp_path / "modes.json"
    path.write_text(
        '{"modalscope": "0.1", "data": {}, "method": "era", "domain": "time", "orders": null, '
        '"modes": [{"frequency_hz": 2.0, "damping_ratio": 0.01,'
        ' "frequency_spread_hz": null, "shape": {"dof": ["1:+Z", "2:+Z"], "real": [1, -1], "imag": [0, 0]}}]}'
    )
    modes = mio.read(path)
    assert modes.frequencies == pytest.approx([2.0])
    assert modes.damping_ratios == pytest.approx([0.01])
    assert (modes.output_dofs, modes.frequencies_spread, modes.participation) == (("1:+Z", "2:+Z"), None, None)
    whole = path.read_text()
    for name in ("real", "frequency_hz", "modes"):
        path.write_text(whole.replace(f'"{name}"', f'"no {name}"'))
        refused("was asked|needs", mio.read, path)


def test_matlab_structures_are_dotted_and_foreign_classes_named(tmp_path):
    import scipy.io as sio
    import scipy.sparse as sparse

    path, frf = tmp_path / "a.mat", samples.frequency_response()
    for compressed in (False, True):
        test = {"H": frf.values, "f": frf.frequencies, "dofs": np.array(frf.output_dofs, dtype=object)}
        sio.savemat(path, {"test": test, "stiffness": sparse.eye_array(3)}, do_compression=compressed)
        rename = {"test.H": "values", "test.f": "frequencies", "test.dofs": "output_dofs"}
        refused("class sparse", mio.read, path, rename=rename)
        back = mio.read(path, rename=rename, ignore=["stiffness"])
        np.testing.assert_array_equal(back.values, frf.values)
        assert back.output_dofs == frf.output_dofs


def test_matlab_drops_trailing_axes_and_they_come_back(tmp_path):
    import scipy.io as sio

    sio.savemat(
        tmp_path / "a.mat",
        {"frequencies": np.arange(1.0, 5), "values": np.arange(8.0).reshape(4, 2) * (1 - 1j)},
        oned_as="row",
    )
    assert mio.read(tmp_path / "a.mat").values.shape == (4, 2, 1)
