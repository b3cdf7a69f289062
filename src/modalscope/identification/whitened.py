"""The data matrix of ambient channels that are whitened before it is made, and taken back after modes are fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.whitening import Whitening
from modalscope.identification.matrices.full import FullMatrix, OfCombinations, full
from modalscope.identification.matrices.matrix import Eigen, ModalFit, Triple
from modalscope.identification.method import Built, Method, Problem
from modalscope.identification.prepare import Measured
from modalscope.identification.suits import of_past


def whitening_of_row(measured: Measured, row: Method, options: Any) -> Whitening | None:
    """Return the whitening of a row; none for options of single channels, or where only references have a past."""
    by_channel = [*getattr(options, "general", {}).values(), getattr(options, "initial_values", None)]
    whole = len(measured.response.input_dofs) == len(measured.response.output_dofs)
    if any(value is not None for value in by_channel) or (
        of_past(row) and (not whole or getattr(options, "references", None) is not None)
    ):
        return None
    return measured.whitening


def built(problem: Problem, largest: int) -> Built:
    """Return the data matrix of a row for whitened channels."""
    whitening, records = problem.whitening, problem.records
    assert whitening is not None
    response = whitening.of_response(problem.response)
    records = whitening.of_record(records) if of_past(problem.method) and isinstance(records, Signals) else records
    inside = problem.method.matrix(replace(problem, response=response, records=records), largest)
    return inside._replace(matrix=WhitenedChannels(problem.response, whitening, full(inside.matrix)))


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
