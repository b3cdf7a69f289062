"""The data matrix of a row on lines: transfer functions, shifted or differentiated, and matrix fractions; and which outputs it reads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from modalscope.blocks.combinations import Combinations, combinations, enough
from modalscope.blocks.combined import CombinedOutputs
from modalscope.blocks.fraction import fraction
from modalscope.blocks.lines import line_weights
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.shifted import shifted
from modalscope.blocks.transfer import transfer
from modalscope.identification.method import Built, Problem
from modalscope.identification.options import LineOptions
from modalscope.identification.sizes import default_degree, default_shifts
from modalscope.model.checks import DataError
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.response import Response

__all__ = ["fewer_outputs", "matrix_fraction", "transfer_of_lines", "transfer_of_response"]


def matrix_fraction(problem: Problem, order: int) -> Built:
    """Return the normal equations of a matrix fraction; the order is its degree."""
    options = problem.options
    assert isinstance(problem.response, FrequencyResponse)
    weights = line_weights(problem.response, options.weights)
    return Built(fraction(problem.response, degree=order, weights=weights), options)


def transfer_of_response(problem: Problem, order: int) -> Built:
    """Return shifted transfer functions: of the window of samples where those are the data, of lines with elimination else.

    A sampled system's full grid of lines may be turned into periodised samples (source="samples"); in noise elimination is steadier, by a
    factor of 1.5 in frequency and up to 6 in damping on the structures of the tests.
    """
    source = problem.options.source
    if source is None:
        source = "elimination" if isinstance(problem.response, FrequencyResponse) else "samples"
    return _of_window(problem, order) if source == "samples" else transfer_of_lines(problem, order)


def _of_window(problem: Problem, order: int) -> Built:
    options: LineOptions = problem.options
    shifts = options.block_rows or default_shifts(problem.response, order, truncates=problem.method.orders.truncates)
    _refuse(
        "shifted transfer functions of samples have no initial terms to eliminate", options, "initial_values", "basis"
    )
    _refuse("samples are transformed to lines of their own, which it could not name", options, "weights")
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
            "samples have a z-plane, and lines of a continuous structure are not the full grid of a sampled one",
            "Leave it out, or use domain='z'.",
        )
    if not isinstance(response, FrequencyResponse):
        raise DataError(
            "source='elimination' was asked", "the data are samples, not lines", "Leave it out: samples are exact."
        )
    _refuse("the columns of a frequency-domain matrix are lines", options, "block_columns")
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
        matrix = CombinedOutputs(response, few, matrix)
    return Built(matrix, replace(options, block_rows=matrix.block_rows, source="elimination"))


def fewer_outputs(response: Response, order: int, options: Any, *given: Any) -> Combinations | None:
    """Return combinations of the outputs where there are far more than states can need, and nothing was asked of single ones."""
    count = enough(len(response.output_dofs), order)
    plain = options.factorization == "auto" and all(one is None for one in given)
    return combinations(response, count) if count is not None and plain and not response.ambient else None


def _refuse(why: str, options: LineOptions, *names: str) -> None:
    """Raise when an option was given that this matrix has no use for."""
    for name in names:
        if getattr(options, name) is not None:
            raise DataError(f"option {name!r} was asked", why, "Leave it out, or use another domain.")
