"""The data matrix of whitened ambient channels, whose models and modes are those of the channels as they were measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from modalscope.blocks.evolved import ModalSide
from modalscope.blocks.influence import Influence
from modalscope.blocks.matrix import DataMatrix, DerivedMatrix
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.data.response import Response
from modalscope.data.whitening import Whitening

__all__ = ["WhitenedChannels"]


@dataclass(frozen=True, eq=False)
class WhitenedChannels(DerivedMatrix):
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
    def fitted(self) -> DataMatrix:
        """The matrix of the whitened channels."""
        return self.inner

    @property
    def observable(self) -> DataMatrix:
        """The matrix that is factored: that of the whitened channels."""
        return self.inner.observable

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return self.inner.outputs

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0)."""
        return self.inner.block_rows

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return f"{self.inner.describe()}; channels whitened"

    def model(self, triple: Triple) -> Triple:
        """Return the model of the whitened channels, in which all orders are judged."""
        return self.inner.model(triple)

    def of_all_outputs(self, model: Triple) -> Triple:
        """Return the model of the channels as they were measured."""
        B = None if model.B is None else self.whitening.references_back(model.B)
        return replace(model, B=B, C=self.whitening.outputs_back(model.C))

    def as_measured(self, influence: Influence) -> Influence:
        """Refuse: the gradient is known by the whitened channels alone."""
        self._has_no("way back to single channels")

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

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the rows of the whitened channels."""
        return self.inner.row_side(model, eigen, fit.fitted or fit)

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the columns of the whitened references."""
        return self.inner.column_side(model, eigen, fit.fitted or fit)
