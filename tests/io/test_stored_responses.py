"""Impulse responses that stay in their folder: the modes of all in memory, and the shapes of all outputs written as they come."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.data import stored as stored_response
from modalscope.io import survey
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import poles_from
from tests.support import relative

zarr = pytest.importorskip("zarr", reason="zarr is not installed: pip install 'modalscope[zarr]'")

OUTPUTS, SAMPLES, INPUTS, MODES = 700, 80, 2, 4


def parts() -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(0)
    s = poles_from(np.sort(rng.uniform(0.05, 0.4, MODES)), rng.uniform(0.005, 0.02, MODES))
    C = rng.standard_normal((OUTPUTS, MODES)) + 0.3j * rng.standard_normal((OUTPUTS, MODES))
    return s, C, rng.standard_normal((MODES, INPUTS))


def responses(noise: float = 0.0) -> ms.ImpulseResponse:
    s, C, B = parts()
    values = 2 * np.real((C * np.exp(np.arange(SAMPLES)[:, None] * s)[:, None]) @ B)
    values = values + noise * values.std() * np.random.default_rng(1).standard_normal(values.shape)
    return ms.ImpulseResponse(values=values, sampling_rate=1.0, kind="free decay", quantity="velocity")


def folder(path: Path, made: ms.ImpulseResponse, **attributes: Any) -> Path:
    group = zarr.open_group(path, mode="w")
    group.create_array("values", shape=made.values.shape, chunks=(SAMPLES, 64, INPUTS), dtype="f8")[...] = made.values
    group.attrs.update({"sampling_rate": 1.0, "kind": "free decay", "quantity": "velocity", **attributes})
    return path


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_response, "_NUMBERS_AT_A_TIME", 20_000)


@pytest.mark.slow
@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_modes_and_shapes_are_those_of_the_whole_in_memory(tmp_path: Path, noise: float) -> None:
    made = responses(noise)
    stored = ms.read(folder(tmp_path / "big.zarr", made), stored=True)
    assert isinstance(stored, ms.StoredResponse)
    assert (stored.samples, stored.kind, stored.quantity) == (SAMPLES, "free decay", "velocity")
    np.testing.assert_array_equal(stored.part(60, 130).values, made.values[:, 60:130])
    found, whole = (ms.identify(each, method="era", order=2 * MODES) for each in (stored, made))
    assert relative(found.poles, whole.poles) < (1e-4 if noise else 1e-9)
    assert "700 stored outputs are reduced to" in str(found.notes)
    seen: list[tuple[int, int]] = []
    field = ms.full_field(found.modes, stored, tmp_path / "shapes.zarr", progress=lambda *done: seen.append(done))
    assert seen[-1] == (OUTPUTS, OUTPUTS)
    assert len(seen) > 2
    modes = ms.read(tmp_path / "shapes.zarr")
    assert isinstance(modes, ms.ModalModel)
    assert modes.output_dofs == made.output_dofs
    # the second route: all outputs in memory, fitted together with the same poles and participation
    exact, _ = made.basis(found.poles).fit_shapes(found.modes.participation)
    assert relative(modes.shapes, exact) < 1e-9
    rebuilt = modes.impulse_response(SAMPLES, 1.0).values
    left = np.linalg.norm(made.values - rebuilt) / np.linalg.norm(made.values)
    assert np.isclose(field.fit_error, left, rtol=1e-6, atol=1e-9)
    assert (field.outputs, field.modes) == (OUTPUTS, MODES)
    if not noise:
        assert np.min(np.diag(ms.mac(modes.shapes, parts()[1]))) > 1 - 1e-12
    each = np.linalg.norm(made.values - rebuilt, axis=(0, 2)) / np.linalg.norm(made.values, axis=(0, 2))
    np.testing.assert_allclose(field.fit_errors, each, rtol=1e-6, atol=1e-9)


def test_what_is_large_beside_the_memory_stays_and_small_responses_are_read(tmp_path: Path) -> None:
    path = folder(tmp_path / "a.zarr", responses())
    assert isinstance(ms.read(path), ms.ImpulseResponse)
    assert "80x700x2, read some outputs at a time" in str(survey(path, stored=True))


def test_what_cannot_be_done_is_said_before_anything_is_written(tmp_path: Path) -> None:
    stored = ms.read(folder(tmp_path / "big.zarr", responses()), stored=True)
    modes = ms.identify(stored, method="era", order=2 * MODES).modes
    (tmp_path / "there.zarr").mkdir()
    for path, found in (
        ("there.zarr", "there already"),
        ("shapes.npz", "end in .zarr"),
        ("no/shapes.zarr", "no folder"),
    ):
        with pytest.raises(DataError, match=found):
            ms.full_field(modes, stored, tmp_path / path)
    other = ms.identify(responses().select(inputs=[0]), method="era", order=2 * MODES).modes
    with pytest.raises(DataError, match="inputs of the modes are 1"):
        ms.full_field(other, stored, tmp_path / "shapes.zarr")
    some = stored.select(outputs=[650, 3], inputs=[1])
    np.testing.assert_array_equal(some.part(0, 2).values, responses().values[:, [650, 3]][:, :, [1]])
    assert sorted(each.name for each in tmp_path.iterdir()) == ["big.zarr", "there.zarr"]


def test_a_sample_that_is_no_number_is_named_where_it_stands(tmp_path: Path) -> None:
    made = responses()
    path = folder(tmp_path / "big.zarr", made)
    zarr.open_array(path / "values", mode="r+")[3, 200, 0] = np.nan
    with pytest.raises(DataError, match="NaN"):
        ms.identify(ms.read(path, stored=True), method="era", order=8)


@pytest.mark.parametrize("name", ["values", "outputs"])
def test_a_head_that_promises_more_than_there_is_is_refused_at_once(tmp_path: Path, name: str) -> None:
    path, axes = tmp_path / "a.zarr", 3 if name == "values" else 2
    group = zarr.open_group(path, mode="w")
    group.create_array(name, shape=(100, 3, 2)[:axes], chunks=(10, 3, 2)[:axes], dtype="f8")[...] = 1.0
    group.attrs["sampling_rate"] = 1.0
    head = json.loads((path / name / "zarr.json").read_text())
    head["shape"][0] = 10**15
    (path / name / "zarr.json").write_text(json.dumps(head))
    for options in ({}, {"stored": True}):
        with pytest.raises(DataError, match="100000000000000 pieces, and there are 11 files"):
            ms.read(path, **options)
