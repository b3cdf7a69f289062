"""Binary formats give back every bit, text formats their digits."""

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra import numpy as hnp

import modalscope.io as mio
from modalscope.data import DataError, FrequencyResponse, ImpulseResponse, ModalModel, Signals
from tests.io import samples

FEW = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
#: Within what a universal file's guard takes for numbers in the right byte order.
VALUES = st.floats(-1e9, 1e9, allow_nan=False).map(lambda v: 0.0 if abs(v) < 1e-9 else v)
RATES = st.floats(0.01, 1e6)


#: What has cost a field once: several runs, and one output and one input, whose axes MATLAB drops.
ALSO = {
    "three runs": lambda: samples.records(runs=3),
    "one channel": lambda: samples.frequency_response().select(outputs=[0], inputs=[0]),
}
EVERY = {**samples.EVERY, **ALSO}


@pytest.mark.parametrize(
    ("suffix", "kind"),
    [
        *((suffix, kind) for suffix in (".npz", ".h5", ".hdf5", ".mat") for kind in EVERY),
        *((".uff", kind) for kind in ("frequency response", "impulse response", "records", "geometry")),
    ],
)
def test_named_arrays_and_binary_universal_files_keep_every_field(tmp_path, suffix, kind):
    thing = EVERY[kind]()
    mio.write(tmp_path / f"a{suffix}", thing)
    assert samples.differences(thing, mio.read(tmp_path / f"a{suffix}")) == []


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat"])
@pytest.mark.parametrize("groups", [("a", "a", "b", "c"), None, "auto"])
def test_groups_come_back_given_none_or_by_default(tmp_path, suffix, groups):
    frf = FrequencyResponse(values=np.full((3, 1, 4), 1j), frequencies=[1, 2, 3], groups=groups)
    mio.write(tmp_path / f"a{suffix}", frf)
    assert mio.read(tmp_path / f"a{suffix}").groups == frf.groups


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat", ".uff", ".csv"])
@pytest.mark.parametrize("kind", ["frequency response", "records"])
def test_data_remember_the_file_that_they_came_from(tmp_path, suffix, kind):
    path = tmp_path / f"a{suffix}"
    mio.write(path, samples.EVERY[kind]())
    data = mio.read(path)
    assert data.source_path == path
    assert data.select(outputs=[0]).processed("cut").source_path == path
    assert samples.EVERY[kind]().source_path is None
    assert mio.survey(path).thing.source_path == path


def test_inputs_that_are_named_while_reading_are_groups_by_their_names(tmp_path):
    mio.write(tmp_path / "a.npz", FrequencyResponse(values=np.full((3, 1, 4), 1j), frequencies=[1, 2, 3]))
    assert mio.read(tmp_path / "a.npz", input_dofs=list("abcd")).groups == tuple("abcd")
    assert mio.read(tmp_path / "a.npz", groups=[1, 1, 2, 2]).groups == ("1", "1", "2", "2")


