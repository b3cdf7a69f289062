"""Reduce the canonical form of the null space to minimum order, so that its extraneous poles are gone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, singledispatch

from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.factor import factorize
from modalscope.identification.matrices.hankel import hankel
from modalscope.identification.matrices.matrix import Realization, Triple
from modalscope.identification.realizations.balanced import balanced
from modalscope.identification.realizations.companion import NullSpaceCompanion
from modalscope.numerics.errors import DataError, check_choice


@dataclass(frozen=True, eq=False, kw_only=True)
class Reduced(Realization):
    """Models of minimum order from a canonical form, by `way`: order -> model."""

    way: Callable[[int], Triple]

    def triple(self, n: int) -> Triple:
        """Return the model of n states."""
        return self.way(n)


@singledispatch
def reduced(realization: Realization, how: str) -> Reduced:
    """Return models of minimum order from a canonical form.

    `realization`: the canonical form of the null space, of samples; another one is a `DataError`. `how`: "projection":
    (E P)# A~ (E P), which is the alternate method. "markov": ERA on C~ A~^k B~, the model's own Markov parameters.
    """
    raise DataError(
        f"reduction={how!r}:",
        "only the canonical form of the null space, in the time domain, has extraneous poles to be rid of",
        "Leave it out, or use method='polyreference', domain='time'.",
    )


@reduced.register
def _(companion: NullSpaceCompanion, how: str) -> Reduced:
    ways = {"projection": _projected, "markov": _from_markov}
    way = partial(ways[check_choice("reduction", how, ways)], companion)
    notes = (*companion.notes, f"reduced to minimum order: {how}")
    return Reduced(factors=companion.factors, matrix=companion.matrix, notes=notes, way=way)


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
