"""Define what a data matrix offers, the shift of its rows, and the models (A, B, C) that are read off it.

Symbols, here and in the modules of matrices and realizations: l outputs, m inputs, n states; H(0), H(1) the data matrix and the same one
step on, H(0) = P diag(d) Q'; V the row factor [C g_0; C g_1; ...] of the matrix with one block row more, g_k = A^k for samples and
g_k = p_k(A) for polynomials on lines; E0 and E1 what takes V to its rows without the last block, and one step on; E_l and E_m the first l
rows and m columns; T_0 a compression within every block; # a pseudo-inverse.

No stage asks for a data matrix whole: factorizations multiply with H(0) and H(1), a realization asks for the shift of the rows and for
first block rows and columns, and modes are fitted to the response behind it. What else is told of a data matrix, how well its factors
follow the modes and what noise does to them, stands in `modalscope.identification.matrices.full`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np

from modalscope.identification.matrices.factor import Factors
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.operators import Operator, real_times

#: Maximum condition of eigenvectors for their inverse; above it they are nearly dependent (defective poles).
_MAX_CONDITION = 1e13


@dataclass(frozen=True, eq=False, slots=True)
class Eigen:
    """Eigenvalues of a model in the plane of its data matrix, with right vectors and the matching rows of their inverse.

    `values` (k,). `vectors` (N, k). `left` (k, N).
    """

    values: ComplexArray
    vectors: ComplexArray
    left: ComplexArray

    def dual(self) -> Eigen:
        """Return the eigenvalues of A' with its vectors."""
        return Eigen(self.values, self.left.T, self.vectors.T)

    def take(self, index: Array) -> Eigen:
        """Return some of them."""
        return Eigen(self.values[index], self.vectors[:, index], self.left[index])


@dataclass(frozen=True, eq=False, slots=True)
class ModalFit:
    """Shapes and participation of modes, from the model or fitted to the data.

    `shapes` (l, k). `participation` (k, m): referred to the impulse itself. `terms` (t, l, m): direct term, or residuals of the modes
    below and above the band. `powers`: powers of the relative frequency j f / f_max that the terms are factors of. `reach` (k,): norm of
    each mode's function over the lines. `basis`: what it was fitted with, where it is dear to make and small to keep. `misfit`:
    norm(measured - rebuilt) / norm(measured) of the response that is judged, outputs brought level, where the fit knows it. `unexplained`
    (l, m): energy that no residues of these poles explain, where the fit knows it; NaN of channels where that is near rounding. `fitted`:
    the same of the combinations of outputs that it was fitted to, where these stand for many.
    """

    shapes: ComplexArray
    participation: ComplexArray
    terms: RealArray
    powers: tuple[int, ...] = (0,)
    reach: RealArray | None = None
    basis: ModalBasis | None = None
    misfit: float | None = None
    unexplained: RealArray | None = None
    fitted: ModalFit | None = None

    def bare(self) -> ModalFit:
        """Return the fit without its basis."""
        return replace(self, basis=None, fitted=None if self.fitted is None else self.fitted.bare())


@dataclass(frozen=True, eq=False)
class Triple:
    """(A, B, C) of one order; B is None where the columns of the data matrix are lines or times.

    `A` (N, N). `B` (N, m). `C` (l, N). `rank`: states kept from the factorization; canonical forms have more (N > rank). `factors`: what
    the states were cut from: those of the row factor P d^a and the column factor d^(1-a) Q'. None in canonical forms, whose states are
    the block rows themselves. `power`: a. `span` (N, rank): orthonormal basis of the states that the truncated factor explains, of a
    canonical form. `turned`: whether that is a space of left eigenvectors: inputs and outputs have changed places.
    """

    A: RealArray
    B: RealArray | None
    C: RealArray
    rank: int
    factors: Factors | None = None
    power: float = 0.5
    span: RealArray | None = None
    turned: bool = False

    def dual(self) -> Triple:
        """Return (A', C', B'): the model of the transposed response."""
        assert self.B is not None
        return replace(self, A=self.A.T, B=self.C.T, C=self.B.T, turned=not self.turned)

    def eigen(self) -> Eigen:
        """Return eigenvalues and vectors of A."""
        values, vectors = np.linalg.eig(self.A)
        return Eigen(values, vectors.astype(complex), inverse_vectors(vectors))

    def row_states(self, vectors: Array) -> ComplexArray:
        """Return the row factor times vectors of states: [c g_0; c g_1; ...] of modes; for canonical forms the vectors themselves."""
        if self.factors is None:
            return np.asarray(vectors)
        n = self.rank
        return np.asarray(real_times(self.factors.P[:, :n], self.factors.d[:n, None] ** self.power * vectors))

    def explained(self, eigen: Eigen) -> RealArray | None:
        """Return the share of each mode's vector, 0 to 1, that the truncated factor explains; None where there is nothing to tell.

        Of a canonical form without noise: 1 for the modes, less for the extraneous poles. In noise it tells them apart better than
        the amplitude in the first block column, which the noise of that column drives as well.
        """
        if self.span is None:
            return None
        X = eigen.left.T if self.turned else eigen.vectors
        return np.asarray(np.linalg.norm(self.span.T @ X, axis=0) / np.linalg.norm(X, axis=0))


