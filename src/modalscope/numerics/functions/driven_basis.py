"""Compute the regressors of records with given poles: forced response to measured inputs, and transients of each run.

With c_j the shape of a pole, l_j what drives it and d = [U; ends] the drives of a run, Y = sum_j c_j (l_j' d) / (x - s_j) + conj + D U.
Every drive of every pole is two real columns, the same for all outputs; the shapes tie their coefficients together.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.pole_basis import ModalBasis
from modalscope.numerics.functions.pole_functions import functions_at
from modalscope.numerics.functions.poles import is_real
from modalscope.numerics.orthonormal import factor_of_gram, stacked_factor, triangle_of

#: Complex numbers in the columns of the lines that are compressed at a time (2 MB), and that a model gives at a time (1 MB).
_COMPRESSED_NUMBERS, _EVALUATED_NUMBERS = 1 << 17, 1 << 16

#: Columns with a squared length below this share of the longest are rounding.
_ROUNDING_OF_SQUARES = 1e-28


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """The lines of one run.

    `points` (F,): where they lie in the plane of the poles. `outputs` (F, l). `inputs` (F, m). `ends` (F,): what the first and the last
    state of the run act through: x in the z-plane, 1 in the s-plane.
    """

    points: ComplexArray
    outputs: ComplexArray
    inputs: ComplexArray
    ends: ComplexArray


@dataclass(frozen=True, eq=False, slots=True)
class DrivenBasis(ModalBasis):
    """Real columns of the direct terms and of every pole under every drive, on as many rows as they need.

    The rows are compressed when it is made: the norm of the residual is that on all lines.

    `terms` (K, m): the inputs, which every output has for itself: D. `functions` (K, 2 n (m + R)): the two functions of every pole, drive
    by drive: inputs first, then the ends of every run. `data` (K, l, 1). `drives`: m + R.
    """

    drives: int = 1

    @property
    def by_drive(self) -> RealArray:
        """The functions (K, m + R, 2 n)."""
        return self.functions.reshape(len(self.functions), self.drives, self.functions.shape[1] // self.drives)

    @property
    def reach(self) -> RealArray:
        """Root mean square over the drives of the norm of each pole's functions, (n,)."""
        by_pole = self.by_drive.reshape(len(self.functions), self.drives, -1, 2)
        return np.asarray(np.sqrt(np.sum(by_pole**2, axis=(0, 1, 3)) / self.drives))

    @property
    def by_pole(self) -> RealArray:
        """The functions of each pole under all drives, (K, n, 2 (m + R))."""
        by_pole = self.by_drive.reshape(len(self.functions), self.drives, -1, 2).transpose(0, 2, 1, 3)
        return np.ascontiguousarray(by_pole).reshape(len(by_pole), by_pole.shape[1], 2 * self.drives)

    def compressed(self) -> DrivenBasis:
        """Return the basis itself: it is compressed already."""
        return self

    def fit_participation(self, shapes: Array, level: Array | float = 1.0) -> tuple[ComplexArray, RealArray]:
        """Fit what drives each pole to known shapes, with D of every output, by least squares over all rows.

        `shapes` (l, n). `level` (l,): what every output counts in parts of: its noise.

        Returns
        -------
        participation : array of complex, (n, m + R)
            Of the inputs, then of the ends of every run.
        terms : array, (1, l, m)
            D.
        """
        t, width = self.terms.shape[1], self.terms.shape[1] + self.functions.shape[1]
        R = np.hstack([self.terms, self.functions, self.data[:, :, 0]])
        if len(R) > R.shape[1] or np.any(np.tril(R, -1)):
            R = stacked_factor(np.zeros((0, 0)), R)
        by_pole = R[:, t:width].reshape(len(R), self.drives, -1, 2)
        size = np.sqrt(np.maximum(np.einsum("kdji,kdji->d", by_pole, by_pole), 1e-300))  # no unit of a force counts
        w = ((by_pole[..., 0] - 1j * by_pole[..., 1]) / size[:, None]).reshape(len(R), -1)
        unit = np.broadcast_to(np.asarray(level, dtype=float), (len(shapes),))
        level_shapes, data = np.asarray(shapes, dtype=complex) / unit[:, None], R[:, width:] / unit
        c = np.asarray(np.tile(level_shapes, self.drives))
        solution = _tied_fit(w[t:], c, data[t:])
        if solution is None:
            lower = R[t:, t:width].reshape(len(R) - t, self.drives, -1)
            columns = np.concatenate([_tied(lower / size[:, None], shape) for shape in level_shapes])
            theta = _least_squares(columns, data[t:].T.reshape(-1, 1))[:, 0]
            solution = theta[::2] + 1j * theta[1::2]
        rest = (w[:t] @ (solution * c).T).real
        direct = _least_squares(R[:t, :t], data[:t] - rest) * unit
        solution = solution.reshape(self.drives, -1) / size[:, None]
        return np.ascontiguousarray(solution.T), np.asarray(direct.T[None], dtype=np.float64)

    def fit_shapes(self, participation: Array) -> tuple[ComplexArray, RealArray]:
        """Fit shapes to known participation of all drives: shapes (l, n) and D (1, l, m)."""
        n, t = self.functions.shape[1] // (2 * self.drives), self.terms.shape[1]
        by_pole = self.by_drive.reshape(len(self.functions), self.drives, n, 2)
        turned = np.einsum("kdj,jd->kj", by_pole[..., 0] - 1j * by_pole[..., 1], participation)
        columns = np.hstack([self.terms, np.stack([turned.real, -turned.imag], axis=2).reshape(len(turned), -1)])
        solution = _least_squares(columns, self.data[:, :, 0])
        return np.asarray((solution[t::2] + 1j * solution[t + 1 :: 2]).T), solution[:t].T[None]

    def fit_ends(self, shapes: Array, participation: Array, terms: Array) -> ComplexArray:
        """Fit what the ends of the runs give to each pole, (n, R), the rest being known: participation (n, m) of the inputs."""
        inputs = participation.shape[1]
        forced = self._sum(self.by_drive[:, :inputs], shapes, participation) + self.terms @ terms[0].T
        free = self.by_drive[:, inputs:]
        R = stacked_factor(np.zeros((0, 0)), np.hstack([free.reshape(len(free), -1), self.data[:, :, 0] - forced]))
        width = free.shape[1] * free.shape[2]
        columns = np.concatenate([_tied(R[:, :width].reshape(len(R), free.shape[1], -1), c) for c in shapes])
        return _complex(_least_squares(columns, R[:, width:].T.reshape(-1, 1))[:, 0], free.shape[1])

    def of_terms(self, coefficients: RealArray) -> RealArray:
        """Return coefficients (m, l) of the inputs as D, (1, l, m)."""
        return np.ascontiguousarray(coefficients.T)[None]

    def rebuilt(self, shapes: Array, participation: Array, terms: Array) -> RealArray:
        """Return what shapes, participation and D give, in the rows of the data; ends that are not given are fitted."""
        if participation.shape[1] < self.drives:
            ends = self.fit_ends(shapes, participation, terms)
            participation = np.hstack([participation, ends])
        forced = self._sum(self.by_drive, shapes, participation)
        return np.asarray((forced + self.terms @ np.asarray(terms)[0].T)[:, :, None])

    def missed(self, shapes: Array, participation: Array, terms: Array) -> Iterator[RealArray]:
        """Yield `rebuilt` without the data at once: there are few rows."""
        yield self.rebuilt(shapes, participation, terms) - self.data

    @staticmethod
    def _sum(functions: RealArray, shapes: Array, participation: Array) -> RealArray:
        """Return sum_j c_j (l_j' d) g_j of every output, (K, l)."""
        tied = np.asarray(shapes)[:, None, :] * np.asarray(participation).T  # (l, d, n)
        both = np.stack([tied.real, tied.imag], axis=3).reshape(len(tied), -1)
        return np.asarray(functions.reshape(len(functions), -1) @ both.T)


