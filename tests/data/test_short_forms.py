"""Short ways to make data: by place, of one channel, and by the names of responses to a force."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.systems import chain5
from tests.support import refused

F = np.linspace(0.3, 7.5, 120)


def test_records_and_responses_are_made_by_place() -> None:
    y = np.random.default_rng(0).standard_normal((50, 2))
    record = ms.Signals(y, 100.0)
    assert (record.samples, record.sampling_rate, record.output_dofs) == (50, 100.0, ("y1", "y2"))
    response = ms.FrequencyResponse(chain5().frequency_response(F).values, F, quantity="mobility")
    assert response.lines == 120
    impulse = ms.ImpulseResponse(y[:, 0], 100.0)
    assert (impulse.values.shape, impulse.sampling_rate) == ((50, 1, 1), 100.0)
    refused("Signals takes outputs and sampling_rate by position, but there are 3 values", ms.Signals, y, 100.0, y)
    with pytest.raises(TypeError):
        ms.Signals(y, outputs=y, sampling_rate=1.0)  # type: ignore[misc]


def test_one_channel_needs_no_further_axes() -> None:
    y = np.sin(np.arange(50.0))
    record = ms.Signals(outputs=y, inputs=y[::-1], sampling_rate=10.0)
    assert (record.outputs.shape, record.inputs.shape if record.inputs is not None else None) == ((50, 1), (50, 1))
    H = 1 / (4 - F**2 + 0.04j * F)
    assert ms.FrequencyResponse(H, F).values.shape == (120, 1, 1)
    refused("axes", ms.FrequencyResponse, values=np.ones((120, 2), complex), frequencies=F)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("receptance", "displacement"),
        ("compliance", "displacement"),
        ("mobility", "velocity"),
        ("inertance", "acceleration"),
        ("Accelerance", "acceleration"),
    ],
)
def test_responses_to_a_force_have_names(name: str, quantity: str) -> None:
    response = ms.FrequencyResponse(chain5().frequency_response(F).values, F, quantity=name)
    assert response.quantity == quantity
    refused("quantity", ms.FrequencyResponse, values=response.values, frequencies=F, quantity="stiffness")


@pytest.mark.parametrize(
    ("units", "sides", "quantity", "factor"),
    [
        ("g/N", ("g", "N"), "acceleration", 9.80665),
        ("(mm/s)/kN", ("mm/s", "kN"), "velocity", 1e-6),
        ("m/s^2/N", ("m/s^2", "N"), "acceleration", 1.0),
        ("mm", ("mm", ""), "displacement", 1e-3),
        ("100 mV/g", ("100 mV/g", ""), "acceleration", 0.0980665),
        (("in", "lbf"), ("in", "lbf"), "displacement", 0.0254 / 4.4482216152605),
        ("furlong/N", ("furlong/N", ""), None, 1.0),
    ],
)
def test_the_unit_of_a_response_is_that_of_both_sides_and_says_the_quantity(
    units: str | tuple[str, str], sides: tuple[str, str], quantity: str | None, factor: float
) -> None:
    H = chain5().frequency_response(F).values
    response = ms.FrequencyResponse(H, F, units=units)  # type: ignore[arg-type]
    assert (response.units[0][0], response.units[1][0], response.quantity) == (*sides, quantity)
    np.testing.assert_allclose(response.in_si().values, factor * H)
    assert ms.FrequencyResponse(H, F, units=units, quantity="velocity").quantity == "velocity"  # type: ignore[arg-type]


def test_units_of_records_say_the_quantities_and_may_be_one_per_output() -> None:
    y = np.random.default_rng(0).standard_normal((50, 2))
    assert ms.Signals(y, 100.0, units="g").quantity == "acceleration"  # type: ignore[arg-type]
    assert ms.Signals(y, 100.0, units="V").quantity is None  # type: ignore[arg-type]
    mixed = ms.Signals(y, 100.0, units=["mm/s", "100 mV/g"])  # type: ignore[arg-type]
    assert (mixed.units, mixed.quantities) == ((("mm/s", "100 mV/g"), ()), ("velocity", "acceleration"))
    driven = ms.Signals(y, 100.0, inputs=y, units=["g", "N"])  # type: ignore[arg-type]
    assert driven.units == (("g", "g"), ("N", "N"))


def test_a_result_prints_its_table_and_saves_itself(tmp_path: Path) -> None:
    result = ms.analyze(chain5().frequency_response(F, noise=0.01, seed=0), orders=range(8, 15, 2))
    text = str(result)
    assert text.startswith(result.modes.table())
    assert "Unexplained" in text
    assert repr(result).startswith("<result: ")
    path = result.save(tmp_path / "modes.json")
    assert np.array_equal(ms.read(path).poles, result.modes.poles)
    assert "<svg" in result.save(tmp_path / "modes.html", title="A chain").read_text()


def test_a_frame_becomes_a_record() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"a [m/s^2]": np.sin(np.arange(40.0)), "b [m/s^2]": np.cos(np.arange(40.0))})
    frame.index = np.arange(40) / 20.0
    record = ms.Signals.from_frame(frame)
    assert isinstance(record, ms.Signals)
    assert record.sampling_rate == pytest.approx(20.0)
    assert record.output_dofs == ms.from_frame(frame).output_dofs
    refused("reading DataFrame with inputs(.|\n)*columns", ms.Signals.from_frame, frame, inputs=["a"])
