"""Right matrix fraction H(z) = B(z) A(z)^-1 as a data matrix: LSCF, known as PolyMAX."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.blocks.factor import Factors
from modalscope.blocks.fraction_noise import FractionInfluence, LineSums
from modalscope.blocks.influence import Lines, all_lines
from modalscope.blocks.matrix import DataMatrix
from modalscope.blocks.normal_equations import NormalEquations, half_circle
from modalscope.blocks.triple import Eigen, Misfit, ModalFit, Triple
from modalscope.data.response import output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.data.statespace import StateSpace
from modalscope.functions.poles import to_continuous, to_discrete
from modalscope.numerics.checks import Array, ComplexArray, check_count
from modalscope.numerics.errors import DataError


def fraction(
    response: FrequencyResponse, *, degree: int, weights: ArrayLike | None = None, equal_outputs: bool = True
) -> Fraction:
    """Prepare the normal equations of all degrees up to `degree`.

    `response`: lines of any band. `degree`: largest degree p of the polynomials; a model of degree p has p m poles. `weights` (F,):
    weights of the lines. `equal_outputs`: divide every output by its root mean square over the band.

    Raises `DataError`: fewer lines than unknowns: 2 F l must be at least (p + 1) l + p m.

    Notes
    -----
    Guillaume et al., A poly-reference implementation of the least-squares complex frequency-domain estimator, IMAC XXI (2003);
    Peeters et al., The PolyMAX frequency-domain method, Shock and Vibration 11 (2004). The lines lie at z = exp(j w T), which is
    exact for sampled systems only: for a structure's own responses the fraction is an approximation that improves with its
    degree.
    """
    lines, outputs, inputs = response.values.shape
    p = check_count("degree", degree)
    unknowns = (p + 1) * outputs + p * inputs
    if 2 * lines * outputs < unknowns:
        raise DataError(
            f"a matrix fraction of degree {p} needs 2 x lines x outputs >= (p + 1) x outputs + p x inputs = {unknowns}",
            f"{lines} lines and {outputs} outputs give {2 * lines * outputs}",
            "Widen the band or lower the degree.",
        )
    low, high = half_circle(response)
    level = output_scale(response) if equal_outputs else np.ones(outputs)
    return Fraction(
        response=response,
        degree=p,
        base=low,
        interval=1 / (2 * (high - low)),
        weights=None if weights is None else np.asarray(weights, dtype=float),
        output_scale=level,
    )


@dataclass(frozen=True, eq=False)
class Fraction(NormalEquations, DataMatrix):
    """The data matrix of a right matrix fraction (made by `fraction`)."""

    @property
    def block_rows(self) -> int:
        """Largest degree of the polynomials."""
        return self.degree

    @property
    def dt(self) -> float | None:
        """Sampling interval when the system is a sampled one; a structure's own responses give continuous poles."""
        return self.interval if self.response.sampling_rate is not None else None

    @cached_property
    def sums(self) -> LineSums:
        """What sums over the lines are made of where noise moves the poles."""
        return LineSums(self)

    @property
    def thinned(self) -> bool:
        """No: few points of the arc stand for all lines."""
        return False

    def influence(self, left: Array, right: Array, lines: Lines | None = None) -> FractionInfluence:
        """Return the gradient of left_j dA right_j, A = [A_1; ...; A_p]; left (k, p m), right (m, k)."""
        m, degree = self.inputs, left.shape[1] // self.inputs
        rows = np.concatenate([np.zeros((len(left), m)), -self.solved(degree, left.T).T], axis=1)
        kept = all_lines(self.response.lines) if lines is None else lines
        return FractionInfluence(
            self.sums, rows.reshape(len(left), degree + 1, m), np.asarray(right.T, dtype=complex), kept
        )

    @cached_property
    def factors(self) -> Factors:
        """Eigenvectors of M of the largest degree and the roots of its eigenvalues, the singular values of the data behind it."""
        weights, vectors = np.linalg.eigh(self.gram_matrices[-1])
        d, V = np.sqrt(np.clip(weights[::-1], 0, None)), vectors[:, ::-1]
        return Factors(V, d, V, d, d.size, f"normal equations, {d.size} unknowns a column")

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles, rad/s, of roots of A(z)."""
        z = np.asarray(poles, dtype=complex)
        upper = to_continuous(np.where(z.imag < 0, z.conj(), z), self.interval) + 2j * np.pi * self.base
        return np.where(z.imag < 0, upper.conj(), upper)

    def from_s(self, poles: Array) -> ComplexArray:
        """Roots of A(z) from continuous poles."""
        s = np.asarray(poles, dtype=complex)
        upper = to_discrete(np.where(s.imag < 0, s.conj(), s) - 2j * np.pi * self.base, self.interval)
        return np.where(s.imag < 0, upper.conj(), upper)

    def fit(self, model: Triple, eigen: Eigen) -> ModalFit:
        """Return participation, the last entries of the left eigenvectors; shapes and residuals by least squares over the lines."""
        participation = eigen.left[:, -self.inputs :]
        powers = self.response.outside_powers
        basis = self.response.basis(self.to_s(eigen.values), powers, self.weights)
        solution = basis.turned.solved(participation.T)
        shapes, terms = solution.side.T, solution.terms.transpose(0, 2, 1)
        if self.weights is not None:
            return ModalFit(shapes, participation, terms, powers)
        misfit = self._misfit.of_left(solution.left.T)
        return ModalFit(shapes, participation, terms, powers, misfit=misfit, unexplained=solution.unexplained.T)

    @cached_property
    def _misfit(self) -> Misfit:
        return Misfit(self.response, self.output_scale)

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Yield data and model with the residuals, which no state has."""
        if fit.powers == (0,):
            yield from super().compared(model, poles, fit)
            return
        basis = self.response.basis(poles, fit.powers)
        yield basis.data, basis.rebuilt(fit.shapes, fit.participation, fit.terms)

    def describe(self) -> str:
        """Say what the normal equations are, in words."""
        f = self.response.frequencies
        kind = "exact for a sampled system" if self.dt is not None else "approximate for a continuous structure"
        moved = f", counted from {self.base:g} Hz" if self.base else ""
        weighted = ", weighted lines" if self.weights is not None else ""
        lines = f"{f.size} lines, {f[0]:g} to {f[-1]:g} Hz{moved}"
        return f"right matrix fraction to degree {self.degree} on {lines}, z = exp(j w T), {kind}{weighted}"
