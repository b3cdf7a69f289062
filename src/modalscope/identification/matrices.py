"""The data matrix of a method on a response: which blocks, in which form, and what was chosen where nothing was asked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from modalscope.blocks.fraction import Fraction, fraction
from modalscope.blocks.hankel import Hankel, hankel
from modalscope.blocks.lines import line_weights
from modalscope.blocks.projection import Projection, projection
from modalscope.blocks.shifted import Shifted, shifted
from modalscope.blocks.transfer import Transfer, transfer
from modalscope.identification.sizes import default_blocks, default_degree, default_projection, default_shifts
from modalscope.identification.table import Method
from modalscope.model.checks import DataError, check_choice, check_count, check_each
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.response import Response
from modalscope.model.signals import Signals

__all__ = [
    "HANKEL_OPTIONS",
    "LINE_OPTIONS",
    "Matrix",
    "checked_shifts",
    "hankel_of",
    "is_dual",
    "matrix_of_lines",
    "projection_of",
    "refuse",
]

Matrix = Hankel | Projection | Transfer | Shifted | Fraction

#: Options of `identify` and `stabilize` that shape the Hankel matrix.
HANKEL_OPTIONS = (
    "row_shifts",
    "column_shifts",
    "row_subsets",
    "column_subsets",
    "row_weights",
    "column_weights",
    "row_compression",
    "column_compression",
)

#: Options that shape a matrix of transfer functions.
LINE_OPTIONS = ("initial_values", "basis", "source")


def refuse(why: str, **given: Any) -> None:
    """Raise when an option was given that the data matrix has no use for."""
    for name, value in given.items():
        if value is not None:
            raise DataError(f"option {name!r} was asked", why, "Leave it out, or use another domain.")


def checked_shifts(name: str, value: Any) -> Any:
    """Return shifts as whole numbers; other options are checked where they are used."""
    if value is None or not name.endswith("_shifts"):
        return value
    return [check_count(name, s, least=0) for s in check_each(name, value, "whole numbers that increase from 0")]


def matrix_of_lines(
    cell: Method, response: Response, order: int, weights: str | ArrayLike | None, options: Mapping[str, Any]
) -> tuple[Matrix, dict[str, Any]]:
    """Return the matrix fraction, shifted transfer functions of samples where those are the data, or lines with elimination.

    A sampled system's full grid of lines may be turned into periodised samples (source="samples"); in noise elimination is steadier, by a
    factor of 1.5 in frequency and up to 6 in damping on the structures of the tests.
    """
    never = [name for name in HANKEL_OPTIONS if name != "row_shifts"]
    refuse("the columns of a frequency-domain matrix are lines", **{name: options.get(name) for name in never})
    said = {"weights": weights if isinstance(weights, str) else None if weights is None else "given"}
    chosen: dict[str, Any] = {name: checked_shifts(name, options.get(name)) for name in ("row_shifts", *LINE_OPTIONS)}
    if cell.factors == "fraction":
        assert isinstance(response, FrequencyResponse)
        refuse("a matrix fraction has neither", block_rows=options["block_rows"], **chosen)
        return fraction(response, degree=order, weights=line_weights(response, weights)), said
    rows, columns, band = options["block_rows"], options["block_columns"], options["band"]
    source = chosen.pop("source")
    if source is None:
        source = "samples" if isinstance(response, ImpulseResponse) else "elimination"
    check_choice("source", source, ("samples", "elimination"))
    if source == "samples":
        for name in ("initial_values", "basis"):
            refuse("shifted transfer functions of samples have no initial terms to eliminate", **{name: chosen[name]})
        refuse("samples are transformed to lines of their own, which it could not name", weights=weights)
        q = rows or default_shifts(response, order)
        made = shifted(response, block_rows=q, block_columns=columns, band=band, row_shifts=chosen["row_shifts"])
        return made, {"block_rows": made.block_rows, "block_columns": made.window, "source": source}
    if isinstance(response, ImpulseResponse):
        raise DataError(
            "source='elimination' was asked", "the data are samples, not lines", "Leave it out: samples are exact."
        )
    refuse("the columns of a frequency-domain matrix are lines", block_columns=columns)
    q = rows or default_degree(response, order)
    made_of_lines = transfer(
        response,
        domain=cell.domain,
        block_rows=q,
        order=order,
        weights=line_weights(response, weights),
        basis="orthogonal" if chosen["basis"] is None else chosen["basis"],
        initial_values=chosen["initial_values"],
        row_shifts=chosen["row_shifts"],
    )
    return made_of_lines, {"block_rows": made_of_lines.block_rows, "source": source, **said}


def is_dual(cell: Method, form: str | None, response: ImpulseResponse, rows: int | None, columns: int | None) -> bool:
    """Whether the controllable form is built, as the observable form of the transposed response.

    Canonical forms have l r or m s states; the smaller is the default. Where the blocks are not given they are chosen for equal
    sizes, and fewer channels make the finer steps.
    """
    if form == "smaller" or (form is None and cell.name == "polyreference"):
        _, outputs, inputs = response.values.shape
        if rows is None or columns is None:
            return bool(inputs < outputs)
        return bool(inputs * columns < outputs * rows)
    return (form or cell.forms[0]) == "controllable"


def hankel_of(
    cell: Method,
    response: ImpulseResponse,
    dual: bool,
    order: int,
    block_rows: int | None,
    block_columns: int | None,
    options: dict[str, Any],
) -> tuple[Hankel, dict[str, Any]]:
    """Return the Hankel matrix of the response, or of the transposed one when it is dual, and the settings used."""
    spans = {
        "block_rows": _span(block_rows, options.get("row_shifts")),
        "block_columns": _span(block_columns, options.get("column_shifts")),
    }
    turned = _transposed(response) if dual else response
    side = "block_columns" if dual else "block_rows"
    if (
        cell.factors == "complete" and spans[side] is None
    ):  # the order says how many blocks, every one more is for nothing
        spans[side] = -(-order // turned.values.shape[1])
    if dual and cell.canonical:  # the side of the companion's states is the short one
        columns, rows = default_blocks(turned, order, spans["block_columns"], spans["block_rows"])
    else:
        rows, columns = default_blocks(response, order, spans["block_rows"], spans["block_columns"])
    settings = {"block_rows": rows, "block_columns": columns, **{k: v for k, v in options.items() if v is not None}}
    chosen = {
        "block_rows": block_rows if options.get("row_shifts") is not None else rows,
        "block_columns": block_columns if options.get("column_shifts") is not None else columns,
        **options,
    }
    if not dual:
        return hankel(response, **chosen), settings
    swap = {"row": "column", "column": "row"}
    sides = {key: "row" if "row" in key else "column" for key in chosen}
    return hankel(turned, **{key.replace(sides[key], swap[sides[key]]): v for key, v in chosen.items()}), settings


def projection_of(
    records: Signals | None, response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[Projection, dict[str, Any]]:
    """Return the projection of the records' future on their past, and the settings used."""
    assert records is not None
    sizes = _span(block_rows, None), _span(block_columns, None)
    rows, columns = default_projection(records, response, order, *sizes)
    return projection(records, None, rows, columns), {"block_rows": rows, "block_columns": columns}


def _span(blocks: int | None, shifts: Any) -> int | None:
    """Return how many samples one side spans, when it is given."""
    if shifts is not None and len(shifts):
        return int(max(shifts)) + 1
    return blocks


def _transposed(response: ImpulseResponse) -> ImpulseResponse:
    """Return the response with inputs and outputs in each other's places."""
    return replace(
        response,
        values=response.values.transpose(0, 2, 1),
        feedthrough=None,
        output_dofs=tuple(f"in {dof}" for dof in response.input_dofs),
        input_dofs=tuple(f"out {dof}" for dof in response.output_dofs),
        units=response.units[::-1],
        groups=None,
    )
