"""A document, or a folder of data, may be a stranger's: what it names outside is not read unless that is said."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import modalscope as ms
from modalscope.interfaces.cli import main
from modalscope.io.beside import OPENING, lies_in
from modalscope.io.formats import FORMATS

LINES = ms.systems.chain5().frequency_response(np.linspace(0.2, 8, 120), quantity="acceleration", noise=0.02, seed=1)
POINTS = "node,x,y,z\n" + "".join(f"{k},{k},0,0\n" for k in range(1, 6))


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Return a folder with data, a document of them, and a table of points; another table lies outside."""
    inside = tmp_path / "inside"
    inside.mkdir()
    ms.write(inside / "data.npz", LINES)
    for folder in (inside, tmp_path):
        (folder / "points.csv").write_text(POINTS)
    ms.write(inside / "x.analysis.json", ms.analyze(inside / "data.npz", orders=[10]).analysis)
    return inside


def with_file(place: Path, **changed: Any) -> Path:
    """Return the document with other entries of its file."""
    path = place / "x.analysis.json"
    kept = json.loads(path.read_text())
    kept["analysis"]["files"][0] |= changed
    path.write_text(json.dumps(kept))
    return path


def notes_of(result: ms.Result) -> list[str]:
    return [note.text for note in result.notes if note.kind == "outside"]


def test_a_geometry_outside_is_not_read_and_a_note_names_the_option(place: Path) -> None:
    outside = place.parent / "points.csv"
    document = with_file(place, reading={"geometry": str(outside)})
    allowed = ms.replay(document, allow_outside=True)
    first = ms.replay(document)
    assert first.data.geometry is None or first.data.geometry.nodes != allowed.data.geometry.nodes
    (note,) = notes_of(first)
    assert "points.csv lies outside" in note
    assert "to read it: --allow-outside" in note
    (place / "link.csv").symlink_to(outside)
    assert notes_of(ms.replay(with_file(place, reading={"geometry": [str(place / "link.csv")]})))
    assert len(allowed.data.geometry.nodes) == 5
    assert not notes_of(allowed)
    np.testing.assert_array_equal(allowed.modes.poles, first.modes.poles)


def test_a_geometry_beside_the_document_or_the_data_is_read(place: Path, tmp_path: Path) -> None:
    document = with_file(place, reading={"geometry": str(place / "points.csv")})
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for folder in (place, elsewhere):
        result = ms.replay(document.rename(folder / document.name))
        assert len(result.data.geometry.nodes) == 5
        assert not notes_of(result)


def test_data_with_a_geometry_from_outside_are_those_that_were_analysed(place: Path) -> None:
    for outside in (place / "points.csv", place.parent / "points.csv"):
        result = ms.analyze(place / "data.npz", orders=[10], reading={"geometry": str(outside)})
        data = ms.read(place / "data.npz", geometry=outside)
        again = ms.replay(result.analysis, data)
        np.testing.assert_array_equal(again.modes.poles, result.modes.poles)
        notes = notes_of(again)
        assert bool(notes) == (outside.parent != place)
        assert all("Geometry not compared: points.csv lies outside" in note for note in notes)
        assert not notes_of(ms.replay(result.analysis, data, allow_outside=True))
        with pytest.raises(ms.DataError, match="hash differs"):
            ms.replay(result.analysis, replace(data, values=data.values * 2), allow_outside=outside.parent == place)
    bare = ms.read(place / "data.npz")
    with pytest.raises(ms.DataError, match="hash differs"):  # where the geometry may be compared it is
        ms.replay(result.analysis, bare, allow_outside=True)


def test_data_in_other_units_are_those_that_were_analysed(tmp_path: Path) -> None:
    rows = np.column_stack([np.arange(400) / 20, np.random.default_rng(0).standard_normal((400, 2))])
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="Time [s],Force [N],Acc [g]", comments="")
    result = ms.analyze(tmp_path / "a.csv", orders=[4, 6])
    data = ms.read(tmp_path / "a.csv")
    assert data.units[0] == ("g",)
    assert len(ms.replay(result.analysis, data).modes) == len(result.modes)


