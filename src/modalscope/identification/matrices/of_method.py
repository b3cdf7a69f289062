"""Build and factor the data matrix of each method for its problem, with default block sizes.

A kind of matrix is loaded when a row of it runs.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.identification.matrices.combinations import Combinations, CombinedOutputs, combinations, enough
from modalscope.identification.matrices.costs import DENSE_ENTRIES, record_cost, refuse_beyond_memory
from modalscope.identification.matrices.factor import Factors, factorize, left_factor
from modalscope.identification.matrices.full import full
from modalscope.identification.matrices.hankel import TurnedHankel, hankel
from modalscope.identification.matrices.lines import line_weights
from modalscope.identification.matrices.matrix import DataMatrix
from modalscope.identification.matrices.transfer import transfer
from modalscope.identification.method import Built, Problem
from modalscope.identification.options import DrivenOptions, HankelOptions, LineOptions, SpectraOptions
from modalscope.identification.sizes import (
    companion_windows,
    default_blocks,
    default_degree,
    default_driven,
    default_projection,
    default_record_degree,
    default_shifts,
    default_windows,
)
from modalscope.numerics.errors import DataError

if TYPE_CHECKING:
    from modalscope.identification.matrices.fraction import Fraction


def matrix_fraction(problem: Problem, order: int) -> Built:
    """Return the normal equations of a matrix fraction; the order is its degree."""
    from modalscope.identification.matrices.fraction import fraction

    options = problem.options
    assert isinstance(problem.response, FrequencyResponse)
    weights = line_weights(problem.response, options.weights)
    return Built(fraction(problem.response, degree=order, weights=weights), options)


def transfer_of_response(problem: Problem, order: int) -> Built:
    """Return shifted transfer functions: of a window of samples for samples, of lines with elimination for lines.

    A full grid of lines of a sampled system may also become periodised samples (source="samples"); under noise elimination has smaller
    standard deviations, by a factor of 1.5 in frequency and up to 6 in damping on the structures of the tests.
    """
    default = "elimination" if isinstance(problem.response, FrequencyResponse) else "samples"
    source = problem.options.source or default
    return _of_window(problem, order) if source == "samples" else transfer_of_lines(problem, order)


def _of_window(problem: Problem, order: int) -> Built:
    from modalscope.identification.matrices.shifted import shifted

    options: LineOptions = problem.options
    shifts = options.block_rows or default_shifts(problem.response, order, truncates=problem.method.orders.truncates)
    _refuse(options, "shifted transfer functions of samples have no initial terms", "initial_values", "basis")
    _refuse(options, "the lines are those of the transformed samples", "weights")
    matrix = shifted(
        problem.response,
        block_rows=shifts,
        block_columns=options.block_columns,
        band=options.band,
        row_shifts=options.row_shifts,
    )
    settings = replace(options, block_rows=matrix.block_rows, block_columns=matrix.window, source="samples")
    return Built(matrix, settings)


def transfer_of_lines(problem: Problem, order: int) -> Built:
    """Return transfer functions on the lines of any band, initial terms eliminated."""
    options: LineOptions = problem.options
    response = problem.response
    if options.source == "samples":
        raise DataError(
            f"source='samples' in domain {problem.method.domain!r} was asked",
            "samples need domain='z'",
            "Omit it, or use domain='z'.",
        )
    if not isinstance(response, FrequencyResponse):
        raise DataError("source='elimination' was asked", "the data are samples, not lines", "Omit it.")
    _refuse(options, "the columns of a frequency-domain matrix are lines", "block_columns")
    few = fewer_outputs(response, order, options, options.initial_values)
    taken: Any = response if few is None else few.response
    matrix: DataMatrix = transfer(
        taken,
        domain=problem.method.domain,
        block_rows=options.block_rows or default_degree(response, order, truncates=problem.method.orders.truncates),
        order=order,
        weights=line_weights(response, options.weights),
        equal_outputs=few is None,
        basis=options.basis or "orthogonal",
        initial_values=options.initial_values,
        row_shifts=options.row_shifts,
    )
    if few is not None:
        matrix = CombinedOutputs(response, few, full(matrix))
    return Built(matrix, replace(options, block_rows=matrix.block_rows, source="elimination"))


def loewner_of_lines(problem: Problem, order: int) -> Built:
    """Return the Loewner matrix of the lines of any band."""
    from modalscope.identification.matrices.loewner import loewner

    return of_points(loewner, problem, order)


def of_points(made: Callable[..., DataMatrix], problem: Problem, order: int) -> Built:
    """Return the matrix that a function makes of lines of any band as they are."""
    options, response = problem.options, problem.response
    assert isinstance(response, FrequencyResponse)
    few = fewer_outputs(response, order, options)
    taken: Any = response if few is None else few.response
    weights = line_weights(response, options.weights)
    matrix = made(taken, domain=problem.method.domain, order=order, weights=weights, equal_outputs=few is None)
    return Built(matrix if few is None else CombinedOutputs(response, few, full(matrix)), options)


def fewer_outputs(response: Response, order: int, options: Any, *given: Any) -> Combinations | None:
    """Return combinations of the outputs where these far exceed the states, and no option concerns single ones."""
    count = enough(len(response.output_dofs), order)
    plain = options.factorization == "auto" and all(one is None for one in given)
    return combinations(response, count) if count is not None and plain and not response.ambient else None


def _refuse(options: LineOptions, why: str, *names: str) -> None:
    """Raise `DataError` for a given option that this matrix does not have."""
    for name in names:
        if getattr(options, name) is not None:
            raise DataError(f"option {name!r} was asked", why, "Omit it, or use another domain.")


#: Block rows and columns of a response for a largest order, where either is not given.
_Sizes = Callable[[ImpulseResponse, int, int | None, int | None], tuple[int, int]]


def plain_hankel(problem: Problem, order: int) -> Built:
    """Return the Hankel matrix of samples, by default in observable form."""
    options: HankelOptions = problem.options
    turned = options.form == "controllable" or (options.form == "smaller" and _fewer_inputs(problem, options))
    rows, columns = default_windows(_samples(problem), order, *options.spans)
    return _hankel(problem, turned, rows, columns, order)


def canonical_hankel(problem: Problem, order: int) -> Built:
    """Return the Hankel matrix whose companion form has fewer states, by default."""
    options: HankelOptions = problem.options
    turned = options.form == "controllable" or (options.form != "observable" and _fewer_inputs(problem, options))
    rows, columns = _canonical_sizes(companion_windows, _samples(problem), order, turned, *options.spans)
    return _hankel(problem, turned, rows, columns, order)


def complete_hankel(problem: Problem, order: int) -> Built:
    """Return the Hankel matrix of a form without truncation, with as many blocks as the order has."""
    options: HankelOptions = problem.options
    turned = options.form in (None, "controllable") or (options.form == "smaller" and _fewer_inputs(problem, options))
    response = _samples(problem)
    _, outputs, inputs = response.values.shape
    rows, columns = options.spans
    if turned:
        columns = columns or -(-order // inputs)
    else:
        rows = rows or -(-order // outputs)
    return _hankel(problem, turned, *_canonical_sizes(default_blocks, response, order, turned, rows, columns), order)


def _canonical_sizes(
    sizes: _Sizes, response: ImpulseResponse, order: int, turned: bool, rows: int | None, columns: int | None
) -> tuple[int, int]:
    """Return block rows and columns of a companion form: the side of its states is the one that the order counts."""
    if not turned:
        return sizes(response, order, rows, columns)
    first, second = sizes(_transposed(response), order, columns, rows)
    return second, first


def _fewer_inputs(problem: Problem, options: HankelOptions) -> bool:
    """Whether the side of the inputs is the smaller one; by channels where sizes are not given."""
    _, outputs, inputs = problem.response.values.shape
    if options.block_rows is None or options.block_columns is None:
        return bool(inputs < outputs)
    return bool(inputs * options.block_columns < outputs * options.block_rows)


def _hankel(problem: Problem, turned: bool, rows: int, columns: int, order: int) -> Built:
    options: HankelOptions = problem.options
    settings = replace(options, block_rows=rows, block_columns=columns, form="controllable" if turned else "observable")
    measured, notes = _lags_read(_samples(problem), rows + columns)
    notes = (*_unfiltered(problem), *notes)
    general: dict[str, Any] = options.general
    few = fewer_outputs(measured, order, options, *general.values())
    response: Any = measured if few is None else few.response
    sizes: dict[str, Any] = {
        "block_rows": None if options.row_shifts else rows,
        "block_columns": None if options.column_shifts else columns,
    }
    if turned:
        side = {"row": "column", "column": "row"}
        exchanged = {
            re.sub("row|column", lambda m: side[m[0]], name): value for name, value in {**sizes, **general}.items()
        }
        matrix: DataMatrix = TurnedHankel(response, hankel(_transposed(response), **exchanged))
    else:
        matrix = hankel(response, **sizes, **general)
    return Built(matrix if few is None else CombinedOutputs(measured, few, full(matrix)), settings, notes)


def _unfiltered(problem: Problem) -> tuple[Note, ...]:
    """Return a note where a band does not change the data: measured samples are not filtered."""
    band = problem.options.band
    if band is None or problem.records is not None or problem.response is not problem.measured:
        return ()
    inside = f"the diagram those of {band[0]:g} to {band[1]:g} Hz"
    text = f"Samples are not filtered: the model has all modes, {inside}"
    if any("low-pass filtered" in step for step in problem.response.processing):
        text = f"Samples are filtered from above only: the model has modes below the band, too, {inside}"
    return (Note("not filtered", {"lowest": band[0], "highest": band[1]}, text),)


def _samples(problem: Problem) -> ImpulseResponse:
    assert isinstance(problem.response, ImpulseResponse)
    return problem.response


def _lags_read(response: ImpulseResponse, read: int) -> tuple[ImpulseResponse, tuple[Note, ...]]:
    """Return a correlation without the lags that no block contains."""
    if response.kind != "correlation" or response.samples <= read:
        return response, ()
    note = Note("lags used", {"used": read, "there": response.samples}, f"{read} of {response.samples} lags are used")
    return replace(response, values=response.values[:read]), (note,)


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


def projected_records(problem: Problem, order: int) -> Built:
    """Return the projection of the future of records on their past; participation is that of their correlation."""
    from modalscope.identification.matrices.projections import canonical_projection, projection

    options = problem.options
    assert isinstance(problem.records, Signals)
    correlation = _samples(problem)
    rows, columns = default_projection(problem.records, correlation, order, options.block_rows, options.block_columns)
    correlation, notes = _lags_read(correlation, rows + columns)
    project = canonical_projection if options.weighting == "cva" else projection
    references = correlation.input_dofs if options.references is None else options.references
    matrix = project(problem.records, references, rows, columns, correlation)
    return Built(matrix, replace(options, block_rows=rows, block_columns=columns, form="observable"), notes)


def records_on_lines(problem: Problem, order: int) -> Built:
    """Return the lines of records, inputs and end effects eliminated."""
    from modalscope.identification.matrices.records import record_lines

    options: SpectraOptions = problem.options
    assert isinstance(problem.response, RecordSpectra)
    truncates = problem.method.orders.truncates
    few = fewer_outputs(problem.response, order, options) if truncates else None
    taken: Any = problem.response if few is None else few.response
    degree = options.block_rows or default_record_degree(taken, order, truncates=truncates)
    lines, outputs, _ = taken.values.shape
    cost = record_cost(lines, outputs, taken.eliminated[0] - 1, degree)
    refuse_beyond_memory(cost)
    matrix: DataMatrix = record_lines(taken, domain=problem.method.domain, block_rows=degree, equal_outputs=few is None)
    if few is not None:
        matrix = CombinedOutputs(problem.response, few, full(matrix))
    return Built(matrix, replace(options, block_rows=degree, form="observable"), (cost.note,))


def driven_records(problem: Problem, order: int) -> Built:
    """Return the projection of records with inputs on their past; the band restricts the lines of the fit error."""
    from modalscope.identification.matrices.driven import driven_projection

    options: DrivenOptions = problem.options
    assert problem.driven is not None
    assert isinstance(problem.response, RecordSpectra)
    rows, columns, single = default_driven(problem.driven, order, options.block_rows, options.block_columns)
    matrix = driven_projection(problem.driven, rows, columns, single, problem.response)
    settings = replace(options, block_rows=rows, block_columns=columns, form="observable")
    return Built(matrix, settings, _unfiltered(problem))


def h0_factors(matrix: DataMatrix, order: int, route: str) -> Factors:
    """Factor H(0)."""
    return matrix.with_columns(factorize(matrix.shifted(0), order, route))


def loewner_factors(matrix: DataMatrix, order: int, route: str) -> Factors:
    """Factor H(0); a large one by a range, which knows directions in the bulk of the noise to 1e-6, where a dense way takes minutes."""
    rows, columns = matrix.shifted(0).shape
    return h0_factors(matrix, order, "randomized" if route == "auto" and rows * columns > DENSE_ENTRIES else route)


def tall_factors(matrix: DataMatrix, order: int, route: str) -> Factors:
    """Factor the matrix with one block row more."""
    return matrix.with_columns(factorize(matrix.tall(), order, route))


def complete_factors(matrix: DataMatrix, order: int, route: str) -> Factors:
    """Factor the matrix with one block row more, with all columns of the left factor."""
    return left_factor(matrix.tall(), route)


def fraction_factors(matrix: Fraction, order: int, route: str) -> Factors:
    """Return the eigenvectors of the normal equations of a matrix fraction."""
    return matrix.factors