def inverse_vectors(vectors: Array) -> ComplexArray:
    """Return X^-1 of eigenvectors as columns; the pseudo-inverse where they have nearly lost independence (defective poles)."""
    X = np.asarray(vectors, dtype=np.complex128)
    try:
        inverse = np.asarray(np.linalg.inv(X), dtype=complex)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(X), dtype=complex)
    if np.linalg.norm(X, 1) * np.linalg.norm(inverse, 1) < _MAX_CONDITION:
        return inverse
    return np.asarray(np.linalg.pinv(X), dtype=complex)


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
            return np.asarray(V[place_of(self.before)]), np.asarray(V[place_of(self.after)])
        h = self.recurrence
        blocks = V.reshape(h.shape[0], self.block, -1)
        combined = np.tensordot(h.T, blocks, axes=1).reshape(h.shape[1] * self.block, -1)
        return V[: h.shape[1] * self.block], combined


def place_of(index: IntArray) -> slice | IntArray:
    """Return rows that are consecutive, as they are for whole blocks, as a slice, which takes no time; others as they are."""
    first, last = int(index[0]), int(index[-1])
    if last - first + 1 == index.size and np.array_equal(index, np.arange(first, last + 1)):
        return slice(first, last + 1)
    return index


class DataMatrix(ABC):
    """The object between the data and the factorizations.

    H(0) and H(1) are given by `shifted`; `tall` holds the rows of both together, and `row_shift` belongs to its factors. What a
    structure does not allow is None, or a DataError that says so.
    """

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
    def observable(self) -> Any:
        """The matrix that is factored: this one, or in the controllable form that of the transposed response."""
        return self

    @property
    def fitted(self) -> Any:
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

    def with_columns(self, factors: Factors) -> Factors:
        """The factors with what the indicators need of the columns, where these are not Q itself."""
        return factors

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

    @abstractmethod
    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Shapes and participation of the eigenvalues of a model: from C and B, or by least squares on the data."""

    def model(self, triple: Triple) -> Triple:
        """The model of the response, from that of the matrix that was factored."""
        return triple

    def _has_no(self, what: str) -> NoReturn:
        raise DataError(
            f"this realization needs {what}",
            f"the data matrix has none: {self.describe()}",
            "Choose another method, see methods().",
        )


class DerivedMatrix(DataMatrix):
    """A data matrix whose poles are those of another one, `inner`."""

    inner: Any

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a result made from this matrix must say."""
        return tuple(self.inner.warnings)

    def describe(self) -> str:
        """What the matrix is, in words."""
        return str(self.inner.describe())

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return np.asarray(self.inner.to_s(poles))

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles in the plane of the inner matrix."""
        return np.asarray(self.inner.from_s(poles))

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None when it is continuous."""
        interval: float | None = self.inner.dt
        return interval


@dataclass(frozen=True, eq=False, kw_only=True)
class Realization(ABC):
    """Models of all orders that one method reads off one data matrix, cut from arrays that are computed once.

    `factors`: of the matrix that the method factors, or of a stand-in with the same singular values. `matrix`: that was factored.
    `notes`: what was chosen, in words.
    """

    factors: Factors
    matrix: DataMatrix
    notes: tuple[str, ...] = ()

    @abstractmethod
    def triple(self, n: int) -> Triple:
        """Return the model of order n.

        Raises `DataError`: an order beyond the rank, or one that the method cannot have.
        """
