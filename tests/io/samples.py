"""Small nouns with every field filled, to write and read back."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from modalscope.data import FrequencyResponse, Geometry, ImpulseResponse, ModalModel, Note, Signals
from modalscope.data.indicators import mpc
from modalscope.data.notes import Candidate, Harmonic

OUTPUTS, INPUTS = ("1:+Z", "2:+Z", "12:-X"), ("1:+Z", "shaker")
UNITS = ("m/s2", "N")


def geometry(seed: int = 0) -> Geometry:
    rng = np.random.default_rng(seed)
    return Geometry(
        nodes=[1, 2, 12, 20], coordinates=rng.normal(size=(4, 3)), lines=[[1, 2], [2, 12]], faces=[[1, 2, 12, 20]]
    )


def frequency_response(seed: int = 0, lines: int = 7) -> FrequencyResponse:
    rng = np.random.default_rng(seed)
    shape = (lines, 3, 2)
    return FrequencyResponse(
        values=rng.normal(size=shape) + 1j * rng.normal(size=shape),
        frequencies=np.linspace(1, 20, lines),
        quantity="acceleration",
        coherence=rng.uniform(size=shape),
        output_dofs=OUTPUTS,
        input_dofs=INPUTS,
        units=UNITS,
        geometry=geometry(seed),
    )


def impulse_response(seed: int = 0, samples: int = 8) -> ImpulseResponse:
    rng = np.random.default_rng(seed)
    return ImpulseResponse(
        values=rng.normal(size=(samples, 3, 2)),
        feedthrough=rng.normal(size=(3, 2)),
        sampling_rate=44100.0,
        quantity="acceleration",
        output_dofs=OUTPUTS,
        input_dofs=INPUTS,
        units=UNITS,
    )


def records(seed: int = 0, runs: int = 1, samples: int = 9) -> Signals:
    rng = np.random.default_rng(seed)
    shape = (samples,) if runs == 1 else (runs, samples)
    return Signals(
        outputs=rng.normal(size=(*shape, 3)),
        inputs=rng.normal(size=(*shape, 2)),
        sampling_rate=51200.0,
        quantities=("acceleration", "velocity", "displacement"),
        output_dofs=OUTPUTS,
        input_dofs=INPUTS,
        units=(("m/s2", "m/s", "m"), "N"),
    )


def unrefined(seed: int = 0, count: int = 2) -> ModalModel:
    rng = np.random.default_rng(seed + 1)
    return ModalModel(
        poles=-rng.uniform(0.1, 1, count) + 1j * np.sort(rng.uniform(5, 500, count)),
        shapes=rng.normal(size=(3, count)) + 1j * rng.normal(size=(3, count)),
        participation=rng.normal(size=(count, 2)) + 1j * rng.normal(size=(count, 2)),
        quantity="acceleration",
        indicators={"emac": rng.uniform(size=count)},
        output_dofs=OUTPUTS,
        input_dofs=INPUTS,
        units=UNITS,
        processing=("band 1 to 100 Hz",),
    )


def modes(seed: int = 0, count: int = 2) -> ModalModel:
    rng = np.random.default_rng(seed)
    poles = -rng.uniform(0.1, 1, count) + 1j * np.sort(rng.uniform(5, 500, count))
    shapes = rng.normal(size=(3, count)) + 1j * rng.normal(size=(3, count))
    return ModalModel(
        poles=poles,
        shapes=shapes,
        participation=rng.normal(size=(count, 2)) + 1j * rng.normal(size=(count, 2)),
        feedthrough=rng.normal(size=(3, 2)),
        lower_residual=rng.normal(size=(3, 2)),
        quantity="acceleration",
        frequencies_spread=rng.uniform(size=count),
        damping_ratios_spread=np.where(np.arange(count) == 0, np.nan, 0.001),
        indicators={"emac": rng.uniform(size=count), "mpc": mpc(shapes)},
        reasons=tuple({"orders": [4, 6], "spread": 0.1 * j} for j in range(count)),
        output_dofs=OUTPUTS,
        input_dofs=INPUTS,
        units=UNITS,
        geometry=geometry(seed),
        processing=("band 1 to 100 Hz",),
        frequencies_std=rng.uniform(size=count),
        shapes_std=rng.uniform(size=(3, count)),
        damping_ratios_repeatability=rng.uniform(size=count),
        damping_ratios_lower=np.where(np.arange(count) == 0, np.nan, 1e-4),
        degrees=rng.uniform(5, 500, (count, 2)),
        gain=rng.uniform(5, 50, count),
        left_out=[Candidate(frequency=7.5, damping_ratio=0.3, reason="seen in two orders only", remedy="raise orders")],
        harmonics=[Harmonic(frequency=25.0, order=1, level=0.4, evidence="no damping at all")],
        unrefined=unrefined(seed, count),
        converged=True,
        notes=[Note("rank", {"rank": 12}, "the data have rank 12"), "seen in one band"],
    )


EVERY = {
    "frequency response": frequency_response,
    "impulse response": impulse_response,
    "records": records,
    "modes": modes,
    "geometry": geometry,
}


def differences(a: Any, b: Any) -> list[str]:
    """Names of the fields in which two nouns differ by a single bit."""
    if type(a) is not type(b):
        return [f"{type(a).__name__} became {type(b).__name__}"]
    found = []
    for field in dataclasses.fields(a):
        if field.name == "source_path":
            continue
        x, y = getattr(a, field.name), getattr(b, field.name)
        if dataclasses.is_dataclass(x):
            found += differences(x, y)
        elif isinstance(x, np.ndarray):
            found += [] if np.array_equal(x, y, equal_nan=True) else [field.name]
        elif field.name == "indicators":
            found += [] if x.keys() == y.keys() and all(np.array_equal(x[k], y[k]) for k in x) else [field.name]
        elif x != y:
            found.append(field.name)
    return found
