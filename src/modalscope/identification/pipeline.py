"""Build and factor the data matrix of a problem, and realize models of all orders from its factors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.whitening import Whitening
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import FullMatrix, OfCombinations, full
from modalscope.identification.matrices.matrix import DataMatrix, Eigen, ModalFit, Realization, Triple
from modalscope.identification.method import Built, Method, Problem
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_count, check_kind
from modalscope.numerics.handed import handed
from modalscope.numerics.resources import one_thread


@dataclass(frozen=True, eq=False)
class WhitenedChannels(OfCombinations):
    """A data matrix of W R V', whose models are taken back: C by W^-1, B by V'^-1.

    `response`: R as it was measured. `whitening`: W and V. `inner`: of W R V', to which modes are fitted.
    """

    response: Response
    whitening: Whitening
    inner: FullMatrix

    @cached_property
    def judged(self) -> Response:
        """The response of the channels, over the lags or lines that the inner matrix takes."""
        count = self.inner.judged.count
        return (
            self.response
            if count == self.response.count
            else replace(self.response, values=self.response.values[:count])
        )

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return self.inner.outputs

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return f"{self.inner.describe()}; channels whitened"

    def of_all_outputs(self, model: Triple) -> Triple:
        """Return the model of the channels as they were measured."""
        B = None if model.B is None else self.whitening.references_back(model.B)
        return replace(model, B=B, C=self.whitening.outputs_back(model.C))

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return the fit to the whitened channels, its shapes, participation and terms taken back; `fitted` is the fit itself."""
        found = self.inner.fit(model, eigen)
        return replace(
            found,
            shapes=self.whitening.outputs_back(found.shapes),
            participation=self.whitening.references_back(found.participation),
            terms=self.whitening.values_back(found.terms),
            basis=None,
            unexplained=None,
            fitted=found,
        )


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

    @property
    def reported_band(self) -> tuple[float, float]:
        """Frequencies between which poles are reported, Hz."""
        return self.response.reported_band(self.problem.options.band)

    def triple(self, order: int) -> Triple:
        """Return the model of one order, with inputs and outputs in their own places."""
        return self.matrix.model(self.realization.triple(order))


@dataclass(frozen=True, eq=False, slots=True)
class Factored:
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
    """Return the data matrix of a row, of ambient data that of their whitened channels."""
    order, whitening = check_count("order", largest), problem.whitening
    if whitening is None:
        return problem.method.matrix(problem, order)
    response, records = whitening.of_response(problem.response), problem.records
    records = whitening.of_record(records) if problem.method.of_past and isinstance(records, Signals) else records
    inside = problem.method.matrix(replace(problem, response=response, records=records), order)
    return inside._replace(matrix=WhitenedChannels(problem.response, whitening, full(inside.matrix)))


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
