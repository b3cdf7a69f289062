"""Responses of many outputs through few combinations of them: as many as states can need, by a randomized range.

With H = D X, D the outputs' scale, and orthonormal U (l, r) that spans the range of X, the responses U'X of r combinations hold what
any model of fewer states can explain, H = D U (U'X). What they do not hold, |X - U U'X|^2, is measured over all lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.model.checks import Array, RealArray
from modalscope.model.response import Response, output_scale

__all__ = ["Combinations", "combinations", "enough"]

#: Combinations beside the states that are asked: terms of the polynomials, and directions to spare.
_BESIDE = 40

#: With fewer than so many times as many outputs as combinations nothing is gained.
_WORTH = 3

#: Powers of the randomized range: two leave the last wanted direction as good as the first.
_POWERS = 2

#: Numbers of the data that are looked at together.
_AT_A_TIME = 4_000_000

#: Share of the energy below which what is discarded is measured itself, for the difference of the sums would be rounding.
_ROUNDING = 1e-10


def enough(outputs: int, order: int) -> int | None:
    """Return how many combinations serve models up to an order; None where there are hardly more outputs than that.

    Examples
    --------
    >>> enough(1000, 80), enough(300, 80)
    (120, None)
    """
    count = order + _BESIDE
    return count if outputs >= _WORTH * count else None


@dataclass(frozen=True, eq=False)
class Combinations:
    """A response of r combinations of l outputs (made by `combinations`).

    Parameters
    ----------
    response : Response
        U'X.
    spread : array, (l, r)
        D U: shapes of all outputs from those of the combinations.
    back : array, (r, l)
        U' D^-1: combinations of values of all outputs.
    discarded : float
        |X - U U'X|^2 / |X|^2.
    """

    response: Response
    spread: RealArray
    back: RealArray
    discarded: float

    @property
    def words(self) -> str:
        """What was done, in words."""
        outputs, count = self.spread.shape
        return f"{outputs} outputs through {count} combinations, which leave out {self.discarded:.2g} of their energy"


def combinations(response: Response, count: int, seed: int = 0) -> Combinations:
    """Return the response of `count` combinations of the outputs, which hold nearly all of its energy.

    Parameters
    ----------
    response : Response
    count : int
        r.
    seed : int
        Of the random directions that the range is first seen from; two powers make the result depend on it little.

    References
    ----------
    Halko, Martinsson and Tropp, "Finding structure with randomness", SIAM Review 53 (2011), algorithm 4.4.
    """
    scale = output_scale(response)
    scale = np.where(scale > 0, scale, 1.0)
    data = _Columns(response.values, scale)
    W: RealArray = np.random.default_rng(seed).standard_normal((data.columns, count))
    for _ in range(_POWERS):
        W = np.linalg.qr(data.transposed_times(np.linalg.qr(data.times(W))[0]))[0]
    U = np.linalg.qr(data.times(W))[0]
    columns = data.transposed_times(U)
    left = 1 - float(np.sum(columns**2)) / data.energy
    discarded = left if left > _ROUNDING else data.left_by(U, columns) / data.energy
    back = U.T / scale
    return Combinations(_labelled(response, data.as_response(columns), back), scale[:, None] * U, back, discarded)


def _labelled(response: Response, values: Array, back: RealArray) -> Response:
    """Return the combinations' response: what belongs to single outputs has no meaning for them, but variances add up."""
    count = len(back)
    changed: dict[str, Any] = {
        "values": values,
        "output_dofs": tuple(f"combination {k + 1}" for k in range(count)),
        "units": (("",) * count, response.units[1]),
        "geometry": None,
    }
    for name in ("variance", "coherence"):
        if getattr(response, name, None) is not None:
            changed[name] = None
    variance = response.known_variance
    if variance is not None:
        changed["variance"] = np.einsum("ro,kom->krm", back**2, variance, optimize=True)
    known = getattr(response, "feedthrough", None)
    if known is not None:
        changed["feedthrough"] = back @ known
    return replace(response, **changed)


class _Columns:
    """X (l, K m) of level outputs, complex numbers as two real columns, by products over stretches of lines."""

    def __init__(self, values: Array, scale: RealArray) -> None:
        self.values, self.scale = values, scale
        self.count, self.outputs, inputs = values.shape
        self.each = inputs * (2 if np.iscomplexobj(values) else 1)
        self.columns = self.count * self.each
        self.energy = sum(float(np.sum(part**2)) for _, part in self._parts())

    def _parts(self) -> Iterator[tuple[slice, RealArray]]:
        """Yield which columns, and some of them as rows, (columns, l)."""
        step = max(_AT_A_TIME // (self.outputs * self.each), 1)
        for start in range(0, self.count, step):
            part = np.ascontiguousarray(self.values[start : start + step])
            real = part.view(np.float64).reshape(len(part), self.outputs, self.each)
            level = np.empty((len(part), self.each, self.outputs))
            np.divide(real.transpose(0, 2, 1), self.scale, out=level)
            yield slice(start * self.each, (start + len(part)) * self.each), level.reshape(-1, self.outputs)

    def times(self, right: RealArray) -> RealArray:
        """X W, (l, r)."""
        return np.asarray(sum(part.T @ right[s] for s, part in self._parts()))

    def transposed_times(self, left: RealArray) -> RealArray:
        """X' U, (columns, r)."""
        found = np.empty((self.columns, left.shape[1]))
        for s, part in self._parts():
            np.matmul(part, left, out=found[s])
        return found

    def as_response(self, columns: RealArray) -> Array:
        """Return columns X' U as lines or samples of r outputs, (K, r, m)."""
        values = np.ascontiguousarray(columns.reshape(self.count, self.each, -1).transpose(0, 2, 1))
        return values.view(complex) if np.iscomplexobj(self.values) else values

    def left_by(self, U: RealArray, columns: RealArray) -> float:
        """|X - U U'X|^2."""
        return sum(float(np.sum((part - columns[s] @ U.T) ** 2)) for s, part in self._parts())
