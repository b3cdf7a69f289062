"""Write a result as a workbook: modes, shapes, MAC and responses, a sheet each, with numbers as numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.indicators import mac
from modalscope.data.rebuilt import rebuilt
from modalscope.data.responses import FrequencyResponse
from modalscope.data.results import Result
from modalscope.numerics.errors import DataError, optional_package, printable
from modalscope.selection.judging.description import columns_of

#: Columns that programs for tables can hold, and channels of responses that are written: a sheet stays readable.
_MAX_COLUMNS, _MAX_CHANNELS = 16_384, 64

#: Width of columns, in characters.
_WIDTH = 15


def write_workbook(path: Path, thing: Any) -> None:
    """Write a result, or modes alone, to an .xlsx file.

    Raises `DataError`: something without modes, more modes or channels than a sheet has columns, or openpyxl is missing.
    """
    modes = thing.modes if isinstance(thing, Result) else thing
    if not isinstance(modes, ModalModel):
        fault = f"{type(thing).__name__} has no modes"
        raise DataError("writing a workbook:", fault, "Write a result or modes; others as .npz or .csv.")
    if 2 * len(modes) + 1 > _MAX_COLUMNS:
        raise DataError("writing a workbook:", f"{len(modes)} modes exceed its columns", "Write .csv or .npz.")
    openpyxl = optional_package("a workbook", "openpyxl", "excel")
    book = openpyxl.Workbook(write_only=True)
    _sheet(book, "modes", _modes(modes))
    _sheet(book, "shapes", _shapes(modes))
    if len(modes) and len(modes.output_dofs) > 1:
        _sheet(book, "MAC", _similarity(modes))
    diagrams: Sequence[StabilizationDiagram] = thing.diagrams if isinstance(thing, Result) else ()
    for k, diagram in enumerate(diagrams):
        shown = diagram.response.picture()
        if isinstance(shown, FrequencyResponse):
            _sheet(book, "responses" if k == 0 else f"responses {k + 1}", _responses(shown, modes))
    book.save(str(path))


def _sheet(book: Any, title: str, rows: Iterable[Sequence[Any]]) -> None:
    """Write a sheet whose first row stays where the others move."""
    sheet = book.create_sheet(title)
    sheet.freeze_panes = "B2"
    sheet.sheet_format.defaultColWidth = _WIDTH
    for row in rows:
        sheet.append([_cell(value) for value in row])


def _cell(value: Any) -> Any:
    """Return a value as a cell: numbers that are not known are empty, and no text becomes a formula."""
    if isinstance(value, str):
        text = printable(value)
        return f"'{text}" if text.startswith("=") else text
    return float(value) if np.isfinite(value) else None


def _modes(modes: ModalModel) -> Iterator[list[Any]]:
    columns = columns_of(modes)
    yield ["mode", *columns]
    for j in range(len(modes)):
        yield [j + 1, *(values[j] for values in columns.values())]


def _shapes(modes: ModalModel) -> Iterator[list[Any]]:
    heads = [f"{j + 1}: {f:.6g} Hz" for j, f in enumerate(modes.frequencies)]
    yield ["channel", *(f"{head}, {part}" for head in heads for part in ("real", "imaginary"))]
    for label, row in zip(modes.output_dofs, modes.shapes, strict=True):
        yield [label, *(part for value in row for part in (value.real, value.imag))]


def _similarity(modes: ModalModel) -> Iterator[list[Any]]:
    yield ["mode", *(f"{f:.6g} Hz" for f in modes.frequencies)]
    for f, row in zip(modes.frequencies, mac(modes.shapes), strict=True):
        yield [f"{f:.6g} Hz", *row]


def _responses(response: FrequencyResponse, modes: ModalModel) -> Iterator[list[Any]]:
    """Yield the lines of the strongest channels, measured and, where they can be, rebuilt: real and imaginary parts."""
    power = np.sum(np.abs(response.values) ** 2, axis=0)
    order = np.argsort(-power, axis=None, kind="stable")[:_MAX_CHANNELS]
    pairs = [divmod(int(k), power.shape[1]) for k in order]
    sides = {"measured": response.values}
    if len(modes) and modes.participation is not None:
        sides["rebuilt"] = rebuilt(response, modes)
    names = [f"{response.output_dofs[i]} / {response.input_dofs[j]}" for i, j in pairs]
    yield [
        "frequency_hz",
        *(f"{name}, {side}, {part}" for name in names for side in sides for part in ("real", "imaginary")),
    ]
    for k, f in enumerate(response.frequencies):
        values = [side[k, i, j] for i, j in pairs for side in sides.values()]
        yield [f, *(part for value in values for part in (value.real, value.imag))]
