r"""Loewner matrices of responses on lines: the column of the table that interpolates.

The lines are parted, alternately, into points lambda_j of the columns, with values W_j, and mu_i of the rows, with values V_i. With
H(x) = C (x I - A)^-1 B + D the divided differences

    (V_i - W_j) / (mu_i - lambda_j)                   = -C (mu_i I - A)^-1   (lambda_j I - A)^-1 B        = -H(0)
    (mu_i V_i - lambda_j W_j) / (mu_i - lambda_j)     = -C (mu_i I - A)^-1 A (lambda_j I - A)^-1 B + D    = -H(1)

are H(0) = O R and H(1) = O A R of the report with other factors, so that its realizations serve them. Points come with their conjugates,
which makes real rows (y(mu) + y(mu*)) / sqrt 2 and (y(mu) - y(mu*)) / (sqrt 2 j), and columns alike. A direct term, and one that grows
with x, is removed by projecting the columns on the complement of 1 and lambda. With points weighted by the square root of their share of
the axis, the products O'O and R R' are quadratures of the Grammians and the singular values approach those of Hankel.

Mayo and Antoulas, A framework for the solution of the generalized realization problem, Linear Algebra Appl. 425 (2007). Gosea, Gugercin,
Beattie, Data-driven balancing of linear dynamical systems, SIAM J. Sci. Comput. 44 (2022): the weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.response import output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.influence import LineInfluence, Lines, Outer, all_lines
from modalscope.identification.matrices.line_columns import FittedToLines
from modalscope.identification.matrices.lines import OnPlane
from modalscope.identification.matrices.matrix import Eigen, RowShift, Triple
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.polynomials import Plane, plane_of
from modalscope.numerics.operators import Operator, TransposedOperator, real_times, times_real

#: Count of numbers of the kernel that are made at a time.
_KERNEL_NUMBERS = 1 << 21

#: Eliminated functions of the lines: 1 and lambda.
_ELIMINATED = 2


def loewner(
    response: FrequencyResponse,
    *,
    domain: str,
    order: int = 1,
    weights: ArrayLike | None = None,
    equal_outputs: bool = True,
) -> Loewner:
    """Return the Loewner matrix of lines in s or z, every second line a row.

    `response`: lines of any band. `order`: largest number of states that will be asked; used to check that the lines suffice. `weights`
    (F,): of the lines, beyond their share of the axis. `equal_outputs`: divide every output by its root mean square over the band.

    Raises `DataError`: fewer lines than the order needs.
    """
    lines, outputs, inputs = response.values.shape
    few = min(2 * (lines // 2) * outputs, (2 * ((lines + 1) // 2) - _ELIMINATED) * inputs)
    if few < order:
        raise DataError(
            f"order {order} of a Loewner matrix:",
            f"{lines} lines, {outputs} outputs and {inputs} inputs allow at most {max(few, 0)} states",
            "Widen the band or lower the order.",
        )
    plane = plane_of(domain, response.span[1], response.sampling_rate)
    return Loewner(
        response=response,
        plane=plane,
        points=plane.point(response.frequencies),
        weights=None if weights is None else np.asarray(weights, dtype=float),
        output_scale=output_scale(response) if equal_outputs else np.ones(outputs),
    )


class Points(NamedTuple):
    """One side of a Loewner matrix: which lines, x there, the root of their share of the axis, and the response."""

    lines: IntArray
    at: ComplexArray
    root: RealArray
    values: ComplexArray


def trapezoid(points: ComplexArray) -> RealArray:
    """Return the share of the axis, over 2 pi, for which each of increasing points stands."""
    steps = np.abs(np.diff(points))
    return np.asarray((np.concatenate([[0.0], steps]) + np.concatenate([steps, [0.0]])) / (4 * np.pi))


def cauchy(rows: ComplexArray, columns: ComplexArray) -> RealArray:
    """Return 1 / (mu - lambda) for points with their conjugates as a real matrix, real parts of rows and of columns first."""
    a, b = 1 / (rows[:, None] - columns), 1 / (rows[:, None] - columns.conj())
    return np.block([[a.real + b.real, a.imag - b.imag], [a.imag + b.imag, b.real - a.real]])


@dataclass(frozen=True, eq=False)
class CauchyProducts:
    """H(0) by its products, V K - K W with the kernel K; H(1) where the values are mu V and lambda W. It is never formed.

    `rows`, `columns`: with weighted kernel and values (F', l, m). `eliminated` (2 F', e): orthonormal functions of the columns' lines.
    """

    rows: Points
    columns: Points
    eliminated: RealArray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns, parts before lines before channels."""
        return 2 * self.rows.values[..., 0].size, 2 * self.columns.values[:, 0].size

    @property
    def product_operations(self) -> float:
        """Those of the kernel on the inputs, and on the outputs."""
        return 8.0 * len(self.rows.at) * len(self.columns.at) * sum(self.rows.values.shape[1:])

    @property
    def gram_operations(self) -> None:
        """None."""

    @property
    def row_gram_operations(self) -> None:
        """None."""

    @property
    def energy(self) -> float:
        """Sum of the squares of all entries."""
        total, (mu, V), (lam, W) = 0.0, (self.rows.at, self.rows.values), (self.columns.at, self.columns.values)
        for s in self._pieces(V[0].size):
            for x, values in ((lam, W), (lam.conj(), W.conj())):
                size = np.sum(np.abs(V[s, None] - values) ** 2, axis=(2, 3)) / np.abs(mu[s, None] - x) ** 2
                total += 2 * float(self.rows.root[s] ** 2 @ size @ self.columns.root**2)
        inputs = V.shape[2]
        whole = np.kron(self.eliminated, np.eye(inputs))
        return total - float(np.sum(self._times(whole.reshape(2, -1, inputs, whole.shape[1])) ** 2))

    def _pieces(self, channels: int = 1) -> Iterator[slice]:
        step = max(_KERNEL_NUMBERS // (4 * len(self.columns.at) * channels), 1)
        for start in range(0, len(self.rows.at), step):
            yield slice(start, start + step)

    def kernel(self, s: slice = slice(None)) -> RealArray:
        """Return K on some of the rows' lines, weighted."""
        root = np.tile(self.columns.root, 2)
        return cauchy(self.rows.at[s], self.columns.at) * root * np.tile(self.rows.root[s], 2)[:, None]

    def dense(self) -> RealArray:
        """The matrix as an array."""
        return self.transposed_times(np.eye(self.shape[0])).T

    def times(self, right: Array) -> RealArray:
        """H X."""
        inputs, k = self.columns.values.shape[2], right.shape[1]
        X = np.asarray(right, dtype=float).reshape(len(self.eliminated), -1)
        X = X - self.eliminated @ (self.eliminated.T @ X)
        return self._times(X.reshape(2, -1, inputs, k))

    def _times(self, X: Array) -> RealArray:
        """Return H X without the projection, X (2, F', m, k)."""
        V, W = self.rows.values, self.columns.values
        xi = X[0] - 1j * X[1]
        both = _stacked(np.concatenate([xi, W @ xi], axis=1), -1)
        found = np.empty((2, *V.shape[:2], X.shape[3]))
        for s in self._pieces():
            y = _complex(self.kernel(s) @ both, V.shape[2] + V.shape[1], 1)
            value = y[:, V.shape[2] :] - V[s] @ y[:, : V.shape[2]]
            found[0, s], found[1, s] = value.real, value.imag
        return found.reshape(self.shape[0], -1)

    def transposed_times(self, left: Array) -> RealArray:
        """H' Z."""
        V, W = self.rows.values, self.columns.values
        outputs, inputs = V.shape[1:]
        Z = np.asarray(left, dtype=float).reshape(2, len(V), outputs, -1)
        y = Z[0] + 1j * Z[1]
        both = np.concatenate([V.conj().transpose(0, 2, 1) @ y, y], axis=1)
        total = np.zeros((2 * len(W), both[0].size))
        for s in self._pieces():
            total += self.kernel(s).T @ _stacked(both[s], 1)
        xi = _complex(total, inputs + outputs, -1)
        xi = W.conj().transpose(0, 2, 1) @ xi[:, inputs:] - xi[:, :inputs]
        X = _stacked(xi, -1)
        return np.asarray(X - self.eliminated @ (self.eliminated.T @ X)).reshape(self.shape[1], -1)

    def gram(self) -> None:
        """None."""

    def row_gram(self) -> None:
        """None."""

    def transposed(self) -> Operator:
        """H'."""
        return TransposedOperator(self)

    def row_chunks(self, rows: int) -> Iterator[RealArray]:
        """The rows from first to last, `rows` at a time."""
        for start in range(0, self.shape[0], rows):
            yield self.transposed_times(np.eye(self.shape[0])[:, start : start + rows]).T

    def column_chunks(self, columns: int) -> Iterator[RealArray]:
        """The columns from first to last as rows, `columns` at a time."""
        for start in range(0, self.shape[1], columns):
            yield self.times(np.eye(self.shape[1])[:, start : start + columns]).T


def _stacked(values: ComplexArray, sign: int) -> RealArray:
    """Return values (F, c, k) as real rows: real parts above imaginary ones times a sign, (2 F, c k)."""
    flat = values.reshape(len(values), -1)
    return np.concatenate([flat.real, sign * flat.imag])


def _complex(rows: RealArray, channels: int, sign: int) -> ComplexArray:
    """Return the values (F, c, k) of real rows: the inverse of `_stacked`."""
    half = len(rows) // 2
    return np.asarray(rows[:half] + sign * 1j * rows[half:]).reshape(half, channels, -1)


@dataclass(frozen=True)
class BarycentricShift(RowShift):
    """E0 and E1 of rows C (mu_i I - A)^-1: mu_i V_i - V_i A = C at every i, so that what is common to all lines goes.

    `points` (F',): mu. `constant` (2 F',): the weighted constant on the rows, of length one.
    """

    points: ComplexArray = None  # type: ignore[assignment]
    constant: RealArray = None  # type: ignore[assignment]

    def split(self, V: Array) -> tuple[RealArray, RealArray]:
        """Return E0 V and E1 V."""
        rows = self.unweighted(V)
        half = len(self.points)
        shifted = self.points[:, None] * (rows[: rows.shape[0] // 2] + 1j * rows[rows.shape[0] // 2 :]).reshape(
            half, -1
        )
        moved = np.concatenate([shifted.real, shifted.imag]).reshape(rows.shape)
        return self._without_constant(rows), self._without_constant(moved)

    def _without_constant(self, rows: Array) -> RealArray:
        flat = np.asarray(rows).reshape(self.constant.size, -1)
        return np.asarray(flat - np.outer(self.constant, self.constant @ flat)).reshape(rows.shape)

    def pencil(self, left: Array, values: Array, rows: int) -> ComplexArray:
        """Return L_j = F_j E1 - x_j F_j E0 on the rows."""
        F = self._without_constant(left.T.real).T + 1j * self._without_constant(left.T.imag).T
        u, v = np.split(F.reshape(len(F), 2 * len(self.points), -1), 2, axis=1)
        mu = self.points[:, None]
        L = np.concatenate([mu.real * u + mu.imag * v, mu.real * v - mu.imag * u], axis=1)
        return np.asarray(L.reshape(len(F), rows) - values[:, None] * F)


class LoewnerVectors(NamedTuple):
    """Columns v_j of the matrix by their coefficients (n, k) in the right factors."""

    factors: Factors
    coefficients: Array


class LoewnerPencil(NamedTuple):
    """Rows (k, rows of H(0)): F_j of F_j (dH(1) - x_j dH(0)) with `values` x_j, or L_j of L_j dH(0) without."""

    rows: ComplexArray
    values: Array | None


@dataclass(frozen=True, eq=False)
class Loewner(OnPlane, FittedToLines):
    """The Loewner matrix of one band (made by `loewner`)."""

    response: FrequencyResponse
    plane: Plane
    points: ComplexArray
    weights: RealArray | None
    output_scale: RealArray

    @property
    def thinned(self) -> bool:
        """False: neighbouring lines stand on different sides."""
        return False

    def _points(self, start: int) -> Points:
        index = np.arange(start, len(self.points), 2)
        root = np.sqrt(trapezoid(self.points[index])) * (1.0 if self.weights is None else self.weights[index])
        return Points(index, self.points[index], root, self.response.values[index] / self.output_scale[:, None])

    @cached_property
    def columns(self) -> Points:
        """Points of the columns: the first line and every second one."""
        return self._points(0)

    @cached_property
    def rows(self) -> Points:
        """Points of the rows: the second line and every second one."""
        return self._points(1)

    @cached_property
    def eliminated(self) -> RealArray:
        """Orthonormal 1 and lambda on the lines of the columns."""
        functions = np.stack([np.ones_like(self.columns.at), self.columns.at / np.abs(self.points).max()], axis=1)
        weighted = functions * self.columns.root[:, None]
        return np.linalg.qr(np.concatenate([weighted.real, weighted.imag]))[0]

    @property
    def block_rows(self) -> int:
        """Real rows of lines."""
        return 2 * len(self.rows.at)

    def shifted(self, k: int) -> Operator:
        """Return H(k)."""
        rows, columns = (
            side._replace(values=side.at[:, None, None] ** k * side.values) for side in (self.rows, self.columns)
        )
        return CauchyProducts(rows, columns, self.eliminated)

    def tall(self) -> Operator:
        """Return H(0): the lines themselves are what shifts."""
        return self.shifted(0)

    @cached_property
    def row_shift(self) -> BarycentricShift:
        """E0 and E1 by the lines."""
        weighted = np.concatenate([self.rows.root, np.zeros(len(self.rows.root))])
        constant = weighted / np.linalg.norm(weighted)
        return BarycentricShift(block=self.outputs, points=self.rows.at, constant=constant)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return W R X for the columns R of H(k): C = first_rows(Q d^-1/2)."""
        X = np.asarray(right, dtype=float).reshape(len(self.eliminated), -1)
        X = (X - self.eliminated @ (self.eliminated.T @ X)).reshape(2, len(self.columns.at), -1, right.shape[1])
        values = self.response.values[self.columns.lines] * (self.columns.at**k * self.columns.root)[:, None, None]
        return np.asarray(np.sqrt(2) * np.einsum("fom,fmk->ok", values, X[0] - 1j * X[1]).real)

    def row_blocks(self, P: Array) -> RealArray:
        """Return a left factor by lines, real parts first, (2 F', l, k)."""
        return np.asarray(P.reshape(self.block_rows, self.outputs, -1))

    def first_block(self, shapes: Array) -> Array:
        """Return C in the scale of the rows."""
        return np.asarray(shapes) / self.output_scale[:, None]

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return how a mode runs over the lines, (1 / (mu - x), its conjugate point's) as real rows have it."""
        x, w = np.asarray(poles)[None, :], self.rows.root[:, None] / np.sqrt(2)
        up, down = 1 / (self.rows.at[:, None] - x), 1 / (self.rows.at.conj()[:, None] - x)
        return np.concatenate([w * (up + down), -1j * w * (up - down)])

    def shapes(self, V: Array, poles: Array) -> ComplexArray:
        """Return the shapes c of modes from their columns c / (mu_i - x) of the row factor, by least squares over all lines."""
        g = self.evolution(poles, self.block_rows)
        blocks = np.asarray(V).reshape(self.block_rows, self.outputs, -1)
        c = np.einsum("kn,kln->ln", g.conj(), blocks) / np.sum(np.abs(g) ** 2, axis=0)
        return np.asarray(self.output_scale[:, None] * c)

    def mode_shapes(self, model: Triple, eigen: Eigen) -> ComplexArray:
        """Return the shapes by the rows of the matrix."""
        return self.shapes(model.row_states(eigen.vectors), eigen.values)

    # ------------------------------------------------------------------------------------------------------ influence
    def pencil(self, left: Array, values: Array, *, tall: bool) -> LoewnerPencil:
        """Return rows F_j with their x_j, or by the shift of the lines."""
        if tall:
            return LoewnerPencil(self.row_shift.pencil(left, values, left.shape[1]), None)
        return LoewnerPencil(np.asarray(left), np.asarray(values))

    def right_vectors(self, factors: Factors, coefficients: Array) -> LoewnerVectors:
        """Return columns v_j."""
        return LoewnerVectors(factors, np.asarray(coefficients))

    def influence(self, left: LoewnerPencil, right: LoewnerVectors, lines: Lines | None = None) -> LineInfluence:
        """Return the gradient: -(F (mu - x)) by K v on the lines of the rows, F K (lambda - x) by v on those of the columns.

        The kernel is applied to the factors, once for all poles.
        """
        x, n = left.values, len(right.coefficients)
        P, Q = right.factors.P[:, :n], right.factors.Q[:, :n]
        KQ, KP = self._kernel_on(right.factors)
        l, m, by_pole = self.outputs, self.response.values.shape[2], right.coefficients.T
        on_rows = _both(left.rows, l, -1), _both(times_real(by_pole, KQ[:, :n].T), m, 1)
        rows = left.rows if x is None else times_real(left.rows, P)
        of_rows = self._kernel_times(rows.T, 1).T if x is None else times_real(rows, KP[:, :n].T)
        on_columns = _both(of_rows, l, 1), _both(times_real(by_pole, Q.T), m, -1)
        parts = []
        for k in (0, 1):
            mu, lam = ((p.at, p.at.conj())[k] for p in (self.rows, self.columns))
            a = on_rows[0][k] if x is None else on_rows[0][k] * (mu - x[:, None])[:, :, None]
            b = on_columns[0][k] if x is None else on_columns[0][k] * (lam - x[:, None])[:, :, None]
            parts.append(
                Outer(self._on_lines(-a, b) / self.output_scale, self._on_lines(on_rows[1][k], on_columns[1][k]))
            )
        used = all_lines(self.response.lines) if lines is None else lines
        direct, mirrored = (Outer(p.left[:, used.used], p.right[:, used.used]) for p in parts)
        return LineInfluence((direct,), (mirrored,), used)

    def _kernel_on(self, factors: Factors) -> tuple[RealArray, RealArray]:
        """Return K Q and K' P, made once."""
        made = factors.between
        if "K Q" not in made:
            made["K Q"], made["K' P"] = self._kernel_times(factors.Q, 0), self._kernel_times(factors.P, 1)
        return made["K Q"], made["K' P"]

    def _kernel_times(self, sides: Array, of_rows: int) -> Any:
        """Return K X of columns (2 F' m, k), or K' X of rows (2 F' l, k)."""
        K = CauchyProducts(self.rows, self.columns, self.eliminated).kernel()
        flat = sides.reshape(K.shape[1 - of_rows], -1)
        return real_times(K.T if of_rows else K, flat).reshape(-1, sides.shape[1])

    def _on_lines(self, of_rows: ComplexArray, of_columns: ComplexArray) -> ComplexArray:
        whole = np.empty((len(of_rows), self.response.lines, of_rows.shape[2]), dtype=complex)
        whole[:, self.rows.lines], whole[:, self.columns.lines] = of_rows, of_columns
        return whole

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        f = self.response.frequencies
        weighting = "; weighted lines" if self.weights is not None else ""
        size = f"{len(self.rows.at)} x {len(self.columns.at)} of {f.size} lines, {f[0]:g} to {f[-1]:g} Hz"
        return f"Loewner matrix {size} ({self.plane.name}); direct and linear term eliminated{weighting}"


def _both(parts: Array, channels: int, sign: int) -> tuple[ComplexArray, ComplexArray]:
    """Return real parts (k, 2 F c) at the points and at their conjugates, (k, F, c): (u + sign j v) / sqrt 2 and the other sign."""
    u, v = np.split(np.asarray(parts).reshape(len(parts), -1, channels), 2, axis=1)
    return (u + sign * 1j * v) / np.sqrt(2), (u - sign * 1j * v) / np.sqrt(2)
