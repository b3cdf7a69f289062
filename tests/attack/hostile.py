"""A folder as a stranger may send it: every way in which a file of it can name another one leads to a secret beside the folder.

`python -m tests.attack.hostile made PLACE` writes it; `run PLACE NOTE` runs every command on it and notes in a file what Python opens, and
`show PLACE` opens all of it on the page. `strace -f -e trace=open,openat,openat2,creat` before these also tells what libraries and other
processes open.
"""

from __future__ import annotations

import json
import os
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

import modalscope as ms
from tests.io import ordinary

LINES = ms.systems.chain5().frequency_response(np.linspace(0.2, 8, 120), quantity="acceleration", noise=0.02, seed=1)
RECORD = ms.systems.chain5().simulate(samples=600, sampling_rate=20.0, noise=0.02, seed=0)
POINTS = "node,x,y,z\n" + "".join(f"{k},{k},0,0\n" for k in range(1, 6))
MESH = "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n"


def secrets(place: Path) -> Path:
    """Write what nothing may open."""
    place.mkdir()
    (place / "points.csv").write_text(POINTS)
    (place / "mesh.inp").write_text(MESH)
    (place / "mesh.bdf").write_text("GRID,1,,0.,0.,0.\n")
    ms.write(place / "data.npz", LINES)
    ms.write(place / "data.h5", RECORD)
    (place / "raw").write_bytes(np.ones(4000).tobytes())
    (place / "c").mkdir()
    (place / "c" / "0").write_bytes(np.ones((600, 2)).tobytes())
    return place


def hostile(folder: Path, outside: Path) -> Path:
    """Write the folder."""
    folder.mkdir()
    ms.write(folder / "data.npz", LINES)
    ms.write(folder / "x.analysis.json", ms.analyze(folder / "data.npz", orders=[8, 10]).analysis)
    up = os.path.relpath(outside, folder)
    (folder / "link.csv").symlink_to(outside / "points.csv")
    geometries: list[Any] = [str(outside / "points.csv"), f"{folder}/{up}/points.csv", [str(folder / "link.csv")]]
    geometries += [str(outside / "mesh.inp"), [str(outside / "points.csv"), str(outside / "points.csv")]]
    for k, geometry in enumerate(geometries):
        _document(folder, f"geometry{k}", reading={"geometry": geometry})
    for k, path in enumerate(
        (outside / "data.npz", outside / "data.h5", f"{up}/data.npz", "/etc/hostname", "/dev/zero")
    ):
        _document(folder, f"path{k}", path=str(path))
    (folder / "include.inp").write_text(f"{MESH}*INCLUDE, INPUT={up}/mesh.inp\n")
    (folder / "input.inp").write_text(f"*NODE, INPUT={outside}/mesh.inp\n")
    (folder / "include.bdf").write_text(f"BEGIN BULK\nINCLUDE '{up}/mesh.bdf'\nGRID,1,,0.,0.,0.\nENDDATA\n")
    (folder / "list.vtu").write_text(f'<VTKFile type="PUnstructuredGrid"><Piece Source="{outside}/a.vtu"/></VTKFile>')
    entity = f'<!DOCTYPE x [<!ENTITY s SYSTEM "file://{outside}/points.csv">]>'
    (folder / "entity.vtu").write_text(f'<?xml version="1.0"?>{entity}<VTKFile type="UnstructuredGrid">&s;</VTKFile>')
    for suffix in (".h5", ".mat", ".nc", ".med"):
        _of_hdf5(folder / f"links{suffix}", outside)
    _workbook(folder / "book.xlsx", entity)
    _store(folder / "a.zarr", outside)
    return folder


def _document(folder: Path, name: str, **changed: Any) -> None:
    """Write the document with other entries of its file."""
    kept = json.loads((folder / "x.analysis.json").read_text())
    kept["analysis"]["files"][0] |= changed
    (folder / f"{name}.analysis.json").write_text(json.dumps(kept))


