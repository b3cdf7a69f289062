"""Balanced realizations and balanced truncation of state-space models."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from modalscope.model.checks import DataError, RealArray, check_count
from modalscope.model.gramians import gramian_factor

if TYPE_CHECKING:
    from modalscope.model.statespace import StateSpace

__all__ = ["Balanced", "balance"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Balanced:
    """A balanced model, whole or cut to its leading states.

    Parameters
    ----------
    state_space : StateSpace
        The model: both Gramians are diag(hankel_singular_values) when it is whole.
    hankel_singular_values : array
        All of them, falling; those below rounding belong to states that are not seen or not driven.
    T, inverse : array, (n, k), (k, n)
        Change of coordinates x = T z, and its left inverse.
    error_bound : float
        2 times the sum of the singular values that were cut: no frequency response of the cut model is further than this from
        the whole one, in the largest singular value over outputs and inputs, at any frequency.
    """

    state_space: StateSpace
    hankel_singular_values: RealArray
    T: RealArray
    inverse: RealArray
    error_bound: float


def balance(model: StateSpace, order: int | None, steady_state: bool) -> Balanced:
    """Return the balanced realization or its leading states (see `StateSpace.balanced`)."""
    sampled = model.dt is not None
    reach, sight = gramian_factor(model.A, model.B, sampled), gramian_factor(model.A.T, model.C.T, sampled)
    T, inverse, singular = _balancing(reach, sight)
    A, B, C, D = inverse @ model.A @ T, inverse @ model.B, model.C @ T, np.array(model.D)
    kept = len(A) if order is None else check_count("order", order)
    if kept > len(A):
        raise DataError(
            f"a balanced model of order {kept} was asked",
            f"{len(A)} states are both seen by the outputs and driven by the inputs",
            f"Lower the order to at most {len(A)}.",
        )
    if steady_state:
        A, B, C, D = _steady_state_cut(A, B, C, D, kept, sampled)
    return Balanced(
        state_space=replace(model, A=A[:kept, :kept], B=B[:kept], C=C[:, :kept], D=D),
        hankel_singular_values=singular,
        T=T[:, :kept],
        inverse=inverse[:kept],
        error_bound=float(2 * singular[kept:].sum()),
    )


def _balancing(reach: RealArray, sight: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return T (n, k), its left inverse (k, n) and the Hankel singular values of factors of both Gramians.

    From sight' reach = U S V': T = reach V S^-1/2 and T^-1 = S^-1/2 U' sight'. The k states above rounding, n eps of the
    first, are kept; no coordinates balance the others, which outputs do not see or inputs do not drive.
    """
    U, s, Vt = np.linalg.svd(sight.T @ reach)
    k = int(np.count_nonzero(s > s.size * np.finfo(float).eps * s[0])) if s.size and s[0] > 0 else 0
    root = np.sqrt(s[:k])
    return reach @ Vt[:k].T / root, (U[:, :k] / root).T @ sight.T, s


def _steady_state_cut(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray, order: int, sampled: bool
) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Drop all but `order` states of a balanced model by putting them in their steady state: the gain at 0 Hz stays."""
    n = A.shape[0]
    rest = (np.eye(n - order) if sampled else 0) - A[order:, order:]
    fixed = np.linalg.solve(rest, np.hstack([A[order:, :order], B[order:]]))
    stateful, driven = fixed[:, :order], fixed[:, order:]
    return (
        A[:order, :order] + A[:order, order:] @ stateful,
        B[:order] + A[:order, order:] @ driven,
        C[:, :order] + C[:, order:] @ stateful,
        D + C[:, order:] @ driven,
    )
