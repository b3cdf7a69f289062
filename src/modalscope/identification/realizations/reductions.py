"""Reduce the canonical form of the null space to minimum order, so that its extraneous poles are gone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
import scipy.linalg as sla

from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.matrices.matrix import Realization, Triple
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.companion import NullSpaceCompanion, companion_matrix
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError, check_choice

#: By projection on the factor's own states, by ERA on the model's Markov parameters, by the sign of time.
REDUCTIONS = ("projection", "markov", "reversed")


@dataclass(frozen=True, eq=False, kw_only=True)
class Reduced(Realization):
    """Models of minimum order from a canonical form.

    `way`: (companion, order) -> model.
    """

    companion: NullSpaceCompanion
    way: Callable[[NullSpaceCompanion, int], Triple]

    def triple(self, n: int) -> Triple:
        """Return the model of n states; by "reversed" of as many as lie outside the circle."""
        return self.way(self.companion, n)


@singledispatch
def reduced(realization: Realization, how: str) -> Reduced:
    """Return models of minimum order from a canonical form.

    `realization`: the canonical form of the null space, of samples; another one is a `DataError`. `how`: "projection":
    (E P)# A~ (E P), which is the alternate method. "markov": ERA on C~ A~^k B~, the model's own Markov parameters. "reversed": data that
    run backward grow, so that a mode's pole becomes 1 / z outside the unit circle while the minimum-norm extraneous poles stay inside;
    the invariant subspace of those outside is the model. Without noise exact; a mode that does not decay is not told apart.
    """
    raise DataError(
        f"reduction={how!r} was asked",
        "only the canonical form of the null space, in the time domain, has extraneous poles to be rid of",
        "Leave it out, or use method='polyreference', domain='time'.",
    )


@reduced.register
def _(companion: NullSpaceCompanion, how: str) -> Reduced:
    ways = {"projection": _projected, "markov": _from_markov, "reversed": _from_reversal}
    way = ways[check_choice("reduction", how, REDUCTIONS)]
    notes = (*companion.notes, f"reduced to minimum order: {how}")
    return Reduced(factors=companion.factors, matrix=companion.matrix, notes=notes, companion=companion, way=way)


def _projected(companion: NullSpaceCompanion, n: int) -> Triple:
    model = companion.triple(n)
    if model.span is None or model.B is None:
        return model
    Z = model.span
    return Triple(Z.T @ model.A @ Z, Z.T @ model.B, model.C @ Z, n)


def _from_markov(companion: NullSpaceCompanion, n: int) -> Triple:
    model = companion.triple(n)
    assert model.B is not None
    sampled = StateSpace(A=model.A, B=model.B, C=model.C, dt=1.0)
    rows, columns = companion.matrix.block_rows, len(companion.factors.Q) // model.B.shape[1]
    markov = hankel(sampled.impulse_response(rows + columns), block_rows=rows, block_columns=columns)
    return balanced(markov, factorize(markov.shifted(0), n)).triple(n)


def reversed_companion(companion: NullSpaceCompanion, n: int) -> RealArray:
    """Return the companion matrix of the same null space with time reversed: V_0 = R [V_r; ...; V_1], minimum norm."""
    companion.factors.check_order(n)
    shift, r = companion.shift, companion.matrix.block_rows
    P = companion.P[:, :n]
    backward = P.reshape(r + 1, shift.block, n)[::-1].reshape(P.shape)
    columns, target = backward[: shift.block * r], backward[shift.block * r :]
    return companion_matrix(target @ np.linalg.pinv(columns), shift, r)


def _from_reversal(companion: NullSpaceCompanion, n: int) -> Triple:
    backward = reversed_companion(companion, n)
    T, Z, k = sla.schur(backward, output="real", sort="ouc")
    if k == 0:
        raise DataError(
            f"order={n}, reduction='reversed' was asked", "no reversed pole grows", "Use reduction='projection'."
        )
    # [I, X] takes the part of a state that lies in the growing subspace along the decaying one
    X = sla.solve_sylvester(T[:k, :k], -T[k:, k:], T[:k, k:])
    matrix, shift = companion.matrix, companion.shift
    column = np.asarray(matrix.first_block_column(tall=True))
    column = shift.unweighted(column).reshape(-1, shift.block, column.shape[1])[:0:-1].reshape(-1, column.shape[1])
    # the state [V_r; ...; V_1] belongs to one sample later than V_0, and the model runs against it
    inverse = np.asarray(np.linalg.inv(T[:k, :k]), dtype=float)
    state = Z[:, :k].T @ column + X @ (Z[:, k:].T @ column)
    head = np.linalg.pinv(np.asarray(matrix.first_block(np.eye(matrix.outputs))))
    return Triple(inverse, state, head @ Z[-shift.block :, :k] @ T[:k, :k], k)
