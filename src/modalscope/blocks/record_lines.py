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
from modalscope.blocks.plane import Plane, plane_of
from modalscope.blocks.polynomial_rows import PolynomialRows
from modalscope.blocks.polynomials import evaluate, orthogonal_basis
from modalscope.blocks.triple import Eigen, ModalFit, Triple
from modalscope.model.checks import Array, ComplexArray, DataError, IntArray, RealArray, check_count
from modalscope.model.driven_basis import Run
from modalscope.model.line_choice import running_mean
from modalscope.model.record_spectra import RecordSpectra
from modalscope.model.response import level_power, output_scale
from modalscope.model.statespace import StateSpace
from modalscope.model.triangles import stacked_factor, triangle_of

__all__ = ["RecordLines", "record_lines"]

#: Numbers in the columns of the lines that are taken at a time, complex ones: 2 MB.
_NUMBERS = 1 << 17

#: Lines on which polynomials are made orthogonal: those of a longer record are nearly so on all lines, which is as good.
_ORTHOGONAL = 65_536

#: Lines on either side that a weight is averaged over, and the least power over the median that it follows.
_BESIDE, _QUIET = 20, 0.01

#: Rows p_j U below this share of the largest, in multiples of rounding, are no directions of their own.
_ROUNDING = 16.0


