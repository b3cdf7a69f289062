"""From data to a realization of all orders: the response that suits the domain, the data matrix, its factors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from modalscope.blocks.factor import Factors, factorize, left_factor
from modalscope.blocks.fraction import Fraction, fraction
from modalscope.blocks.hankel import Hankel, hankel
from modalscope.blocks.lines import line_weights
from modalscope.blocks.projection import Projection, projection
from modalscope.blocks.shifted import Shifted, shifted
from modalscope.blocks.transfer import Transfer, transfer
from modalscope.methods import Method
from modalscope.model.checks import (
    DataError,
    check_band,
    check_choice,
    check_count,
    check_each,
)
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.response import Response
from modalscope.model.signals import Signals
from modalscope.prepare import Data, prepare
from modalscope.realize.fraction import fraction_factors
from modalscope.realize.reduction import reduced
from modalscope.realize.triple import Realization, Triple
from modalscope.sizes import default_blocks, default_degree, default_projection, default_shifts

__all__ = ["Pipeline", "build"]

Matrix = Hankel | Projection | Transfer | Shifted | Fraction

#: Options of `identify` and `stabilize` that shape the Hankel matrix.
_HANKEL = (
    "row_shifts",
    "column_shifts",
    "row_subsets",
    "column_subsets",
    "row_weights",
    "column_weights",
    "row_compression",
    "column_compression",
)

#: What the columns of a sequence without inputs are, and participation with them.
_PARTICIPATION = {
    "free decay": "participation is the amplitude of each mode in each initial state, not a modal input vector",
    "correlation": "participation is the correlation of each mode with each reference channel, not a modal input vector",
}

#: Options that shape a matrix of transfer functions.
_LINES = ("initial_values", "basis", "source")


@dataclass(frozen=True, eq=False)
class Pipeline:
    """One method on one response, factored once for all orders.

    Parameters
    ----------
    method : Method
    response : ImpulseResponse or FrequencyResponse
        What is identified, cut to the band and in the domain of the method.
    matrix : Hankel, Projection, Transfer, Shifted or Fraction
        Of the response, a projection of the records behind it, or of the transposed one in the controllable form.
    realization : Realization
    dual : bool
        Whether inputs and outputs have changed places.
    settings : mapping
        Block sizes and options used.
    notes : tuple of str
        What was chosen, converted or left out.
    band : (float, float), optional
        Hz; modes outside are not reported.
    """

    method: Method
    response: Response
    matrix: Matrix
    realization: Realization
    dual: bool
    settings: Mapping[str, Any]
    notes: tuple[str, ...]
    band: tuple[float, float] | None = None

    @property
    def factors(self) -> Factors:
        """The factors that all orders are cut from."""
        return self.realization.factors

    def triple(self, order: int) -> Triple:
        """Return the model of one order, with inputs and outputs in their own places."""
        model = self.realization.triple(order)
        return model.dual() if self.dual else model


def build(
    data: Data,
    *,
    method: str | None = None,
    domain: str | None = None,
    order: int,
    band: tuple[float, float] | None = None,
    exclude: Any = None,
    block_rows: int | None = None,
    block_columns: int | None = None,
    form: str | None = None,
    weights: str | ArrayLike | None = None,
    factorization: str = "auto",
    reduction: str | None = None,
    **options: Any,
) -> Pipeline:
    """Take data to the realization of all orders up to `order`; the options are those of `identify`."""
    unknown = sorted(set(options) - set(_HANKEL) - set(_LINES))
    if unknown:
        raise DataError(
            f"option {unknown[0]!r} was asked",
            f"the options of the data matrix are {', '.join((*_HANKEL, *_LINES))}",
            "Correct its name.",
        )
    band = None if band is None else check_band(band)
    kept = data if exclude is None else data.select(exclude=exclude)
    cell, response, records, notes = prepare(kept, method, domain, band)
    check_count("order", order)
    _counts(block_rows=block_rows, block_columns=block_columns)
    _check_form(cell, form)
    if isinstance(response, FrequencyResponse) or cell.domain != "time":
        chosen = {**options, "block_rows": block_rows, "block_columns": block_columns, "band": band}
        matrix, settings = _matrix_of_lines(cell, response, order, weights, chosen)
        dual = False
    else:
        _refuse("this method works on samples", weights=weights, **{name: options.get(name) for name in _LINES})
        if band is not None and isinstance(data, ImpulseResponse):
            notes.append(
                f"samples are not filtered: the model has all modes, a diagram those from {band[0]:g} to {band[1]:g} Hz"
            )
        dual = _is_dual(cell, form, response, block_rows, block_columns)
        given = {name: _shifts(name, options.get(name)) for name in _HANKEL}
        if cell.on_records:
            _refuse("a projection of records has whole, equal blocks", **given)
            matrix, settings = _projection_of(records, response, order, block_rows, block_columns)
        else:
            matrix, settings = _hankel_of(cell, response, dual, order, block_rows, block_columns, given)
        settings["form"] = "controllable" if dual else "observable"
        response = _lags_read(response, settings, notes)
    factors = _factor(matrix, cell, order, factorization)
    notes.append(f"{matrix.describe()}; {factors.how}")
    notes.extend(matrix.warnings)
    if isinstance(response, ImpulseResponse) and response.kind in _PARTICIPATION:
        notes.append(_PARTICIPATION[response.kind])
    realization = cell.realize(matrix, factors)
    if reduction is not None:
        realization = _reduced(cell, matrix, realization, reduction)
        settings["reduction"] = reduction
    notes.extend(realization.notes)
    return Pipeline(cell, response, matrix, realization, dual, settings, tuple(notes), band)


def _reduced(cell: Method, matrix: Matrix, realization: Realization, how: str) -> Realization:
    """Return the models of a canonical form at minimum order."""
    if cell.name != "polyreference" or not isinstance(matrix, Hankel):
        raise DataError(
            f"reduction={how!r} of method {cell.name!r} in domain {cell.domain!r} was asked",
            "only the canonical form of the null space, in the time domain, has extraneous poles to be rid of",
            "Leave it out, or use method='polyreference', domain='time'.",
        )
    return reduced(matrix, realization, how)


def _lags_read(response: ImpulseResponse, settings: dict[str, Any], notes: list[str]) -> ImpulseResponse:
    """Return a correlation without the lags that no block holds: they carry estimation errors and little else."""
    read = settings["block_rows"] + settings["block_columns"]
    if response.kind != "correlation" or response.samples <= read:
        return response
    notes.append(f"{read} of {response.samples} lags are used")
    return replace(response, values=response.values[:read])


def _check_form(cell: Method, form: str | None) -> None:
    if form is not None:
        check_choice("form", form, ("observable", "controllable", "smaller"))
    if form == "controllable" and cell.domain != "time" and cell.factors != "fraction":
        raise DataError(
            f"the controllable form of method {cell.name!r} in domain {cell.domain!r} was asked",
            "its columns are lines, G(x_i) B, in which the state matrix does not appear as in B, AB, A^2 B, ...: there is none",
            "Use form='observable', or domain='time'.",
        )
    check_choice(
        "form", cell.forms[0] if form is None else form, (*cell.forms, "smaller") if len(cell.forms) > 1 else cell.forms
    )


def _counts(**blocks: int | None) -> None:
    for name, value in blocks.items():
        if value is not None:
            check_count(name, value)


def _refuse(why: str, **given: Any) -> None:
    """Raise when an option was given that the data matrix has no use for."""
    for name, value in given.items():
        if value is not None:
            raise DataError(f"option {name!r} was asked", why, "Leave it out, or use another domain.")


def _matrix_of_lines(
    cell: Method, response: Response, order: int, weights: str | ArrayLike | None, options: Mapping[str, Any]
) -> tuple[Matrix, dict[str, Any]]:
    """Return the matrix fraction, shifted transfer functions of samples where those are the data, or lines with elimination.

    A sampled system's full grid of lines may be turned into periodised samples (source="samples"); in noise elimination is steadier, by a
    factor of 1.5 in frequency and up to 6 in damping on the structures of the tests.
    """
    never = [name for name in _HANKEL if name != "row_shifts"]
    _refuse("the columns of a frequency-domain matrix are lines", **{name: options.get(name) for name in never})
    said = {"weights": weights if isinstance(weights, str) else None if weights is None else "given"}
    chosen: dict[str, Any] = {name: _shifts(name, options.get(name)) for name in ("row_shifts", *_LINES)}
    if cell.factors == "fraction":
        assert isinstance(response, FrequencyResponse)
        _refuse("a matrix fraction has neither", block_rows=options["block_rows"], **chosen)
        return fraction(response, degree=order, weights=line_weights(response, weights)), said
    rows, columns, band = options["block_rows"], options["block_columns"], options["band"]
    source = chosen.pop("source")
    if source is None:
        source = "samples" if isinstance(response, ImpulseResponse) else "elimination"
    check_choice("source", source, ("samples", "elimination"))
    if source == "samples":
        for name in ("initial_values", "basis"):
            _refuse("shifted transfer functions of samples have no initial terms to eliminate", **{name: chosen[name]})
        _refuse("samples are transformed to lines of their own, which it could not name", weights=weights)
        q = rows or default_shifts(response, order)
        made = shifted(response, block_rows=q, block_columns=columns, band=band, row_shifts=chosen["row_shifts"])
        return made, {"block_rows": made.block_rows, "block_columns": made.window, "source": source}
    if isinstance(response, ImpulseResponse):
        raise DataError(
            "source='elimination' was asked", "the data are samples, not lines", "Leave it out: samples are exact."
        )
    _refuse("the columns of a frequency-domain matrix are lines", block_columns=columns)
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


def _factor(matrix: Matrix, cell: Method, order: int, route: str) -> Factors:
    if isinstance(matrix, Fraction):
        return fraction_factors(matrix)
    if cell.factors == "h0":
        return factorize(matrix.shifted(0), order, route)
    if cell.factors == "complete":
        return left_factor(matrix.tall(), route)
    return factorize(matrix.tall(), order, route)


def _is_dual(cell: Method, form: str | None, response: ImpulseResponse, rows: int | None, columns: int | None) -> bool:
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


def _hankel_of(
    cell: Method,
    response: ImpulseResponse,
    dual: bool,
    order: int,
    block_rows: int | None,
    block_columns: int | None,
    options: dict[str, Any],
) -> tuple[Hankel, dict[str, Any]]:
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


def _shifts(name: str, value: Any) -> Any:
    """Return shifts as whole numbers; other options are checked where they are used."""
    if value is None or not name.endswith("_shifts"):
        return value
    return [check_count(name, s, least=0) for s in check_each(name, value, "whole numbers that increase from 0")]


def _projection_of(
    records: Signals | None, response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[Projection, dict[str, Any]]:
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
    )