def test_certify_reads_outside_where_that_is_said(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []

    def told(*_: Any, allow_outside: bool, **__: Any) -> None:
        asked.append(allow_outside)
        raise ms.DataError("replay:", "this is enough", "End.")

    monkeypatch.setattr("modalscope.analysis.checking.certify.replay", told)
    for allowed in (False, True):
        with pytest.raises(ms.DataError, match="this is enough"):
            ms.certify(place / "x.analysis.json", allow_outside=allowed)
    assert asked == [False, True]


def test_the_options_of_the_command_line_say_the_same(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = with_file(place, reading={"geometry": str(place.parent / "points.csv")})
    for command in (["identify"], ["certify", "--replicates", "2"]):
        main([*command, str(document), "-v"])
        assert "Geometry not read" in capsys.readouterr().out or command == ["certify", "--replicates", "2"]
        assert main([*command, str(document), "--allow-outside", "-v"]) == 0
        assert "Geometry not read" not in capsys.readouterr().out


def test_data_of_another_hash_are_not_even_read(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    secret = place.parent / "secret.csv"
    secret.write_text("not for you\n")
    document = with_file(place, path=str(secret))
    read: list[Any] = []
    opened = ms.analysis.workflow.replay.opened  # type: ignore[attr-defined]
    monkeypatch.setattr("modalscope.analysis.workflow.replay.opened", lambda *a, **k: read.append(a) or opened(*a, **k))
    with pytest.raises(ms.DataError, match="hash differs"):
        ms.replay(document)
    assert not read
    with pytest.raises(ms.DataError, match=r"secret\.csv"):  # as asked: force is about the hash
        ms.replay(document, force=True)
    assert len(read) == 1


@pytest.mark.parametrize("path", ["/dev/zero", "/", "/none/such.npz"])
def test_what_is_no_file_of_data_is_answered_at_once(place: Path, path: str) -> None:
    with pytest.raises(ms.DataError):
        ms.replay(with_file(place, path=path))


def test_without_a_hash_only_given_data_are_read(place: Path) -> None:
    document = with_file(place, sha256="")
    for force in (False, True):
        with pytest.raises(ms.DataError, match=r"no hash of the file.\n.*replay\(document, data\)"):
            ms.replay(document, force=force, allow_outside=True)
    assert len(ms.replay(document, place / "data.npz").modes) == 5


@pytest.mark.parametrize("reading", [None, [], "geometry", 3])
def test_damaged_options_of_reading_are_refused(place: Path, reading: Any) -> None:
    with pytest.raises(ms.DataError):
        ms.replay(with_file(place, reading=reading))


@pytest.mark.slow
@pytest.mark.parametrize("geometry", [{"a": 1}, 7, [1, 2], "a\0b", "\ud800", "x" * 5000, [["a"]]])
def test_a_geometry_that_is_no_path_is_left_or_refused(place: Path, geometry: Any) -> None:
    for allowed in (False, True):
        try:
            assert notes_of(ms.replay(with_file(place, reading={"geometry": geometry}), allow_outside=allowed))
        except ms.DataError:
            continue


def test_no_other_option_of_reading_opens_a_file(tmp_path: Path) -> None:
    """Each option of each format gets the name of a file that nothing may open: it is a pipe, at which opening waits."""
    options = {name for row in FORMATS.values() for name in row.read_options}
    assert {"columns", "rows", "sheet", "rename"} < options
    trap = tmp_path / "trap.csv"
    os.mkfifo(trap)
    for suffix in (".npz", ".csv", ".mat", ".uff", ".json"):
        path = tmp_path / f"data{suffix}"
        ms.write(path, LINES if suffix != ".json" else ms.analyze(LINES, orders=[10]).modes)
        for name in options - set(OPENING):
            try:
                ms.read(path, **{name: str(trap)})
            except ms.DataError:
                continue


def test_links_of_a_store_that_leave_it_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    import zarr

    store = tmp_path / "x.zarr"
    group = zarr.open_group(str(store), mode="w")
    group.create_array("outputs", shape=(64, 2), chunks=(32, 2), dtype=float)[...] = np.ones((64, 2))
    assert ms.read(store, sampling_rate=8.0).samples == 64
    inner = next(path for path in sorted((store / "outputs").rglob("*")) if path.is_file() and path.suffix != ".json")
    (tmp_path / "secret").write_bytes(inner.read_bytes())
    inner.unlink()
    inner.symlink_to(tmp_path / "secret")
    with pytest.raises(ms.DataError, match="is a link to a file outside of the folder"):
        ms.read(store, sampling_rate=8.0)
    inner.unlink()
    (store / "outputs").rename(tmp_path / "outputs")
    (store / "outputs").symlink_to(tmp_path / "outputs")
    with pytest.raises(ms.DataError, match="outputs is a link"):
        ms.read(store, sampling_rate=8.0)


def test_a_link_within_the_folder_is_inside(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert lies_in(tmp_path / "b" / "c.csv", [tmp_path / "a"])
    assert not lies_in(tmp_path / "ab" / "c.csv", [tmp_path / "a"])
