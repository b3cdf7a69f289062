"""Linearized fractions in partial fractions, with common poles of all channels: AAA and vector fitting.

With sigma(x) = d + sum_j c_j / (x - p_j) both minimize sum |sigma H - N|^2 over the lines, as LSCF does with powers of z. They differ in
the p_j and in N. Vector fitting has free numerators over the same p_j, and moves these to the zeros of sigma until they stay. AAA takes
lines for p_j, where N interpolates H, so that c is the null vector of a Loewner matrix that has all channels as rows; d = 0, and the zeros
of sigma are the eigenvalues of an arrow pencil. All is real by conjugate pairs.

Nakatsukasa, Sete, Trefethen, The AAA algorithm for rational approximation, SIAM J. Sci. Comput. 40 (2018); set-valued: Lietaert et al.,
Automatic rational approximation and linearization of nonlinear eigenvalue problems, IMA J. Numer. Anal. 42 (2022). Gustavsen, Improving the
pole relocating properties of vector fitting, IEEE Trans. Power Delivery 21 (2006); Deschrijver et al., Macromodeling of multiport systems
using a fast implementation of the vector fitting method, IEEE Microwave and Wireless Components Letters 18 (2008).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.response import output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.line_columns import FittedToLines
from modalscope.identification.matrices.lines import OnPlane
from modalscope.identification.matrices.matrix import Eigen, Realization, Triple
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import line_basis
from modalscope.numerics.functions.polynomials import Plane, plane_of

#: Relative error of an interpolant below which further points would fit rounding: the tolerance of the AAA paper.
_TOLERANCE = 1e-13

#: Damping of starting poles, evenly over the band (Gustavsen and Semlyen: a hundredth), and relocations at most.
_START_DAMPING, _MAX_RELOCATIONS = 0.01, 10

#: Poles have settled when none moves by more than this in the scaled plane: a thousandth of what data of 40 dB tell.
_SETTLED = 1e-8


class PartialFractions(NamedTuple):
    """Sigma(x) = d + sum_j c_j / (x - p_j): points p (k,) of the upper half plane stand for pairs, real ones for themselves.

    `coefficients` (n,): real, those of the functions of `partial_fractions`. `direct`: d.
    """

    points: Array
    coefficients: RealArray
    direct: float = 0.0

    def zeros_matrix(self) -> RealArray:
        """Return a real matrix whose eigenvalues are the zeros of sigma: L - b c'/d, of d = 0 the finite ones of the arrow pencil."""
        pairs = self.points.imag != 0
        blocks = [np.array([[p.real, -p.imag], [p.imag, p.real]] if p.imag else [[p.real]]) for p in self.points]
        L = sla.block_diag(*blocks)
        b = np.concatenate([[1.0, 0.0] if pair else [1.0] for pair in pairs])
        c = self.coefficients
        if self.direct:
            return np.asarray(L - np.outer(b, c) / self.direct)
        Z = sla.null_space(c[None])
        return np.asarray(Z.T @ (L - np.outer(b, c @ L) / (c @ b)) @ Z)


def partial_fractions(points: Array, at: ComplexArray) -> ComplexArray:
    """Return g = 1 / (x - p) of real points, of pairs (g + h) / 2 and (g - h) / 2j with h = 1 / (x - p*): (lines, functions)."""
    g, mirrored = 1 / (at[:, None] - points), 1 / (at[:, None] - points.conj())
    pairs = points.imag != 0
    both = np.stack([(g + mirrored) / 2, (g - mirrored) / 2j], axis=2).reshape(at.size, -1)
    return both[:, np.stack([np.ones_like(pairs), pairs], axis=1).ravel()]


