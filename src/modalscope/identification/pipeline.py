"""From data to a realization of all orders: the response that suits the domain, the data matrix, its factors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from modalscope.blocks.factor import Factors, factorize, left_factor
from modalscope.blocks.fraction import Fraction
from modalscope.blocks.hankel import Hankel
from modalscope.identification.matrices import (
    HANKEL_OPTIONS,
    LINE_OPTIONS,
    Matrix,
    checked_shifts,
    hankel_of,
    is_dual,
    matrix_of_lines,
    projection_of,
    refuse,
)
from modalscope.identification.prepare import Data, prepare
from modalscope.identification.table import Method
from modalscope.model.checks import (
    DataError,
    check_band,
    check_choice,
    check_count,
)
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.response import Response
from modalscope.realizations.fraction import fraction_factors
from modalscope.realizations.reduction import reduced
from modalscope.realizations.triple import Realization, Triple

__all__ = ["Pipeline", "build"]

#: What the columns of a sequence without inputs are, and participation with them.
_PARTICIPATION = {
    "free decay": "participation is the amplitude of each mode in each initial state, not a modal input vector",
    "correlation": "participation is the correlation of each mode with each reference channel, not a modal input vector",
}


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
    unknown = sorted(set(options) - set(HANKEL_OPTIONS) - set(LINE_OPTIONS))
    if unknown:
        raise DataError(
            f"option {unknown[0]!r} was asked",
            f"the options of the data matrix are {', '.join((*HANKEL_OPTIONS, *LINE_OPTIONS))}",
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
        matrix, settings = matrix_of_lines(cell, response, order, weights, chosen)
        dual = False
    else:
        refuse("this method works on samples", weights=weights, **{name: options.get(name) for name in LINE_OPTIONS})
        if band is not None and isinstance(data, ImpulseResponse):
            notes.append(
                f"samples are not filtered: the model has all modes, a diagram those from {band[0]:g} to {band[1]:g} Hz"
            )
        dual = is_dual(cell, form, response, block_rows, block_columns)
        given = {name: checked_shifts(name, options.get(name)) for name in HANKEL_OPTIONS}
        if cell.on_records:
            refuse("a projection of records has whole, equal blocks", **given)
            matrix, settings = projection_of(records, response, order, block_rows, block_columns)
        else:
            matrix, settings = hankel_of(cell, response, dual, order, block_rows, block_columns, given)
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


def _factor(matrix: Matrix, cell: Method, order: int, route: str) -> Factors:
    if isinstance(matrix, Fraction):
        return fraction_factors(matrix)
    if cell.factors == "h0":
        return factorize(matrix.shifted(0), order, route)
    if cell.factors == "complete":
        return left_factor(matrix.tall(), route)
    return factorize(matrix.tall(), order, route)
