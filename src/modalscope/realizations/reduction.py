"""From a canonical form to minimum order (after Eq. 54): three ways to be rid of the extraneous poles, in the time domain."""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import factorize
from modalscope.blocks.hankel import Hankel, hankel
from modalscope.model.checks import DataError, RealArray, check_choice
from modalscope.model.statespace import StateSpace
from modalscope.realizations.balanced import balanced
from modalscope.realizations.companion import companion_matrix
from modalscope.realizations.triple import Realization, Triple

__all__ = ["REDUCTIONS", "reduced", "reversed_companion"]

#: By projection on the factor's own states, by ERA on the model's Markov parameters, by the sign of time.
REDUCTIONS = ("projection", "markov", "reversed")


def reduced(matrix: Hankel, realization: Realization, how: str) -> Realization:
    """Return models of minimum order from a canonical form.

    Parameters
    ----------
    matrix : Hankel
    realization : Realization
        The canonical form of the null space.
    how : {"projection", "markov", "reversed"}
        "projection": (E P)# A~ (E P), which is the alternate method. "markov": ERA on C~ A~^k B~, the model's own Markov parameters.
        "reversed": data that run backward grow, so that a mode's pole becomes 1 / z outside the unit circle while the
        minimum-norm extraneous poles stay inside; the invariant subspace of those outside is the model. Without noise exact; a
        mode that does not decay is not told apart.

    Returns
    -------
    Realization
        Models of n states; by "reversed" of as many as lie outside the circle.
    """
    check_choice("reduction", how, REDUCTIONS)
    way = {"projection": _projected, "markov": _from_markov, "reversed": _from_reversal}[how]
    return Realization(
        realization.factors,
        lambda n: way(matrix, realization, n),
        canonical=True,
        notes=(*realization.notes, f"reduced to minimum order: {how}"),
    )


def _projected(matrix: Hankel, realization: Realization, n: int) -> Triple:
    model = realization.triple(n)
    if model.span is None or model.B is None:
        return model
    Z = model.span
    return Triple(Z.T @ model.A @ Z, Z.T @ model.B, model.C @ Z, n)


def _from_markov(matrix: Hankel, realization: Realization, n: int) -> Triple:
    model = realization.triple(n)
    assert model.B is not None
    sampled = StateSpace(A=model.A, B=model.B, C=model.C, dt=1.0)
    own = hankel(
        sampled.impulse_response(matrix.block_rows + matrix.block_columns),
        block_rows=matrix.block_rows,
        block_columns=matrix.block_columns,
    )
    return balanced(own, factorize(own.shifted(0), n)).triple(n)


def reversed_companion(matrix: Hankel, realization: Realization, n: int) -> RealArray:
    """Return the companion matrix of the same null space with time reversed: V_0 = R [V_r; ...; V_1], minimum norm."""
    realization.factors.check_order(n)
    shift, r = matrix.row_shift, matrix.block_rows
    P = shift.unweighted(realization.factors.P[:, :n])
    backward = P.reshape(r + 1, shift.block, n)[::-1].reshape(P.shape)
    known, target = backward[: shift.block * r], backward[shift.block * r :]
    return companion_matrix(target @ np.linalg.pinv(known), shift, r)


def _from_reversal(matrix: Hankel, realization: Realization, n: int) -> Triple:
    backward = reversed_companion(matrix, realization, n)
    T, Z, k = sla.schur(backward, output="real", sort="ouc")
    if k == 0:
        raise DataError(
            f"order={n} with reduction='reversed' was asked",
            "no pole of the reversed data lies outside the unit circle",
            "Use reduction='projection'.",
        )
    # [I, X] takes the part of a state that lies in the growing subspace along the decaying one
    X = sla.solve_sylvester(T[:k, :k], -T[k:, k:], T[:k, k:])
    block = matrix.row_shift.block
    column = np.asarray(matrix.first_block_column(tall=True))
    column = matrix.row_shift.unweighted(column).reshape(-1, block, column.shape[1])[:0:-1].reshape(-1, column.shape[1])
    # the state [V_r; ...; V_1] belongs to one sample later than V_0, and the model runs against it
    inverse = np.asarray(np.linalg.inv(T[:k, :k]), dtype=float)
    state = Z[:, :k].T @ column + X @ (Z[:, k:].T @ column)
    head = np.linalg.pinv(np.asarray(matrix.first_block(np.eye(matrix.outputs))))
    return Triple(inverse, state, head @ Z[-block:, :k] @ T[:k, :k], k)
