"""Realized models (A, B, C), their eigenvalues, and shapes and participation fitted to the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modalscope.data.response import Response
from modalscope.identification.matrices.factor import Factors
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.operators import real_times

#: Maximum condition of eigenvectors for their inverse; above it they are nearly dependent (defective poles).
_MAX_CONDITION = 1e13

#: Models of one data matrix are the same within this fraction of their largest entry: rounding.
_SAME_MODEL = 1e-12


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

    def has_poles_of(self, other: Triple) -> bool:
        """Whether another model from the same factors is this one in other units of its states, and so at every smaller order.

        States of which the row factor is P d^a are those of P d^(1/2) but for d^(a - 1/2): leading blocks stay leading blocks.
        """
        if (
            self.factors is None
            or self.factors is not other.factors
            or (self.rank, self.turned) != (other.rank, other.turned)
        ):
            return False
        if any(model.span is not None or len(model.A) != model.rank for model in (self, other)):
            return False
        return _same(self._balanced(self.A, 1, 1), other._balanced(other.A, 1, 1))

    def has_ends_of(self, other: Triple) -> bool:
        """Whether B and C of a model with the same poles are the same, too, in the same units of states."""
        if self.B is None or other.B is None:
            return False
        ends = ((self.B, other.B, 1, 0), (self.C, other.C, 0, 1))
        return all(_same(self._balanced(a, *sides), other._balanced(b, *sides)) for a, b, *sides in ends)

    def _balanced(self, values: RealArray, left: int, right: int) -> RealArray:
        """Return an array of states on either side (0 or 1) for those of P d^(1/2)."""
        assert self.factors is not None
        unit = self.factors.d[: self.rank] ** (self.power - 0.5)
        scaled = values * unit[:, None] if left else values
        return np.asarray(scaled / unit if right else scaled)

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


def _same(one: RealArray, other: RealArray) -> bool:
    return bool(np.all(np.abs(one - other) <= _SAME_MODEL * np.max(np.abs(one), initial=0.0)))


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


def padded(rows: Sequence[Array]) -> ComplexArray:
    """Return rows of several orders below each other, zeros behind those that are shorter than the longest."""
    table, start = np.zeros((sum(map(len, rows)), max(part.shape[1] for part in rows)), dtype=complex), 0
    for part in rows:
        table[start : start + len(part), : part.shape[1]] = part
        start += len(part)
    return table


@dataclass(frozen=True, eq=False)
class Misfit:
    """norm(measured - rebuilt) / norm(measured), each output divided by a scale.

    `scale` (l,).
    """

    response: Response
    scale: RealArray

    @cached_property
    def _whole(self) -> float:
        values = self.response.values
        energy = sum(np.einsum("klm,klm->l", part, part) for part in (values.real, values.imag))
        return float(np.sqrt(np.sum(energy / self.scale**2)))

    def of_left(self, left: RealArray) -> float:
        """Return the misfit by the energy (l, m) that is left of every channel."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._of_energy(float(np.sum(left / self.scale[:, None] ** 2)))

    def _of_energy(self, energy: float) -> float:
        ratio = np.sqrt(energy) / self._whole
        return float(ratio) if np.isfinite(ratio) else np.inf

    def of_fit(self, poles: Array, fit: ModalFit) -> float:
        """Return the misfit of a fit, rebuilt some lines or samples after the other.

        `poles` (k,): rad/s, as they are in the data.
        """
        basis = fit.basis or self.response.basis(poles, fit.powers)
        channels = basis.data.shape[1:]
        level = np.repeat(1 / self.scale, channels[1]).reshape(channels)  # in one piece, as what is left
        energy = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for left in basis.missed(fit.shapes, fit.participation, fit.terms[: basis.terms.shape[1]]):
                left *= level
                energy += float(np.vdot(left, left))
            return self._of_energy(energy)
