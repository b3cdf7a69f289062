"""Block-diagonalize state matrices, also with repeated or defective poles (Eqs. 15-16), and take their logarithm (Eqs. 5-8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import is_real
from modalscope.numerics.linear_systems import sampled, scaled, state_scale
from modalscope.numerics.orthonormal import most_real

#: An eigenvalue whose sensitivity (1 / cosine of the angle between its left and right eigenvectors) is above this has lost half
#: of its digits: it is nearly defective.
SENSITIVE = 1e7


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Block:
    """One diagonal block of a modal form.

    `states`: its states. `poles`: its poles: a real one, a conjugate pair, or a whole cluster that no well conditioned coordinates take
    apart. `separate`: false for such a cluster: its poles lack eigenvectors of their own, or nearly so.
    """

    states: slice
    poles: ComplexArray
    separate: bool


def block_diagonal_basis(A: RealArray, frequency: RealArray) -> tuple[RealArray, RealArray, tuple[Block, ...], float]:
    """Return T and block diagonal M with A T = T M, the blocks, and the condition of T in well scaled states.

    Poles with sound eigenvectors stand in blocks of their own. The others are gathered by rising distance until the
    condition of T is below `SENSITIVE`; such a cluster's block is its part of the ordered real Schur form.

    `A` (n, n). `frequency` (n,): what the blocks are ordered by, for the eigenvalues in the order of `numpy.linalg.eigvals`.
    """
    scale = state_scale(A)
    A = scaled(A, scale)
    eigen = sla.eig(A, left=True)
    values, left, right = (np.asarray(part, dtype=complex) for part in eigen)
    cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))  # both are of length one
    suspect = cosine * SENSITIVE < 1
    radius = float(np.abs(values).max(initial=0))
    # distances at which suspects are one cluster: from the spread of a perturbed double pole up to all of them
    for distance in (*(radius * 10.0**power for power in range(-7, 0)), np.inf):
        T, M, blocks = _assemble(A, values, right, _clusters(values, suspect, distance), frequency)
        condition = float(np.linalg.cond(T)) if values.size else 1.0
        if not suspect.any() or condition < SENSITIVE:
            return scale[:, None] * T, M, blocks, condition
    T, M, blocks = _assemble(A, values, right, [np.arange(values.size)], frequency)
    return scale[:, None] * T, M, blocks, 1.0


def _clusters(values: ComplexArray, suspect: BoolArray, distance: float) -> list[IntArray]:
    """Return the indices of each block: pairs and real poles alone, suspects joined within the distance."""
    upper = values.real + 1j * np.abs(values.imag)
    groups: list[IntArray] = [np.array([i]) for i in np.flatnonzero((values.imag >= 0) & ~suspect)]
    left = set(np.flatnonzero((values.imag >= 0) & suspect).tolist())
    while left:
        members = [left.pop()]
        for member in members:
            near = {i for i in left if np.abs(upper[i] - upper[member]) <= distance}
            left -= near
            members += sorted(near)
        groups.append(np.array(sorted(members)))
    return groups


def _assemble(
    A: RealArray, values: ComplexArray, vectors: ComplexArray, groups: list[IntArray], frequency: RealArray
) -> tuple[RealArray, RealArray, tuple[Block, ...]]:
    n = A.shape[0]
    T, M = np.zeros((n, n)), np.zeros((n, n))
    blocks, start = [], 0
    for group in sorted(groups, key=lambda g: float(np.min(frequency[g]))):
        if len(group) == 1:
            basis, inner = _pair(values[group[0]], vectors[:, group[0]])
        else:
            basis, inner = _invariant(A, values, group)
        states = slice(start, start + basis.shape[1])
        T[:, states], M[states, states] = basis, inner
        poles = np.asarray(np.linalg.eigvals(inner), dtype=complex)
        blocks.append(Block(states=states, poles=poles, separate=len(group) == 1))
        start = states.stop
    return T, M, tuple(blocks)


def _pair(value: complex, vector: ComplexArray) -> tuple[RealArray, RealArray]:
    if value.imag == 0:
        return vector.real[:, None] / np.linalg.norm(vector.real), np.array([[value.real]])
    # turn the vector so that its real and imaginary parts are orthogonal: the best conditioned real basis of the pair
    turned = most_real(vector)
    basis = np.column_stack([turned.real, turned.imag])
    return basis / np.linalg.norm(turned), np.array([[value.real, value.imag], [-value.imag, value.real]])


def _invariant(A: RealArray, values: ComplexArray, group: IntArray) -> tuple[RealArray, RealArray]:
    """Return an orthonormal basis of the invariant subspace of a cluster, and A on it, by the ordered real Schur form."""
    upper = values.real + 1j * np.abs(values.imag)
    inside = np.zeros(values.size, bool)
    inside[group] = True
    inside |= np.isin(upper, upper[group])

    def chosen(real: float, imag: float = 0.0) -> bool:
        # the reordering perturbs the eigenvalues: each belongs to the nearest of those computed before
        return bool(inside[np.argmin(np.abs(upper - (real + 1j * abs(imag))))])

    S, Z, count = sla.schur(A, output="real", sort=chosen)
    return Z[:, :count], S[:count, :count]


def continuous(A: RealArray, B: RealArray, dt: float, *, held: bool) -> tuple[RealArray, RealArray]:
    """Return the continuous A and B whose exact sampling is given; the logarithm is that of the modal form's blocks."""
    z = np.asarray(np.linalg.eigvals(A), dtype=complex)
    bad = is_real(z) & (z.real <= 0)
    if bad.any():
        few = ", ".join(f"{v:.3g}" for v in z[bad].real[:4])
        raise DataError(
            "a real continuous model:",
            f"{int(bad.sum())} poles of the sampled one lie on the real axis at or below zero ({few})",
            "Lower the order, or remove those states first: their poles are at the Nyquist frequency and carry no mode.",
        )
    T, M, blocks, _ = block_diagonal_basis(A, np.abs(np.log(z)))
    for block in blocks:
        M[block.states, block.states] = _logarithm(M[block.states, block.states], block.separate) / dt
    rates = np.asarray(np.linalg.solve(T.T, (T @ M).T).T, dtype=float)
    if not held:
        return rates, B
    step = sampled(rates, np.eye(len(A)), dt, held=True)[1]
    return rates, np.asarray(np.linalg.solve(step, B), dtype=float)


def _logarithm(block: RealArray, separate: bool) -> RealArray:
    """Return the logarithm of a block of the modal form: of its eigenvalue, or of the matrix where poles share it."""
    if not separate:
        return np.real(sla.logm(block))
    if block.shape == (1, 1):
        return np.log(block)
    s = np.log(complex(block[0, 0], block[0, 1]))
    return np.array([[s.real, s.imag], [-s.imag, s.real]])
