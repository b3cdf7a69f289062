"""The data matrix of whitened ambient channels, whose models and modes are those of the channels as they were measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from modalscope.blocks.matrix import DataMatrix, OfCombinations
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.data.response import Response
from modalscope.data.whitening import Whitening


@dataclass(frozen=True, eq=False)
class WhitenedChannels(OfCombinations):
    """A data matrix of W R V', whose models are taken back: C by W^-1, B by V'^-1.

    `response`: R as it was measured. `whitening`: W and V. `inner`: of W R V', to which modes are fitted.
    """

    response: Response
    whitening: Whitening
    inner: DataMatrix

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
