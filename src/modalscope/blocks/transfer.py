"""Block matrices of transfer functions at the lines of any band, z- and s-domain (Eqs. 82, 89-93, made right).

The rows are p_k(x_i) H(x_i), with polynomials p_k orthogonal on the measured lines instead of powers of x. From
x^k H = C A^k X + (a polynomial of degree k with unknown matrix coefficients: the direct term and the initial values) it follows
that p_k(x) H = C p_k(A) X + (a polynomial of degree k). The unknown polynomials are removed by projecting the columns
on the complement of p_0, ..., p_q; what is left is [C p_0(A); ...; C p_q(A)] X, whose row shift is the recurrence of the basis.
Columns are real: real and imaginary parts side by side, which is the same as using the lines at -w too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla
from numpy.typing import ArrayLike

from modalscope.blocks.matrix import Evolution, RowShift
from modalscope.blocks.operators import DenseMatrix
from modalscope.blocks.polynomials import evaluate, orthogonal_basis
from modalscope.model.checks import Array, ComplexArray, DataError, RealArray, check_count, real_array
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.poles import to_continuous, to_discrete

__all__ = ["Plane", "Transfer", "line_weights", "plane_of", "transfer"]


@dataclass(frozen=True)
class Plane:
    """The plane in which the polynomials live: where a line lies, and how poles go back to rad/s.

    Parameters
    ----------
    name : str
        In words.
    point : callable
        Frequencies in Hz -> points x.
    to_s, from_s : callable
        Poles of the realization -> rad/s, and back.
    dt : float or None
        Sampling interval when x = exp(j w dt).
    """

    name: str
    point: Callable[[RealArray], ComplexArray]
    to_s: Callable[[Array], ComplexArray]
    from_s: Callable[[Array], ComplexArray]
    dt: float | None = None


def plane_of(domain: str, response: FrequencyResponse) -> Plane:
    """Return the plane of a domain: s scaled to the band, z by the exponential for sampled responses, else the bilinear map.

    The bilinear map z = (1 + s T/2) / (1 - s T/2), T = 2 / w_max, is exact for continuous responses, the exponential is not.
    """
    top = 2 * np.pi * float(response.frequencies[-1])
    rate = response.sampling_rate
    if domain == "s":
        if rate is not None:
            raise DataError(
                "domain='s' was asked",
                f"the response is that of a system sampled at {rate:g} Hz, which is no rational function of j w",
                "Use domain='z', or leave sampling_rate out when the response is that of the structure itself.",
            )
        scale = top or 1.0
        return Plane(
            f"s-plane, scaled by {top / 2 / np.pi:g} Hz",
            lambda f: 2j * np.pi * f / scale,
            lambda x: np.asarray(x, dtype=complex) * scale,
            lambda s: np.asarray(s, dtype=complex) / scale,
        )
    if rate is not None:
        dt = 1 / rate
        return Plane(
            "z-plane, exponential",
            lambda f: np.exp(2j * np.pi * f * dt),
            lambda z: to_continuous(z, dt),
            lambda s: to_discrete(s, dt),
            dt,
        )
    half = 1 / (top or 1.0)

    def into(s: Array) -> ComplexArray:
        return np.asarray((1 + np.asarray(s) * half) / (1 - np.asarray(s) * half), dtype=complex)

    def back(z: Array) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((np.asarray(z) - 1) / (np.asarray(z) + 1) / half, dtype=complex)

    return Plane("z-plane, bilinear map", lambda f: into(2j * np.pi * f), back, into)


def line_weights(response: FrequencyResponse, weights: str | ArrayLike | None) -> RealArray | None:
    """Return one positive weight a line.

    Parameters
    ----------
    response : FrequencyResponse
    weights : array (F,), {"variance", "coherence", "level"} or None
        1 / standard deviation of the estimate averaged over channels; from coherence g2 by
        var = |H|^2 (1 - g2) / g2; or the inverse of the root mean square level of the response, which makes weak modes count.
    """
    if weights is None:
        return None
    if not isinstance(weights, str):
        array = real_array("weights", weights, "(lines,)", 1)
        if array.size != response.lines or np.any(array <= 0):
            raise DataError(
                f"weights needs {response.lines} positive entries",
                f"it has {array.size}, the smallest {array.min():g}",
                "Give one a line.",
            )
        return array
    power = np.mean(np.abs(response.values) ** 2, axis=(1, 2))
    if weights == "level":
        variance = power
    elif weights == "variance" and response.variance is not None:
        variance = np.mean(response.variance, axis=(1, 2))
    elif weights == "coherence" and response.coherence is not None:
        g2 = np.clip(response.coherence.reshape(response.lines, -1), 1e-6, 1)
        variance = power * np.mean((1 - g2) / g2, axis=1)
    else:
        have = [name for name in ("variance", "coherence") if getattr(response, name) is not None]
        raise DataError(
            f"weights={weights!r} was asked",
            f"the response carries {' and '.join(have) or 'neither variance nor coherence'}",
            "Use weights='level', give one a line, or None.",
        )
    floor = 1e-6 * variance.max()
    return np.asarray(np.sqrt(variance.max() / np.maximum(variance, floor))) if floor > 0 else None


def transfer(
    response: FrequencyResponse,
    *,
    domain: str,
    block_rows: int,
    order: int | None = None,
    weights: ArrayLike | None = None,
    equal_outputs: bool = True,
) -> Transfer:
    """Stack p_k(x_i) H(x_i), k = 0 ... block_rows, with the unknown initial terms eliminated.

    Parameters
    ----------
    response : FrequencyResponse
        Lines of any band.
    domain : {"s", "z"}
    block_rows : int
        q: H(0) holds p_0 ... p_(q-1), H(1) goes to p_q, which is the degree.
    order : int, optional
        Largest number of states that will be asked; used to check that the lines suffice.
    weights : array, (F,), optional
        Weights of the lines.
    equal_outputs : bool
        Divide every output by its root mean square over the band, so that quiet outputs count as much as loud ones in the
        truncation. Shapes are scaled back.

    Raises
    ------
    DataError
        Fewer lines than unknowns: 2 F m must be at least n + (q + 1) m.

    Notes
    -----
    Source: the report, Eqs. 82 and 89-93, with the elimination and the basis of its errata (recipes f3 and g).
    """
    lines, outputs, inputs = response.values.shape
    q = check_count("block_rows", block_rows)
    states = order or 1
    if 2 * lines * inputs < states + (q + 1) * inputs:
        raise DataError(
            f"order {states} with block_rows={q} needs 2 x lines x inputs >= order + (block_rows + 1) x inputs = {states + (q + 1) * inputs}",
            f"{lines} lines and {inputs} inputs give {2 * lines * inputs}",
            "Widen the band, lower block_rows or lower the order.",
        )
    plane = plane_of(domain, response)
    level = np.sqrt(np.mean(np.abs(response.values) ** 2, axis=(0, 2)))
    w = None if weights is None else np.asarray(weights, dtype=float)
    basis, recurrence = orthogonal_basis(plane.point(response.frequencies), q, w)
    return Transfer(response, plane, basis, recurrence, w, level if equal_outputs else np.ones(outputs))


@dataclass(frozen=True, eq=False)
class Transfer:
    """The block matrix of one band, through its exact triangular factor (made by `transfer`)."""

    response: FrequencyResponse
    plane: Plane
    basis: ComplexArray
    recurrence: RealArray
    weights: RealArray | None
    output_scale: RealArray

    @property
    def block_rows(self) -> int:
        """Blocks in a column of H(0), which is the degree q."""
        return int(self.recurrence.shape[1])

    def _real(self, columns: ComplexArray) -> RealArray:
        """Weighted columns (F, k) -> (2 F, k): real and imaginary parts."""
        weighted = columns if self.weights is None else columns * self.weights[:, None]
        return np.vstack([weighted.real, weighted.imag])

    def columns_array(self) -> RealArray:
        """Return the whole matrix with the unknown terms projected out, transposed: (2 F m, l (q + 1)).

        Input by input: the polynomials are the same for each, orthonormal in the real inner product.
        """
        lines, outputs, inputs = self.response.values.shape
        Z = self._real(self.basis)
        parts = []
        for i in range(inputs):
            rows = (self.basis[:, :, None] * (self.response.values[:, None, :, i] / self.output_scale)).reshape(
                lines, -1
            )
            R = self._real(rows)
            for _ in range(2):  # twice, so that what is left is orthogonal to rounding
                R -= Z @ (Z.T @ R)
            parts.append(R)
        return np.vstack(parts)

    @cached_property
    def triangle(self) -> RealArray:
        """L (l (q + 1), k): the matrix times an orthonormal matrix, its exact stand-in."""
        whole = self.columns_array()
        if whole.shape[0] <= whole.shape[1]:
            return np.ascontiguousarray(whole.T)
        R = sla.qr(whole, mode="r", overwrite_a=True, check_finite=False)[0]
        return np.ascontiguousarray(R[: whole.shape[1]].T)

    def shifted(self, k: int) -> DenseMatrix:
        """Return H(k): E0 and E1 applied to the triangular factor."""
        return DenseMatrix(self.row_shift.split(self.triangle)[k])

    def tall(self) -> DenseMatrix:
        """Return all q + 1 block rows."""
        return DenseMatrix(self.triangle)

    @property
    def row_shift(self) -> RowShift:
        """E0 drops the last block, E1 = h' (x) I."""
        return RowShift(block=self.response.values.shape[1], recurrence=self.recurrence)

    @property
    def first_value(self) -> float:
        """p_0, the constant of the basis."""
        return float(self.basis[0, 0].real)

    def first_rows(self, right: Array, k: int = 0) -> RealArray:
        """Return (first block row of H(k) / p_0) X, such that C = first_rows(Q d^-1/2)."""
        outputs = self.response.values.shape[1]
        head = self.triangle[:outputs]
        if k == 1:  # x p_0 = h_00 p_0 + h_10 p_1
            head = self.recurrence[0, 0] * head + self.recurrence[1, 0] * self.triangle[outputs : 2 * outputs]
        return np.asarray(self.output_scale[:, None] * (head @ right) / self.first_value)

    def shapes(self, V: Array, poles: Array) -> ComplexArray:
        """Return the shapes c of modes from their columns [c p_0; c p_1; ...] of the row factor, by least squares over all blocks.

        The first block alone would do, but far from the axis the polynomials grow beyond 1e15, and it is rounding beside them.

        Parameters
        ----------
        V : array of complex, (l K, k)
            Row factor times eigenvectors, K = q or q + 1 blocks.
        poles : array of complex, (k,)
            In the plane of the polynomials.
        """
        blocks = np.asarray(V).reshape(-1, self.response.values.shape[1], len(poles))
        p = evaluate(self.recurrence, self.first_value, poles)[: blocks.shape[0]]
        size = np.max(np.abs(p), axis=0)
        p = p / size
        c = np.einsum("kn,kln->ln", p.conj(), blocks) / np.sum(np.abs(p) ** 2, axis=0) / size
        return np.asarray(self.output_scale[:, None] * c)

    def first_columns(self, right: Array) -> None:
        """None: the columns are lines; B and D come from least squares over them."""
        return

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s."""
        return self.plane.to_s(poles)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles in the plane of the polynomials."""
        return self.plane.from_s(poles)

    @property
    def dt(self) -> float | None:
        """Sampling interval of the identified system; None in the s-domain and under the bilinear map."""
        return self.plane.dt

    def evolution(self, poles: Array, blocks: int) -> Evolution:
        """Return p_k(x) / p_0 at the poles."""
        return evaluate(self.recurrence, 1.0, poles)[:blocks]

    def describe(self) -> str:
        """Say what the matrix is, in words."""
        f = self.response.frequencies
        weighted = ", weighted lines" if self.weights is not None else ""
        return f"transfer functions on {f.size} lines, {f[0]:g} to {f[-1]:g} Hz, polynomials to degree {self.block_rows} ({self.plane.name}){weighted}"
