"""pandas objects as data: names, units and the rate of the index are kept, and `analyze` takes them as they are."""

from __future__ import annotations

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.frames import table_of_variables
from modalscope.systems import chain5
from tests.io.ordinary import CHANNELS, FREQUENCIES, RATE, RESPONSES, TIMES
from tests.support import refused

pd = pytest.importorskip("pandas")

HEADS = ["Force [N]", "AccA [m/s2]", "AccB [m/s2]"]


def frame(index: object = None) -> pd.DataFrame:
    return pd.DataFrame(CHANNELS, columns=HEADS, index=index)


@pytest.mark.parametrize(
    "index",
    [
        pd.Index(TIMES),
        pd.Index(TIMES, name="t"),
        pd.Index(1000 * TIMES, name="Time [ms]"),
        pd.to_timedelta(TIMES, unit="s"),
        pd.Timestamp("2024-05-01T23:59:59.9") + pd.to_timedelta(TIMES, unit="s"),
    ],
    ids=["bare", "named", "milliseconds", "durations", "dates"],
)
def test_the_index_gives_the_rate(index: object) -> None:
    record = ms.from_frame(frame(index))
    assert record.sampling_rate == RATE
    assert (record.input_dofs, record.output_dofs) == (("Force",), ("AccA", "AccB"))
    assert record.units == (("m/s2", "m/s2"), ("N",))
    assert record.quantity == "acceleration"
    assert np.array_equal(record.outputs, CHANNELS[:, 1:])


def test_a_count_of_rows_needs_a_rate_that_attributes_or_the_caller_give() -> None:
    refused("sampling_rate=HZ", ms.from_frame, frame())
    assert ms.from_frame(frame(), sampling_rate=RATE).sampling_rate == RATE
    told = frame()
    told.attrs["fs"] = RATE
    assert ms.from_frame(told).sampling_rate == RATE
    bare = pd.DataFrame(CHANNELS, columns=["a", "b", "c"])
    bare.attrs["units"] = {"a": "N", "b": "g"}
    assert ms.from_frame(bare, sampling_rate=RATE).units == (("g", ""), ("N",))


def test_a_series_is_one_output() -> None:
    record = ms.from_frame(pd.Series(CHANNELS[:, 1], index=TIMES, name="AccA [g]"))
    assert (record.output_dofs, record.units, record.inputs) == (("AccA",), (("g",), ()), None)


def test_complex_columns_over_frequencies_are_responses() -> None:
    held = pd.DataFrame(RESPONSES, columns=["H1", "H2"], index=pd.Index(FREQUENCIES, name="Frequency [Hz]"))
    found = ms.from_frame(held, quantity="acceleration")
    assert isinstance(found, ms.FrequencyResponse)
    assert np.array_equal(found.values[:, :, 0], RESPONSES)
    assert found.quantity == "acceleration"


def test_analyze_takes_a_frame_and_finds_what_it_finds_in_the_data() -> None:
    record = chain5().simulate(samples=600, sampling_rate=20.0, seed=1)
    names = [f"sensor {k}" for k in range(len(record.output_dofs))]
    held = pd.DataFrame(
        np.column_stack([record.inputs, record.outputs]),
        columns=["Force 1 [N]", "Force 2 [N]", *(f"{name} [m/s2]" for name in names)],
        index=np.arange(600) / 20.0,
    )
    from_frame, direct = (ms.analyze(data, orders=[10, 12], refine=False) for data in (held, ms.from_frame(held)))
    assert np.array_equal(from_frame.modes.frequencies, direct.modes.frequencies)
    assert len(from_frame.modes) == 5


def test_an_axis_of_another_number_of_values_is_refused() -> None:
    variables = {"a": (("time",), np.arange(150.0), "g")}
    coords = {"time": (("other",), np.arange(2.0), "s")}
    refused("'time' has 2 values for 150 of the others", table_of_variables, "file.nc", variables, coords, {})


def test_other_objects_are_refused() -> None:
    refused("it is list", ms.from_frame, [1, 2])
