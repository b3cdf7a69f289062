"""Fit the shapes of all outputs of stored responses and write them piece by piece (full-field measurements)."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.analysis.workflow.shapes import fitted_shapes
from modalscope.data.modes import ModalModel
from modalscope.data.stored import StoredResponse
from modalscope.io.zarr import modes_in_pieces
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray, check_kind, check_path
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class FullField:
    """Result of `full_field`.

    Parameters
    ----------
    path : Path
        A Zarr folder of modes, which `read` takes.
    outputs, modes : int
    fit_error : float
        norm(measured - rebuilt) / norm(measured) over all outputs.
    fit_errors : array, (outputs,)
        The same of each output.
    """

    path: Path
    outputs: int
    modes: int
    fit_error: float
    fit_errors: RealArray


@named()
@one_thread
def full_field(
    modes: ModalModel, data: StoredResponse, path: str | Path, *, progress: Progress | None = None
) -> FullField:
    """Write the shapes of all outputs of stored responses to a Zarr folder, piece by piece.

    Poles and participation are those of the modes; every output is fitted by least squares, in one pass over the file.

    Parameters
    ----------
    modes : ModalModel
        Identified from the responses: their own shapes are not used.
    data : StoredResponse
    path : path
        A folder `.zarr` that is not there yet.
    progress : callable, optional
        Called with how many outputs are done, and of how many.

    Raises
    ------
    DataError
        A folder that is there, modes without participation or in other inputs, responses that do not read.
    """
    check_kind("full_field", modes, ModalModel)
    check_kind("full_field", data, StoredResponse)
    folder = _new_folder(check_path(path))
    pending, left, whole, outputs = folder.with_name(f".{folder.name}.part"), 0.0, 0.0, len(data.output_dofs)
    shutil.rmtree(pending, ignore_errors=True)
    try:
        shapes, errors = modes_in_pieces(pending, modes, data), np.empty(outputs)
        for found in fitted_shapes(data, modes):
            shapes[found.outputs] = found.shapes
            with np.errstate(divide="ignore", invalid="ignore"):
                errors[found.outputs] = np.sqrt(found.left / found.whole)
            left, whole = left + float(found.left.sum()), whole + float(found.whole.sum())
            if progress is not None:
                progress(found.outputs.stop, outputs)
        pending.replace(folder)
    except OSError as error:
        have = f"the system refuses: {error.strerror or error}"
        raise DataError(f"writing {folder}:", have, "Choose another place.") from None
    finally:
        shutil.rmtree(pending, ignore_errors=True)
    return FullField(folder, outputs, len(modes), float(np.sqrt(left / whole)) if whole else 0.0, errors)


def _new_folder(path: Any) -> Path:
    target = Path(path)
    if target.suffix.lower() != ".zarr" or target.exists():
        found = "it is there already" if target.exists() else "it does not end in .zarr"
        raise DataError(f"shapes in the folder {target.name}:", found, "Name a new folder, shapes.zarr.")
    if not target.parent.is_dir():
        raise DataError(f"writing {target}:", f"there is no folder {target.parent}", "Make it first.")
    return target