@dataclass(frozen=True, eq=False)
class CommonPoles(OnPlane, FittedToLines):
    """A scalar fraction of all channels of a response.

    `largest`: order up to which models are asked.
    """

    response: FrequencyResponse
    plane: Plane
    at: ComplexArray
    weights: RealArray | None
    output_scale: RealArray
    largest: int

    @abstractmethod
    def sigma(self, order: int) -> PartialFractions:
        """Return the denominator of one order."""

    @property
    def channels(self) -> ComplexArray:
        """Values of all channels, outputs brought level, (F, l m)."""
        return (self.response.values / self.output_scale[:, None]).reshape(self.response.lines, -1)

    @property
    def block_rows(self) -> int:
        """Largest order."""
        return self.largest

    @property
    def row_weights(self) -> RealArray:
        """Weights of the lines."""
        return np.ones(self.response.lines) if self.weights is None else self.weights

    @property
    @abstractmethod
    def factors(self) -> Factors:
        """Singular values of the linearized problem of the largest order."""

    def mode_shapes(self, model: Triple, eigen: Eigen) -> ComplexArray:
        """Return the leading left vector of the residue of each pole, residues of all channels by least squares."""
        lines = self.response
        basis = line_basis(
            lines.frequencies, lines.sampling_rate, self._line_data, self.to_s(eigen.values), (0,), self.weights
        )
        columns = basis.columns
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1
        flat = basis.data.reshape(len(columns), -1) / np.repeat(self.output_scale, lines.values.shape[2])
        found = np.linalg.lstsq(columns / size, flat, rcond=None)[0] / size[:, None]
        residues = found[1::2] + 1j * found[2::2]
        left = np.linalg.svd(residues.reshape(-1, *lines.values.shape[1:]), full_matrices=False)[0]
        return np.asarray(self.output_scale[:, None] * left[:, :, 0].T)

    def _said(self, what: str) -> str:
        f = self.response.frequencies
        return f"{what} on {f.size} lines, {f[0]:g} to {f[-1]:g} Hz, common poles of {self.channels.shape[1]} channels ({self.plane.name})"


# -------------------------------------------------------------------------------------------------------------------- AAA
def aaa(
    response: FrequencyResponse, *, domain: str, order: int, weights: Array | None = None, equal_outputs: bool = True
) -> Interpolant:
    """Return interpolants of lines in s or z for every order: how many lines they go through.

    Raises `DataError`: more of them than half of the lines, so that fewer equations than unknowns would be left.
    """
    lines, outputs, _ = response.values.shape
    if 2 * order > lines:
        raise DataError(
            f"an interpolant of {order} lines:",
            f"there are {lines} lines",
            f"Lower the order to at most {lines // 2}, or widen the band.",
        )
    plane = plane_of(domain, response.span[1], response.sampling_rate)
    scale = output_scale(response) if equal_outputs else np.ones(outputs)
    return Interpolant(response, plane, plane.point(response.frequencies), weights, scale, order)


class _Step(NamedTuple):
    """An interpolant: its lines, their coefficients, the singular values of its Loewner matrix, and its largest error, relative."""

    lines: IntArray
    sigma: PartialFractions
    singular_values: RealArray
    error: float


