"""Records on lines: block rows of the outputs' transforms, from which the inputs and both ends of every run are eliminated.

On the lines x of a whole run of N samples x X = A X + B U + x (x(0) - x(N)) / sqrt(N), Y = C X + D U, exactly, so that with
polynomials p_k orthogonal on the lines

    p_k(x) Y = C p_k(A) X + sum_(j <= k) G_kj p_j(x) U + sum_(j <= k) t_kj p_j(x).

The rows p_j and p_j U are projected away, each run with its own inputs and its own ends; what is left lies side by side. The
polynomials are those of the lines of all runs together: the left factor [C p_0(A); ...; C p_q(A)] is one for all.

Every line may have a weight, since the equations hold line by line, and the rows of white noise stay white when the polynomials are
orthogonal under the same weights. Weights that follow the resonances bend the polynomials to them: a degree then shows damping that
would take half as many more with equal weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import Factors
from modalscope.blocks.few_points import Few, few_points
from modalscope.blocks.influence import Lines
from modalscope.blocks.operators import LargeMatrix
from modalscope.blocks.output_noise import noise_beside_quietest
from modalscope.blocks.plane import Plane, plane_of
from modalscope.blocks.polynomial_rows import PolynomialRows
from modalscope.blocks.polynomials import evaluate, orthogonal_basis
from modalscope.blocks.record_influence import Driven, RecordColumns, RecordInfluence, told_lines
from modalscope.blocks.run_columns import RunColumns
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.model.checks import Array, ComplexArray, DataError, IntArray, RealArray, check_count
from modalscope.model.line_choice import resonance_weights
from modalscope.model.output_levels import output_scale
from modalscope.model.record_spectra import RecordSpectra
from modalscope.model.record_sums import line_power
from modalscope.model.statespace import StateSpace
from modalscope.model.triangles import stacked_factor, triangle_of

__all__ = ["RecordLines", "record_lines"]

#: Lines on which polynomials are made orthogonal: those of a longer record are nearly so on all lines, which is as good.
_ORTHOGONAL = 32_768

#: Length that a column keeps beside those before it where products are enough: those by few points are known to 1e-12 or so.
_KEPT = 1e-3

#: Rows p_j U below this share of the largest, in multiples of rounding, are no directions of their own.
_ROUNDING = 16.0


def record_lines(
    spectra: RecordSpectra, *, domain: str, block_rows: int, order: int | None = None, equal_outputs: bool = True
) -> RecordLines:
    """Stack p_k(x) Y, k = 0 ... block_rows, on the lines of all runs, inputs and ends eliminated.

    Parameters
    ----------
    spectra : RecordSpectra
    domain : {"z", "s"}
        "z" is exact for inputs that were held between samples; both serve a structure measured through anti-aliasing filters.
    block_rows : int
        q, the degree.
    order : int, optional
        Largest number of states that will be asked; used to check that the lines suffice.
    equal_outputs : bool
        Whether outputs are brought to one level: that of their noise beside their root mean squares. Combinations of level outputs are
        level as they are.

    Raises
    ------
    DataError
        Fewer lines than unknowns: the sum over runs of 2 F - (q + 1)(1 + m) must be at least the order.

    Notes
    -----
    McKelvey, Akcay and Ljung, IEEE Trans. Automatic Control 41 (1996) 960-979; Pintelon, Schoukens and Vandersteen, same
    Transactions 42 (1997) 1717-1720.
    """
    q = check_count("block_rows", block_rows)
    response = spectra if domain == "z" else spectra.continuous()
    plane = plane_of(domain, response)
    scale = output_scale(response) if equal_outputs else np.ones(response.values.shape[1])
    w = resonance_weights(line_power(response), response.run)
    every = -(-response.count // _ORTHOGONAL)
    thin = plane.point(response.frequencies[::every])
    basis, recurrence = orthogonal_basis(thin, q, w[::every] * np.sqrt(response.count / thin.size))
    made = RecordLines(response, plane, float(basis[0, 0].real), recurrence, scale, w)
    if made.left < max(order or 1, 1):
        raise DataError(
            f"order {order or 1} with block_rows={q} was asked",
            f"{response.count} lines leave {made.left} equations when inputs and ends are eliminated",
            "Measure longer, widen the band, or lower block_rows or the order.",
        )
    return made.by_noise() if equal_outputs else made


class _Taken(NamedTuple):
    """What the elimination takes from one run: the rank that goes, of how many rows, and the coefficients taken off."""

    rank: int
    given: int
    taken_off: RealArray


@dataclass(frozen=True, eq=False)
class RecordLines(PolynomialRows):
    """The block matrix of records on lines (made by `record_lines`)."""

    response: RecordSpectra
    plane: Plane
    constant: float
    recurrence: RealArray
    output_scale: RealArray
    line_weights: RealArray
    row_shifts: tuple[int, ...] | None = None
    known: tuple[RealArray, tuple[_Taken, ...]] | None = None

    def by_noise(self) -> RecordLines:
        """Return the matrix with every output divided by its noise, the quietest as it was; the triangle is scaled in its place."""
        triangle, parts = self._eliminated
        noise = noise_beside_quietest(triangle, self.outputs)
        rows = np.tile(noise, self.block_rows + 1)
        triangle /= rows[:, None]
        for part in parts:
            part.taken_off[:] /= rows
        return replace(self, output_scale=self.output_scale * noise, known=(triangle, parts))

    @property
    def first_value(self) -> float:
        """p_0, the constant of the basis."""
        return self.constant

    def polynomials(self, lines: slice | IntArray) -> ComplexArray:
        """Return p_k on some lines, (lines, q + 1): they are not kept."""
        return evaluate(self.recurrence, self.constant, self.plane.point(self.response.frequencies[lines])).T

    @cached_property
    def judged(self) -> RecordSpectra:
        """The records' own lines, of long records those that tell; outputs that were levelled by their noise are judged by it, too."""
        found = self.response.judging()
        return found if self.known is None else replace(found, level=self.output_scale)

    @property
    def outputs(self) -> int:
        """Rows of a block."""
        return int(self.response.values.shape[1])

    @property
    def parts(self) -> tuple[_Taken, ...]:
        """What was taken from every run that has lines."""
        return self._eliminated[1]

    @property
    def left(self) -> int:
        """Columns that are left of all runs: the sum of 2 F - rank."""
        return sum(2 * (own.stop - own.start) - part.rank for own, part in zip(self.spans, self.parts, strict=True))

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Where the lines of every run stand that has any."""
        return tuple(own for own in self.response.spans_of_runs if own.stop > own.start)

    @property
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): what is left of all runs, times an orthonormal matrix."""
        return self._eliminated[0]

    @cached_property
    def _eliminated(self) -> tuple[RealArray, tuple[_Taken, ...]]:
        if self.known is not None:
            return self.known
        triangle, taken = np.zeros((0, self.outputs * (self.block_rows + 1))), []
        for own in self.spans:
            left, part = self._left_of(own)
            triangle = stacked_factor(triangle, left)
            taken.append(part)
        return np.ascontiguousarray(triangle.T), tuple(taken)

    def _left_of(self, own: slice) -> tuple[RealArray, _Taken]:
        """Project the outputs' rows of a run on the complement of p_j and p_j U, in chunks of lines.

        The triangular factor of [eliminated, outputs] stands in for the lines; the rank of its first columns is seen on it.
        """
        columns = RunColumns(self, own)
        given = columns.given
        R = triangle_of(lambda: (rows for _, rows in columns.rows()), columns.count, _KEPT, gram=columns.gram())
        known, beside = R[:given, :given], R[:given, given:]
        size = np.linalg.norm(known, axis=0)
        size = np.where(size > 0, size, 1)
        Q, T, order = sla.qr(known / size, pivoting=True, check_finite=False)
        diagonal = np.abs(np.diag(T))
        floor = _ROUNDING * max(R.shape) * np.finfo(float).eps
        rank = int(np.count_nonzero(diagonal > floor * diagonal[0]))
        taken_off = np.zeros((given, R.shape[1] - given))
        seen = Q[:, :rank].T @ beside
        taken_off[order[:rank]] = sla.solve_triangular(T[:rank, :rank], seen, check_finite=False)
        left = R[given:, given:] if rank == given else np.vstack([Q[:, rank:].T @ beside, R[given:, given:]])
        return left, _Taken(rank, given, taken_off / size[:, None])

    def shifted(self, k: int) -> LargeMatrix:
        """Return H(k): E0 and E1 applied to the triangular factor."""
        return LargeMatrix(super().shifted(k).dense())

    def tall(self) -> LargeMatrix:
        """Return all q + 1 block rows."""
        return LargeMatrix(super().tall().dense())

    def on_lines(self, rows: RealArray) -> RealArray:
        """Return H' X of the matrix over the told lines, (2 F, k), inputs and ends eliminated: X (l (q + 1), k)."""
        used = self.told.used
        found = np.zeros((2, used.size, rows.shape[1]))
        for own, part in zip(self.spans, self.parts, strict=True):
            weights = np.vstack([-part.taken_off @ rows, rows])
            kept = np.flatnonzero((used >= own.start) & (used < own.stop))
            for s, columns in RunColumns(self, own).rows(used[kept]):
                found[:, kept[s]] = (columns @ weights).reshape(2, -1, rows.shape[1])
        return found.reshape(-1, rows.shape[1])

    @cached_property
    def told(self) -> Lines:
        """The lines on which the influence of noise is kept."""
        return told_lines(self)

    @cached_property
    def few(self) -> Few:
        """Points that stand for the told lines where products of two of the polynomials are summed."""
        points = self.plane.point(self.response.frequencies[self.told.used])
        return few_points(points, self.block_rows, circle=self.dt is not None)

    @cached_property
    def told_weights(self) -> RealArray:
        """The weights of the told lines."""
        return np.asarray(self.line_weights[self.told.used], dtype=float)

    @cached_property
    def told_spread(self) -> RealArray:
        """How a quarter of what the told lines stand for is spread over the few points, by the squares of the weights, (F, points)."""
        return self.few.spread * (self.told.each * self.told_weights**2 / 4)[:, None]

    def right_vectors(self, factors: Factors, coefficients: Array) -> Driven:
        """Return v_j on the told lines, to be made of the right factor some at a time."""
        assert factors.right is not None
        return Driven(factors.right.whole[0], np.asarray(coefficients, dtype=complex))

    def influence(self, left: Array, right: Driven, lines: Lines | None = None) -> RecordInfluence:
        """Return the gradient on the told lines, whichever are asked: what it takes does not grow with them; see `RecordInfluence`."""
        coefficients = np.asarray(left.reshape(len(left), -1, self.outputs) / self.output_scale, dtype=complex)
        return RecordInfluence(self, coefficients, right)

    def with_columns(self, factors: Factors) -> Factors:
        """Return the factors with their rows of Q over the lines, for when they are asked."""
        return replace(factors, right=RecordColumns(self, factors))

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes from all block rows; participation of inputs and ends, and D, by least squares over the records' lines."""
        shapes = self.shapes(model.row_states(eigen.vectors), eigen.values)
        basis = self.judged.basis(self.to_s(eigen.values))
        participation, terms = basis.fit_participation(shapes, self.output_scale)
        return ModalFit(shapes, participation, terms, reach=basis.reach, basis=basis)

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Yield the records' lines and what the modes give on them, from the first states that fit best, some at a time."""
        for s, values in self.judged.modelled(poles, fit.shapes, fit.participation, fit.terms):
            yield self.judged.values[s], values[:, :, None]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Inputs that are no directions of their own."""
        short = [part.given - part.rank for part in self.parts]
        told = [str(note) for note in self.judged.untold]
        if any(short):
            told.append(
                f"{sum(short)} of {sum(part.given for part in self.parts)} rows of inputs and ends depend on the others and were left out: "
                "inputs that are alike, or that hold few lines"
            )
        return tuple(told)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        low, high = self.response.span
        runs = len(self.parts)
        of = f"{runs} runs" if runs > 1 else "one run"
        return (
            f"records of {of} on {self.response.count} lines, {low:g} to {high:g} Hz, polynomials to degree {self.block_rows} "
            f"({self.plane.name}); inputs and ends eliminated"
        )