def record_lines(spectra: RecordSpectra, *, domain: str, block_rows: int, order: int | None = None) -> RecordLines:
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
    scale = output_scale(response)
    w = resonance_weights(response, scale)
    every = -(-response.count // _ORTHOGONAL)
    thin = plane.point(response.frequencies[::every])
    basis, recurrence = orthogonal_basis(thin, q, w[::every] * np.sqrt(response.count / thin.size))
    made = RecordLines(response, plane, float(basis[0, 0].real), recurrence, scale, weights=w)
    if made.left < max(order or 1, 1):
        raise DataError(
            f"order {order or 1} with block_rows={q} was asked",
            f"{response.count} lines leave {made.left} equations when inputs and ends are eliminated",
            "Measure longer, widen the band, or lower block_rows or the order.",
        )
    return made


def resonance_weights(spectra: RecordSpectra, scale: RealArray) -> RealArray:
    """Return a weight a line, (F,), of mean square one: the root of the outputs' amplitude over neighbouring lines of the run.

    Parameters
    ----------
    spectra : RecordSpectra
    scale : array, (l,)
        What the outputs are divided by.
    """
    power = running_mean(level_power(spectra, scale), spectra.run, _BESIDE)
    w = np.maximum(power, _QUIET * max(float(np.median(power)), np.finfo(float).tiny)) ** 0.25
    return np.asarray(w / np.sqrt(np.mean(w**2)))


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
    row_shifts: tuple[int, ...] | None = None
    weights: RealArray | None = None

    @property
    def first_value(self) -> float:
        """p_0, the constant of the basis."""
        return self.constant

    def polynomials(self, lines: slice | IntArray) -> ComplexArray:
        """Return p_k on some lines, (lines, q + 1): they are not kept."""
        return evaluate(self.recurrence, self.constant, self.plane.point(self.response.frequencies[lines])).T

    @cached_property
    def judged(self) -> RecordSpectra:
        """The records' own lines; of long records those that tell."""
        return self.response.judging()

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
        own = [int(np.sum(self.response.run == r)) for r in range(len(self.response.durations))]
        return sum(2 * F - part.rank for F, part in zip([F for F in own if F], self.parts, strict=True))

    @property
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): what is left of all runs, times an orthonormal matrix."""
        return self._eliminated[0]

    @cached_property
    def _eliminated(self) -> tuple[RealArray, tuple[_Taken, ...]]:
        triangle, taken = np.zeros((0, self.outputs * (self.block_rows + 1))), []
        for r, run in enumerate(self.response.runs()):
            if len(run.points):
                left, part = self._left_of(r, run)
                triangle = stacked_factor(triangle, left)
                taken.append(part)
        return np.ascontiguousarray(triangle.T), tuple(taken)

    def _left_of(self, r: int, run: Run) -> tuple[RealArray, _Taken]:
        """Project the outputs' rows of a run on the complement of p_j and p_j U, in chunks of lines.

        The triangular factor of [eliminated, outputs] stands in for the lines; the rank of its first columns is seen on it.
        """
        terms = 1 + int(np.sum(np.any(run.inputs, axis=0)))
        width = (terms + self.outputs) * (self.block_rows + 1)
        R = triangle_of(lambda: (columns for _, columns in self._columns(r, run)), width)
        given = terms * (self.block_rows + 1)
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

    def _columns(self, r: int, run: Run) -> Iterator[tuple[slice, RealArray]]:
        """Yield [p_j, p_j U, p_j Y] of a run times the weights, some lines at a time, real parts above imaginary ones."""
        used = np.any(run.inputs, axis=0)
        size = np.maximum(np.sqrt(np.mean(np.abs(run.inputs[:, used]) ** 2, axis=0)), 1e-300)
        wide = (1 + int(used.sum()) + self.outputs) * (self.block_rows + 1)
        first = int(np.argmax(self.response.run == r))
        step = max(_NUMBERS // wide, 1)
        for start in range(0, len(run.points), step):
            s = slice(start, start + step)
            basis = self.polynomials(slice(first + start, first + start + len(run.points[s])))
            drives = np.hstack([np.ones((len(basis), 1)), run.inputs[s][:, used] / size])
            head = (drives[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
            tail = (basis[:, :, None] * (run.outputs[s] / self.output_scale)[:, None, :]).reshape(len(basis), -1)
            columns = np.empty((2, len(head), wide))
            for part, own in ((head, slice(None, head.shape[1])), (tail, slice(head.shape[1], None))):
                columns[0, :, own], columns[1, :, own] = part.real, part.imag
            if self.weights is not None:
                columns *= self.weights[first + start : first + start + len(basis), None]
            yield s, columns.reshape(-1, wide)

    def on_lines(self, rows: RealArray) -> RealArray:
        """Return H' X of the matrix over the lines, (2 F, k), inputs and ends eliminated: X (l (q + 1), k)."""
        found = np.zeros((2, self.response.count, rows.shape[1]))
        there = [(r, run) for r, run in enumerate(self.response.runs()) if len(run.points)]
        for (r, run), part in zip(there, self.parts, strict=True):
            weights = np.vstack([-part.taken_off @ rows, rows])
            own = np.flatnonzero(self.response.run == r)
            for s, columns in self._columns(r, run):
                found[:, own[s]] = (columns @ weights).reshape(2, -1, rows.shape[1])
        return found.reshape(-1, rows.shape[1])

    def with_columns(self, factors: Factors) -> Factors:
        """Return the factors with their rows of Q over the lines, for when they are asked."""
        return replace(factors, right=RecordColumns(self, factors))

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return shapes from all block rows; participation of inputs and ends, and D, by least squares over the records' lines."""
        shapes = self.shapes(model.row_states(eigen.vectors), eigen.values)
        basis = self.judged.basis(self.to_s(eigen.values))
        participation, terms = basis.fit_participation(shapes)
        return ModalFit(shapes, participation, terms, reach=basis.reach, basis=basis)

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> tuple[Array, Array]:
        """Return the records' lines and what the modes give on them, from the first states that fit best."""
        values = self.judged.evaluated(poles, fit.shapes, fit.participation, fit.terms)
        return self.judged.values, values[:, :, None]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Inputs that are no directions of their own."""
        short = [part.given - part.rank for part in self.parts]
        untold = self.judged.untold
        told = []
        if untold:
            told.append(
                f"inputs {', '.join(untold)} are zero or depend on each other: what they give together is known, "
                "how it is shared among them is not (participation is the shortest that fits)"
            )
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


@dataclass(frozen=True, eq=False)
class RecordColumns:
    """The right factor over the lines of all runs, computed when it is first asked for.

    Parameters
    ----------
    matrix : RecordLines
    factors : Factors
        Of the triangular stand-in.
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