@pytest.mark.slow
@FEW
@given(
    values=hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=6), elements=VALUES),
    rate=RATES,
)
@pytest.mark.parametrize("suffix", [".npz", ".h5", ".uff", ".mat", ".csv"])
def test_records_come_back_exactly(tmp_path, suffix, values, rate):
    record = Signals(outputs=values, sampling_rate=rate)
    mio.write(tmp_path / f"a{suffix}", record)
    back = mio.read(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(back.outputs, values)
    # a universal file keeps the ends of the time axis; the rate follows from them by one division
    assert back.sampling_rate == pytest.approx(rate, rel=4 * np.finfo(float).eps)


@pytest.mark.slow
@FEW
@given(
    parts=hnp.arrays(
        np.float64, st.tuples(st.integers(2, 6), st.integers(1, 3), st.integers(1, 2), st.just(2)), elements=VALUES
    ),
    steps=hnp.arrays(np.float64, 6, elements=st.floats(1e-3, 1e3)),
)
@pytest.mark.parametrize("suffix", [".npz", ".h5", ".uff", ".mat", ".csv"])
def test_uneven_frequency_responses_come_back_exactly(tmp_path, suffix, parts, steps):
    values = parts[..., 0] + 1j * parts[..., 1]
    if not values.imag.any():
        return  # magnitudes are refused
    f = np.cumsum(steps)[: len(values)]
    frf = FrequencyResponse(values=values, frequencies=f)
    mio.write(tmp_path / f"a{suffix}", frf)
    back = mio.read(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(back.values, values)
    # an axis that is even to rounding is written as such and comes back as its straight line: some units in the last place
    np.testing.assert_allclose(back.frequencies, f, rtol=16 * np.finfo(float).eps)


@pytest.mark.parametrize(
    ("suffix", "digits"), [(".json", 14), (".npz", 14), (".h5", 14), (".mat", 14), (".csv", 12), (".uff", 4)]
)
def test_intervals_and_deviations_of_shapes_come_back_from_every_format(tmp_path, suffix, digits):
    modes = dataclasses.replace(
        samples.modes(),
        damping_ratios_std=np.array([1e-4, 2e-3]),
        frequencies_repeatability=np.array([0.3, 0.1]),
        damping_ratios_repeatability=np.array([2e-4, 1e-3]),
        shapes_std=None if suffix == ".csv" else samples.modes().shapes_std,
    )
    mio.write(tmp_path / f"a{suffix}", modes)
    back = mio.read(tmp_path / f"a{suffix}")
    assert back.damping_ratios_lower[1] == pytest.approx(1e-4)
    for name, ends in modes.interval().items():
        np.testing.assert_allclose(back.interval()[name], ends, rtol=10.0**-digits)
    if suffix != ".csv":
        np.testing.assert_allclose(back.shapes_std, modes.shapes_std, rtol=1e-5)


@pytest.mark.parametrize("suffix", [".csv", ".uff"])
def test_modes_without_deviations_come_back_without(tmp_path, suffix):
    modes = samples.unrefined()
    mio.write(tmp_path / f"a{suffix}", modes)
    back = mio.read(tmp_path / f"a{suffix}")
    assert (back.frequencies_std, back.degrees, back.damping_ratios_lower, back.shapes_std) == (None,) * 4
    np.testing.assert_allclose(back.poles, modes.poles, rtol=1e-5)
    np.testing.assert_allclose(np.abs(back.shapes), np.abs(modes.shapes), rtol=1e-5)


def test_text_sets_keep_their_twelve_digits(tmp_path):
    frf = samples.frequency_response()
    mio.write(tmp_path / "a.uff", frf, text=True)
    back = mio.read(tmp_path / "a.uff")
    # E20.11: twelve significant digits, so half a unit in the twelfth
    np.testing.assert_allclose(back.values.view(float), frf.values.view(float), rtol=5e-12)
    assert (back.output_dofs, back.input_dofs, back.quantity, back.units) == (
        frf.output_dofs,
        frf.input_dofs,
        frf.quantity,
        frf.units,
    )


@pytest.mark.parametrize("text", [False, True])
def test_uneven_text_keeps_six_digits_of_the_abscissa(tmp_path, text):
    f = np.array([1.0, 2.5, 7.123456789, 11.0])
    frf = FrequencyResponse(values=samples.frequency_response(lines=4).values, frequencies=f)
    mio.write(tmp_path / "a.uff", frf, text=text)
    # the standard's E13.5 has six significant digits
    np.testing.assert_allclose(mio.read(tmp_path / "a.uff").frequencies, f, rtol=5e-6 if text else 0)


def test_an_even_axis_is_not_spoilt_by_its_thirteen_columns(tmp_path):
    f = np.linspace(1.0002000123, 10001.0002000123, 9999)
    frf = FrequencyResponse(values=(np.random.default_rng(1).normal(size=(9999, 1, 2)).view(complex)), frequencies=f)
    mio.write(tmp_path / "a.uff", frf)
    np.testing.assert_array_equal(mio.read(tmp_path / "a.uff").frequencies, f)


@pytest.mark.parametrize("dataset", [55, 2414])
def test_complex_shapes_survive_in_a_universal_file(tmp_path, dataset):
    modes = samples.modes(count=4)
    mio.write(tmp_path / "a.uff", modes, dataset=dataset)
    back = mio.read(tmp_path / "a.uff")
    assert isinstance(back, ModalModel)
    assert back.output_dofs == ("1:+Z", "2:+Z", "12:+X")
    turned = modes.shapes * np.array([[1], [1], [-1]])  # 12:-X is told along +X
    # six significant digits of each part: E13.5
    np.testing.assert_allclose(back.shapes.view(float), turned.view(float), rtol=5e-6)
    np.testing.assert_allclose(back.poles.imag, modes.poles.imag, rtol=5e-6)
    np.testing.assert_allclose(back.poles.real, modes.poles.real, rtol=5e-6)
    assert back.quantity == "acceleration"
    assert back.geometry is not None
    assert back.geometry.nodes == modes.geometry.nodes


@pytest.mark.parametrize("dataset", [55, 2414])
def test_real_shapes_are_normal_modes_with_frequency_and_damping(tmp_path, dataset):
    full = samples.modes()
    modes = ModalModel(poles=full.poles, shapes=full.shapes.real, output_dofs=full.output_dofs)
    mio.write(tmp_path / "a.uff", modes, dataset=dataset)
    back = mio.read(tmp_path / "a.uff")
    np.testing.assert_allclose(back.frequencies, modes.frequencies, rtol=5e-6)
    np.testing.assert_allclose(back.damping_ratios, modes.damping_ratios, rtol=1e-5)
    assert not back.shapes.imag.any()


def test_modes_json_keeps_every_field(tmp_path):
    modes = samples.modes()
    mio.write(
        tmp_path / "modes.json", modes, method="era", domain="time", orders=range(2, 9, 2), data={"file": "test.uff"}
    )
    assert samples.differences(modes, mio.read(tmp_path / "modes.json")) == []
    assert "method era" in str(mio.survey(tmp_path / "modes.json"))


@pytest.mark.parametrize("kind", ["dirac", "free decay", "correlation", "pulse"])
def test_impulse_responses_keep_kind_and_start_in_a_universal_file(tmp_path, kind):
    late = ImpulseResponse(
        values=samples.impulse_response().values,
        sampling_rate=100.0,
        kind=kind,
        first_sample=3,
        output_dofs=samples.OUTPUTS,
    )
    mio.write(tmp_path / "a.uff", late)
    back = mio.read(tmp_path / "a.uff")
    assert (back.kind, back.first_sample) == (kind, 3)
    np.testing.assert_array_equal(back.values, late.values)


def test_lag_zero_of_a_correlation_stays_apart(tmp_path):
    irf = samples.impulse_response()
    correlation = ImpulseResponse(
        values=irf.values,
        feedthrough=irf.feedthrough,
        sampling_rate=64.0,
        kind="correlation",
        output_dofs=samples.OUTPUTS,
    )
    mio.write(tmp_path / "a.uff", correlation)
    back = mio.read(tmp_path / "a.uff")
    np.testing.assert_array_equal(back.feedthrough, irf.feedthrough)
    np.testing.assert_array_equal(back.values, irf.values)


def test_what_a_format_cannot_hold_is_refused(tmp_path):
    irf = samples.impulse_response()
    odd = ImpulseResponse(values=irf.values, feedthrough=irf.feedthrough, sampling_rate=1.0, kind="dirac")
    for path, thing in (
        ("a.uff", odd),
        ("a.csv", irf),
        ("a.csv", samples.records(runs=2)),
        ("a.json", irf),
        ("a.csv", samples.geometry()),
    ):
        with pytest.raises(DataError, match=r"\.npz|\.h5"):
            mio.write(tmp_path / path, thing)
    assert list(tmp_path.iterdir()) == []


def test_the_same_data_give_the_same_universal_file(tmp_path):
    for name in ("a.uff", "b.uff"):
        mio.write(tmp_path / name, samples.frequency_response())
    assert (tmp_path / "a.uff").read_bytes() == (tmp_path / "b.uff").read_bytes()


def test_scipy_and_h5py_read_what_is_written(tmp_path):
    h5py, sio = pytest.importorskip("h5py"), pytest.importorskip("scipy.io")
    frf = samples.frequency_response()
    mio.write(tmp_path / "a.h5", frf)
    mio.write(tmp_path / "a.mat", frf)
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(file["values_real"][()] + 1j * file["values_imag"][()], frf.values)
        assert [axis[0].name for axis in file["values_real"].dims] == ["/frequencies", "/output", "/input"]
        assert [label.decode() for label in file["output_dofs"][()]] == list(frf.output_dofs)
    variables = sio.loadmat(tmp_path / "a.mat")
    np.testing.assert_array_equal(variables["values"], frf.values)
    np.testing.assert_array_equal(variables["frequencies"].ravel(), frf.frequencies)


def test_matlab_7_3_files_are_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    frf = samples.frequency_response()
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        pair = np.dtype([("real", "f8"), ("imag", "f8")])
        stored = np.empty(frf.values.T.shape, dtype=pair)
        stored["real"], stored["imag"] = frf.values.T.real, frf.values.T.imag
        group = file.create_group("test")
        group.create_dataset("H", data=stored).attrs["MATLAB_class"] = np.bytes_("double")
        group.create_dataset("f", data=frf.frequencies[:, None]).attrs["MATLAB_class"] = np.bytes_("double")
        text = np.array([[ord(c)] for c in "velocity"], dtype=np.uint16)
        file.create_dataset("quantity", data=text).attrs["MATLAB_class"] = np.bytes_("char")
    with (tmp_path / "a.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    back = mio.read(tmp_path / "a.mat", rename={"test.H": "values", "test.f": "frequencies"})
    np.testing.assert_array_equal(back.values, frf.values)
    np.testing.assert_array_equal(back.frequencies, frf.frequencies)
    assert back.quantity == "velocity"