def _of_hdf5(path: Path, outside: Path) -> None:
    """Write links, raw data and virtual parts that lie in other files."""
    import h5py  # an extra

    with h5py.File(path, "w", userblock_size=512 if path.suffix == ".mat" else 0) as file:
        file["time"] = np.arange(500) / 20
        file["sampling_rate"] = 20.0
        file["outputs"] = h5py.ExternalLink(str(outside / "data.h5"), "/outputs")
        file["ENS_MAA"] = h5py.ExternalLink(str(outside / "data.h5"), "/")
        file.create_dataset("raw", (500,), float, external=[(str(outside / "raw"), 0, 4000)])
        layout = h5py.VirtualLayout((500,), float)
        layout[:] = h5py.VirtualSource(str(outside / "data.h5"), "outputs", (600, 5))[:500, 0]
        file.create_virtual_dataset("virtual", layout)
        for name in ("raw", "virtual"):
            file[name].dims[0].attach_scale(_scale(file["time"]))
    if path.suffix == ".mat":
        with path.open("r+b") as raw:
            raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def _scale(dataset: Any) -> Any:
    if not dataset.is_scale:
        dataset.make_scale("time")
    return dataset


def _workbook(path: Path, entity: str) -> None:
    """Write a workbook whose text is an entity of another file."""
    whole = path.with_name("whole.xlsx")
    ordinary.CASES["a workbook with units and a title"].write(whole)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "xl/worksheets/sheet1.xml":
                data = f'<?xml version="1.0"?>{entity}'.encode() + data.replace(b"<v>", b"<v>&s;", 1)
            new.writestr(name, data)
    whole.unlink()


def _store(path: Path, outside: Path) -> None:
    """Write a Zarr folder of which a piece is a link."""
    piece = path / "outputs" / "c"
    piece.mkdir(parents=True)
    codecs = [{"name": "bytes", "configuration": {"endian": "little"}}]
    grid = {"name": "regular", "configuration": {"chunk_shape": [600, 2]}}
    head = {"zarr_format": 3, "node_type": "array", "shape": [600, 2], "data_type": "float64", "chunk_grid": grid}
    keys = {"name": "default", "configuration": {"separator": "/"}}
    head |= {"chunk_key_encoding": keys, "fill_value": 0.0, "codecs": codecs, "attributes": {}}
    (path / "outputs" / "zarr.json").write_text(json.dumps(head))
    group = {"zarr_format": 3, "node_type": "group", "attributes": {"sampling_rate": 20.0}}
    (path / "zarr.json").write_text(json.dumps(group))
    (piece / "0").symlink_to(outside / "c", target_is_directory=True)


def commands(folder: Path, output: Path) -> list[list[str]]:
    """Return command lines that meet every file of the folder; a link, or a hash that is asked for, is for the user to name."""
    told = [path for path in sorted(folder.iterdir()) if not path.is_symlink() and not path.name.startswith("path")]
    data = [path for path in told if not path.name.endswith(".analysis.json")]
    lines = [["info", str(path)] for path in data]
    lines += [["identify", str(path), "--orders", "8:10:2", "-o", str(output / "a.json")] for path in data]
    lines += [["identify", str(path), "-o", str(output / "a.json")] for path in told if path not in data]
    return lines + [
        ["identify", str(folder / "data.npz"), "--geometry", str(path), "--orders", "8:10:2"] for path in data
    ]


def made(place: Path) -> None:
    """Write the folder, the secrets and a folder of results at a place."""
    place.mkdir(parents=True)
    hostile(place / "folder", secrets(place / "outside"))
    (place / "out").mkdir()


def run(place: Path, note: Path) -> None:
    """Run every command on the folder at a place, and note what Python opens."""
    from modalscope.interfaces.cli import main

    with note.open("w") as told:

        def watch(event: str, given: tuple[Any, ...]) -> None:
            if event == "open" and isinstance(given[0], str | bytes):
                told.write(f"{os.path.realpath(os.fsdecode(given[0]))}\n")

        sys.addaudithook(watch)
        for line in commands(place / "folder", place / "out"):
            print(line, main(line), flush=True)
        told.flush()
        os._exit(0)  # the hook stays with the process


def show(place: Path) -> None:
    """Open every file of the folder on the page, and wait for what is computed of it."""
    from tests.interfaces.app.server import served

    with served(place / "folder", place / "out" / "page") as server:
        for path in sorted((place / "folder").iterdir()):
            status, _, told = server.request("POST", "/api/open", {"files": [path.name]})
            print(path.name, status, server.settled(json.loads(told)["key"])["stage"] if status == 200 else told)


if __name__ == "__main__":
    what, where = sys.argv[1], Path(sys.argv[2])
    {"made": made, "show": show, "run": lambda place: run(place, Path(sys.argv[3]))}[what](where)
