"""Define what a data matrix tells beside its models: how well its factors follow the modes, and what noise does to the poles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.evolved import Evolved, ModalSide
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.influence import Influence, Lines
from modalscope.identification.matrices.matrix import (
    DataMatrix,
    DerivedMatrix,
    Eigen,
    ModalFit,
    RowShift,
    Triple,
    place_of,
)
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import real_times, times_real


def pencil_of(shift: RowShift, left: Array, values: Array, rows: int) -> ComplexArray:
    """Return L_j = F_j E1 - x_j F_j E0 on the rows that E0 and E1 were given, (k, rows), without weights or mixing.

    `left` (k, rows of E0): f_j, one per row. `values` (k,): x_j.
    """
    F, x = np.asarray(left), np.asarray(values)[:, None]
    L = np.zeros((len(F), rows), dtype=complex)
    if shift.recurrence is None:
        assert shift.before is not None
        assert shift.after is not None
        L[:, place_of(shift.after)] = F
        L[:, place_of(shift.before)] -= x * F
        return L
    h = shift.recurrence
    blocks = F.reshape(len(F), h.shape[1], shift.block)
    L += real_times(h, blocks).reshape(len(F), -1)
    L[:, : F.shape[1]] -= x * F
    return L


class FullMatrix(DataMatrix):
    """A data matrix whose factors can be compared with its modes, and whose poles are known as functions of the response."""

    #: Whether both sides of a mode are known by its own shape and participation: modes of several orders are then compared at once.
    by_mode: ClassVar[bool] = False

    #: Whether shapes and participation are fitted to the states that the factors give, whatever C and B are.
    fits_states: ClassVar[bool] = False

    def row_blocks(self, P: Array) -> RealArray | None:
        """A left factor (rows, k) by block rows, (blocks, channels, k); None where the blocks are not whole."""
        return None

    # ---------------------------------------------------------------------------------------------------------- influence
    def pencil(self, left: Array, values: Array, *, tall: bool) -> Any:
        """Return L_j with L_j dH = F_j (dH(1) - x_j dH(0)), one row on the whole matrix per pole: (k, rows).

        `left` (k, rows of H(0)): f_j. `values` (k,): x_j, eigenvalues. `tall`: whether F_j lies on the rows that E0 selects of `tall()`,
        without weights, and not on those of `shifted(0)`.
        """
        return pencil_of(self.row_shift, left, values, self.tall().shape[0])

    def right_vectors(self, factors: Factors, coefficients: Array) -> Any:
        """Return columns v_j of the matrix from their coefficients in the factors' own, Q X: an array, or what `influence` makes one of.

        `coefficients` (n, k).
        """
        return times_real(coefficients.T, factors.Q[:, : len(coefficients)].T).T  # a vector lies in one piece

    def influence(self, left: Any, right: Any, lines: Lines | None = None) -> Influence:
        """Return the gradient of left_j dH right_j by the response: the adjoint of what makes the matrix of the response.

        `left`: as `pencil` gives them. `right`: as `right_vectors` gives them. `lines`: where columns are lines: those that stand for
        all; by default all.
        """
        self._has_no("way back to the response")

    @property
    def thinned(self) -> bool:
        """Whether what noise does is summed line by line, so that lines far from all poles may stand for their neighbours."""
        return True

    def as_measured(self, influence: Influence) -> Influence:
        """Return the gradient by the response as it was measured, from that of the matrix that was factored."""
        return influence

    # ------------------------------------------------------------------------------------------------------------- models
    def of_all_outputs(self, model: Triple) -> Triple:
        """The same model with the outputs and inputs of the response, where it has combinations of them."""
        return model

    def with_noise(self, model: StateSpace) -> StateSpace:
        """Return a model with the gain and the covariance of its innovations, where the data matrix knows them."""
        return model

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Data and model where the model was fitted: (measured, rebuilt), some lines or samples after the other."""
        yield from self.judged.with_model(model)

    # --------------------------------------------------------------------------------------------------------- indicators
    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """How a mode runs down the block rows: (blocks, n) factors of its first block."""
        self._has_no("block rows for a mode to run down")

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """The row factor V against c_j g_k; None when its blocks are not whole, or the states are the rows themselves."""
        if model.factors is None:
            return None
        n = model.rank
        blocks = self.row_blocks(model.factors.P[:, :n])
        if blocks is None:
            return None
        states = model.factors.d[:n, None] ** model.power * eigen.vectors
        return Evolved(blocks, states, self.first_block(fit.shapes), self.evolution(eigen.values, len(blocks)))

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """The column factor W against b_j h_k; None where blocks are not whole, and where columns are times of unknown states."""
        return None


def full(matrix: DataMatrix) -> FullMatrix:
    """Return a data matrix that knows its influence and its sides, or raise `DataError`: a plain one does not."""
    if isinstance(matrix, FullMatrix):
        return matrix
    have = f"the plain data matrix has none: {matrix.describe()}"
    raise DataError("standard deviations or indicators of factors:", have, "Leave out plain_steps().")


class OfCombinations(FullMatrix, DerivedMatrix):
    """A data matrix of combinations of the channels, `inner`: it is factored and judged, and modes are fitted to it, then taken back."""

    inner: FullMatrix

    @property
    def fitted(self) -> FullMatrix:
        """The matrix of the combinations."""
        return self.inner

    @property
    def observable(self) -> Any:
        """The matrix that is factored: that of the combinations."""
        return self.inner.observable

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0)."""
        return self.inner.block_rows

    def model(self, triple: Triple) -> Triple:
        """Return the model of the combinations, in which all orders are judged."""
        return self.inner.model(triple)

    def as_measured(self, influence: Influence) -> Influence:
        """Refuse: the gradient is known by the combinations alone."""
        self._has_no("way back to single channels")

    def row_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the rows of the combinations."""
        return self.inner.row_side(model, eigen, fit.fitted or fit)

    def column_side(self, model: Triple, eigen: Eigen, fit: ModalFit) -> ModalSide | None:
        """Return the columns of the combinations."""
        return self.inner.column_side(model, eigen, fit.fitted or fit)
