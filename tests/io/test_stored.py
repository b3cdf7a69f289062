"""Records in HDF5 and Zarr that stay there: the same numbers, and nothing read that cannot be or that is not there."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.io import read, survey, write
from modalscope.numerics.errors import DataError

h5py = pytest.importorskip("h5py")

RATE, SAMPLES, CHANNELS = 20.0, 5000, 3
LABELS = ["a:+Z", "b:+Z", "c:-X"]


@pytest.fixture(scope="module")
def samples() -> Any:
    return np.random.default_rng(1).standard_normal((SAMPLES, CHANNELS))


def hdf5(path: Path, samples: Any, **layout: Any) -> Path:
    with h5py.File(path, "w") as file:
        file.create_dataset("outputs", data=samples, **layout)
        file["sampling_rate"] = RATE
        file["output_dofs"] = LABELS
    return path


def zarr_folder(path: Path, samples: Any, **layout: Any) -> Path:
    zarr = pytest.importorskip("zarr", reason="zarr is not installed: pip install 'modalscope[zarr]'")
    group = zarr.open_group(path, mode="w", **{k: layout.pop(k) for k in ("zarr_format",) if k in layout})
    array = group.create_array("outputs", shape=samples.shape, chunks=(700, CHANNELS), dtype=samples.dtype, **layout)
    array[...] = samples
    group.attrs["sampling_rate"] = RATE
    group.attrs["output_dofs"] = LABELS
    group.attrs["by"] = "a laboratory"
    return path


def files(folder: Path, samples: Any) -> list[Path]:
    made = [
        hdf5(folder / "whole.h5", samples),
        hdf5(folder / "packed.h5", samples, chunks=(700, 2), compression="gzip"),
    ]
    made += [zarr_folder(folder / "three.zarr", samples), zarr_folder(folder / "two.zarr", samples, zarr_format=2)]
    return [*made, zarr_folder(folder / "single.zarr", samples.astype(np.float32))]


@pytest.mark.slow
def test_a_stored_record_is_the_record(tmp_path: Path, samples: Any) -> None:
    for path in files(tmp_path, samples):
        stored, whole = read(path, stored=True, quantity="velocity"), read(path, quantity="velocity")
        assert isinstance(stored, ms.StoredSignals)
        assert isinstance(whole, ms.Signals)
        assert (stored.samples, stored.sampling_rate, stored.output_dofs) == (SAMPLES, RATE, whole.output_dofs)
        assert stored.quantities == ("velocity",) * CHANNELS
        assert stored.source_path == path.absolute()
        np.testing.assert_array_equal(stored.load().outputs, whole.outputs)
        np.testing.assert_array_equal(stored.chunk(690, 1405), whole.outputs[690:1405])
        np.testing.assert_array_equal(stored.select(outputs=["c:-X"]).chunk(4990, 9999)[:, 0], whole.outputs[4990:, 2])
        found, expected = (ms.estimate_correlation(each, lags=30).values for each in (stored, whole))
        np.testing.assert_allclose(found, expected, atol=1e-12)
        again = pickle.loads(pickle.dumps(stored))  # workers are sent it
        np.testing.assert_array_equal(again.chunk(0, 10), whole.outputs[:10])
        assert "stored records: 5000 samples at 20 Hz" in survey(path, stored=True).result


def test_a_record_that_is_large_beside_the_memory_stays_in_its_file(
    tmp_path: Path, samples: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in files(tmp_path, samples):
        assert isinstance(read(path), ms.Signals)
    monkeypatch.setattr("modalscope.numerics.resources._allowed", 3 * samples.nbytes)
    for path in (tmp_path / "whole.h5", tmp_path / "three.zarr"):
        assert isinstance(read(path), ms.StoredSignals)
        assert isinstance(read(path, stored=False), ms.Signals)


def test_rate_and_units_may_come_from_elsewhere(tmp_path: Path, samples: Any) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["y"] = samples
        file["time"] = np.arange(SAMPLES) / RATE
    stored = read(tmp_path / "a.h5", stored=True, rename={"y": "outputs"}, units="g")
    assert stored.sampling_rate == pytest.approx(RATE)
    from modalscope.data.units import si_form

    turned, notes = si_form(stored)
    assert "converted to SI" in str(notes[0])
    np.testing.assert_allclose(turned.chunk(5, 9), 9.80665 * samples[5:9])
    assert turned.quantities == ("acceleration",) * CHANNELS
    with pytest.raises(DataError, match="expected FrequencyResponse, "):
        write(tmp_path / "b.npz", stored)


def test_the_command_finds_the_modes_of_a_stored_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = ms.systems.chain5().simulate(inputs="ambient", duration=200.0, sampling_rate=25.0, seed=0)
    path = zarr_folder(tmp_path / "big.zarr", made.outputs[:, :CHANNELS])
    with (path / "zarr.json").open("r+") as file:
        head = json.load(file)
        head["attributes"]["sampling_rate"] = 25.0
        file.seek(0)
        json.dump(head, file)
        file.truncate()
    monkeypatch.setattr("modalscope.io.stored._PARTS_OF_MEMORY", 10**9)  # it counts as large
    from modalscope.interfaces.cli import main

    assert main(["identify", str(path), "--orders", "10:30:10", "-o", str(tmp_path / "modes.json"), "--no-refine"]) == 0
    printed = capsys.readouterr()
    assert len(read(tmp_path / "modes.json")) >= 4
    assert "Hz" in printed.out


@pytest.mark.parametrize("kind", ["missing piece", "code that runs", "vast pieces", "no JSON", "a file"])
def test_folders_that_cannot_be_are_refused(tmp_path: Path, samples: Any, kind: str) -> None:
    path = zarr_folder(tmp_path / "a.zarr", samples, zarr_format=2)
    head = path / "outputs" / ".zarray"
    told = json.loads(head.read_text())
    said = {
        "missing piece": "1 of its 8 pieces are missing",
        "code that runs": "it is packed by pickle",
        "vast pieces": "it comes in pieces of the shape",
        "no JSON": "is no JSON",
        "a file": "it is a file",
    }[kind]
    if kind == "missing piece":
        next(each for each in (path / "outputs").iterdir() if each.name.startswith("3")).unlink()
    elif kind == "a file":
        path = tmp_path / "b.zarr"
        path.write_bytes(b"PK")
    else:
        told |= {"filters": [{"id": "pickle"}]} if kind == "code that runs" else {"chunks": [10**9, 3]}
        head.write_text("{" if kind == "no JSON" else json.dumps(told))
    for options in ({}, {"stored": True}):
        with pytest.raises(DataError, match=said):
            read(path, **options)


def test_pieces_that_are_damaged_are_found_where_they_are_read(tmp_path: Path, samples: Any) -> None:
    path = zarr_folder(tmp_path / "a.zarr", samples)
    piece = path / "outputs" / "c" / "3" / "0"
    piece.write_bytes(piece.read_bytes()[:50])
    stored = read(path, stored=True)
    assert stored.chunk(0, 700).shape == (700, CHANNELS)
    with pytest.raises(DataError, match="reading samples 2000 to 2799 of outputs"):
        stored.chunk(2000, 2800)


def test_hdf5_records_that_cannot_be_are_refused(tmp_path: Path, samples: Any) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("outputs", shape=(10**7, 3), chunks=(10**5, 3), dtype=float)
        file["sampling_rate"] = RATE
    with pytest.raises(DataError, match="100 of the 100 pieces of /outputs are missing"):
        read(tmp_path / "a.h5", stored=True)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        file["outputs"], file["inputs"], file["sampling_rate"] = samples, samples[:, :1], RATE
    with pytest.raises(DataError, match="it holds inputs"):
        read(tmp_path / "b.h5", stored=True)
    assert isinstance(read(tmp_path / "b.h5", stored=True, ignore=["inputs"]), ms.StoredSignals)
    with pytest.raises(DataError, match="stored"):
        read(tmp_path / "b.h5", stored="yes")


def test_a_codec_with_an_unknown_option_is_damage_of_the_file(tmp_path: Path) -> None:
    """The package passes what stands there as an argument; an attack found it."""
    folder = tmp_path / "a.zarr"
    zarr_folder(folder, np.ones((1500, CHANNELS)), zarr_format=2)
    for head in folder.rglob(".zarray"):
        head.write_text(head.read_text().replace('"shuffle"', '"shZffle"'))
    with pytest.raises(DataError, match="damaged or of another kind"):
        ms.read(folder)
