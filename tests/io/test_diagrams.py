"""A stabilization diagram on the disk: read back, everything is what it was, and the same modes are selected."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import DataError, Geometry, StabilizationDiagram
from modalscope.io import survey
from modalscope.systems import chain5

SUFFIXES = [".npz", ".json"]


def of_samples() -> StabilizationDiagram:
    return ms.stabilize(chain5().impulse_response(300, noise=0.01, seed=0), orders=range(2, 21, 2))


def of_lines() -> StabilizationDiagram:
    geometry = Geometry(nodes=["1", "2", "4", "5"], coordinates=np.arange(12.0).reshape(4, 3))
    f = np.linspace(0.3, 7.5, 300)
    response = chain5().frequency_response(f, quantity="acceleration", noise=0.01, seed=0)
    response = replace(response, geometry=geometry, coherence=np.full((300, 4), 0.9), averages=7, units=("m/s2", "N"))
    return ms.stabilize(response, orders=range(2, 31, 2), band=(0.5, 7.0), weights="coherence")


def of_transformed() -> StabilizationDiagram:
    response = chain5().frequency_response(0.025 * np.arange(12, 301), noise=0.01, seed=0)
    return ms.stabilize(response, domain="time", orders=range(2, 21, 2))


def of_correlations() -> StabilizationDiagram:
    return ms.stabilize(chain5().simulate(inputs="ambient", samples=4000, sampling_rate=20.0), orders=range(2, 15, 2))


def same(a: object, b: object) -> bool:
    """Equal to the last bit, NaN with NaN."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    if hasattr(a, "__dataclass_fields__"):
        return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)  # type: ignore[arg-type]
    return a == b


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("make", [of_samples, of_lines, of_transformed, of_correlations])
def test_what_is_read_back_is_the_same_to_the_last_bit(make, suffix: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    diagram, path = make(), tmp_path / f"d{suffix}"
    ms.write(path, diagram)
    again = ms.read(path)
    for field in fields(diagram):
        assert same(getattr(diagram, field.name), getattr(again, field.name)), field.name
    before, after = ms.select(diagram), ms.select(again)
    assert len(before) >= 3
    assert same(before, after)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_numbers_that_are_not_finite_and_no_poles_at_all_come_back(suffix: str, tmp_path: Path) -> None:
    diagram = of_samples()
    errors = np.array(diagram.fit_errors)
    errors[:3] = [np.nan, np.inf, -np.inf]
    spoilt = replace(diagram, fit_errors=errors)
    flat = [f.name for f in fields(diagram) if f.name in ("poles", "order_of_pole", "participation")]
    flat += ["stable_frequency", "stable_damping", "stable_shape", "frequencies_std", "damping_ratios_std"]
    none = replace(
        diagram, **{name: getattr(diagram, name)[:0] for name in flat}, shapes=diagram.shapes[:, :0], indicators={}
    )
    for thing in (spoilt, none):
        ms.write(tmp_path / f"d{suffix}", thing)
        again = ms.read(tmp_path / f"d{suffix}")
        assert same(thing.fit_errors, again.fit_errors)
        assert again.shapes.shape == thing.shapes.shape


def test_a_survey_tells_what_the_file_holds(tmp_path: Path) -> None:
    ms.write(tmp_path / "d.npz", of_samples())
    told = survey(tmp_path / "d.npz")
    assert told.result.startswith("stabilization diagram: ")
    assert "impulse responses" in told.result
    assert "(era, time)" in str(told)


@pytest.mark.parametrize("suffix", [".csv", ".uff", ".mat", ".h5"])
def test_formats_without_a_place_for_a_diagram_refuse_it(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"diagrams are written as \.npz or \.json"):
        ms.write(tmp_path / f"d{suffix}", of_samples())
    assert not list(tmp_path.iterdir())


def test_a_damaged_diagram_is_an_error_that_says_so(tmp_path: Path) -> None:
    path = tmp_path / "d.json"
    ms.write(path, of_samples())
    whole = json.loads(path.read_text())
    for spoil in (
        lambda d: d.pop("arrays"),
        lambda d: d["arrays"].pop("poles"),
        lambda d: d["arrays"].pop("response_values"),
        lambda d: d["arrays"].pop("response_sampling_rate"),
        lambda d: d["arrays"].update(poles=[1.0]),
        lambda d: d["arrays"].update(poles={"real": ["x"], "imag": [0.0]}),
        lambda d: d["diagram"].pop("orders"),
        lambda d: d["diagram"].update(unknown=3),
        lambda d: d.update(diagram=3),
    ):
        document = json.loads(json.dumps(whole))
        spoil(document)
        path.write_text(json.dumps(document))
        with pytest.raises(DataError):
            ms.read(path)
    path = tmp_path / "d.npz"
    np.savez(path, diagram=np.asarray("{"), poles=np.zeros(1))
    with pytest.raises(DataError, match="stabilization diagram"):
        ms.read(path)
