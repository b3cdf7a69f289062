"""The data matrix of few combinations of many outputs; its models and modes are those of all outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modalscope.blocks.combinations import Combinations
from modalscope.blocks.evolved import ModalSide
from modalscope.blocks.influence import Influence
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.misfit import Misfit
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.model.checks import Array, ComplexArray
from modalscope.model.response import Response

__all__ = ["CombinedOutputs"]


@dataclass(frozen=True, eq=False)
class CombinedOutputs(DataMatrix):
    """A data matrix of combinations U'D^-1 H, whose models are taken back by D U: one product gives the shapes of all outputs.

    Parameters
    ----------
    response : Response
        As it was measured.
    few : Combinations
    inner : DataMatrix
        Of the combinations.
    """

    response: Response
    few: Combinations
    inner: DataMatrix

    @property
    def judged(self) -> Response:
        """The response of all outputs; of long records the lines that tell."""
        return self.response.judging()

    @property
    def fitted(self) -> DataMatrix:
        """The matrix of the combinations."""
        return self.inner

    @property
    def observable(self) -> DataMatrix:
        """The matrix that is factored: that of the combinations."""
        return self.inner.observable

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return len(self.few.U)

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0)."""
        return self.inner.block_rows

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a result made from this matrix must say."""
        return self.inner.warnings

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        return f"{self.inner.describe()}; {self.few.words}"

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return self.inner.to_s(poles)

    def from_s(self, poles: Array) -> ComplexArray:
        """The matrix' own poles."""
        return self.inner.from_s(poles)

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None when it is continuous."""
        return self.inner.dt

    def model(self, triple: Triple) -> Triple:
        """Return the model of the combinations, in which all orders are judged."""
        return self.inner.model(triple)

    def of_all_outputs(self, model: Triple) -> Triple:
        """Return the model of all outputs."""
        return replace(model, C=self.few.spread(model.C))

    def as_measured(self, influence: Influence) -> Influence:
        """Refuse: the gradient is known by the combinations alone."""
        self._has_no("way back to single outputs")

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return the fit to the combinations, its shapes and terms spread over all outputs; what was discarded is left as well."""
        found = self.inner.fit(model, eigen)
        own = self._misfit.of_fit(self.to_s(eigen.values), found) if found.misfit is None else found.misfit
        discarded = self.few.discarded
        return replace(
            found,
            shapes=self.few.spread(found.shapes),
            terms=self.few.spread(found.terms.transpose(1, 0, 2)).transpose(1, 0, 2),
            basis=None,
            fitted=replace(found, basis=None),
            misfit=float(np.sqrt((1 - discarded) * own**2 + discarded)),
        )

    @cached_property
    def _misfit(self) -> Misfit:
        response = self.few.response
        return Misfit(response, np.ones(response.values.shape[1]))

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the rows of the combinations."""
        return self.inner.row_side(model, eigen, fit.fitted or fit)

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the columns, which all outputs share."""
        return self.inner.column_side(model, eigen, fit.fitted or fit)
