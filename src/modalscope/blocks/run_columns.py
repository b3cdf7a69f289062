"""The columns of one run of records on lines: polynomials times a one, the inputs that the run has, and the outputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from modalscope.blocks.record_gram import gram_by_points
from modalscope.model.checks import ComplexArray, IntArray, RealArray

if TYPE_CHECKING:
    from modalscope.blocks.record_lines import RecordLines

__all__ = ["RunColumns"]

#: Numbers in the columns of the lines that are taken at a time, complex ones: 2 MB, or an eighth of their products.
_NUMBERS, _EIGHTH = 1 << 17, 8


@dataclass(frozen=True, eq=False)
class RunColumns:
    """[p_j, p_j U, p_j Y] on the lines of a run, times the weights of the lines, every channel divided by its size.

    Parameters
    ----------
    matrix : RecordLines
    own : slice
        The lines of the run.
    """

    matrix: RecordLines
    own: slice

    @cached_property
    def inputs(self) -> tuple[IntArray, RealArray]:
        """The inputs that the run has, and their root mean squares on its lines."""
        drive = self.matrix.response.drive[self.own]
        used = np.flatnonzero(np.any(drive, axis=0))
        power = np.einsum("fi,fi->i", drive.real, drive.real) + np.einsum("fi,fi->i", drive.imag, drive.imag)
        return used, np.maximum(np.sqrt(power[used] / max(len(drive), 1)), 1e-300)

    @property
    def drives(self) -> int:
        """Channels that are eliminated: the ends and the inputs."""
        return 1 + int(self.inputs[0].size)

    @property
    def given(self) -> int:
        """Columns of these."""
        return self.drives * (self.matrix.block_rows + 1)

    @property
    def count(self) -> int:
        """Columns in all."""
        return self.given + self.matrix.outputs * (self.matrix.block_rows + 1)

    def channels(self, lines: slice | IntArray) -> ComplexArray:
        """Return a one, the inputs and the outputs on some lines, (lines, 1 + m + l)."""
        response, (used, size) = self.matrix.response, self.inputs
        values, drives = response.values[lines, :, 0], response.drive[lines]
        found = np.hstack([response.ones(lines)[:, None], drives[:, used] / size, values / self.matrix.output_scale])
        found *= self.matrix.line_weights[lines, None]
        return np.asarray(found)

    def rows(self, some: IntArray | None = None) -> Iterator[tuple[slice, RealArray]]:
        """Yield which of the lines, all or some, and the columns on them, real parts above imaginary ones."""
        own, drives, given, wide = self.own, self.drives, self.given, self.count
        step, count = max(_NUMBERS // wide, wide // _EIGHTH), own.stop - own.start if some is None else some.size
        for start in range(0, count, step):
            s = slice(start, min(start + step, count))
            here = slice(own.start + s.start, own.start + s.stop) if some is None else some[s]
            basis, channels = self.matrix.polynomials(here), self.channels(here)
            columns = np.empty((2, len(basis), wide))
            for values, side in (
                (channels[:, :drives, None] * basis[:, None, :], slice(None, given)),
                (basis[:, :, None] * channels[:, None, drives:], slice(given, None)),
            ):
                flat = values.reshape(len(basis), -1)
                columns[0, :, side], columns[1, :, side] = flat.real, flat.imag
            yield s, columns.reshape(-1, wide)

    def gram(self) -> RealArray | None:
        """Return the Gram matrix of the columns on all lines where it is had without them; None else."""
        first, count, matrix = self.own.start, self.own.stop - self.own.start, self.matrix
        if 2 * count <= self.count:
            return None

        def of_run(lines: slice) -> slice:
            return slice(first + lines.start, first + lines.stop, lines.step)

        return gram_by_points(
            count,
            lambda lines: matrix.plane.point(matrix.response.frequencies[of_run(lines)]),
            lambda lines: self.channels(of_run(lines)),
            lambda lines: matrix.polynomials(first + lines),
            given=self.drives,
            circle=matrix.dt is not None,
        )
