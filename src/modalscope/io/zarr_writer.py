"""Modes in a Zarr folder whose shapes are written piece by piece."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from modalscope.io.arrays import to_arrays
from modalscope.model.channels import Channels
from modalscope.model.extras import optional_package
from modalscope.model.modes import ModalModel

__all__ = ["modes_in_pieces"]

#: Numbers in a piece of the shapes.
_PIECE = 1_000_000

#: Arrays that belong to the outputs that modes were identified with.
_OF_OUTPUTS = ("output_dofs", "shapes", "shapes_std", "output_units", "feedthrough", "lower_residual", "upper_residual")

#: Texts that stand as attributes, and what is left out: what the modes were before, and where their own outputs are.
_TEXTS, _LEFT = ("input_dofs", "processing", "quantity"), ("unrefined_", "geometry_")


def modes_in_pieces(folder: Path, modes: ModalModel, channels: Channels) -> Any:
    """Return the array of the shapes, to be filled, in a new Zarr folder with all else of some modes.

    Parameters
    ----------
    folder : path
        Not there yet.
    modes : ModalModel
    channels : Channels
        Whose outputs the shapes will have.
    """
    zarr = optional_package(f"writing {folder.suffix}", "zarr", "zarr")
    group, outputs = zarr.open_group(str(folder), mode="w"), len(channels.output_dofs)
    plain = {name: array for name, array in to_arrays(modes).items() if not name.startswith(_LEFT)}

    def made(name: str, shape: tuple[int, ...], piece: tuple[int, ...], kind: Any, **more: Any) -> Any:
        # pieces of zeros are written, too: one that is not there is damage
        whole = {"write_empty_chunks": True}
        return group.create_array(name, shape=shape, chunks=piece, dtype=kind, config=whole, **more)

    for name, array in plain.items():
        if name not in _OF_OUTPUTS and array.dtype.kind in "biufc":
            made(name, array.shape, tuple(max(n, 1) for n in array.shape), array.dtype)[...] = array
    group.attrs.update({name: plain[name].tolist() for name in _TEXTS if name in plain})
    labels = np.asarray(channels.output_dofs, dtype=np.dtypes.StringDType())
    made("output_dofs", labels.shape, (_PIECE,), str)[...] = labels
    count = max(len(modes), 1)
    return made("shapes", (outputs, len(modes)), (max(_PIECE // count, 1), count), complex, compressors=None)
