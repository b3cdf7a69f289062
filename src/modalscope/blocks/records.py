"""Block matrix of the Fourier transforms of records with inputs, and the sensitivity of its poles to noise.

A pole moves by dp = sum over lines of a . dY + b . dY*, with a = P(x) u / 2 and b = P~(x) t / 2: vectors of polynomials of degree q, smooth
from line to line, and one number u and t a line, which follow the input and are not. White noise asks for sums of |P|^2 |u|^2 and the
like. Such a product is a polynomial of 2 q + 1 coefficients, which as many points determine: every sum over lines is a sum over these
points, |u|^2 being spread over them once. Nothing of lines times outputs times poles is ever formed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.blocks.factor import Factors
from modalscope.blocks.influence import LineInfluence, Lines, Moments, Outer
from modalscope.blocks.lines import PolynomialRows
from modalscope.blocks.polynomials import Few, Plane, both_sums, evaluate, few_points, orthogonal_basis, plane_of
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.data.line_choice import resonance_weights
from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.response import output_scale
from modalscope.data.statespace import StateSpace
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray, check_count, freeze
from modalscope.numerics.errors import DataError
from modalscope.numerics.operators import LargeMatrix
from modalscope.numerics.orthonormal import stacked_factor, triangle_of

# -------------------------------------------------------------------------------------------------------- output noise
# How noisy each output is, seen on block rows whose noise is white: what brings outputs to one level of noise.

#: Where modes leave nothing the directions of an output's rows are noise; modes take the strongest, two each, so that a quarter is left
#: to noise up to 3 (q + 1) / 8 modes. More than that can only be taken for noise that is level with the modes.
_QUARTER = 4

#: Noise below this part of an output is not what limits it: forces that were not held and what is no structure leave as much.
_LEAST = 1e-4


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
    noise = np.full(outputs, _LEAST)
    for o in range(outputs):
        own = rows[o::outputs]
        values = np.linalg.eigvalsh(own @ own.T)
        noise[o] = max(np.sqrt(max(values[len(values) // _QUARTER], 0.0)), _LEAST)
    return np.asarray(noise / noise.min(initial=np.inf))


# --------------------------------------------------------------------------------------------------------- record cost
# What records on lines will take, before anything is computed: seconds of one core, and memory in addition to the records.

#: Products of two columns that a core takes in a second, with the columns themselves: measured from 1e10 to 1e12 of them.
_RATE = 2.5e10

#: Triangular factors in memory at a time, and bytes of all small arrays.
_TRIANGLES, _SMALL = 4, 32e6


class Cost(NamedTuple):
    """Predicted cost: seconds of one core for the factor, bytes of the transforms and triangles, and (q + 1)(1 + m + l) columns."""

    seconds: float
    bytes: float
    columns: int
    lines: int

    @property
    def note(self) -> Note:
        """The cost in words."""
        seconds = "less than a second" if self.seconds < 1 else f"about {self.seconds:.2g} s"
        text = f"{self.columns} columns on {self.lines} lines: {seconds} of one core and {_words(self.bytes)} of memory predicted"
        return Note("cost", {"seconds": self.seconds, "bytes": self.bytes}, text)


def record_cost(lines: int, outputs: int, inputs: int, degree: int) -> Cost:
    """Return the cost of records on lines: 2 F ((q + 1)(1 + m + l))^2 products, 16 F (l + m) bytes and four triangles of the columns.

    `lines`: f, of all runs. `degree`: q.

    Examples
    --------
    >>> print(record_cost(999_999, 62, 2, 8).note)
    585 columns on 999999 lines: about 27 s of one core and 1.1 GB of memory predicted
    """
    columns = (degree + 1) * (1 + inputs + outputs)
    size = 16.0 * lines * (outputs + inputs) + _TRIANGLES * 8.0 * columns**2 + _SMALL
    return Cost(2.0 * lines * columns**2 / _RATE, size, columns, lines)


def refuse_beyond_memory(cost: Cost) -> None:
    """Raise where records on lines would take more memory than the machine has.

    Raises `DataError`: names both, and what takes less.
    """
    there = _memory()
    if there is not None and cost.bytes > there:
        raise DataError(
            "records on lines were asked",
            f"{cost.columns} columns on {cost.lines} lines take {_words(cost.bytes)} beside the records, the machine has {_words(there)}",
            "Give a band, lower block_rows, leave out channels, or identify the runs one by one.",
        )


def _memory() -> float | None:
    """Return the bytes of memory of the machine; None where it does not tell."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def _words(size: float) -> str:
    return f"{size / 1e9:.2g} GB" if size >= 1e9 else f"{size / 1e6:.2g} MB"


