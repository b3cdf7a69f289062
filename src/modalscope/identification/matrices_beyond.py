"""Build and factor the data matrices of records, of matrix fractions, of Loewner matrices and of windows of samples, with their options.

A kind of matrix is loaded when a row of it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.identification.matrices.factor import Factors, h0_factors
from modalscope.identification.matrices.hankel import lags_read
from modalscope.identification.matrices.line_columns import line_weights
from modalscope.identification.matrices.lines import transfer_of_lines
from modalscope.identification.matrices.matrix import DataMatrix, Realization
from modalscope.identification.method import Built, Problem, fewer_outputs, refuse
from modalscope.identification.options import LineOptions, Options
from modalscope.numerics.errors import check_choice

if TYPE_CHECKING:
    from modalscope.identification.matrices.fraction import Fraction


# ------------------------------------------------------------------------------------------------------------------ options


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class FractionOptions(Options):
    """Of a matrix fraction; see `modalscope.identification.matrices.fraction`.

    `form`: "controllable". `weights` (lines,).
    """

    why_not = "a matrix fraction is fitted to all lines and has no blocks"

    form: str | None = None
    weights: Any = None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class PointOptions(Options):
    """Of a Loewner matrix; see `modalscope.identification.matrices.loewner`.

    `form`: "observable". `weights` (lines,).
    """

    why_not = "a Loewner matrix interpolates the lines themselves"

    form: str | None = None
    weights: Any = None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class DrivenOptions(Options):
    """Of records with inputs projected on their past; see `modalscope.identification.matrices.driven`.

    `block_rows`, `block_columns`: blocks of the future and of the past. `form`: "observable".
    """

    why_not = "a projection of records has whole, equal blocks of samples"

    block_rows: int | None = None
    block_columns: int | None = None
    form: str | None = None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class RecordOptions(DrivenOptions):
    """Of records projected on their past; see `modalscope.identification.matrices.projections`.

    `block_rows`, `block_columns`: blocks of the future and of the past. `form`: "observable". `references`: outputs of the past;
    all by default. `weighting`: "cva": both sides are whitened, so that the singular values are canonical correlations.
    """

    references: Any = None
    weighting: str | None = None

    def __post_init__(self) -> None:
        DrivenOptions.__post_init__(self)
        if self.weighting is not None:
            check_choice("weighting", self.weighting, ("cva",))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class SpectraOptions(Options):
    """Of records on lines; see `modalscope.identification.matrices.records`.

    `block_rows`: the degree of the polynomials. `form`: "observable".
    """

    why_not = "the columns of records on lines are all lines of whole runs"

    block_rows: int | None = None
    form: str | None = None


# ----------------------------------------------------------------------------------------------------------------- matrices


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
    from modalscope.identification.sizes import default_shifts

    options: LineOptions = problem.options
    shifts = options.block_rows or default_shifts(problem.response, order, truncates=problem.method.orders.truncates)
    refuse(options, "shifted transfer functions of samples have no initial terms", "initial_values", "basis")
    refuse(options, "the lines are those of the transformed samples", "weights")
    matrix = shifted(
        problem.response,
        block_rows=shifts,
        block_columns=options.block_columns,
        band=options.band,
        row_shifts=options.row_shifts,
    )
    settings = replace(options, block_rows=matrix.block_rows, block_columns=matrix.window, source="samples")
    return Built(matrix, settings)


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
    return Built(matrix if few is None else few.whole(response, matrix), options)


def projected_records(problem: Problem, order: int) -> Built:
    """Return the projection of the future of records on their past; participation is that of their correlation."""
    from modalscope.identification.matrices.projections import canonical_projection, projection
    from modalscope.identification.sizes import default_projection

    options = problem.options
    assert isinstance(problem.records, Signals)
    correlation = problem.response
    assert isinstance(correlation, ImpulseResponse)
    rows, columns = default_projection(problem.records, correlation, order, options.block_rows, options.block_columns)
    correlation, notes = lags_read(correlation, rows + columns)
    project = canonical_projection if options.weighting == "cva" else projection
    references = correlation.input_dofs if options.references is None else options.references
    matrix = project(problem.records, references, rows, columns, correlation)
    return Built(matrix, replace(options, block_rows=rows, block_columns=columns, form="observable"), notes)


def records_on_lines(problem: Problem, order: int) -> Built:
    """Return the lines of records, inputs and end effects eliminated."""
    from modalscope.identification.fast.record_cost import record_cost, refuse_beyond_memory
    from modalscope.identification.matrices.records import record_lines
    from modalscope.identification.sizes import default_record_degree

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
        matrix = few.whole(problem.response, matrix)
    return Built(matrix, replace(options, block_rows=degree, form="observable"), (cost.note,))


def driven_records(problem: Problem, order: int) -> Built:
    """Return the projection of records with inputs on their past; the band restricts the lines of the fit error."""
    from modalscope.identification.matrices.driven import driven_projection
    from modalscope.identification.sizes import default_driven

    options: DrivenOptions = problem.options
    assert problem.driven is not None
    assert isinstance(problem.response, RecordSpectra)
    rows, columns, single = default_driven(problem.driven, order, options.block_rows, options.block_columns)
    matrix = driven_projection(problem.driven, rows, columns, single, problem.response)
    settings = replace(options, block_rows=rows, block_columns=columns, form="observable")
    return Built(matrix, settings)


def loewner_factors(matrix: DataMatrix, order: int, route: str) -> Factors:
    """Factor H(0); a large one by a range, which knows directions in the bulk of the noise to 1e-6, where a dense way takes minutes."""
    from modalscope.identification.fast.factorizations import DENSE_ENTRIES

    rows, columns = matrix.shifted(0).shape
    return h0_factors(matrix, order, "randomized" if route == "auto" and rows * columns > DENSE_ENTRIES else route)


def fraction_factors(matrix: Fraction, order: int, route: str) -> Factors:
    """Return the eigenvectors of the normal equations of a matrix fraction."""
    return matrix.factors


def fraction_models(matrix: Fraction, factors: Factors) -> Realization:
    """Return the companion forms of a matrix fraction of every degree."""
    from modalscope.identification.realizations.fraction_companion import fraction_companion

    return fraction_companion(matrix, factors)
