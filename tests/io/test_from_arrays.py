"""Named arrays as data: what is unknown, of the wrong sort or in another order is named with the way out."""

import numpy as np
import pytest
from scipy.io import savemat

import modalscope.io as mio
from benchmarks.exports.verdict import dead_ends, obeyed, suggestions
from modalscope.io.arrays import to_arrays
from tests.io import samples
from tests.support import refused

RNG = np.random.default_rng(4)


def test_unknown_arrays_are_named_with_the_way_out(tmp_path):
    np.savez(tmp_path / "a.npz", y=np.zeros((4, 2)), seed=10.0)
    error = refused("the arrays y, seed are unknown", mio.read, tmp_path / "a.npz")
    assert "rename={'y': 'outputs'}" in error.change
    np.savez(tmp_path / "b.npz", outputs=np.ones((4, 2)), sampling_rate=10.0, notes="x")
    refused("the arrays notes are unknown besides those of Signals", mio.read, tmp_path / "b.npz")
    assert mio.read(tmp_path / "b.npz", ignore="notes").samples == 4
    np.savez(tmp_path / "c.npz", outputs=np.ones((4, 2)))
    refused("sampling_rate are missing", mio.read, tmp_path / "c.npz")
    assert mio.read(tmp_path / "c.npz", sampling_rate=5.0).sampling_rate == 5.0
    refused("rename or ignore of z", mio.read, tmp_path / "c.npz", rename={"z": "inputs"})


@pytest.mark.parametrize(
    "arrays",
    [
        {"frequencies": np.array([1.2, 3.4, 5.6]), "damping": np.full(3, 0.01), "phi": np.ones((8, 3)) + 0j},
        {"fn": np.array([1.2, 3.4, 5.6]), "Zeta": np.full(3, 0.01), "Phi": np.ones((8, 3))},
        {"time": np.arange(24.0), "f": np.ones((24, 5)), "zeta_mean": np.ones((24, 5)), "shapes": np.ones((24, 5, 8))},
    ],
)
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5"])
def test_modes_of_other_programs_are_refused_as_what_they_are(tmp_path, arrays, suffix):
    path = tmp_path / f"a{suffix}"
    if suffix == ".h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            for name, array in arrays.items():
                file[name] = array
    else:
        savemat(path, arrays) if suffix == ".mat" else np.savez(path, **arrays)
    refused("it holds modes, by its '(damping|Zeta|zeta_mean)'", mio.read, path)


def test_modes_beside_a_record_are_no_reason_to_refuse_it(tmp_path):
    y = RNG.standard_normal((400, 3))
    np.savez(tmp_path / "a.npz", y=y, fs=20.0, fn=np.array([1.2, 3.4, 5.6]), zeta=np.full(3, 0.01))
    assert mio.read(tmp_path / "a.npz").samples == 400
    np.savez(tmp_path / "b.npz", t=np.arange(400) / 20, y=y, damping=np.full(3, 0.01))
    assert mio.read(tmp_path / "b.npz").sampling_rate == 20.0


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


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"reasons": "[{"}, "reasons in a.npz needs JSON text"),
        ({"notes": "[" * 5000}, "notes in a.npz needs JSON text"),
        ({"reasons": '{"a": 1}'}, "reasons"),
        ({"left_out": "[3]"}, "left_out"),
        ({"harmonics": '[{"frequency": "high"}]'}, "frequency needs a finite number"),
        ({"geometry_lines": np.array([[0, 9]])}, "geometry_lines needs indices 0 to 3 into the nodes"),
        ({"geometry_motions": "[[[]]]"}, "motions of a geometry: expected a mapping"),
        ({"geometry_motions": '{"a": [3]}'}, "they are none"),
        ({"output_dofs": np.array(["x" * 1001, "b", "c"])}, "output_dofs in a.npz needs labels"),
    ],
)
def test_damaged_texts_and_indices_are_named(tmp_path, changed, said):
    whole = to_arrays(samples.EVERY["modes"]())
    np.savez(tmp_path / "a.npz", **{**whole, **changed})
    refused(said, mio.read, tmp_path / "a.npz")


def test_options_that_the_data_do_not_have_are_named(tmp_path):
    mio.write(tmp_path / "a.npz", samples.EVERY["modes"]())
    refused("averages", mio.read, tmp_path / "a.npz", averages=3)


def test_labels_of_bytes_are_text(tmp_path):
    np.savez(tmp_path / "a.npz", outputs=np.ones((4, 2)), sampling_rate=1.0, output_dofs=np.array([b"1:+X", b"2:+X"]))
    assert mio.read(tmp_path / "a.npz").output_dofs == ("1:+X", "2:+X")


def _saved(path, **arrays):
    np.savez(path / "test.npz", **arrays)
    return path / "test.npz"


