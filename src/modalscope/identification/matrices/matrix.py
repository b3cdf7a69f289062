"""Base class of block data matrices, the shift of their rows, and pencils of rows on lines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn

import numpy as np

from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.evolved import Evolved, ModalSide
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.influence import Influence, Lines
from modalscope.identification.matrices.triple import Eigen, ModalFit, Triple
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import Operator, real_times, times_real


@dataclass(frozen=True, eq=False)
class RowShift:
    """E0 and E1 with (E1 V) = (E0 V) A for the row factor V = [C g_0; C g_1; ...] of the matrix with one block row more.

    In the time domain both select rows. On a polynomial basis E1 combines the block rows by the basis' recurrence
    x p_k = sum_j h_jk p_j, so that E1 = h' (x) I.

    `before`, `after`: rows that E0 and E1 select. `recurrence` (degree + 1, degree): h, when E1 combines. `block`: rows in a block.
    `weight`: row weights that the factor still carries; they are removed first. `mixing` (rows, rows): what takes the factor's rows back
    where they were mixed by a full triangle. `whole`: whether every block row holds all `block` channels, as companion forms need.
    """

    block: int
    before: IntArray | None = None
    after: IntArray | None = None
    recurrence: RealArray | None = None
    weight: RealArray | None = None
    mixing: RealArray | None = None
    whole: bool = True

    @classmethod
    def by_block(cls, block: int, blocks: int, mixing: RealArray | None = None) -> RowShift:
        """Return the shift of whole consecutive blocks: E0 drops the last one, E1 the first (Eq. 57)."""
        before = np.arange(blocks * block)
        return cls(block=block, before=before, after=before + block, mixing=mixing)

    def unweighted(self, V: Array) -> RealArray:
        """Return V without the row weights, or taken back by the mixing."""
        if self.mixing is not None:
            return np.asarray(self.mixing @ V)
        return V if self.weight is None else V / self.weight[:, None]

    def split(self, V: Array) -> tuple[RealArray, RealArray]:
        """Return E0 V and E1 V."""
        V = self.unweighted(V)
        if self.recurrence is None:
            assert self.before is not None
            assert self.after is not None
            return _rows(V, self.before), _rows(V, self.after)
        h = self.recurrence
        blocks = V.reshape(h.shape[0], self.block, -1)
        combined = np.tensordot(h.T, blocks, axes=1).reshape(h.shape[1] * self.block, -1)
        return V[: h.shape[1] * self.block], combined

    def pencil(self, left: Array, values: Array, rows: int) -> ComplexArray:
        """Return L_j = F_j E1 - x_j F_j E0 on the rows that E0 and E1 were given, (k, rows), without weights or mixing.

        `left` (k, rows of E0): f_j, one a row. `values` (k,): x_j.
        """
        F, x = np.asarray(left), np.asarray(values)[:, None]
        L = np.zeros((len(F), rows), dtype=complex)
        if self.recurrence is None:
            assert self.before is not None
            assert self.after is not None
            L[:, _place(self.after)] = F
            L[:, _place(self.before)] -= x * F
            return L
        h = self.recurrence
        blocks = F.reshape(len(F), h.shape[1], self.block)
        L += real_times(h, blocks).reshape(len(F), -1)
        L[:, : F.shape[1]] -= x * F
        return L


def _rows(V: Array, index: IntArray) -> RealArray:
    """Select rows: a view when they are consecutive, as they are for whole blocks."""
    return np.asarray(V[_place(index)])


def _place(index: IntArray) -> slice | IntArray:
    """Return rows that are consecutive as a slice, which takes no time, others as they are."""
    first, last = int(index[0]), int(index[-1])
    if last - first + 1 == index.size and np.array_equal(index, np.arange(first, last + 1)):
        return slice(first, last + 1)
    return index


class DataMatrix(ABC):
    """The object between the data and the factorizations.

    H(0) and H(1) are given by `shifted`; `tall` holds the rows of both together, and `row_shift` belongs to its factors. What a
    structure does not allow is None, or a DataError that says so.
    """

    #: Whether both sides of a mode are known by its own shape and participation: modes of several orders are then compared at once.
    by_mode: ClassVar[bool] = False

    #: Whether shapes and participation are fitted to the states that the factors give, whatever C and B are.
    fits_states: ClassVar[bool] = False

    # ------------------------------------------------------------------------------------------------ the matrix itself
    response: Any

    @property
    def judged(self) -> Any:
        """The response that a model of this matrix is compared with."""
        return self.response

    @property
    def outputs(self) -> int:
        """Outputs of the response (inputs, when it was transposed)."""
        return int(self.response.values.shape[1])

    @property
    @abstractmethod
    def block_rows(self) -> int:
        """Blocks in a column of H(0)."""

    @abstractmethod
    def describe(self) -> str:
        """What the matrix is, in words."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a result made from this matrix must say."""
        return ()

    @property
    def observable(self) -> DataMatrix:
        """The matrix that is factored: this one, or in the controllable form that of the transposed response."""
        return self

    @property
    def fitted(self) -> DataMatrix:
        """The matrix in whose channels models are fitted: this one, or that of combinations of outputs."""
        return self

    def shifted(self, k: int) -> Operator:
        """H(k), k = 0 or 1."""
        self._has_no(f"H({k})")

    def tall(self) -> Operator:
        """H with one block row more than H(0)."""
        self._has_no("block row more")

    @property
    def row_shift(self) -> RowShift:
        """E0 and E1."""
        self._has_no("shift of its rows")

    def between(self, factors: Factors) -> RealArray:
        """K = P' H(1) Q, (k, k): all that a truncated realization needs of H(1), made once for all that are read off the factors."""
        if "K" not in factors.between:
            factors.between["K"] = self.projected(factors)
        return factors.between["K"]

    def projected(self, factors: Factors) -> RealArray:
        """K = P' H(1) Q as it is made."""
        return np.asarray(factors.P.T @ self.shifted(1).times(np.ascontiguousarray(factors.Q)))

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """The first block row of H(k), times X, in outputs: C = first_rows(Q d^-1/2), C A = first_rows(Q d^-1/2, 1)."""
        self._has_no("first block row")

    def first_of_states(self, factors: Factors) -> RealArray:
        """C of all kept directions, the first block row of H(0) Q d^-1/2, which is that of P d^1/2."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.first_rows(factors.Q / np.sqrt(factors.d))

    def first_block(self, shapes: Array) -> Array:
        """What the first block row of the factor V holds for given shapes (l, n): T_0 C, or C p_0 on polynomials."""
        return np.asarray(shapes)

    def first_block_column(self, *, tall: bool = False) -> RealArray | None:
        """H(0) E_m, or that of tall(), with the inputs themselves; None where columns are lines or times."""
        return None

    def first_columns(self, factors: Factors) -> RealArray | None:
        """X (m, k) such that B = d^1/2 X', as a rule the first rows of Q; None where columns are lines or times."""
        return None

    def row_blocks(self, P: Array) -> RealArray | None:
        """A left factor (rows, k) by block rows, (blocks, channels, k); None where the blocks are not whole."""
        return None

    def with_columns(self, factors: Factors) -> Factors:
        """The factors with what the indicators need of the columns, where these are not Q itself."""
        return factors

    # ---------------------------------------------------------------------------------------------------------- influence
    def pencil(self, left: Array, values: Array, *, tall: bool) -> Any:
        """Return L_j with L_j dH = F_j (dH(1) - x_j dH(0)), one row on the whole matrix a pole: (k, rows).

        `left` (k, rows of H(0)): f_j. `values` (k,): x_j, eigenvalues. `tall`: whether F_j lies on the rows that E0 selects of `tall()`,
        without weights, and not on those of `shifted(0)`.
        """
        return self.row_shift.pencil(left, values, self.tall().shape[0])

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

    # ---------------------------------------------------------------------------------------------------- poles and modes
    @abstractmethod
    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""

    @abstractmethod
    def from_s(self, poles: Array) -> ComplexArray:
        """The matrix' own poles from continuous ones."""

    @property
    @abstractmethod
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None when it is continuous."""

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """How a mode runs down the block rows: (blocks, n) factors of its first block."""
        self._has_no("block rows for a mode to run down")

    @abstractmethod
    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Shapes and participation of the eigenvalues of a model: from C and B, or by least squares on the data."""

    def model(self, triple: Triple) -> Triple:
        """The model of the response, from that of the matrix that was factored."""
        return triple

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

    def _has_no(self, what: str) -> NoReturn:
        raise DataError(
            f"a realization that needs {what.removeprefix('a ')} was asked",
            f"this data matrix has no {what}: {self.describe()}",
            "Choose another method, see methods().",
        )


class DerivedMatrix(DataMatrix):
    """A data matrix whose poles are those of another one, `inner`."""

    inner: DataMatrix

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a result made from this matrix must say."""
        return self.inner.warnings

    def describe(self) -> str:
        """What the matrix is, in words."""
        return self.inner.describe()

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return self.inner.to_s(poles)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles in the plane of the inner matrix."""
        return self.inner.from_s(poles)

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None when it is continuous."""
        return self.inner.dt


class OfCombinations(DerivedMatrix):
    """A data matrix of combinations of the channels, `inner`: it is factored and judged, and modes are fitted to it, then taken back."""

    @property
    def fitted(self) -> DataMatrix:
        """The matrix of the combinations."""
        return self.inner

    @property
    def observable(self) -> DataMatrix:
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
