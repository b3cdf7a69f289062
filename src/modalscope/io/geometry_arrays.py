"""A geometry out of named arrays: nodes, coordinates, and lines and faces as indices into the nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.model import DataError, Geometry

__all__ = ["damaged", "geometry_of_arrays"]


def damaged(where: str, found: str) -> DataError:
    """Return the error about fields that no data object can be made of."""
    return DataError(f"reading {where} was asked", f"its fields are damaged ({found})", "Write the file again.")


def geometry_of_arrays(where: str, values: dict[str, Any]) -> Geometry:
    """Return the geometry of arrays by their names in the layout.

    Parameters
    ----------
    where : str
        The file, for messages.
    values : dict
        `geometry_nodes`, `geometry_coordinates`, and where present `geometry_lines`, `geometry_faces`, `geometry_motions`.

    Raises
    ------
    DataError
        An array is missing, or counts nodes that are not there.
    """
    nodes = values.get("geometry_nodes")
    if nodes is None or values.get("geometry_coordinates") is None:
        raise DataError(
            "a geometry needs geometry_nodes and geometry_coordinates",
            f"there are {', '.join(values)}",
            "Add the missing array.",
        )
    named: dict[str, Any] = {}
    for key in ("lines", "faces"):
        index = np.asarray(values.get(f"geometry_{key}", np.zeros((0, 2), int)))
        if index.size and (
            index.ndim != 2
            or index.dtype.kind not in "iuf"
            or index.min() < 0
            or index.max() >= len(nodes)
            or np.any(index != np.rint(index))
        ):
            raise DataError(
                f"geometry_{key} needs indices 0 to {len(nodes) - 1} into the nodes",
                f"they reach from {index.min()} to {index.max()}",
                "Count nodes from 0.",
            )
        named[key] = [[nodes[int(i)] for i in row] for row in index] or None
    motions = values.get("geometry_motions")
    try:
        return Geometry(nodes=nodes, coordinates=values["geometry_coordinates"], motions=motions or {}, **named)
    except DataError:
        raise
    except (TypeError, AttributeError, OverflowError, ValueError) as error:
        raise damaged(where, f"geometry: {error}") from None
