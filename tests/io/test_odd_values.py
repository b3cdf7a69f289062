"""Booleans, masks, nothing and what is no name where numbers and names belong: answered in words, or read as what it means."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope import DataError
from modalscope.io.columns.axis import sampling_of
from tests.io import test_stored
from tests.io.apart import ending

Y = np.random.default_rng(0).standard_normal((300, 2))
BITS = Y > 0


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"outputs": BITS, "sampling_rate": 10.0}, "outputs in a.npz needs numbers, but it holds True and False"),
        ({"outputs": Y, "sampling_rate": True}, "sampling_rate in a.npz needs numbers"),
        ({"frequencies": BITS[:, 0], "values": Y[:, :, None]}, "frequencies in a.npz needs numbers"),
        ({"t": np.arange(300) > 3, "acc": Y}, "the times in column 1, .t. have too few digits"),
    ],
)
def test_booleans_in_a_file_are_no_numbers(arrays: dict[str, Any], words: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(DataError, match=words):
        ms.read(tmp_path / "a.npz")


def test_an_array_of_booleans_is_one_of_triggers(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", BITS)
    with pytest.raises(DataError, match="needs a column of measured values"):
        ms.read(tmp_path / "a.npy", sampling_rate=10.0)
    with pytest.raises(DataError, match="its type is bool"):
        ms.Signals(outputs=BITS, sampling_rate=10.0)
    with pytest.raises(DataError, match="sampling_rate needs a positive number"):
        ms.Signals(outputs=Y, sampling_rate=True)


def test_what_lies_under_a_mask_is_not_read() -> None:
    masked = np.ma.masked_array(Y, mask=Y > 2)
    for values in (masked, [masked[0], masked[Y.max(axis=1).argmax()]]):
        with pytest.raises(DataError, match="are masked"):
            ms.Signals(outputs=values, sampling_rate=10.0)
    assert np.array_equal(ms.Signals(outputs=np.ma.masked_array(Y), sampling_rate=10.0).outputs, Y)


@pytest.mark.parametrize("null", ["sampling_rate", "outputs", "attribute"])
def test_a_null_dataset_holds_nothing(null: str, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["outputs"] = h5py.Empty("f8") if null == "outputs" else Y
        file["sampling_rate"] = h5py.Empty("f8") if null == "sampling_rate" else 10.0
        if null == "attribute":
            file["outputs"].attrs["fs"] = h5py.Empty("f8")
    if null == "attribute":
        assert ms.read(tmp_path / "a.h5").samples == 300
        return
    with pytest.raises(DataError, match=f"{null} are missing|outputs") as refused:
        ms.read(tmp_path / "a.h5")
    assert "'sampling_rate': 'sampling_rate'" not in str(refused.value)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("packed", [5, "blosc", [3], {"id": 5}, True, {"configuration": 3}])
def test_compressors_that_are_no_names_are_damage(version: int, packed: Any, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    test_stored.zarr_folder(tmp_path / "a.zarr", np.ones((50, test_stored.CHANNELS)), zarr_format=version)
    for head in (*tmp_path.rglob(".zarray"), *tmp_path.rglob("zarr.json")):
        said = json.loads(head.read_text("utf-8"))
        if "shape" in said:
            head.write_text(json.dumps(said | ({"compressor": packed} if version == 2 else {"codecs": packed})))
    with pytest.raises(DataError, match="as Zarr"):
        ms.read(tmp_path / "a.zarr")


@pytest.mark.parametrize("names", ["3", {"chunk_grid": 3}, {"attributes": [3]}])
def test_a_head_of_another_kind_is_damage(names: Any, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    test_stored.zarr_folder(tmp_path / "a.zarr", np.ones((50, test_stored.CHANNELS)), zarr_format=3)
    for head in tmp_path.rglob("zarr.json"):
        said = json.loads(head.read_text("utf-8"))
        head.write_text(json.dumps(said | names if isinstance(names, dict) else names))
    assert ending(tmp_path / "a.zarr")["how"] == "DataError"


def test_columns_of_0_and_1_are_no_times(tmp_path: Path) -> None:
    """Directions of sensors: they begin at 0, end at 1, and fall as often as they rise."""
    column = np.random.default_rng(1).integers(0, 2, 24).astype(float)
    column[[0, -1]] = 0, 1
    with pytest.raises(DataError, match="they fall as often as they rise"):
        sampling_of(column)
    np.savetxt(tmp_path / "directions.txt", np.column_stack([column, 1 - column, column]), fmt="%d", delimiter="\t")
    with pytest.raises(DataError, match="needs a column of measured values"):
        ms.read(tmp_path / "directions.txt")
