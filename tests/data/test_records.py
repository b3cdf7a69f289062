"""Records of several runs: what they share, what may differ, and what does not belong together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from modalscope import merge
from modalscope.data import DataError, Records, Signals, as_records
from tests.support import FIVE


def run(samples: int = 5, inputs: tuple[str, ...] = ("1:+Z",), **fields: object) -> Signals:
    given = {
        "outputs": np.full((samples, 2), float(samples)),
        "inputs": np.full((samples, len(inputs)), 2.0) if inputs else None,
        "sampling_rate": 8.0,
        "output_dofs": ["1:+Z", "2:+Z"],
        "input_dofs": list(inputs),
        "units": ("m/s2", "N"),
        "quantities": "acceleration",
        **fields,
    }
    return Signals(**given)  # type: ignore[arg-type]


def test_runs_of_other_lengths_and_inputs_belong_to_one_test() -> None:
    records = Records(runs=[run(5), run(7, ("2:+Z", "1:+Z")), run(4, ("3:+Z",))])  # type: ignore[arg-type]
    assert records.samples == (5, 7, 4)
    assert records.sampling_rate == 8
    assert records.output_dofs == ("1:+Z", "2:+Z")
    assert records.input_dofs == ("1:+Z", "2:+Z", "3:+Z")
    assert [records.inputs_of(k) for k in range(3)] == [(0,), (1, 0), (2,)]
    assert records.units == (("m/s2", "m/s2"), ("N", "N", "N"))
    assert records.quantity == "acceleration"


def test_the_runs_of_one_record_are_taken_apart_without_a_copy() -> None:
    stacked = FIVE["chain5"]().simulate(samples=20, sampling_rate=20.0, runs=3)
    records = as_records(stacked)
    assert len(records.runs) == 3
    assert all(np.shares_memory(one.outputs, stacked.outputs) for one in records.runs)
    assert all(one.inputs is not None and np.shares_memory(one.inputs, stacked.inputs) for one in records.runs)
    np.testing.assert_array_equal(np.stack([one.outputs for one in records.runs]), stacked.outputs)


def test_what_is_given_as_records_becomes_them() -> None:
    records = Records(runs=(run(), run(6)))
    assert as_records(records) is records
    assert as_records([records]) is records
    assert as_records(run()).samples == (5,)
    assert as_records([run(), records]).samples == (5, 5, 6)
    for wrong in (np.ones(3), "test.uff", None):
        with pytest.raises(DataError, match="record"):
            as_records(wrong)


def test_merge_gives_records_where_runs_do_not_stack() -> None:
    for parts in ([run(5), run(7)], [run(5), run(5, ("2:+Z",))]):
        merged = merge(parts)
        assert isinstance(merged, Records)
        assert merged.runs == tuple(parts)
    three = merge([merge([run(5), run(7)]), run(4)])
    assert isinstance(three, Records)
    assert three.samples == (5, 7, 4)
    assert isinstance(merge([run(5), run(5)]), Signals)
    with pytest.raises(DataError, match="references: records of the same channels"):
        merge([run(5), run(7)], references=[0])


def test_choosing_inputs_leaves_out_the_runs_that_had_other_ones() -> None:
    records = Records(runs=(run(5), run(7, ("2:+Z", "1:+Z")), run(4, ("3:+Z",))))
    some = records.select(outputs="2:+Z", inputs=["1:+Z"])
    assert some.output_dofs == ("2:+Z",)
    assert some.samples == (5, 7)
    assert some.groups == ("run 1", "run 2")
    assert some.runs[1].input_dofs == ("1:+Z",)
    assert records.select(exclude="1:+Z").groups == ("run 2", "run 3")
    ambient = Records(runs=(run(5, ()), run(6, ()))).select(outputs=[0])
    assert ambient.samples == (5, 6)
    with pytest.raises(DataError, match="that leaves no input"):
        Records(runs=(run(),)).select(exclude="1:+Z")


def test_every_run_is_a_group_unless_labels_say_otherwise() -> None:
    monday = Signals(outputs=np.ones((2, 5, 1)), sampling_rate=8.0, groups=["monday", "monday"])  # type: ignore[arg-type]
    tuesday = Signals(outputs=np.ones((2, 5, 1)), sampling_rate=8.0)
    assert tuesday.groups == ("run 1", "run 2")
    assert Records(runs=(monday, tuesday)).groups == ("monday", "monday", "run 3", "run 4")
    assert Records(runs=(tuesday, tuesday)).groups == ("run 1", "run 2", "run 3", "run 4")
    assert merge([monday, tuesday]).groups == ("monday", "monday", "run 3", "run 4")
    assert Records(runs=(tuesday,), groups=None).groups is None
    assert Records(runs=(run(),)).groups is None


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"sampling_rate": 16.0}, "one sampling rate, but run 1 has 8 Hz, run 3 16 Hz"),
        ({"output_dofs": ["2Z", "1Z"]}, r"same outputs: number 1 is 1:\+Z in run 1 and 2:\+Z in run 3"),
        ({"outputs": np.ones((5, 1)), "output_dofs": ["1Z"]}, "same outputs: run 1 has 2, run 3 1"),
        ({"quantities": ("acceleration", None)}, "number 2 is acceleration in run 1 and not known in run 3"),
        ({"units": ("g", "N")}, "units of the outputs: number 1 is m/s2 in run 1 and g in run 3"),
        ({"units": ("m/s2", "lbf")}, r"input 1:\+Z needs one unit, but one run has it in N, another in lbf"),
        ({"inputs": ()}, "all runs need inputs, or none, but run 3 has none"),
    ],
)
def test_runs_that_do_not_belong_together_are_named(other: dict, message: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(DataError, match=message):
        Records(runs=(run(), run(), run(**other)))


def test_what_records_do_not_have_they_say() -> None:
    with pytest.raises(DataError, match="the list is empty"):
        Records(runs=())
    with pytest.raises(DataError, match="each of the runs"):
        Records(runs=(np.ones((3, 2)),))  # type: ignore[arg-type]
    with pytest.raises(DataError, match="run 1: there are 1"):
        Records(runs=(run(),)).inputs_of(1)
    with pytest.raises(DataError, match="groups needs 1 labels, one per run, but 2 are given"):
        Records(runs=(run(),), groups=("a", "b"))
    assert Records(runs=(run(),), source_path="a.npz").source_path == Path("a.npz")  # type: ignore[arg-type]
