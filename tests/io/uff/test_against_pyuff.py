"""The second route: pyuff reads what is written here, and what pyuff writes is read here."""

import struct
from dataclasses import replace

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.data import FrequencyResponse, ModalModel
from tests.io import samples

pyuff = pytest.importorskip("pyuff")


def sets_of(path):
    return pyuff.UFF(str(path))


def by_type(path, dataset):
    file = sets_of(path)
    return [file.read_sets(k) for k, number in enumerate(file.get_set_types()) if number == dataset]


@pytest.mark.parametrize("text", [False, True])
def test_pyuff_reads_our_functions(tmp_path, text):
    frf = samples.frequency_response()
    mio.write(tmp_path / "a.uff", frf, text=text)
    functions = [s for s in by_type(tmp_path / "a.uff", 58) if s["func_type"] == 4]
    assert len(functions) == frf.values[0].size
    for s in functions:
        i = [label.split(":")[0] for label in frf.output_dofs].index(str(s["rsp_node"]))
        j = 0 if s["ref_node"] == 1 else 1
        assert s["binary"] == (not text)
        # pyuff takes the even abscissa from its 13 columns
        np.testing.assert_allclose(s["x"], frf.frequencies, rtol=1e-9)
        np.testing.assert_allclose(s["data"], frf.values[:, i, j], rtol=5e-12 if text else 0)
        assert (s["ordinate_spec_data_type"], s["ordinate_axis_units_lab"], s["orddenom_axis_units_lab"]) == (
            12,
            "m/s2",
            "N",
        )


def test_pyuff_reads_our_records_geometry_and_units(tmp_path):
    record, geometry = samples.records(), samples.geometry()
    mio.write(tmp_path / "a.uff", record)
    channels = by_type(tmp_path / "a.uff", 58)
    np.testing.assert_array_equal(
        np.column_stack([s["data"] for s in channels]), np.hstack([record.outputs, record.inputs])
    )
    assert by_type(tmp_path / "a.uff", 164)[0]["length"] == 1.0
    mio.write(tmp_path / "g.uff", geometry)
    nodes = by_type(tmp_path / "g.uff", 2411)[0]
    np.testing.assert_array_equal(np.column_stack([nodes[axis] for axis in "xyz"]), geometry.coordinates)
    assert by_type(tmp_path / "g.uff", 82)[0]["nodes"].tolist() == [1, 2, 0, 2, 12]
    assert by_type(tmp_path / "g.uff", 2412)[0]["quad"]["nodes_nums"] == [[1, 2, 12, 20]]
    mio.write(tmp_path / "h.uff", geometry, nodes=15, lines=2412)
    old = by_type(tmp_path / "h.uff", 15)[0]
    np.testing.assert_allclose(np.column_stack([old[axis] for axis in "xyz"]), geometry.coordinates, rtol=5e-6)
    assert [rod["nodes_nums"] for rod in by_type(tmp_path / "h.uff", 2412)[0][11]] == [[1, 2], [2, 12]]


def test_pyuff_reads_our_modes(tmp_path):
    modes = samples.modes()
    mio.write(tmp_path / "a.uff", modes, dataset=55)
    sets = by_type(tmp_path / "a.uff", 55)
    assert [s["analysis_type"] for s in sets] == [3, 3, 0, 0]  # the deviations of shapes are no modes
    for s, pole, shape in zip(sets[:2], modes.poles, modes.shapes.T, strict=True):
        assert s["eig"] == pytest.approx(pole, rel=1e-5)
        # 1:+Z and 2:+Z are z of nodes 1 and 2; 12:-X is x of node 12, turned
        np.testing.assert_allclose([s["r3"][0], s["r3"][1], -s["r1"][2]], shape, rtol=1e-5)
    mio.write(tmp_path / "b.uff", modes, dataset=2414)
    for s, shape in zip(by_type(tmp_path / "b.uff", 2414)[:2], modes.shapes.T, strict=True):
        assert (s["dataset_location"], s["analysis_type"], list(s["node_nums"])) == (1, 3, [1, 2, 12])
        np.testing.assert_allclose(s["data_at_node"][0][4:6], [shape[0].real, shape[0].imag], rtol=1e-5)


def test_modes_carry_their_deviations_as_text(tmp_path):
    modes = replace(
        samples.modes(),
        frequencies_std=np.full(len(samples.modes()), 0.0123),
        damping_ratios_std=np.full(len(samples.modes()), 4.56e-4),
    )
    mio.write(tmp_path / "a.uff", replace(modes, shapes_std=None))
    assert (tmp_path / "a.uff").read_text().count("std 0.0123 Hz, 0.000456") == len(modes)
    assert mio.read(tmp_path / "a.uff").frequencies == pytest.approx(modes.frequencies, rel=1e-5)