def driven_basis(runs: Sequence[Run], poles: Array) -> DrivenBasis:
    """Return the columns that poles give on the lines of some runs.

    `runs`: of the same outputs and inputs. `poles` (n,): in the plane of the points; one of each pair, and real ones.
    """
    parts = [_triangle(run, poles) for run in runs]
    inputs, n, total = runs[0].inputs.shape[1], len(poles), len(runs)
    rows = np.cumsum([0, *(len(part) for part in parts)])
    functions = np.zeros((rows[-1], inputs + total, 2 * n))
    for r, part in enumerate(parts):
        pole_columns = part[:, inputs : inputs + 2 * n * (inputs + 1)].reshape(len(part), inputs + 1, 2 * n)
        functions[rows[r] : rows[r + 1], :inputs] = pole_columns[:, :inputs]
        functions[rows[r] : rows[r + 1], inputs + r] = pole_columns[:, inputs]
    stacked = np.vstack(parts)
    outputs = runs[0].outputs.shape[1]
    return DrivenBasis(
        terms=stacked[:, :inputs],
        functions=functions.reshape(rows[-1], -1),
        data=stacked[:, stacked.shape[1] - outputs :, None],
        drives=inputs + total,
    )


def _triangle(run: Run, poles: Array) -> RealArray:
    """Return the triangular factor of [U, functions of every pole under every drive, Y] over the lines of a run, in pieces."""
    inputs, outputs = run.inputs.shape[1], run.outputs.shape[1]
    width = inputs + 2 * len(poles) * (inputs + 1) + outputs
    return triangle_of(lambda: _columns(run, poles, width), width)


