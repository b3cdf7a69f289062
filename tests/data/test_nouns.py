"""Records, responses, geometry and labels: what they keep, and what they refuse in three parts."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, strategies as st

from modalscope.data import (
    DataError,
    Dof,
    FrequencyResponse,
    Geometry,
    ImpulseResponse,
    ModalModel,
    Signals,
    StabilizationDiagram,
    parse_dof,
)
from modalscope.data.geometry import label_of

GOOD = {
    Signals: {"outputs": np.ones((5, 2)), "inputs": np.ones((5, 1)), "sampling_rate": 10.0},
    ImpulseResponse: {"values": np.ones((5, 2, 1)), "sampling_rate": 10.0},
    FrequencyResponse: {"values": np.full((5, 2, 1), 1 + 1j), "frequencies": np.arange(5.0)},
    Geometry: {"nodes": ["a", "b"], "coordinates": np.zeros((2, 3))},
}


@pytest.mark.parametrize(
    ("noun", "change", "message"),
    [
        (
            Signals,
            {"outputs": np.ones((2, 2, 2, 2))},
            r"outputs needs axes \(samples, outputs\).*, but the array has shape \(2, 2, 2, 2\)",
        ),
        (Signals, {"outputs": [[1, 2], [3]]}, "outputs needs axes .*, but it is ragged"),
        (Signals, {"outputs": [["a", "b"]]}, "outputs needs numbers, but its type is"),
        (Signals, {"outputs": np.full((5, 2), 1j)}, "outputs needs real numbers, but it is complex"),
        (Signals, {"outputs": np.array([[1, np.nan], [2, np.inf]])}, r"2 of 4 values .* the first at index \(0, 1\)"),
        (Signals, {"inputs": np.ones((4, 1))}, r"the same runs and samples, but the shapes are \(5, 2\) and \(4, 1\)"),
        (Signals, {"outputs": np.ones((1, 2)), "inputs": None}, "needs two samples"),
        (Signals, {"sampling_rate": 0}, "sampling_rate needs a positive number, but it is 0"),
        (Signals, {"sampling_rate": "fast"}, "sampling_rate needs a positive number, but it is 'fast'"),
        (Signals, {"quantities": ("velocity",)}, "quantities needs 2, but 1 are given"),
        (Signals, {"quantities": "speed"}, "quantity='speed': there are only displacement"),
        (Signals, {"output_dofs": ["1:X", "1X"]}, r"output_dofs needs different labels, but 1:\+X are repeated"),
        (Signals, {"units": ("g", "N", "s")}, "units needs one unit, or a pair"),
        (Signals, {"units": (("g",), "N")}, "outputs needs 2 units, but there are 1"),
        (ImpulseResponse, {"values": np.ones((5, 2))}, r"values needs axes \(samples, outputs, inputs\)"),
        (ImpulseResponse, {"values": np.ones((1, 2, 1))}, "an impulse response needs two samples"),
        (
            ImpulseResponse,
            {"feedthrough": np.ones((1, 2))},
            r"feedthrough needs shape \(2, 1\), \(outputs, inputs\), but it has \(1, 2\)",
        ),
        (ImpulseResponse, {"kind": "step"}, "kind='step': there are only pulse, dirac"),
        (ImpulseResponse, {"kind": "puls"}, "Did you mean 'pulse'"),
        (ImpulseResponse, {"first_sample": -1}, "first_sample needs a whole number of at least 0, but it is -1"),
        (FrequencyResponse, {"values": np.ones((5, 2, 1))}, "they are magnitudes"),
        (FrequencyResponse, {"frequencies": np.arange(4.0)}, r"one entry for each of the 5 lines .*, but it has 4"),
        (FrequencyResponse, {"frequencies": [0, 1, 3, 2, 4]}, r"line 3 \(2 Hz\) does not lie above line 2 \(3 Hz\)"),
        (FrequencyResponse, {"frequencies": [0, 1, 1, 2, 4]}, r"line 2 \(1 Hz\) does not lie above line 1 \(1 Hz\)"),
        (
            FrequencyResponse,
            {"frequencies": np.arange(5.0) - 1},
            "frequencies needs lines from 0 Hz, but the first is -1 Hz",
        ),
        (FrequencyResponse, {"sampling_rate": 6.0}, "half the sampling rate, 3 Hz: there are lines up to 4 Hz"),
        (FrequencyResponse, {"coherence": np.full((5, 2), 2.0)}, "at least 0 and at most 1, but they lie between 2"),
        (FrequencyResponse, {"variance": np.ones((5, 2))}, r"variance needs the shape of values, \(5, 2, 1\)"),
        (FrequencyResponse, {"averages": 0}, "averages needs a whole number of at least 1"),
        (FrequencyResponse, {"values": np.zeros((0, 2, 1)), "frequencies": np.zeros(0)}, "at least one line"),
        (Geometry, {"nodes": ["a", "a"]}, "different node names"),
        (Geometry, {"coordinates": np.zeros((3, 3))}, r"coordinates needs shape \(2, 3\), but it has \(3, 3\)"),
        (Geometry, {"lines": [["a", "c"]]}, "geometry lines join nodes, but there is no node c"),
        (Geometry, {"faces": [["a", "b"]]}, r"geometry faces need 3 or 4 nodes per row, but the shape is \(1, 2\)"),
    ],
)
def test_what_cannot_be_used_is_refused_in_three_parts(noun: type, change: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(DataError, match=message) as caught:
        noun(**{**GOOD[noun], **change})
    error = caught.value
    assert error.asked
    assert error.found
    assert error.change.endswith((".", "?"))
    assert str(error) == f"{error.fault}.\n{error.change}"


def test_an_error_survives_another_process() -> None:
    error = DataError("this:", "that is there", "Change it.")
    again = pickle.loads(pickle.dumps(error))
    assert (again.asked, again.found, again.change) == (error.asked, error.found, error.change)


def test_nouns_keep_their_own_copy_and_cannot_be_written_to() -> None:
    outputs = np.ones((5, 2))
    record = Signals(outputs=outputs, sampling_rate=10)
    outputs[0, 0] = 7
    assert record.outputs[0, 0] == 1
    # a locked array is shared, not copied again
    assert Signals(outputs=record.outputs, sampling_rate=10).outputs is record.outputs


def test_channels_without_names_are_numbered() -> None:
    record = Signals(**GOOD[Signals])  # type: ignore[arg-type]
    assert record.output_dofs == ("y1", "y2")
    assert record.input_dofs == ("u1",)
    assert record.units == (("", ""), ("",))


def test_one_unit_serves_all_outputs_and_a_pair_both_sides() -> None:
    assert Signals(**GOOD[Signals], units="g").units == (("g", "g"), ("",))  # type: ignore[arg-type]
    assert Signals(**GOOD[Signals], units=(("g", "V"), "N")).units == (("g", "V"), ("N",))  # type: ignore[arg-type]


def test_selection_by_label_number_and_exclusion_agree() -> None:
    rng = np.random.default_rng(0)
    response = FrequencyResponse(
        values=rng.standard_normal((4, 3, 2)) + 1j,
        frequencies=np.arange(1.0, 5),
        output_dofs=["1:X", "2:X", "3:X"],  # type: ignore[arg-type]
        input_dofs=["1:X", "9:Z"],  # type: ignore[arg-type]
        coherence=np.full((4, 3), 0.5),
        variance=np.ones((4, 3, 2)),
    )
    wanted = response.values[:, 1:, 1:]
    for choice in (
        response.select(outputs=["2:X", "3X"], inputs="9:+Z"),
        response.select(outputs=[1, 2], inputs=[1]),
        response.select(outputs=np.array([1, 2]), inputs=np.int64(1)),  # type: ignore[arg-type]
        response.select(outputs=[Dof("2", "+X"), Dof("3", "+X")], inputs=Dof("9", "+Z")),
        response.select(exclude="1:X"),
    ):
        np.testing.assert_array_equal(choice.values, wanted)
        assert choice.output_dofs == ("2:+X", "3:+X")
        assert choice.input_dofs == ("9:+Z",)
        assert choice.coherence is not None
        assert choice.coherence.shape == (4, 2)
        assert choice.variance is not None
        assert choice.variance.shape == (4, 2, 1)


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"outputs": "7:X"}, r"output '7:\+X': there are only y1, y2"),
        ({"inputs": [3]}, "input '3': there are only u1"),
        ({"exclude": "y9"}, "channel to exclude 'y9': there are only y1, y2, u1"),
        ({"exclude": ["y1", "y2"]}, "at least one output, but none is left"),
        ({"exclude": "u1"}, "that leaves no input"),
        ({"outputs": [0, 0]}, "output_dofs needs different labels"),
    ],
)
def test_channels_that_are_not_there_are_named(choice: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(DataError, match=message):
        Signals(**GOOD[Signals]).select(**choice)  # type: ignore[arg-type]


def test_runs_are_counted_and_selected_alike() -> None:
    record = Signals(outputs=np.arange(24.0).reshape(2, 4, 3), sampling_rate=8)
    assert (record.runs, record.samples, record.duration) == (2, 4, 0.5)
    outputs, inputs = record.by_run()
    assert outputs.shape == (2, 4, 3)
    assert inputs is None
    np.testing.assert_array_equal(record.select(outputs=[2]).outputs, record.outputs[..., [2]])


def test_processing_is_written_down_in_order() -> None:
    record = Signals(**GOOD[Signals], processing="read").processed("filtered")  # type: ignore[arg-type]
    assert record.processing == ("read", "filtered")


@given(
    node=st.integers(1, 10**6),
    sign=st.sampled_from(["", "+", "-"]),
    axis=st.sampled_from(["X", "Y", "Z", "RX", "RY", "RZ"]),
)
def test_labels_of_node_and_direction_have_one_form(node: int, sign: str, axis: str) -> None:
    canonical = f"{node}:{sign or '+'}{axis}"
    for way in (f"{node}:{sign}{axis}", f" {node}{sign}{axis} ", (node, sign + axis), f"{node}{sign}{axis.lower()}"):
        assert label_of(way) == canonical
    assert label_of(canonical) == canonical


def test_names_that_are_no_degrees_of_freedom_stay_as_they_are() -> None:
    for name in ("force", "x", "hammer 1", "tip"):
        assert label_of(name) == name
        assert parse_dof(name) is None
    assert parse_dof("tip:-Y") == Dof("tip", "-Y")


def test_directions_have_unit_vectors() -> None:
    assert Dof("1", "-Z").vector == (0, 0, -1)
    assert Dof("1", "+RX").vector is None


def test_geometry_moves_nodes_by_label_and_by_map() -> None:
    geometry = Geometry(
        nodes=[1, 2],  # type: ignore[arg-type]
        coordinates=np.zeros((2, 3)),
        motions={"sway": (("1", (1, 0, 0)), ("2", (0.5, 0, 0)))},
    )
    moved = geometry.displaced(("sway", "2:-Z", "unknown"), np.array([2.0, 3.0, 9.0]))
    np.testing.assert_array_equal(moved, [[2, 0, 0], [1, 0, -3]])


def test_a_diagram_needs_a_row_for_every_pole() -> None:
    flat = {"poles": np.ones(3, complex), "shapes": np.ones((1, 3)), "participation": np.ones((3, 1))}
    stable = {f"stable_{what}": np.array([True, True, False]) for what in ("frequency", "damping", "shape")}
    common = {
        "response": ImpulseResponse(**GOOD[ImpulseResponse]),  # type: ignore[arg-type]
        "method": "era",
        "domain": "time",
        "orders": (2, 4),
        "singular_values": np.ones(4),
        "fit_errors": np.ones(2),
    }
    diagram = StabilizationDiagram(**common, **flat, **stable, order_of_pole=np.array([2, 4, 4]))  # type: ignore[arg-type]
    np.testing.assert_array_equal(diagram.stable, [True, True, False])
    with pytest.raises(DataError, match="a diagram of 3 poles needs as many order_of_pole, but there are 2"):
        StabilizationDiagram(**common, **flat, **stable, order_of_pole=np.array([2, 4]))  # type: ignore[arg-type]
    with pytest.raises(DataError, match="a diagram of 2 poles needs as many order_of_outside, but there are 0"):
        diagram.changed(outside=np.ones(2, complex))


def test_modes_know_their_number_frequencies_and_kinds() -> None:
    modes = ModalModel(poles=[-0.1 + 6j, -3.0], shapes=np.ones((2, 2)))  # type: ignore[arg-type]
    assert len(modes) == 2
    assert modes.kinds == ("mode", "real")
    np.testing.assert_allclose(modes.frequencies, [np.hypot(0.1, 6) / (2 * np.pi), 3 / (2 * np.pi)])


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ("order=12:", "order=12: the rank is 10"),
        ("orders 6 to 8:", "orders 6 to 8: the rank is 10"),
        ("hankel() reads 209 samples", "hankel() reads 209 samples, but the rank is 10"),
    ],
)
def test_a_message_begins_with_the_fault(asked: str, fault: str) -> None:
    error = DataError(asked, "the rank is 10", "Lower it.")
    assert error.fault == fault
    assert str(error) == f"{fault}.\nLower it."


def test_lines_of_a_geometry_are_positions_where_no_node_has_such_a_name() -> None:
    points = {"coordinates": np.eye(3), "lines": [[0, 1], [1, 2]]}
    assert Geometry(nodes=["a", "b", "c"], **points).lines.tolist() == [[0, 1], [1, 2]]
    with pytest.raises(DataError, match="there is no node 0"):  # names count where one of them is a node
        Geometry(nodes=["1", "2", "3"], **points)
    with pytest.raises(DataError, match="there is no node 5"):
        Geometry(nodes=["a", "b", "c"], coordinates=np.eye(3), lines=[[0, 5]])