@dataclass(frozen=True, eq=False)
class Interpolant(CommonPoles):
    """Set-valued barycentric interpolants, each through one line more: where the one before is worst (made by `aaa`).

    The order counts lines; with their conjugates k lines away from 0 Hz give 2 k - 1 poles.
    """

    _steps: list[_Step] = field(default_factory=list)

    def step(self, order: int) -> _Step:
        """Return the interpolant of one order, or the last that did not fit rounding."""
        while len(self._steps) < order:
            if self._steps and self._steps[-1].error < _TOLERANCE:
                return self._steps[-1]
            self._steps.append(self._next())
        return self._steps[order - 1]

    def _next(self) -> _Step:
        values, at = self.channels, self.at
        if self._steps:
            lines, sigma, *_ = self._steps[-1]
            rebuilt = self._evaluated(lines, sigma)
        else:
            lines, rebuilt = np.zeros(0, dtype=int), np.broadcast_to(values.mean(axis=0), values.shape)
        worst = np.max(np.abs(values - rebuilt), axis=1) * self.row_weights
        worst[lines] = 0
        lines = np.append(lines, np.argmax(worst))
        rest = np.setdiff1d(np.arange(at.size), lines)
        A = self.row_weights[rest, None, None] * self._differences(lines, rest)
        R = sla.qr(np.concatenate([A.real, A.imag]).reshape(-1, A.shape[2]), mode="r", check_finite=False)[0]
        _, d, Vt = np.linalg.svd(R[: R.shape[1]])
        sigma = PartialFractions(at[lines], Vt[-1])
        error = np.max(np.abs(self._evaluated(lines, sigma) - values)) / np.max(np.abs(values))
        return _Step(lines, sigma, d, float(error))

    def _differences(self, lines: IntArray, rest: IntArray) -> ComplexArray:
        """Return H times each function less what interpolates it, (lines, channels, functions): a Loewner matrix of one input."""
        phi, W = partial_fractions(self.at[lines], self.at[rest]), self.channels[lines]
        out, k = np.empty((rest.size, W.shape[1], phi.shape[1]), dtype=complex), 0
        for point, value in zip(self.at[lines], W, strict=True):
            own = phi[:, None, k : k + 1 + bool(point.imag)]
            carried = own * value.real[:, None]
            if point.imag:
                carried += own[..., ::-1] * value.imag[:, None] * np.array([-1, 1])
            out[..., k : k + own.shape[2]] = self.channels[rest][:, :, None] * own - carried
            k += own.shape[2]
        return out

    def _evaluated(self, lines: IntArray, sigma: PartialFractions) -> ComplexArray:
        """Return the interpolant on all lines: H - (differences) c / sigma, and H where it is interpolated."""
        rest = np.setdiff1d(np.arange(self.at.size), lines)
        values = np.array(self.channels)
        with np.errstate(divide="ignore", invalid="ignore"):
            missed = self._differences(lines, rest) @ sigma.coefficients
            values[rest] -= missed / (partial_fractions(sigma.points, self.at[rest]) @ sigma.coefficients)[:, None]
        return values

    def sigma(self, order: int) -> PartialFractions:
        """Return the null vector of one order."""
        return self.step(order).sigma

    @property
    def factors(self) -> Factors:
        """Singular values of the Loewner matrix of the largest order."""
        d = self.step(self.largest).singular_values
        V = np.eye(d.size)
        return Factors(V, d, V, d, d.size, f"adaptive, {len(self._steps)} lines interpolated")

    def describe(self) -> str:
        """Say what it is, in words."""
        return self._said("barycentric interpolants (AAA)")


# --------------------------------------------------------------------------------------------------------- vector fitting
def vector_fitting(
    response: FrequencyResponse, *, domain: str, order: int, weights: Array | None = None, equal_outputs: bool = True
) -> VectorFitting:
    """Return relaxed vector fits of lines in s or z for every order up to one: poles.

    Raises `DataError`: more unknowns of a channel, 2 (order + 1), than real equations, two a line.
    """
    lines, outputs, _ = response.values.shape
    if order + 1 > lines:
        raise DataError(
            f"vector fitting of {order} poles:",
            f"there are {lines} lines",
            f"Lower the order to at most {lines - 1}, or widen the band.",
        )
    plane = plane_of(domain, response.span[1], response.sampling_rate)
    scale = output_scale(response) if equal_outputs else np.ones(outputs)
    return VectorFitting(response, plane, plane.point(response.frequencies), weights, scale, order)


