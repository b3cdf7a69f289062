"""The lines of all runs with what drives them, whole: columns of poles, and what a model gives on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.driven_basis import DrivenBasis
from modalscope.model.pole_functions import functions_at
from modalscope.model.poles import is_real

__all__ = ["DrivenLines"]

#: Complex numbers in the columns, or in the outputs, that are made at a time: 1 MB.
_NUMBERS = 1 << 16


@dataclass(frozen=True, eq=False, slots=True)
class DrivenLines:
    """Lines with all drives side by side: the inputs, then the ends of every run, which are zero on the lines of the others.

    Parameters
    ----------
    points : array of complex, (F,)
        Where the lines lie in the plane of the poles.
    drives : array of complex, (F, m + R)
    inputs : int
        m.
    """

    points: ComplexArray
    drives: ComplexArray
    inputs: int

    def divided(self, sizes: RealArray) -> DrivenLines:
        """Return the same lines with every drive divided by its size, (m + R,)."""
        return DrivenLines(self.points, self.drives / sizes, self.inputs)

    def pairs(self, poles: Array, sides: Array, chain: Array | None = None) -> tuple[ComplexArray, ComplexArray]:
        """Return b'd / (x - p) and conj(b)'d / (x - conj p), (F, n) each; with the chain dp/ds their derivatives by s.

        Parameters
        ----------
        poles : array of complex, (n,)
            In the plane of the points.
        sides : array of complex, (n, m + R)
            b.
        chain : array of complex, (n,), optional
        """
        x = self.points[:, None]
        own, pair = 1 / (x - poles), 1 / (x - np.conj(poles))
        if chain is not None:
            own, pair = chain * own**2, np.conj(chain) * pair**2
        return (self.drives @ sides.T) * own, (self.drives @ sides.conj().T) * pair

    def columns(self, poles: Array, sides: Array, chain: Array | None = None) -> ComplexArray:
        """Return w (2 F, n) such that a shape c contributes Re(c w) to the rows: real parts of the lines, then imaginary parts."""
        own, pair = self.pairs(poles, sides, chain)
        return np.concatenate([own + pair.conj(), -1j * (own - pair.conj())])

    def evaluated(
        self, poles: Array, shapes: Array, participation: Array, direct: Array
    ) -> Iterator[tuple[slice, ComplexArray]]:
        """Yield some lines, and the outputs there (lines, l) of shapes (l, n), participation (n, m + R) and D (l, m)."""
        alone, step = is_real(poles), max(_NUMBERS // max(len(poles), len(shapes), 1), 1)
        for start in range(0, len(self.points), step):
            s = slice(start, start + step)
            own, pair = DrivenLines(self.points[s], self.drives[s], self.inputs).pairs(poles, participation)
            found = own @ shapes.T + np.where(alone, 0, pair) @ shapes.conj().T
            found += self.drives[s, : self.inputs] @ direct.T
            yield s, found

    def basis(self, poles: Array, values: ComplexArray, relative: ComplexArray, powers: tuple[int, ...]) -> DrivenBasis:
        """Return the columns of poles on all rows, nothing compressed.

        Terms are the inputs times powers of the relative frequency j f / f_max, (F,), then the ends times one power less.
        """
        g = functions_at(self.points, poles)
        driven = self.drives[:, :, None] * g[:, None]
        inputs, ends = np.split(self.drives, [self.inputs], axis=1)
        terms = [(inputs, k) for k in powers] + [(ends, k - 1) for k in powers if k]
        rows = np.empty((2 * len(g), sum(drives.shape[1] for drives, _ in terms)))
        first = 0
        for drives, k in terms:  # one after the other into their place: of long records each copy is large
            last = first + drives.shape[1]
            _real_above_imaginary(drives * relative[:, None] ** k, rows[:, first:last])
            first = last
        functions = np.empty((2 * len(g), driven[0].size))
        _real_above_imaginary(driven.reshape(len(g), -1), functions)
        data = np.concatenate([values.real, values.imag])
        return DrivenBasis(terms=rows, functions=functions, data=data, drives=self.drives.shape[1])


def _real_above_imaginary(columns: ComplexArray, place: RealArray) -> None:
    """Put real parts above imaginary parts, (F, k) -> (2 F, k)."""
    place[: len(columns)], place[len(columns) :] = columns.real, columns.imag
