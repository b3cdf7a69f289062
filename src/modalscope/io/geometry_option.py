"""The option `geometry` of every format: a Geometry, or the file or files that hold one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from modalscope.io.contents import Contents, Options
from modalscope.io.points import TABLES, geometry_of_tables, joined_by_neighbours
from modalscope.model import DataError, Geometry
from modalscope.model.channels import Channels
from modalscope.model.checks import check_path

__all__ = ["told_of_channels", "with_geometry"]


def with_geometry(options: Options, load: Callable[[Path], Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return options with the geometry itself where a file was named, and what to say of it.

    Parameters
    ----------
    options : mapping
        `geometry`: a Geometry, a path, or paths of points and lines.
    load : callable
        Reads a file that is no table.

    Raises
    ------
    DataError
        A file that is not there, or holds no geometry.
    """
    given = options.get("geometry")
    if given is None or isinstance(given, Geometry):
        return dict(options), ()
    paths = [given] if isinstance(given, str | Path) else list(given) if isinstance(given, list | tuple) else []
    if not 1 <= len(paths) <= 2:
        raise DataError(
            f"geometry={given!r} was asked",
            "it is no Geometry, path, or pair of paths of points and lines",
            'Give geometry="points.csv" or geometry=("points.csv", "lines.csv").',
        )
    points, *lines = (check_path(path) for path in paths)
    missing = next((path for path in (points, *lines) if not path.is_file()), None)
    if missing is not None:
        raise DataError(
            f"the geometry in {missing.name} was asked", "there is no such file", "Check the name and the folder."
        )
    if points.suffix.lower() in TABLES:
        found: Any = geometry_of_tables(points, lines[0] if lines else None)
    else:
        found = load(points)
        found = found if isinstance(found, Geometry) else getattr(found, "geometry", None)
    if found is None:
        raise DataError(
            f"a geometry from {points.name} was asked",
            "it holds none",
            "Give a table of points: node,x,y,z, or another file.",
        )
    geometry, notes = joined_by_neighbours(found)
    return {**options, "geometry": geometry}, notes


def told_of_channels(contents: Contents) -> Contents:
    """Return contents that say which channels have no place in the geometry.

    Parameters
    ----------
    contents : Contents
        Of data with their geometry.
    """
    thing = contents.thing
    if not isinstance(thing, Channels) or thing.geometry is None:
        return contents
    lost = [label for label in thing.output_dofs if not thing.geometry.motion_of(label)]
    if not lost:
        return contents
    note = (
        f"{len(lost)} of {len(thing.output_dofs)} channels have no node and direction in the geometry: {', '.join(lost[:6])}; "
        "name channels as 3:+Z, or add columns channel and direction to the table of points"
    )
    return replace(contents, notes=(*contents.notes, note))