# --------------------------------------------------------------------------------------------------------- run columns
# The columns of one run of records on lines: polynomials times a one, the inputs that the run has, and the outputs.

#: Numbers in the columns of the lines that are taken at a time, complex ones: 2 MB, or an eighth of their products.
_NUMBERS_OF_COLUMNS, _EIGHTH = 1 << 17, 8


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
        found = np.hstack([response.ones(lines)[:, None], drives[:, used] / size, values / self.matrix.output_scale])
        found *= self.matrix.line_weights[lines, None]
        return np.asarray(found)

    def rows(self, some: IntArray | None = None) -> Iterator[tuple[slice, RealArray]]:
        """Yield which of the lines, all or some, and the columns on them, real parts above imaginary ones."""
        own, drives, given, wide = self.own, self.drives, self.given, self.count
        step, count = (
            max(_NUMBERS_OF_COLUMNS // wide, wide // _EIGHTH),
            own.stop - own.start if some is None else some.size,
        )
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


# ---------------------------------------------------------------------------------------------------- record influence

#: Number of lines of long records on which the influence is kept.
_INFLUENCE_LINES = 8192

#: Numbers of each of the arrays that are made of some poles at a time.
_NUMBERS = 1 << 16


def spread_over(weights: Array, few: Few) -> Array:
    """Return what weights of the lines (k, F) are at the points, (k, G)."""
    if not np.iscomplexobj(weights):
        return np.asarray(weights @ few.spread)
    both = np.concatenate([weights.real, weights.imag]) @ few.spread
    return np.asarray(both[: len(weights)] + 1j * both[len(weights) :])


def lines_of_influence(matrix: RecordLines) -> Lines:
    """Return the lines on which the influence is kept, as places among all: all, of long records some, each for those nearest to it."""
    judged, every = matrix.judged, matrix.response
    if judged.count == every.count <= _INFLUENCE_LINES:
        return Lines(np.arange(every.count), np.ones(every.count))
    thin = np.arange(0, judged.count, -(-judged.count // _INFLUENCE_LINES))
    used, each = [], []
    for r, own_lines in enumerate(every.spans_of_runs):
        there = every.frequencies[own_lines]
        own = np.searchsorted(there, judged.frequencies[thin[judged.run[thin] == r]])
        if own.size:
            edges = np.concatenate([[0], (own[1:] + own[:-1] + 1) // 2, [there.size]])
            used.append(own + own_lines.start)
            each.append(np.diff(edges))
    return Lines(np.concatenate(used), np.concatenate(each).astype(float))


class RecordInfluence(LineInfluence):
    """The gradient of poles by the outputs' transforms.

    `left` (k, q + 1, l): coefficients of P, outputs in their own unit. `right`: what the columns of real and of imaginary parts have on
    the lines of the influence.
    """

    def __init__(self, matrix: RecordLines, left: ComplexArray, right: Driven) -> None:
        freeze(self, matrix=matrix, left=left, right=right)

    matrix: RecordLines
    left: ComplexArray
    right: Driven

    @property
    def lines(self) -> Lines:
        """The lines of the influence."""
        return self.matrix.influence_lines

    @property
    def direct(self) -> tuple[Outer, ...]:
        """A = P u on every line: for small problems and for tests."""
        return (Outer(self.at(self.lines.used)[0], self.drives[0][:, :, None]),)

    @property
    def mirrored(self) -> tuple[Outer, ...]:
        """B = P~ t on every line."""
        return (Outer(self.at(self.lines.used)[1], self.drives[1][:, :, None]),)

    @property
    def drives(self) -> tuple[ComplexArray, ComplexArray]:
        """U and t of every pole on the lines of the influence, (k, F) each."""
        (real, beside), (imaginary, pair) = self.right.parts(slice(None)).transpose(2, 0, 1, 3)
        weights = self.matrix.influence_weights / 2
        u, t = (real + pair) + 1j * (beside - imaginary), (real - pair) + 1j * (beside + imaginary)
        return np.asarray(u * weights), np.asarray(t * weights)

    def at(self, lines: IntArray) -> tuple[ComplexArray, ComplexArray]:
        """Return P and P~ on some lines, (k, lines, l) each."""
        return both_sums(self.matrix.polynomials(lines), self.left)

    def joint(self, other: LineInfluence, variance: RealArray, fading: Array | None = None) -> Moments:
        """Return the moments under circular noise; of one variance an output, (l, 1), by the few points."""
        if fading is not None or variance.ndim != 2 or not isinstance(other, RecordInfluence):
            return super().joint(other, variance, fading)
        if other is self:
            return self._own(variance[:, 0])
        finer = max(self.matrix, other.matrix, key=lambda one: one.block_rows)
        few, (used, each) = finer.few, finer.influence_lines
        (P, M), (u, t) = self.at(used[few.place]), self.drives
        (R, N), (v, s) = other.at(used[few.place]), other.drives

        def summed(one: ComplexArray, two: ComplexArray, drive: Array) -> ComplexArray:
            at = (one * two) @ variance[:, 0]
            return np.asarray(np.sum(at * spread_over(drive * each, few), axis=1))

        size = summed(P, R.conj(), u * v.conj()) + summed(M, N.conj(), t * s.conj())
        return Moments(size, summed(P, N, u * s) + summed(M, R, t * v))

    def _own(self, variance: RealArray) -> Moments:
        """Return E|dp|^2 and E dp dp, some poles at a time: sums of |u|^2, |t|^2 and u t, in real numbers."""
        P, M = self.at(self.matrix.influence_lines.used[self.matrix.few.place])
        plain, mirrored, both = np.abs(P) ** 2 @ variance, np.abs(M) ** 2 @ variance, (P * M) @ variance
        size, square = np.empty(len(P)), np.empty(len(P), complex)
        spread = self.matrix.influence_spread
        step = max(_NUMBERS // len(spread), 1)
        for start in range(0, len(P), step):
            s = slice(start, start + step)
            # u = a + b + j (c - d), t = a - b + j (c + d), over two
            (a, d), (c, b) = self.right.parts(s).transpose(0, 2, 1, 3)
            a2, b2, c2, d2 = a * a, b * b, c * c, d * d
            sums = np.stack([a2 + b2 + c2 + d2, 2 * (a * b - c * d), a2 - b2 - c2 + d2, 2 * (a * c + b * d)]) @ spread
            size[s] = np.sum((plain + mirrored)[s] * sums[0] + (plain - mirrored)[s] * sums[1], axis=1)
            square[s] = np.sum(both[s] * (sums[2] + 1j * sums[3]), axis=1)
        return Moments(size, 2 * square)

    def take(self, index: Array) -> RecordInfluence:
        """Return the gradients of some poles."""
        return RecordInfluence(self.matrix, self.left[index], self.right.take(index))


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


@dataclass(frozen=True, eq=False)
class Driven:
    """Columns of the matrix on the lines of the influence, as combinations of those of the right factor: they are not kept.

    `columns` (2 F, K): rows of Q, those of real parts above those of imaginary ones. `coefficients` (n, k): of the first n of them.
    """

    columns: RealArray
    coefficients: ComplexArray

    def parts(self, some: slice) -> RealArray:
        """Return what real and imaginary parts of coefficients give on rows of real and of imaginary parts, (2, k, 2, F), of some poles."""
        chosen = self.coefficients[:, some]
        both = np.hstack([chosen.real, chosen.imag]).T @ self.columns[:, : len(chosen)].T
        return np.asarray(both.reshape(2, chosen.shape[1], 2, -1))

    def take(self, index: Array) -> Driven:
        """Return the columns of some poles."""
        return Driven(self.columns, self.coefficients[:, index])


# -------------------------------------------------------------------------------------------------------- record lines
# Records on lines: block rows of the outputs' transforms, from which the inputs and both ends of every run are eliminated.
#
# On the lines x of a whole run of N samples x X = A X + B U + x (x(0) - x(N)) / sqrt(N), Y = C X + D U, exactly, so that with
# polynomials p_k orthogonal on the lines
#
#     p_k(x) Y = C p_k(A) X + sum_(j <= k) G_kj p_j(x) U + sum_(j <= k) t_kj p_j(x).
#
# The rows p_j and p_j U are projected away, each run with its own inputs and its own ends; what is left lies side by side. The
# polynomials are those of the lines of all runs together: the left factor [C p_0(A); ...; C p_q(A)] is one for all.
#
# Every line may have a weight, since the equations hold line by line, and the rows of white noise stay white when the polynomials are
# orthogonal under the same weights. Weights that follow the resonances bend the polynomials to them: a degree then shows damping that
# would take half as many more with equal weights.

#: Lines on which polynomials are made orthogonal: those of a longer record are nearly so on all lines, which is as good.
_ORTHOGONAL = 32_768

#: Relative residual norm of a column given the preceding ones from which products suffice: those by few points are known to 1e-12.
_KEPT = 1e-3

#: Rows p_j U below this share of the largest, in multiples of rounding, are linearly dependent.
_ROUNDING = 16.0


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
    plane = plane_of(domain, response)
    scale = output_scale(response) if equal_outputs else np.ones(response.values.shape[1])
    w = resonance_weights(response.power(), response.run)
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
        """The records' lines, of long records a selection; outputs that were scaled by their noise are judged in that scale."""
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
        R = triangle_of(lambda: (rows for _, rows in columns.rows()), columns.count, _KEPT)
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
        """Return H' X of the matrix over the lines of the influence, (2 F, k), inputs and ends eliminated: X (l (q + 1), k)."""
        used = self.influence_lines.used
        found = np.zeros((2, used.size, rows.shape[1]))
        for own, part in zip(self.spans, self.parts, strict=True):
            weights = np.vstack([-part.taken_off @ rows, rows])
            kept = np.flatnonzero((used >= own.start) & (used < own.stop))
            for s, columns in RunColumns(self, own).rows(used[kept]):
                found[:, kept[s]] = (columns @ weights).reshape(2, -1, rows.shape[1])
        return found.reshape(-1, rows.shape[1])

    @cached_property
    def influence_lines(self) -> Lines:
        """The lines on which the influence of noise is kept."""
        return lines_of_influence(self)

    @cached_property
    def few(self) -> Few:
        """Points that stand for the lines of the influence where products of two of the polynomials are summed."""
        points = self.plane.point(self.response.frequencies[self.influence_lines.used])
        return few_points(points, self.block_rows, circle=self.dt is not None)

    @cached_property
    def influence_weights(self) -> RealArray:
        """The weights of the lines of the influence."""
        return np.asarray(self.line_weights[self.influence_lines.used], dtype=float)

    @cached_property
    def influence_spread(self) -> RealArray:
        """Weights that map values on the lines of the influence to the few points, (F, points); a quarter for both halves."""
        return self.few.spread * (self.influence_lines.each * self.influence_weights**2 / 4)[:, None]

    def right_vectors(self, factors: Factors, coefficients: Array) -> Driven:
        """Return v_j on the lines of the influence, to be made of the right factor some at a time."""
        assert factors.right is not None
        return Driven(factors.right.whole[0], np.asarray(coefficients, dtype=complex))

    def influence(self, left: Array, right: Driven, lines: Lines | None = None) -> RecordInfluence:
        """Return the gradient on the lines of the influence, whichever are asked; see `RecordInfluence`."""
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
        """Inputs that are linearly dependent."""
        short = [part.given - part.rank for part in self.parts]
        told = [str(note) for note in self.judged.inseparable_inputs]
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
