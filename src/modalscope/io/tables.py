"""Read geometry from the small text tables of operational modal analysis programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modalscope.data import DataError, Geometry
from modalscope.numerics.checks import Array

#: Characters of a cell, at most: in an array each takes the width of the longest.
_LONGEST = 400

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def geometry_from_tables(folder: str | Path, *, background: bool = True) -> Geometry:
    """Return the geometry that a folder of text tables describes, with the motion of every channel.

    Parameters
    ----------
    folder : path
        Tables parted by blanks or tabs: `pts_coord.txt` (header; point, x, y, z), `sens_map.txt` (header; point, and for each
        of x, y, z the channel that moves it, 0 for none), `sens_sign.txt` (the same shape, signs), and where present
        `sens_lines.txt` (pairs of point numbers to join). With `background` also `BG_nodes.txt` (x, y, z) and `BG_lines.txt`
        (pairs of row numbers): the still outline of the structure, whose nodes are called B1, B2, ...
    background : bool
        Whether to take the outline.

    Returns
    -------
    Geometry
        Its `motions` hold the channels' own names, so that records need these as `output_dofs`.

    Raises
    ------
    DataError
        A table is missing, ragged or names points that are not there.
    """
    place = Path(folder)
    points, coordinates = _named(place / "pts_coord.txt")
    if coordinates.shape[1] != 3:
        raise _wrong(
            place / "pts_coord.txt", "point, x, y and z in every row", f"there are {coordinates.shape[1] + 1} columns"
        )
    positions = _numbers(place / "pts_coord.txt", coordinates)
    lines = [[points[i] for i in row] for row in _pairs(place / "sens_lines.txt", len(points))]
    nodes = list(points)
    if background and (place / "BG_nodes.txt").exists():
        outline = _numbers(place / "BG_nodes.txt", np.array(_rows(place / "BG_nodes.txt"))).reshape(-1, 3)
        nodes += [f"B{i + 1}" for i in range(len(outline))]
        lines += [[f"B{i + 1}" for i in row] for row in _pairs(place / "BG_lines.txt", len(outline))]
        positions = np.vstack([positions, outline])
    return Geometry(nodes=nodes, coordinates=positions, lines=lines or None, motions=_motions(place, points))  # type: ignore[arg-type]


def _motions(place: Path, points: list[str]) -> dict[str, list[tuple[str, tuple[float, ...]]]]:
    header = _rows(place / "sens_map.txt")[0][1:]
    mapped, channels = _named(place / "sens_map.txt")
    signed, signs = _named(place / "sens_sign.txt")
    unknown = sorted(set(mapped) - set(points))
    if unknown or signed != mapped or signs.shape != channels.shape or not set(header) <= set(_AXES):
        raise _wrong(
            place / "sens_map.txt",
            "the points of pts_coord.txt, columns x, y, z, and sens_sign.txt of the same shape",
            f"unknown points: {', '.join(unknown) or 'none'}",
        )
    factors = _numbers(place / "sens_sign.txt", signs)
    motions: dict[str, list[tuple[str, tuple[float, ...]]]] = {}
    for point, row, sign in zip(mapped, channels, factors, strict=True):
        for axis, channel, factor in zip(header, row, sign, strict=True):
            if channel != "0":
                vector = tuple(float(factor) * part for part in _AXES[axis])
                motions.setdefault(str(channel), []).append((point, vector))
    return motions


def _rows(path: Path) -> list[list[str]]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _wrong(path, "a text table", str(getattr(error, "strerror", None) or "it is not text").lower()) from None
    rows = [line.split() for line in text.splitlines() if line.strip()]
    if not rows or len({len(row) for row in rows}) != 1:
        raise _wrong(path, "rows of equal length", f"their lengths are {sorted({len(row) for row in rows})[:6]}")
    longest = max(len(cell) for row in rows for cell in row)
    if longest > _LONGEST:
        raise _wrong(path, f"cells of at most {_LONGEST} characters", f"the longest has {longest}")
    return rows


def _named(path: Path) -> tuple[list[str], Array]:
    rows = _rows(path)[1:]
    return [row[0] for row in rows], np.array([row[1:] for row in rows], dtype=np.str_)


def _numbers(path: Path, cells: Array) -> Array:
    try:
        return cells.astype(float)
    except ValueError as error:
        raise _wrong(path, "numbers", str(error)) from None


def _pairs(path: Path, count: int) -> list[list[int]]:
    """Return rows of two numbers from 1 to count as indices; none when there is no such table."""
    if not path.exists():
        return []
    pairs = _numbers(path, np.array(_rows(path)))
    if pairs.shape[1] != 2 or pairs.min() < 1 or pairs.max() > count or np.any(pairs != np.rint(pairs)):
        raise _wrong(
            path, f"pairs of numbers from 1 to {count}", f"they lie between {pairs.min():g} and {pairs.max():g}"
        )
    return [[int(a) - 1, int(b) - 1] for a, b in pairs]


def _wrong(path: Path, asked: str, found: str) -> DataError:
    return DataError(f"the table {path} needs {asked}", found, "Correct or add the table.")
