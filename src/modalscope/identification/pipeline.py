"""Build and factor the data matrix of a problem, and realize models of all orders from its factors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.matrix import DataMatrix, Realization, Triple
from modalscope.identification.method import Built, Matrix, Method, Problem
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_count, check_kind
from modalscope.numerics.handed import handed
from modalscope.numerics.resources import one_thread

#: Origin of a response without inputs -> meaning of its participation.
_PARTICIPATION = {
    "free decay": "Participation is the amplitude of each mode in each initial state, not a modal input vector",
    "correlation": "Participation is the correlation of each mode with each reference channel, not a modal input vector",
}


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Pipeline:
    """One row of the table on its data, factored once for all orders.

    `settings`: every option with the value that was taken. `notes`: what was chosen, converted or left out.
    """

    problem: Problem
    matrix: DataMatrix
    realization: Realization
    settings: Any
    notes: tuple[Note, ...]

    @property
    def method(self) -> Method:
        """The row."""
        return self.problem.method

    @property
    def response(self) -> Response:
        """The response that models are compared with."""
        response: Response = self.matrix.judged
        return response

    @property
    def transformed(self) -> Response | None:
        """The measured lines that the row uses as samples; None without such a transform."""
        measured = self.problem.measured
        return measured if measured.grid is not None and self.response.grid is None else None

    @property
    def factors(self) -> Factors:
        """The factors of all orders."""
        return self.realization.factors

    def triple(self, order: int) -> Triple:
        """Return the model of one order, with inputs and outputs in their own places."""
        return self.matrix.model(self.realization.triple(order))


class Factored(NamedTuple):
    """A data matrix and its factors, which rows that differ in their realization alone share; `chosen`: notes on sizes."""

    matrix: DataMatrix
    settings: Any
    chosen: tuple[Note, ...]
    factors: Factors


@named()
@one_thread
def factor(problem: Problem, largest: int) -> Pipeline:
    """Factor the data matrix of a problem once, for models of every order.

    Parameters
    ----------
    problem : Problem
        Made by `prepare`.
    largest : int
        Largest order that will be asked for; default block sizes follow it.

    Returns
    -------
    Pipeline
        With `matrix`, `factors`, `realization` and `triple(order)`, the model of an order; `sweep` and `stabilize` take it.

    Raises
    ------
    DataError
        Sizes that the data do not allow.

    Examples
    --------
    >>> from modalscope.identification.prepare import prepare
    >>> from modalscope.systems import chain5
    >>> pipeline = factor(prepare(chain5().impulse_response(200), method="era"), 20)
    >>> pipeline.factors.rank, pipeline.triple(10).A.shape
    (10, (10, 10))
    """
    check_kind("problem", problem, Problem)
    return realized(problem, factored(problem, largest))


def built(problem: Problem, largest: int) -> Built:
    """Return the data matrix of a row; of whitened channels, see `modalscope.identification.whitened`."""
    make: Matrix = problem.method.matrix if problem.whitening is None else handed("built")
    return make(problem, check_count("order", largest))


def factored(problem: Problem, largest: int, given: Built | None = None) -> Factored:
    """Return the data matrix of a row, or the same one `given` by another row, and its factors."""
    matrix, settings, chosen = built(problem, largest) if given is None else given
    observable = matrix.observable
    factors = problem.method.factor(observable, largest, settings.factorization)
    return Factored(matrix, settings, chosen, observable.with_columns(factors))


def realized(problem: Problem, given: Factored) -> Pipeline:
    """Return the models of a row from its factors, or from those of a row with the same data matrix."""
    matrix, settings, factors = given.matrix, given.settings, given.factors
    realization = problem.method.realize(matrix.observable, factors)
    reduction = settings.get("reduction")
    if reduction is not None:
        realization = handed("reduced")(realization, reduction)
    participation = _PARTICIPATION.get(problem.response.origin)
    notes = (
        *problem.notes,
        *given.chosen,
        Note("data matrix", {"rank": factors.rank}, f"{matrix.describe()}; {factors.how}"),
        *(Note("warning", {}, text) for text in matrix.warnings),
        *([Note("participation", {}, participation)] if participation else []),
        *(Note("realization", {}, text) for text in realization.notes),
    )
    return Pipeline(problem=problem, matrix=matrix, realization=realization, settings=settings, notes=notes)
