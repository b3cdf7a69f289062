"""Block matrix of the Fourier transforms of records with inputs: inputs and both ends of every run are eliminated.

On the lines x of a whole run of N samples x X = A X + B U + x (x(0) - x(N)) / sqrt(N), Y = C X + D U, exactly, so that with polynomials p_k
orthogonal on the lines

    p_k(x) Y = C p_k(A) X + sum_(j <= k) G_kj p_j(x) U + sum_(j <= k) t_kj p_j(x).

The rows p_j and p_j U are projected out, each run with its own inputs and ends; the remainders lie side by side. The polynomials are
those of the lines of all runs together, so that all runs share the left factor [C p_0(A); ...; C p_q(A)].

Every line may have a weight, since the equations hold line by line; the rows of white noise remain white where the polynomials are
orthogonal under the same weights. Weights that follow the resonances adapt the polynomials to them: equal weights need a degree half as
large again for the same damping.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.line_choice import resonance_weights
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.response import output_scale
from modalscope.data.statespace import StateSpace
from modalscope.identification.fast.record_influence import Driven, InfluenceLines, RecordInfluence, lines_of_influence
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.influence import Lines
from modalscope.identification.matrices.line_columns import FullPolynomialRows
from modalscope.identification.matrices.matrix import Eigen, ModalFit, Triple
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.polynomials import Plane, evaluate, orthogonal_basis, plane_of
from modalscope.numerics.operators import LargeMatrix
from modalscope.numerics.orthonormal import stacked_factor, triangle_of

#: The noise is read off the eigenvalue at one in so many from below: modes take the strongest, two each, so that a quarter is noise up
#: to 3 (q + 1) / 8 modes. More modes count as noise that is level with them.
_NOISE_QUANTILE = 4

#: Minimum noise of an output relative to its root mean square: other errors exceed it.
_MIN_NOISE = 1e-4


def noise_beside_quietest(rows: RealArray, outputs: int) -> RealArray:
    """Return the noise of every output over that of the output with the least, all divided by their root mean squares, (l,).

    White noise of deviation s gives the rows of an output the covariance s^2 S, S the same for all outputs: s is read off a low
    eigenvalue of their products. Least squares weigh each output by 1 / s; levelled by its root mean square a channel that holds
    nothing but noise would have as many directions of size one as there are block rows, before those of weak modes.

    `rows` (l (q + 1), k): block rows of outputs that are divided by their root mean squares. `outputs`: l.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = np.tile([1e-2, 1e-2, 1.0], 20)[:, None] * rng.standard_normal((60, 4000)) / np.sqrt(4000)
    >>> mode = np.tile([1.0, 1.0, 0.0], 20)[:, None] * rng.standard_normal(4000)
    >>> noise_beside_quietest(mode + noise, 3).round(-1)
    array([  0.,   0., 100.])
    """
    noise = np.full(outputs, _MIN_NOISE)
    for o in range(outputs):
        of_output = rows[o::outputs]
        values = np.linalg.eigvalsh(of_output @ of_output.T)
        noise[o] = max(np.sqrt(max(values[len(values) // _NOISE_QUANTILE], 0.0)), _MIN_NOISE)
    return np.asarray(noise / noise.min(initial=np.inf))


#: Count of complex numbers in the columns of the lines taken at a time, 2 MB, or one in so many of their products.
_BLOCK_NUMBERS, _BLOCK_SHARE = 1 << 17, 8


@dataclass(frozen=True, eq=False)
class RunColumns:
    """[p_j, p_j U, p_j Y] on the lines of a run, times the weights of the lines, every channel divided by its size.

    `own`: the lines of the run.
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
        columns = np.hstack([response.ones(lines)[:, None], drives[:, used] / size, values / self.matrix.output_scale])
        columns *= self.matrix.line_weights[lines, None]
        return np.asarray(columns)

    def rows(self, some: IntArray | None = None) -> Iterator[tuple[slice, RealArray]]:
        """Yield which of the lines, all or some, and the columns on them, real parts above imaginary ones."""
        own, drives, given, wide = self.own, self.drives, self.given, self.count
        step = max(_BLOCK_NUMBERS // wide, wide // _BLOCK_SHARE)
        count = own.stop - own.start if some is None else some.size
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


@dataclass(frozen=True, eq=False)
class RecordColumns:
    """The right factor on the lines of the influence of all runs, computed when it is first asked for.

    `factors`: of the triangular stand-in.
    """

    matrix: RecordLines
    factors: Factors

    @property
    def blocks(self) -> RealArray:
        """Rows of Q (1, 2 F, k), all of them."""
        return self.whole

    @cached_property
    def whole(self) -> RealArray:
        """Rows of Q (1, 2 F, k)."""
        matrix, factors = self.matrix, self.factors
        n = max(min(factors.rank, factors.d.size), 1)
        rows = np.zeros((matrix.outputs * (matrix.block_rows + 1), n))
        kept = np.arange(len(rows)) if len(factors.P) == len(rows) else matrix.kept_rows
        rows[kept] = factors.P[:, :n] / factors.d[:n]
        return matrix.on_lines(rows)[None]


#: Maximum number of lines on which polynomials are made orthogonal: on all lines of a longer record they nearly are.
_MAX_ORTHOGONAL_LINES = 32_768

#: Minimum relative length of a column after projection on the preceding ones for its products to suffice.
_MIN_COLUMN_REMAINDER = 1e-3

#: Rows p_j U below this fraction of the largest, in multiples of rounding, are linearly dependent.
_RANK_TOLERANCE = 16.0


def record_lines(
    spectra: RecordSpectra, *, domain: str, block_rows: int, order: int | None = None, equal_outputs: bool = True
) -> RecordLines:
    """Stack p_k(x) Y, k = 0 ... block_rows, on the lines of all runs, inputs and ends eliminated.

    `domain`: "z" is exact for inputs that were held between samples; both serve a structure measured through anti-aliasing filters.
    `block_rows`: q, the degree. `order`: largest number of states that will be asked; used to check that the lines suffice.
    `equal_outputs`: whether outputs are brought to one level: that of their noise beside their root mean squares. Combinations of level
    outputs are level as they are.

    Raises `DataError`: fewer lines than unknowns: the sum over runs of 2 F - (q + 1)(1 + m) must be at least the order.

    Notes
    -----
    McKelvey, Akcay and Ljung, IEEE Trans. Automatic Control 41 (1996) 960-979; Pintelon, Schoukens and Vandersteen, same
    Transactions 42 (1997) 1717-1720.
    """
    q = check_count("block_rows", block_rows)
    response = spectra if domain == "z" else spectra.continuous()
    plane = plane_of(domain, response.span[1], response.sampling_rate)
    scale = output_scale(response) if equal_outputs else np.ones(response.values.shape[1])
    w = resonance_weights(response.power(), response.run)
    every = -(-response.count // _MAX_ORTHOGONAL_LINES)
    thin = plane.point(response.frequencies[::every])
    basis, recurrence = orthogonal_basis(thin, q, w[::every] * np.sqrt(response.count / thin.size))
    made = RecordLines(response, plane, float(basis[0, 0].real), recurrence, scale, w)
    if made.left < max(order or 1, 1):
        raise DataError(
            f"order {order or 1} with block_rows={q}:",
            f"{response.count} lines leave {made.left} equations after inputs and end effects are eliminated",
            "Measure longer, widen the band, or lower block_rows or the order.",
        )
    return made.by_noise() if equal_outputs else made


class _Taken(NamedTuple):
    """What the elimination takes from one run: the rank that goes, of how many rows, and the coefficients taken off."""

    rank: int
    given: int
    taken_off: RealArray


@dataclass(frozen=True, eq=False)
class RecordLines(FullPolynomialRows):
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
        """The records' lines, of long records a selection; outputs that were scaled by their noise are judged in that scale."""
        response = self.response.judging()
        return response if self.known is None else replace(response, level=self.output_scale)

    @property
    def parts(self) -> tuple[_Taken, ...]:
        """What was taken from every run that has lines."""
        return self._eliminated[1]

    @property
    def left(self) -> int:
        """Remaining columns of all runs: the sum of 2 F - rank."""
        return sum(2 * (own.stop - own.start) - part.rank for own, part in zip(self.spans, self.parts, strict=True))

    @cached_property
    def spans(self) -> tuple[slice, ...]:
        """Where the lines of every run stand that has any."""
        return tuple(span for span in self.response.spans_of_runs if span.stop > span.start)

    @property
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): the remainder of all runs, times an orthonormal matrix."""
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
        R = triangle_of(lambda: (rows for _, rows in columns.rows()), columns.count, _MIN_COLUMN_REMAINDER)
        factor, target = R[:given, :given], R[:given, given:]
        size = np.linalg.norm(factor, axis=0)
        size = np.where(size > 0, size, 1)
        Q, T, order = sla.qr(factor / size, pivoting=True, check_finite=False)
        diagonal = np.abs(np.diag(T))
        floor = _RANK_TOLERANCE * max(R.shape) * np.finfo(float).eps
        rank = int(np.count_nonzero(diagonal > floor * diagonal[0]))
        taken_off = np.zeros((given, R.shape[1] - given))
        explained = Q[:, :rank].T @ target
        taken_off[order[:rank]] = sla.solve_triangular(T[:rank, :rank], explained, check_finite=False)
        residual = R[given:, given:] if rank == given else np.vstack([Q[:, rank:].T @ target, R[given:, given:]])
        return residual, _Taken(rank, given, taken_off / size[:, None])

    def shifted(self, k: int) -> LargeMatrix:
        """Return H(k): E0 and E1 applied to the triangular factor."""
        return LargeMatrix(super().shifted(k).dense())

    def tall(self) -> LargeMatrix:
        """Return all q + 1 block rows."""
        return LargeMatrix(super().tall().dense())

    def on_lines(self, rows: RealArray) -> RealArray:
        """Return H' X of the matrix over the lines of the influence, (2 F, k), inputs and ends eliminated: X (l (q + 1), k)."""
        used = self.influence_lines.lines.used
        values = np.zeros((2, used.size, rows.shape[1]))
        for own, part in zip(self.spans, self.parts, strict=True):
            weights = np.vstack([-part.taken_off @ rows, rows])
            kept = np.flatnonzero((used >= own.start) & (used < own.stop))
            for s, columns in RunColumns(self, own).rows(used[kept]):
                values[:, kept[s]] = (columns @ weights).reshape(2, -1, rows.shape[1])
        return values.reshape(-1, rows.shape[1])

    @cached_property
    def influence_lines(self) -> InfluenceLines:
        """The lines on which the influence of noise is stored."""
        lines = lines_of_influence(self.response, self.judged)
        points = self.plane.point(self.response.frequencies[lines.used])
        weights = self.line_weights[lines.used].astype(float)  # squared weights need double precision
        return InfluenceLines(lines, points, weights, self.block_rows, self.dt is not None, self.polynomials)

    def right_vectors(self, factors: Factors, coefficients: Array) -> Driven:
        """Return v_j on the lines of the influence, to be made of the right factor some at a time."""
        assert factors.right is not None
        return Driven(factors.right.whole[0], np.asarray(coefficients, dtype=complex))

    def influence(self, left: Array, right: Driven, lines: Lines | None = None) -> RecordInfluence:
        """Return the gradient on the lines of the influence, whichever are asked; see `RecordInfluence`."""
        coefficients = np.asarray(left.reshape(len(left), -1, self.outputs) / self.output_scale, dtype=complex)
        return RecordInfluence(self.influence_lines, coefficients, right)

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
        """Inputs that are linearly dependent."""
        short = [part.given - part.rank for part in self.parts]
        texts = [str(note) for note in self.judged.inseparable_inputs]
        if any(short):
            texts.append(
                f"{sum(short)} of {sum(part.given for part in self.parts)} rows of inputs and ends are linearly dependent, and dropped: "
                "similar inputs, or inputs with few lines"
            )
        return tuple(texts)

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        low, high = self.response.span
        runs = len(self.parts)
        of = f"{runs} runs" if runs > 1 else "one run"
        return (
            f"records of {of} on {self.response.count} lines, {low:g} to {high:g} Hz, polynomials to degree {self.block_rows} "
            f"({self.plane.name}); inputs and ends eliminated"
        )