@pytest.mark.parametrize(("samples", "asked"), [(37, True), (39, True), (40, False)])
def test_channels_in_rows_are_asked_for_where_there_are_not_twenty_times_as_many_samples(tmp_path, samples, asked):
    path = _saved(tmp_path, acc=RNG.standard_normal((2, samples)), fs=100.0)
    if asked:
        refused("transpose=True", mio.read, path)
    assert mio.read(path, **({"transpose": True} if asked else {})).outputs.shape == (samples, 2)


def test_arrays_of_settings_and_results_beside_a_record_are_left_with_a_note(tmp_path):
    path = _saved(tmp_path, y=RNG.standard_normal((900, 3)), fs=10.0, phi=np.ones((6, 80)), zeta=np.ones(30))
    survey = mio.survey(path)
    assert survey.thing.outputs.shape == (900, 3)
    assert "phi, zeta ignored: no axis has 900 samples" in survey.notes
    refused(r"ignore=\['z'\]", mio.read, _saved(tmp_path, y=np.ones((900, 3)), fs=10.0, z=np.ones(800)))


def test_columns_of_forces_that_are_short_are_hits(tmp_path):
    force = np.zeros((400, 3))
    force[20:23] = RNG.uniform(1, 2, (3, 3))
    acc = RNG.standard_normal((400, 3))
    record = mio.read(_saved(tmp_path, force=force.T, acc=acc.T, fs=1000.0))
    assert (record.runs, record.outputs.shape) == (3, (3, 400, 1))
    assert np.array_equal(record.inputs[:, :, 0], force.T)
    refused("axes={'inputs': 'samples runs'}", mio.read, _saved(tmp_path, force=acc, acc=acc, fs=1000.0))


@pytest.mark.parametrize("shape", [(3, 400, 5), (400, 5, 3)])
def test_axes_are_named_in_the_order_in_which_they_are_stored(tmp_path, shape):
    path = _saved(tmp_path, y=RNG.standard_normal(shape), fs=1000.0)
    message = refused("whether an axis counts channels or hits", mio.read, path).args[0]
    assert not dead_ends(path, message)
    (way,) = suggestions(message)
    assert obeyed(path, way).thing.outputs.shape == (3, 400, 5)


def _of_an_analyser(**changed):
    """Arrays as an analyser exports them to MATLAB: the last record beside averaged spectra and one response."""
    line, time = np.ones(65), np.arange(160) / 128.0
    response = RNG.standard_normal((65, 1)) + 1j * RNG.standard_normal((65, 1))
    arrays = {"Time_domain": time, "Time_chan_1": RNG.standard_normal(160), "Time_chan_2": RNG.standard_normal(160)}
    arrays |= {
        "Freq_domain": np.arange(65.0),
        "PSD_chan_1": line,
        "PSD_DeltaF": 1.0,
        "Auto_Correlation_1": np.ones(129),
    }
    arrays |= {"Hf_chan_2": response, "Hf_Cross_Spec_chan_2": response, "Hf_coh_chan_2": 0.9 * line}
    return arrays | changed


def test_of_records_and_responses_in_one_file_the_responses_are_read_and_the_records_offered(tmp_path):
    arrays = _of_an_analyser()
    path = _saved(tmp_path, **arrays)
    survey = mio.survey(path)
    np.testing.assert_array_equal(survey.thing.values[:, :, 0], arrays["Hf_chan_2"])
    np.testing.assert_allclose(survey.thing.coherence, 0.9)
    (note,) = [note for note in survey.notes if "else" in note]
    assert "(else: --ignore Freq_domain)" in note
    record = mio.read(path, ignore=["Freq_domain"])
    np.testing.assert_array_equal(record.outputs, np.stack([arrays["Time_chan_1"], arrays["Time_chan_2"]], axis=1))


@pytest.mark.parametrize(("top", "taken"), [(1 + 5e-7, True), (1 + 2e-6, False)])
def test_a_coherence_beyond_one_is_left_with_a_note(tmp_path, top, taken):
    survey = mio.survey(_saved(tmp_path, **_of_an_analyser(Hf_coh_chan_2=np.linspace(0.5, top, 65))))
    assert (survey.thing.coherence is not None) is taken
    assert any("values outside 0..1, no coherence" in note for note in survey.notes) is not taken


def test_one_array_asks_for_its_rate_and_a_row_is_a_channel(tmp_path):
    y = np.random.default_rng(0).standard_normal((1, 300))
    savemat(tmp_path / "origin.mat", {"origin": y})
    said = refused("sampling_rate=HZ", mio.read, tmp_path / "origin.mat")
    assert ["--sampling-rate", "HZ"] in suggestions(said.args[0])
    for options in ({}, {"rename": {"origin": "outputs"}}):
        record = mio.read(tmp_path / "origin.mat", sampling_rate=50.0, **options)
        assert np.array_equal(record.outputs, y.T)
