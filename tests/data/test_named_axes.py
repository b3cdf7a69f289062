"""Named arrays: every value stands beside its label, frequency or time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5

xarray = pytest.importorskip("xarray")


def test_a_response_is_found_by_labels_and_frequency() -> None:
    frf = replace(chain5().state_space().frequency_response(np.linspace(0.5, 6, 40)), quantity="acceleration")
    named = frf.to_xarray()
    output, column = frf.output_dofs[1], frf.input_dofs[0]
    value = named["values"].sel(output=output, input=column).sel(frequency=frf.frequencies[7])
    assert complex(value) == frf.values[7, 1, 0]
    assert named.attrs["quantity"] == "acceleration"
    assert "coherence" not in named


def test_samples_are_found_by_their_times() -> None:
    irf = chain5().impulse_response(50)
    named = irf.to_xarray()
    assert named.sizes == {"time": 50, "output": len(irf.output_dofs), "input": len(irf.input_dofs)}
    assert np.array_equal(named["time"], irf.times)


@pytest.mark.parametrize("runs", [None, 3])
def test_records_have_runs_where_they_have_several(runs: int | None) -> None:
    shape = (20, 2) if runs is None else (runs, 20, 2)
    signals = ms.Signals(outputs=np.arange(np.prod(shape), dtype=float).reshape(shape), sampling_rate=10.0)
    named = signals.to_xarray()
    assert named["outputs"].dims == (("run",) if runs else ()) + ("time", "output")
    assert float(named["time"][3]) == pytest.approx(0.3)
    assert "inputs" not in named


def test_modes_have_their_columns_and_shapes() -> None:
    modes = chain5().modes()
    named = modes.to_xarray()
    assert np.array_equal(named["frequency_hz"], modes.frequencies)
    assert np.array_equal(named["shapes"].sel(mode=2), modes.shapes[:, 1])
    assert list(named["grade"].values) == [mode.grade for mode in modes]


def test_a_diagram_has_its_poles() -> None:
    response = chain5().impulse_response(200, noise=0.01, seed=0)
    diagram = ms.stabilize(response, orders=range(2, 13, 2), deviations=True)
    named = diagram.to_xarray()
    stable = named.where(named["stable"], drop=True)
    assert np.array_equal(named["frequencies"], diagram.frequencies)
    assert stable.sizes["pole"] == np.count_nonzero(diagram.stable)
    assert np.array_equal(named["frequencies_std"], diagram.frequencies_std, equal_nan=True)


def test_what_has_no_one_array_says_so() -> None:
    from modalscope.data.named_axes import dataset

    with pytest.raises(ms.DataError, match="Convert each part"):
        dataset(ms.Records(runs=(ms.Signals(outputs=np.ones((9, 1)), sampling_rate=1.0),)))
