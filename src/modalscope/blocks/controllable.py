"""Block Hankel matrices in controllable form: the observable form of the transposed response."""

from __future__ import annotations

from dataclasses import dataclass

from modalscope.blocks.evolved import ModalSide
from modalscope.blocks.hankel import Hankel, fit_of_samples
from modalscope.blocks.influence import Influence
from modalscope.blocks.matrix import DerivedMatrix
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.data.responses import ImpulseResponse


@dataclass(frozen=True, eq=False)
class TurnedHankel(DerivedMatrix):
    """A Hankel matrix of the transposed response, whose models are turned back: (A, B, C) -> (A', C', B').

    `response`: as it was measured. `inner`: of the transposed response.
    """

    response: ImpulseResponse
    inner: Hankel
    by_mode = True

    @property
    def judged(self) -> ImpulseResponse:
        """The samples as they were measured."""
        return self.response

    @property
    def observable(self) -> Hankel:
        """The Hankel matrix of the transposed response, which is factored."""
        return self.inner

    @property
    def outputs(self) -> int:
        """Outputs of the response."""
        return int(self.response.values.shape[1])

    @property
    def block_rows(self) -> int:
        """Blocks on the side of the outputs."""
        return self.inner.block_columns

    def model(self, triple: Triple) -> Triple:
        """Return the model with inputs and outputs in their own places."""
        return triple.dual()

    def as_measured(self, influence: Influence) -> Influence:
        """Return the gradient by the response as it was measured."""
        return influence.transposed()

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes C X and participation X^-1 B, referred to the impulse."""
        return fit_of_samples(self.response, model, eigen)

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the columns of the transposed response's matrix: the side of the outputs."""
        return self.inner.column_side(model, _turned(eigen), self._exchanged(eigen, fit))

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the rows of the transposed response's matrix: the side of the inputs."""
        return self.inner.row_side(model, _turned(eigen), self._exchanged(eigen, fit))

    def _exchanged(self, eigen: Eigen, fit: ModalFit) -> ModalFit:
        """Return shapes and participation in each other's places; the steps to the first sample stay on the side of the columns."""
        late = eigen.values[:, None] ** self.response.first_sample
        return ModalFit((fit.participation * late).T, fit.shapes.T / late, fit.terms.transpose(0, 2, 1))


def _turned(eigen: Eigen) -> Eigen:
    return Eigen(eigen.values, eigen.left.T, eigen.vectors.T)
