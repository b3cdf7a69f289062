"""Give data with names on their axes, as xarray has them: labels, frequencies and times beside the values."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.results import StabilizationDiagram
from modalscope.numerics.errors import DataError, optional_package


def dataset(thing: Any) -> Any:
    """Return an xarray Dataset of responses, records, modes or a stabilization diagram.

    Raises
    ------
    DataError
        xarray is missing; data that stay in their file.
    """
    xarray = optional_package("to_xarray", "xarray", "netcdf")
    arrays, axes, about = _parts(thing)
    known = {name: (dims, values) for name, (dims, values) in arrays.items() if values is not None}
    return xarray.Dataset(known, coords=axes, attrs={name: text for name, text in about.items() if text is not None})


@singledispatch
def _parts(thing: Any) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Return arrays with their axes, the values along the axes, and what is the same everywhere."""
    raise DataError(
        f"named arrays of {type(thing).__name__}:",
        "they are made of one response, one record, modes or a diagram in memory",
        "Convert each part.",
    )


def _channels(data: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return labels and units along the axes of outputs and inputs."""
    axes, units = {"output": list(data.output_dofs), "input": list(data.input_dofs)}, {}
    for side, names in zip(("output", "input"), data.units, strict=True):
        if any(names):
            units[f"{side}_units"] = ((side,), [name or "" for name in names])
    return axes, units


@_parts.register
def _(frf: FrequencyResponse) -> Any:
    axes, units = _channels(frf)
    dims = ("frequency", "output", "input")
    arrays = {name: (dims, getattr(frf, name)) for name in ("values", "coherence", "variance")}
    return arrays, {"frequency": frf.frequencies, **axes, **units}, {"quantity": frf.quantity}


@_parts.register
def _(irf: ImpulseResponse) -> Any:
    axes, units = _channels(irf)
    arrays = {
        "values": (("time", "output", "input"), irf.values),
        "feedthrough": (("output", "input"), irf.feedthrough),
    }
    return arrays, {"time": irf.times, **axes, **units}, {"quantity": irf.quantity, "kind": irf.kind}


@_parts.register
def _(signals: Signals) -> Any:
    axes, units = _channels(signals)
    lead = ("run", "time") if signals.outputs.ndim == 3 else ("time",)
    arrays = {"outputs": ((*lead, "output"), signals.outputs), "inputs": ((*lead, "input"), signals.inputs)}
    quantities = (("output",), [quantity or "" for quantity in signals.quantities])
    times = np.arange(signals.samples) / signals.sampling_rate
    return arrays, {"time": times, **axes, **units, "quantity": quantities}, {"sampling_rate": signals.sampling_rate}


@_parts.register
def _(modes: ModalModel) -> Any:
    axes, _ = _channels(modes)
    table = modes.columns()
    arrays: dict[str, Any] = {name: (("mode",), np.asarray(values)) for name, values in table.items()}
    arrays["shapes"] = (("output", "mode"), modes.shapes)
    arrays["shapes_std"] = (("output", "mode"), modes.shapes_std)
    arrays["participation"] = (("mode", "input"), modes.participation)
    return (
        arrays,
        {"mode": np.arange(1, len(modes) + 1), **axes},
        {"quantity": modes.quantity, "scaling": modes.scaling},
    )


@_parts.register
def _(diagram: StabilizationDiagram) -> Any:
    per_pole = ("order_of_pole", "frequencies", "damping_ratios", "stable", "frequencies_std", "damping_ratios_std")
    arrays: dict[str, Any] = {name: (("pole",), getattr(diagram, name)) for name in per_pole}
    arrays |= {name: (("pole",), values) for name, values in diagram.indicators.items()}
    arrays["shapes"] = (("output", "pole"), diagram.shapes)
    axes = {"output": list(diagram.response.output_dofs)}
    return arrays, axes, {"method": diagram.method, "domain": diagram.domain}