@dataclass(frozen=True, eq=False)
class VectorFitting(CommonPoles):
    """Common poles that are moved to the zeros of sigma until they stay (made by `vector_fitting`)."""

    def start(self, order: int) -> ComplexArray:
        """Return starting points: pairs evenly over the band, slightly damped, and a real one of the middle where the order is odd."""
        low, high = (2 * np.pi * f for f in self.response.span)
        w = low + (high - low) * (np.arange(order // 2) + 0.5) / max(order // 2, 1)
        s = np.concatenate([w * (-_START_DAMPING + 1j), np.full(order % 2, -(low + high) / 2)])
        return self.from_s(s)

    def linearized(self, points: Array) -> Array:
        """Return R (n + 1, n + 1) with |R [c; d]|^2 the sum of |sigma H - N|^2 over channels, their numerators eliminated."""
        functions = partial_fractions(points, self.at)
        phi = np.concatenate([functions, np.ones_like(functions[:, :1])], axis=1) * self.row_weights[:, None]
        Q = np.linalg.qr(np.concatenate([phi.real, phi.imag]))[0]
        R = np.zeros((0, phi.shape[1]))
        for channel in self.channels.T:
            product = channel[:, None] * phi
            own = np.concatenate([product.real, product.imag])
            left = own - Q @ (Q.T @ own)
            R = sla.qr(np.vstack([R, left]), mode="r", check_finite=False)[0][: phi.shape[1]]
        return R

    def relocated(self, points: Array) -> PartialFractions:
        """Return sigma of relaxed vector fitting: least squares with the mean of Re sigma over the lines fixed to 1."""
        R = self.linearized(points)
        phi = partial_fractions(points, self.at).real
        mean = np.append(phi.mean(axis=0), 1.0)
        # minimum of |R u| with mean'u = 1: u along (R'R)^-1 mean; by the null space of mean, which forms no squares
        Z = sla.null_space(mean[None])
        first = mean / (mean @ mean)
        u = first - Z @ np.linalg.lstsq(R @ Z, R @ first, rcond=None)[0]
        return PartialFractions(points, u[:-1], float(u[-1]))

    def sigma(self, order: int) -> PartialFractions:
        """Return sigma whose zeros are where the poles settled, unstable ones mirrored on the way."""
        points: Array = self.start(order)
        for _ in range(_MAX_RELOCATIONS):
            found = self.relocated(points)
            zeros = np.linalg.eigvals(found.zeros_matrix())
            s = self.to_s(zeros)
            stable = self.from_s(-np.abs(s.real) + 1j * s.imag)
            moved = np.asarray(np.where(zeros.imag == 0, stable.real, stable)[zeros.imag >= 0], dtype=complex)
            if (
                moved.size == points.size
                and np.max(np.abs(np.sort_complex(moved) - np.sort_complex(points))) < _SETTLED
            ):
                break
            points = moved
        return found

    @cached_property
    def factors(self) -> Factors:
        """Singular values of the linearized problem from the starting points of the largest order."""
        d = np.asarray(np.linalg.svd(self.linearized(self.start(self.largest)), compute_uv=False), dtype=float)
        V = np.eye(d.size)
        return Factors(V, d, V, d, d.size, "poles relocated")

    def describe(self) -> str:
        """Say what it is, in words."""
        return self._said("relaxed vector fitting")


# ----------------------------------------------------------------------------------------------------------- realizations
@dataclass(frozen=True, eq=False, kw_only=True)
class Zeros(Realization):
    """Eigenvalues of L - b c'/d, of an interpolant those of the arrow pencil [0 c'; b L] - x [0 0; 0 I]."""

    matrix: CommonPoles

    def triple(self, n: int) -> Triple:
        """Return the model of order n; shapes and residuals come from least squares over the lines."""
        if not 1 <= n <= self.matrix.largest:
            raise DataError(
                f"order={n}:",
                f"the fraction has orders 1 to {self.matrix.largest}",
                "Ask for a larger order when it is built.",
            )
        A = self.matrix.sigma(n).zeros_matrix()
        return Triple(A, None, np.zeros((0, len(A))), len(A))


def zeros(matrix: CommonPoles, factors: Factors) -> Zeros:
    """Return the zeros of the denominators of every order; their first-order change with the data is not known."""
    return Zeros(factors=factors, matrix=matrix)
