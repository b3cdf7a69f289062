"""From data to a realization of all orders: the response that suits the domain, the data matrix, its factors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.factor import Factors, factorize
from modalscope.blocks.hankel import Hankel, hankel
from modalscope.blocks.transfer import Transfer, line_weights, transfer
from modalscope.methods import Method, find_method
from modalscope.model.checks import DataError, check_choice, check_count
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.signals import Signals
from modalscope.realize.triple import Realization, Triple

__all__ = ["Data", "Pipeline", "build", "prepare"]

Data = Signals | ImpulseResponse | FrequencyResponse
Response = ImpulseResponse | FrequencyResponse

#: Options of `identify` and `stabilize` that shape the Hankel matrix.
_HANKEL = (
    "row_shifts",
    "column_shifts",
    "row_subsets",
    "column_subsets",
    "row_weights",
    "column_weights",
    "row_compression",
)


@dataclass(frozen=True, eq=False)
class Pipeline:
    """One method on one response, factored once for all orders.

    Parameters
    ----------
    method : Method
    response : ImpulseResponse or FrequencyResponse
        What is identified, cut to the band and in the domain of the method.
    matrix : Hankel or Transfer
        Of the response, or of the transposed one in the controllable form.
    realization : Realization
    dual : bool
        Whether inputs and outputs have changed places.
    settings : mapping
        Block sizes and options used.
    notes : tuple of str
        What was chosen, converted or left out.
    """

    method: Method
    response: Response
    matrix: Hankel | Transfer
    realization: Realization
    dual: bool
    settings: Mapping[str, Any]
    notes: tuple[str, ...]

    @property
    def factors(self) -> Factors:
        """The factors that all orders are cut from."""
        return self.realization.factors

    def triple(self, order: int) -> Triple:
        """Return the model of one order, with inputs and outputs in their own places."""
        model = self.realization.triple(order)
        return model.dual() if self.dual else model


def prepare(
    data: Data, method: str | None, domain: str | None, band: tuple[float, float] | None
) -> tuple[Method, Response, list[str]]:
    """Return the cell of the table, the response in its domain, and notes on what was converted.

    Raises
    ------
    DataError
        A channel of zeros, a band without lines, an unknown method or domain.
    """
    notes: list[str] = []
    response = _to_response(data, band, notes)
    of_lines = isinstance(response, FrequencyResponse)
    records = isinstance(data, Signals)
    default = "alternate" if of_lines or records else "era"
    cell = find_method(
        method or default, domain, "s" if of_lines and response.sampling_rate is None else "z" if of_lines else "time"
    )
    if isinstance(response, FrequencyResponse) and band is not None:
        response = response.band(*band)
    if cell.domain == "time" and isinstance(response, FrequencyResponse):
        response = response.to_impulse_response()
        notes.append("the lines were transformed to samples: damping is biased unless they cover the whole spectrum")
    elif cell.domain != "time" and isinstance(response, ImpulseResponse):
        response = response.to_frequency_response()
        notes.append("the samples were transformed to lines as if nothing followed the last one")
    _check_channels(response)
    return cell, response, notes


def _to_response(data: Data, band: tuple[float, float] | None, notes: list[str]) -> Response:
    if isinstance(data, ImpulseResponse | FrequencyResponse):
        return data
    if not isinstance(data, Signals):
        raise DataError(
            "Signals, an ImpulseResponse or a FrequencyResponse was asked",
            f"this is {type(data).__name__}",
            "Wrap the arrays in one of these, or read a file.",
        )
    from modalscope.preprocess import estimate_correlation, estimate_frf, filter_band

    if data.inputs is not None:
        notes.append("frequency responses were estimated from the records (H1)")
        return estimate_frf(data)
    if band is not None:
        data = filter_band(data, *band)
    notes.append("correlations with all channels as references were estimated from the records")
    return estimate_correlation(data)


def _check_channels(response: Response) -> None:
    """Raise on a channel of zeros: nothing can be read off it, and it hides a wrong cable or a wrong column."""
    for side, axes, labels in (("output", (0, 2), response.output_dofs), ("input", (0, 1), response.input_dofs)):
        dead = [labels[i] for i in np.flatnonzero(~np.any(response.values, axis=axes))]
        if dead:
            raise DataError(
                f"data with a response in every {side} were asked",
                f"{side} {', '.join(dead)} is zero throughout",
                f"Leave it out: exclude={dead!r}, or --exclude {' '.join(dead)}.",
            )


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
    **options: Any,
) -> Pipeline:
    """Take data to the realization of all orders up to `order`; the options are those of `identify`."""
    unknown = sorted(set(options) - set(_HANKEL))
    if unknown:
        raise DataError(
            f"option {unknown[0]!r} was asked",
            f"the options of the data matrix are {', '.join(_HANKEL)}",
            "Correct its name.",
        )
    cell, response, notes = prepare(data if exclude is None else data.select(exclude=exclude), method, domain, band)
    check_count("order", order)
    check_choice("form", form or cell.forms[0], (*cell.forms, "smaller") if len(cell.forms) > 1 else cell.forms)
    if isinstance(response, FrequencyResponse):
        given = sorted(
            name
            for name in ("block_columns", *_HANKEL)
            if locals().get(name) is not None or options.get(name) is not None
        )
        if given:
            raise DataError(
                f"option {given[0]!r} was asked",
                "the columns of a frequency-domain matrix are lines, its rows polynomials",
                "Leave it out, or use domain='time'.",
            )
        q = block_rows or _default_degree(response, order)
        matrix: Hankel | Transfer = transfer(
            response, domain=cell.domain, block_rows=q, order=order, weights=line_weights(response, weights)
        )
        dual, settings = (
            False,
            {"block_rows": q, "weights": weights if isinstance(weights, str) else None if weights is None else "given"},
        )
    else:
        if weights is not None:
            raise DataError(
                "weights of lines were asked", "this method works on samples", "Use row_weights, or domain='s' or 'z'."
            )
        dual = _is_dual(cell, form, response)
        matrix, settings = _hankel_of(response, dual, order, block_rows, block_columns, options)
        settings["form"] = "controllable" if dual else "observable"
    factors = _factor(matrix, cell, order, factorization)
    notes.append(f"{matrix.describe()}; {factors.how}")
    return Pipeline(cell, response, matrix, cell.realize(matrix, factors), dual, settings, tuple(notes))


def _factor(matrix: Hankel | Transfer, cell: Method, order: int, route: str) -> Factors:
    if cell.factors == "h0":
        return factorize(matrix.shifted(0), order, route)
    return factorize(matrix.tall(), order if cell.factors == "tall" else None, route)


def _is_dual(cell: Method, form: str | None, response: ImpulseResponse) -> bool:
    """Whether the controllable form is built, as the observable form of the transposed response; the smaller one for companions."""
    smaller = cell.factors == "tall" and cell.name == "polyreference"
    if form == "smaller" or (form is None and smaller):
        return response.values.shape[2] < response.values.shape[1]
    return (form or cell.forms[0]) == "controllable"


def _hankel_of(
    response: ImpulseResponse,
    dual: bool,
    order: int,
    block_rows: int | None,
    block_columns: int | None,
    options: dict[str, Any],
) -> tuple[Hankel, dict[str, Any]]:
    rows, columns = default_blocks(response, order, block_rows, block_columns)
    settings = {"block_rows": rows, "block_columns": columns, **{k: v for k, v in options.items() if v is not None}}
    chosen = {
        "block_rows": None if options.get("row_shifts") is not None else rows,
        "block_columns": None if options.get("column_shifts") is not None else columns,
        **options,
    }
    if not dual:
        return hankel(response, **chosen), settings
    turned = replace(
        response,
        values=response.values.transpose(0, 2, 1),
        feedthrough=None,
        output_dofs=tuple(f"in {dof}" for dof in response.input_dofs),
        input_dofs=tuple(f"out {dof}" for dof in response.output_dofs),
        units=response.units[::-1],
    )
    swap = {"row": "column", "column": "row"}
    swapped = {}
    for key, value in chosen.items():
        side = "row" if "row" in key else "column"
        # compression stays on the rows of the matrix that is factored: it then combines inputs
        swapped[key if key == "row_compression" else key.replace(side, swap[side])] = value
    return hankel(turned, **swapped), settings


def default_blocks(
    response: ImpulseResponse, order: int, block_rows: int | None, block_columns: int | None
) -> tuple[int, int]:
    """Return block sizes: three times as many rows as states, and the rest of the samples, up to twenty times, as columns.

    More rows than that mostly add noise; more columns average it. Both are at least ten blocks where the samples allow it.
    """
    samples, outputs, inputs = response.values.shape
    rows = block_rows or min(max(-(-3 * order // outputs), 10), max(samples // 2, 1))
    columns = block_columns or max(min(samples - rows, max(-(-20 * order // inputs), rows, 10)), 1)
    return rows, columns


def _default_degree(response: FrequencyResponse, order: int) -> int:
    """Return the degree q: up to 48, fewer with many outputs (600 rows in all) or few lines, at least 8 and what the order needs.

    A high degree steadies the damping of modes near the edge of the band; the triangular factor has outputs x (q + 1) rows.
    """
    lines, outputs, inputs = response.values.shape
    wanted = max(min(48, lines // 4, 600 // outputs), 8, -(-order // outputs) + 1)
    carried = (2 * lines * inputs - order) // inputs - 1
    return max(min(wanted, carried), 1)