def test_the_byte_count_of_a_binary_header_is_the_payload(tmp_path):
    mio.write(tmp_path / "a.uff", samples.frequency_response())
    data, checked = (tmp_path / "a.uff").read_bytes(), 0
    start = data.find(b"    58b")
    while start >= 0:
        count = int(data[start + 31 : start + 43])
        payload = start
        for _ in range(12):
            payload = data.index(b"\n", payload) + 1
        assert data[payload + count : payload + count + 7] == b"    -1\n"
        checked, start = checked + 1, data.find(b"    58b", start + 1)
    assert checked == 12  # six responses and their coherences


def pyuff_function(values, x, node, *, binary, even):
    return {
        "type": 58, "binary": binary, "func_type": 4, "rsp_node": node, "rsp_dir": 3, "ref_node": 1, "ref_dir": 3, "data": values, "x": x,
        "abscissa_spacing": even, "abscissa_spec_data_type": 18, "ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13,
    }  # fmt: skip


# pyuff does not close the file when it writes a binary set
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("even", [0, 1])
def test_files_of_pyuff_are_read(tmp_path, binary, even):
    rng, path = np.random.default_rng(3), tmp_path / "a.uff"
    values, x = rng.normal(size=(9, 2)) + 1j * rng.normal(size=(9, 2)), np.arange(9) * 0.5
    writer = pyuff.UFF(str(path))
    for node in (1, 2):
        writer.write_sets(pyuff_function(values[:, node - 1].copy(), x, node, binary=binary, even=even), "add")
    frf = mio.read(path)
    assert (frf.output_dofs, frf.input_dofs, frf.quantity) == (("1:+Z", "2:+Z"), ("1:+Z",), "acceleration")
    np.testing.assert_allclose(frf.values[:, :, 0], values, rtol=0 if binary else 5e-12)
    np.testing.assert_array_equal(frf.frequencies, x)


def test_single_precision_and_big_endian_sets_are_read(tmp_path):
    path, values = tmp_path / "a.uff", np.array([1.5 - 2j, 0.25 + 1j, 3 - 1j], dtype=np.complex64)
    frf = FrequencyResponse(values=values[:, None, None], frequencies=[1, 2, 3])
    mio.write(path, frf)
    data = path.read_bytes()
    payload = np.ascontiguousarray(values, dtype="<c16").tobytes()
    big = struct.pack(">6f", *values.view(np.float32))
    head = f"{58:6d}b{1:6d}{2:6d}{11:12d}{len(payload):12d}".encode()
    new = f"{58:6d}b{2:6d}{2:6d}{11:12d}{len(big):12d}".encode()
    form, single = f"{6:10d}{3:10d}{1:10d}".encode(), f"{5:10d}{3:10d}{1:10d}".encode()
    path.write_bytes(data.replace(head, new).replace(form, single).replace(payload, big))
    np.testing.assert_array_equal(mio.read(path).values[:, 0, 0], values)


def test_the_example_is_the_same_by_both_routes(request):
    path = request.config.rootpath / "examples" / "beam_hammer" / "beam_hammer.uff"
    if not path.exists():
        pytest.skip("the example is not there")
    frf = mio.read(path)
    assert (frf.values.shape, frf.quantity, frf.units[0][0]) == ((9999, 7, 6), "acceleration", "m/s^2")
    for k in (1, 20, 42):
        s = sets_of(path).read_sets(k)
        i, j = frf.output_dofs.index(f"{s['rsp_node']}:+Z"), frf.input_dofs.index(f"{s['ref_node']}:+Z")
        np.testing.assert_array_equal(frf.values[:, i, j], s["data"])
        np.testing.assert_allclose(frf.frequencies, s["x"], rtol=1e-12)


def test_modes_of_pyuff_are_read(tmp_path):
    path = tmp_path / "a.uff"
    common = {"type": 55, "model_type": 1, "data_ch": 2, "spec_data_type": 8, "load_case": 1, "node_nums": [1, 2]}
    shape = np.array([0.5, -0.25])
    normal = {
        "analysis_type": 2,
        "mode_n": 1,
        "freq": 12.5,
        "modal_damp_vis": 0.02,
        "r1": shape * 0,
        "r2": shape * 0,
        "r3": shape,
    }
    cplx = {
        "analysis_type": 3,
        "mode_n": 2,
        "eig": -1 + 100j,
        "r1": shape * 0j,
        "r2": shape * 0j,
        "r3": shape * (1 + 2j),
    }
    pyuff.UFF(str(path)).write_sets([common | normal, common | cplx], "add")
    modes = mio.read(path)
    assert isinstance(modes, ModalModel)
    assert modes.output_dofs == ("1:+Z", "2:+Z")
    assert modes.frequencies[0] == pytest.approx(12.5)
    assert modes.damping_ratios[0] == pytest.approx(0.02)
    assert modes.poles[1] == pytest.approx(-1 + 100j)
    np.testing.assert_allclose(modes.shapes[:, 1], shape * (1 + 2j))