def _columns(run: Run, poles: Array, width: int) -> Iterator[RealArray]:
    """Yield the columns, real parts above imaginary ones, of some lines at a time."""
    step = max(_COMPRESSED_NUMBERS // width, 1)
    for start in range(0, max(len(run.points), 1), step):
        s = slice(start, start + step)
        U, flat = run.inputs[s], functions_at(run.points[s], poles)
        found = np.empty((2, len(flat), width))
        parts = [U, *(drive[:, None] * flat for drive in (*U.T, run.ends[s])), run.outputs[s]]
        first = 0
        for part in parts:
            columns = slice(first, first + part.shape[1])
            found[0, :, columns], found[1, :, columns] = part.real, part.imag
            first = columns.stop
        yield found.reshape(-1, width)


def _tied_fit(w: ComplexArray, c: ComplexArray, data: RealArray) -> ComplexArray | None:
    """Fit y_o = Re sum_a w_a c_oa l_a over all outputs by normal equations, (a,); None where they would not be accurate.

    Re(x) Re(y) = Re(x* y + x y) / 2, and so on: sums over outputs need nothing but w^H w, w'w, c^H c and c'c.

    `w` (K, a). `c` (l, a). `data` (K, l).
    """
    H, S = (w.conj().T @ w) * (c.conj().T @ c), (w.T @ w) * (c.T @ c)
    a = len(H)
    N = np.empty((2 * a, 2 * a))
    N[:a, :a], N[a:, a:] = (H + S).real / 2, (H - S).real / 2
    N[:a, a:] = -(H + S).imag / 2
    N[a:, :a] = N[:a, a:].T
    alive = np.flatnonzero(np.diag(N) > _ROUNDING_OF_SQUARES * np.diag(N).max(initial=0.0))
    R = factor_of_gram(N[np.ix_(alive, alive)])
    if R is None:
        return None
    solution = np.zeros(a, dtype=complex)
    for _ in range(2):  # the second time corrects rounding
        slope = np.sum(c * (w.T @ (data - (w @ (solution * c).T).real)).T, axis=0)
        step = np.zeros(2 * a)
        step[alive] = sla.cho_solve((R, False), np.concatenate([slope.real, -slope.imag])[alive], check_finite=False)
        solution += step[:a] + 1j * step[a:]
    return solution


def _tied(functions: RealArray, shape: Array) -> RealArray:
    """Return the columns (K, d 2 n) of Re l and Im l of every drive in an output where the poles have this shape (n,).

    With c l = a + j b a pole gives a g1 + b g2, that is Re(c l (g1 - j g2)).
    """
    rows, drives, width = functions.shape
    by_pole = functions.reshape(rows, drives, width // 2, 2)
    turned = (by_pole[..., 0] - 1j * by_pole[..., 1]) * shape
    return np.stack([turned.real, -turned.imag], axis=3).reshape(rows, -1)


def _complex(theta: Array, drives: int) -> ComplexArray:
    """Return (n, drives) from real and imaginary parts that run drive by drive."""
    pairs = theta.reshape(drives, -1, 2)
    return (pairs[..., 0] + 1j * pairs[..., 1]).T


def _least_squares(known: RealArray, target: RealArray) -> RealArray:
    """Solve least squares of smallest norm, columns scaled to length one; the rows are compressed first."""
    count = known.shape[1]
    if not count:
        return np.zeros((0, target.shape[1]))
    scale = np.linalg.norm(known, axis=0)
    scale = np.where(scale > 0, scale, 1)
    both = np.hstack([known / scale, target])
    R = stacked_factor(np.zeros((0, 0)), both)
    return np.linalg.lstsq(R[:, :count], R[:, count:], rcond=None)[0] / scale[:, None]


@dataclass(frozen=True, eq=False, slots=True)
class DrivenLines:
    """Lines with all drives side by side: the inputs, then the ends of every run, which are zero on the lines of the others.

    `points` (F,): where the lines lie in the plane of the poles. `drives` (F, m + R). `inputs`: m.
    """

    points: ComplexArray
    drives: ComplexArray
    inputs: int

    def divided(self, sizes: RealArray) -> DrivenLines:
        """Return the same lines with every drive divided by its size, (m + R,)."""
        return DrivenLines(self.points, self.drives / sizes, self.inputs)

    def pairs(self, poles: Array, sides: Array, chain: Array | None = None) -> tuple[ComplexArray, ComplexArray]:
        """Return b'd / (x - p) and conj(b)'d / (x - conj p), (F, n) each; with the chain dp/ds their derivatives by s.

        `poles` (n,): in the plane of the points. `sides` (n, m + R): b. `chain` (n,).
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
        alone, step = is_real(poles), max(_EVALUATED_NUMBERS // max(len(poles), len(shapes), 1), 1)
        for start in range(0, len(self.points), step):
            s = slice(start, start + step)
            own, pair = DrivenLines(self.points[s], self.drives[s], self.inputs).pairs(poles, participation)
            values = own @ shapes.T + np.where(alone, 0, pair) @ shapes.conj().T
            values += self.drives[s, : self.inputs] @ direct.T
            yield s, values

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
