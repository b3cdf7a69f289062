"""Rules by which the sets of a universal file become one noun, as `survey` tells them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import modalscope.io as mio
from modalscope.data import DataError, FrequencyResponse, Geometry, ImpulseResponse, ModalModel, Signals
from modalscope.io.uff.function import Function, write_function
from tests.io import samples
from tests.support import refused

F = np.arange(1.0, 6.0)
T = np.arange(6) / 100.0


def frf(output, input="1:+Z", x=F, seed=0, **fields):
    rng = np.random.default_rng([seed, *output.encode(), *input.encode()])
    values = rng.normal(size=x.size) + 1j * rng.normal(size=x.size)
    return Function(
        **{
            "kind": 4,
            "output": output,
            "input": input,
            "x": x,
            "values": values,
            "quantity": 12,
            "denominator": 13,
            "abscissa_type": 18,
        }
        | fields
    )


def real(kind, output, input="", x=F, **fields):
    values = np.random.default_rng([kind, *output.encode()]).uniform(0.1, 0.9, x.size)
    return Function(**{"kind": kind, "output": output, "input": input, "x": x, "values": values} | fields)


@pytest.fixture
def file(tmp_path):
    def put(*functions, more=b""):
        path = tmp_path / "test.uff"
        path.write_bytes(more + b"".join(write_function(function) for function in functions))
        return path

    return put


def reasons(path, **options):
    return {finding.what: finding.reason for finding in mio.survey(path, **options).left}


def test_the_matrix_is_sorted_by_node_and_direction(file):
    dofs = ["10:+Z", "2:+Z", "2:-X", "1:+Z"]
    path = file(*(frf(o, i) for i in ("3:+Z", "1:+Z") for o in dofs))
    got = mio.read(path)
    assert got.output_dofs == ("1:+Z", "2:-X", "2:+Z", "10:+Z")
    assert got.input_dofs == ("1:+Z", "3:+Z")
    np.testing.assert_array_equal(got.values[:, 3, 1], frf("10:+Z", "3:+Z").values)


def test_of_an_incomplete_matrix_the_largest_block_is_taken(file):
    pairs = [(o, i) for o in ("1:+Z", "2:+Z", "3:+Z") for i in ("1:+Z", "2:+Z") if (o, i) != ("3:+Z", "2:+Z")]
    path = file(*(frf(o, i) for o, i in pairs))
    survey = mio.survey(path)
    assert mio.read(path).values.shape == (5, 2, 2)
    assert survey.missing == ("1 of 6 pairs of the 3 x 2 matrix: 3:+Z / 2:+Z",)
    assert reasons(path) == {"3:+Z / 1:+Z": "3:+Z / 1:+Z lies outside the largest complete block of outputs and inputs"}
    assert "missing: 1 of 6 pairs" in str(survey)


def test_the_largest_block_is_the_largest_by_trying_all():
    from modalscope.io.uff.matrix import _largest_block

    rng = np.random.default_rng(5)
    for _ in range(30):
        there = rng.uniform(size=(5, 4)) < 0.7
        if not there.any():
            continue
        rows, columns = _largest_block(there)
        assert there[np.ix_(rows, columns)].all()
        subsets = [[b for b in range(4) if mask >> b & 1] for mask in range(1, 16)]
        assert len(rows) * len(columns) == max(int(there[:, s].all(axis=1).sum()) * len(s) for s in subsets)


def test_large_matrices_lose_the_emptiest_rows_first():
    from modalscope.io.uff.matrix import _largest_block

    there = np.ones((20, 15), dtype=bool)
    there[4, 1:] = False
    there[7, 3:9] = False
    rows, columns = _largest_block(there)
    assert columns == list(range(15))
    assert rows == [k for k in range(20) if k not in (4, 7)]


def test_a_pair_measured_twice_is_an_error_until_one_is_chosen(file):
    first, last = frf("1:+Z"), frf("1:+Z", seed=1)
    path = file(first, last, frf("2:+Z"))
    with pytest.raises(DataError, match=r"1:\+Z / 1:\+Z was measured twice: in set 1(.|\n)*set 2(.|\n)*repeated="):
        mio.read(path)
    np.testing.assert_array_equal(mio.read(path, repeated="first").values[:, 0, 0], first.values)
    np.testing.assert_array_equal(mio.read(path, repeated="last").values[:, 0, 0], last.values)
    assert len(mio.survey(path, repeated="last").left) == 1


def test_another_abscissa_is_left_with_its_points(file):
    path = file(frf("1:+Z"), frf("2:+Z"), frf("3:+Z", x=F[:4]))
    assert mio.read(path).output_dofs == ("1:+Z", "2:+Z")
    assert reasons(path) == {"3:+Z / 1:+Z": "another abscissa, 4 points from 1 to 4"}


def test_mixed_quantities_are_not_put_into_one_matrix(file):
    path = file(frf("1:+Z"), frf("2:+Z"), frf("3:+Z", quantity=11))
    assert (mio.read(path).quantity, mio.read(path).output_dofs) == ("acceleration", ("1:+Z", "2:+Z"))
    assert reasons(path) == {"3:+Z / 1:+Z": "velocity where the others are acceleration"}
    chosen = mio.read(path, quantity="velocity")
    assert (chosen.quantity, chosen.output_dofs) == ("velocity", ("3:+Z",))


def test_the_quantity_may_be_given(file):
    path = file(frf("1:+Z", quantity=0))
    assert mio.read(path).quantity is None
    assert any("quantity=" in note for note in mio.survey(path).notes)
    assert mio.read(path, quantity="displacement").quantity == "displacement"


def test_coherence_goes_with_its_responses(file):
    pairs = [("1:+Z", "1:+Z"), ("2:+Z", "1:+Z")]
    ordinary = [real(6, o, i) for o, i in pairs]
    got = mio.read(file(*(frf(o, i) for o, i in pairs), *ordinary))
    np.testing.assert_array_equal(got.coherence[:, :, 0], np.column_stack([c.values for c in ordinary]))
    multiple = [real(26, o) for o, _ in pairs]
    got = mio.read(file(*(frf(o, i) for o, _ in pairs for i in ("1:+Z", "2:+Z")), *multiple))
    np.testing.assert_array_equal(got.coherence, np.column_stack([c.values for c in multiple]))


def test_coherence_that_does_not_fit_is_left(file):
    path = file(frf("1:+Z"), frf("2:+Z"), real(6, "1:+Z", "1:+Z"))
    assert mio.read(path).coherence is None
    assert mio.survey(path).missing == ("coherence of every pair: 1 of 2 are there",)
    path = file(frf("1:+Z"), real(6, "1:+Z", "1:+Z", values=np.full(5, 3.0)))
    assert "between 0 and 1, this from 3 to 3" in str(mio.survey(path))


def test_spectra_and_records_beside_responses_are_left_with_reason(file):
    path = file(frf("1:+Z"), real(2, "1:+Z"), real(1, "1:+Z", x=T))
    left = [finding.reason for finding in mio.survey(path).left]
    assert left == ["no method identifies from such a function", 'want="records" takes it']
    assert isinstance(mio.read(path, want="records"), Signals)


def test_a_file_of_spectra_alone_says_what_it_holds(file):
    with pytest.raises(DataError, match=r"none is one \(set 1 \(dataset 58b\): auto spectrum\)"):
        mio.read(file(real(2, "1:+Z")))


def test_forces_are_inputs_of_a_record(file):
    path = file(real(1, "1:+Z", x=T, quantity=13), real(1, "2:+Z", x=T, quantity=12), real(1, "1:+Z", x=T, quantity=8))
    record = mio.read(path)
    assert (record.output_dofs, record.input_dofs) == (("1:+Z", "2:+Z"), ("1:+Z",))
    assert record.quantities == ("displacement", "acceleration")
    assert record.sampling_rate == pytest.approx(100.0)


def test_channels_that_come_again_are_runs(file):
    functions = [
        real(1, o, x=T, values=np.arange(6.0) + 10 * run, quantity=q)
        for run in range(3)
        for o, q in (("1:+Z", 12), ("2:+Z", 13))
    ]
    record = mio.read(file(*functions))
    assert record.outputs.shape == (3, 6, 1)
    assert record.inputs[2, 0, 0] == 20
    with pytest.raises(DataError, match="every channel equally often"):
        mio.read(file(*functions[:-1]))


def test_channels_without_dofs_are_named_in_order(file):
    path = file(*(real(1, "0:S", x=T, values=np.arange(6.0) + k) for k in range(3)))
    assert mio.read(path).output_dofs == ("ch1", "ch2", "ch3")
    assert mio.read(path, output_dofs=["1:+Z", "2:+Z", "3:+Z"]).output_dofs == ("1:+Z", "2:+Z", "3:+Z")


def test_an_uneven_time_axis_is_no_record(file):
    with pytest.raises(DataError, match="not evenly spaced"):
        mio.read(file(real(1, "1:+Z", x=np.array([0, 1, 3.0, 4, 5, 6]), even=False)))


def test_correlations_and_responses_over_a_force_are_impulse_responses(file):
    lags = np.arange(-2, 4) / 100.0
    correlation = mio.read(file(real(8, "1:+Z", "2:+Z", x=lags)))
    assert isinstance(correlation, ImpulseResponse)
    assert correlation.kind == "correlation"
    assert correlation.samples == 3  # lags 1 to 3; lag 0 apart, negative ones left
    np.testing.assert_array_equal(correlation.feedthrough[0], real(8, "1:+Z", x=lags).values[2])
    sampled = mio.read(file(real(1, "1:+Z", "2:+Z", x=T, denominator=13)))
    assert (sampled.kind, sampled.samples, sampled.feedthrough) == ("dirac", 6, None)


def header(dataset, *lines):
    return "\n".join(["    -1", f"{dataset:6d}", *lines, "    -1\n"]).encode()


def test_displacement_systems_give_the_direction_of_motion(file):
    def row(*values):
        return "".join(f"{v:25.16E}" for v in values).replace("E", "D")

    # local x of system 7 is global y, local y is global -x; its origin is (1, 2, 3)
    system = header(
        2420,
        f"{1:10d}",
        "part",
        f"{7:10d}{0:10d}{8:10d}",
        "turned",
        row(0, 1, 0),
        row(-1, 0, 0),
        row(0, 0, 1),
        row(1, 2, 3),
    )
    nodes = header(2411, f"{1:10d}{0:10d}{7:10d}{11:10d}", row(5, 0, 0), f"{2:10d}{7:10d}{0:10d}{11:10d}", row(5, 0, 0))
    geometry = mio.read(file(frf("1:+X"), frf("2:+X"), more=system + nodes)).geometry
    assert geometry.motion_of("1:+X") == (("1", (0.0, 1.0, 0.0)),)
    assert geometry.motion_of("2:+X") == (("2", (1.0, 0.0, 0.0)),)
    np.testing.assert_allclose(geometry.coordinates, [[5, 0, 0], [1, 7, 3]])


def test_lines_to_missing_nodes_are_left_out_and_told(file):
    nodes = header(15, *(f"{n:10d}{0:10d}{0:10d}{0:10d}{n:13.5E}{-1:13.5E}{0:13.5E}" for n in (1, 2)))
    trace = header(82, f"{1:10d}{4:10d}{0:10d}", "outline", f"{1:10d}{2:10d}{0:10d}{9:10d}")
    path = file(frf("1:+Z"), more=nodes + trace + header(82, f"{2:10d}{2:10d}{0:10d}", "NONE", f"{2:10d}{9:10d}"))
    geometry = mio.read(path).geometry
    assert geometry.lines.tolist() == [[0, 1]]
    assert geometry.coordinates.tolist() == [[1, -1, 0], [2, -1, 0]]
    assert any("1 lines or faces were left out" in note for note in mio.survey(path).notes)


@pytest.mark.parametrize(("count", "told"), [(2, False), (3, True), (1, True)])
def test_a_trace_line_with_another_count_is_read_and_the_difference_told(file, count, told):
    nodes = header(15, *(f"{n:10d}{0:10d}{0:10d}{0:10d}{n:13.5E}{-1:13.5E}{0:13.5E}" for n in (1, 2)))
    path = file(frf("1:+Z"), more=nodes + header(82, f"{1:10d}{count:10d}{0:10d}", "outline", f"{1:10d}{2:10d}"))
    survey = mio.survey(path)
    assert survey.thing.geometry.lines.tolist() == [[0, 1]]
    said = f"its header counts {count} nodes, and 2 are there"
    assert any(said in finding.what for finding in survey.found) is told


def test_unknown_sets_are_left_and_units_are_told(file):
    inches = header(
        164,
        f"{7:10d}{'IN: Inch (pound f)':<20}{2:10d}",
        "".join(f"{v:25.16E}" for v in (39.37, 0.2248, 1.8)),
        f"{459.67:25.16E}",
    )
    path = file(frf("1:+Z"), more=inches + header(1858, "whatever"))
    survey = mio.survey(path)
    assert [finding.reason for finding in survey.left] == ["dataset 1858 is not read"]
    assert any("Inch" in str(note) for note in survey.notes)
    assert mio.read(path).units == (("",), ("",))


def test_si_units_follow_from_the_data_type(file):
    si = header(
        164, f"{1:10d}{'SI: Meter (newton)':<20}{2:10d}", "".join(f"{1.0:25.16E}" for _ in range(3)), f"{273.15:25.16E}"
    )
    assert mio.read(file(frf("1:+Z"), more=si)).units == (("m/s2",), ("N",))
    assert mio.read(file(frf("1:+Z", unit="g"), more=si)).units == (("g",), ("N",))


def test_modes_beside_responses_are_taken_when_wanted(tmp_path):
    mio.write(tmp_path / "m.uff", samples.modes())
    mio.write(tmp_path / "m2.uff", samples.modes(), dataset=2414)
    mio.write(tmp_path / "f.uff", samples.frequency_response())
    both = tmp_path / "both.uff"
    both.write_bytes(b"".join((tmp_path / name).read_bytes() for name in ("m.uff", "m2.uff", "f.uff")))
    assert isinstance(mio.read(both), FrequencyResponse)
    modes = mio.read(both, want="modes")
    assert isinstance(modes, ModalModel)
    assert len(modes) == 2  # once, not once for each dataset
    assert isinstance(mio.read(both, want="geometry"), Geometry)
    with pytest.raises(DataError, match=r"records from both\.uff"):
        mio.read(both, want="records")


def test_labels_without_a_place_in_the_format_are_refused(tmp_path):
    response = samples.frequency_response()
    long = FrequencyResponse(
        values=response.values, frequencies=response.frequencies, output_dofs=["left wing tip", "b", "c"]
    )
    with pytest.raises(DataError, match="up to 10 ASCII characters"):
        mio.write(tmp_path / "a.uff", long)
    modes = ModalModel(poles=[-1 + 10j], shapes=[[1], [2]])
    with pytest.raises(DataError, match="'y1', 'y2' are not node numbers"):
        mio.write(tmp_path / "a.uff", modes)
    assert list(tmp_path.iterdir()) == []


def test_two_kinds_of_impulse_response_in_one_file_are_told_apart(tmp_path: Path) -> None:
    """The commoner is taken, and the other said; where both are as common, or one is wanted, that is said by `kind`."""
    few = ImpulseResponse(
        values=np.ones((5, 1, 1)), sampling_rate=1.0, kind="dirac", output_dofs=["1:+X"], input_dofs=["2:+X"]
    )
    same = dataclasses.replace(few, values=2 * few.values, kind="free decay", units=None)
    more = dataclasses.replace(same, units=None, values=3 * np.ones((5, 2, 1)), output_dofs=["1:+X", "3:+X"])
    both = {}
    for name, others in (("tie", same), ("more", more)):
        parts = []
        for k, data in enumerate((few, others)):
            part = tmp_path / f"{k}.uff"
            mio.write(part, data)
            parts.append(part.read_bytes())
        both[name] = tmp_path / f"{name}.uff"
        both[name].write_bytes(b"".join(parts))
    refused("1 dirac responses and 1 free decay responses", mio.read, both["tie"])
    assert mio.read(both["tie"], kind="dirac").values[0, 0, 0] == 1
    assert mio.read(both["tie"], kind="free decay").values[0, 0, 0] == 2
    assert mio.read(both["more"]).values.shape == (5, 2, 1)
    assert "it is a dirac response" in str(mio.survey(both["more"]))
