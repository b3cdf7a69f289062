"""Right matrix fraction H(z) = B(z) A(z)^-1 as a data matrix: LSCF, known as PolyMAX."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.response import Misfit, output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.data.statespace import StateSpace
from modalscope.identification.fast.fraction_noise import FractionInfluence, LineSums
from modalscope.identification.fast.normal_equations import NormalEquations, half_circle
from modalscope.identification.matrices.factor import Factors
from modalscope.identification.matrices.full import FullMatrix
from modalscope.identification.matrices.influence import Lines, all_lines
from modalscope.identification.matrices.matrix import Eigen, ModalFit, Triple
from modalscope.numerics.checks import Array, ComplexArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_basis import LineFits
from modalscope.numerics.functions.poles import to_continuous, to_discrete


def fraction(
    response: FrequencyResponse, *, degree: int, weights: ArrayLike | None = None, equal_outputs: bool = True
) -> Fraction:
    """Prepare the normal equations of all degrees up to `degree`.

    Parameters
    ----------
    response : FrequencyResponse
        Lines of any band: F lines, l outputs, m inputs.
    degree : int
        Largest degree p of the polynomials; a model of degree p has p m poles.
    weights : array, (F,), optional
        Weights of the lines.
    equal_outputs : bool
        Whether to divide every output by its root mean square over the band.

    Raises
    ------
    DataError
        Fewer equations than unknowns: real and imaginary parts of l outputs on F lines are 2 F l equations for one column of
        beta_0, ..., beta_p (l each) and A_1, ..., A_p (m each), that is (p + 1) l + p m unknowns.

    Notes
    -----
    Guillaume et al., A poly-reference implementation of the least-squares complex frequency-domain estimator, IMAC XXI (2003);
    Peeters et al., The PolyMAX frequency-domain method, Shock and Vibration 11 (2004). The lines lie at z = exp(j w T), which is
    exact for sampled systems only: for a structure's own responses the fraction is an approximation that improves with its
    degree.
    """
    lines, outputs, inputs = response.values.shape
    p = check_count("degree", degree)
    equations, unknowns = 2 * lines * outputs, (p + 1) * outputs + p * inputs
    if equations < unknowns:
        raise DataError(
            f"a matrix fraction of degree {p} needs 2 x lines x outputs >= (p + 1) x outputs + p x inputs = {unknowns}",
            f"{lines} lines and {outputs} outputs give {equations}",
            "Widen the band or lower the degree.",
        )
    low, high = half_circle(response)
    return Fraction(
        response=response,
        degree=p,
        base=low,
        interval=1 / (2 * (high - low)),  # from z = 1 to z = -1 is half of the circle
        weights=None if weights is None else np.asarray(weights, dtype=float),
        output_scale=output_scale(response) if equal_outputs else np.ones(outputs),
    )


@dataclass(frozen=True, eq=False)
class Fraction(NormalEquations, FullMatrix):
    """The data matrix of a right matrix fraction (made by `fraction`): no factor is compared with its modes."""

    by_mode = True

    @property
    def block_rows(self) -> int:
        """Largest degree of the polynomials."""
        return self.degree

    @property
    def dt(self) -> float | None:
        """Sampling interval of a sampled system; None for the responses of a structure, whose poles are continuous."""
        return self.interval if self.response.sampling_rate is not None else None

    @cached_property
    def sums(self) -> LineSums:
        """The sums over the lines that give the standard deviations of the poles, shared by all orders."""
        return LineSums(self)

    @property
    def thinned(self) -> bool:
        """False: noise is summed over a few points of the arc (`LineSums`), which costs the same for any number of lines."""
        return False

    def influence(self, left: Array, right: Array, lines: Lines | None = None) -> FractionInfluence:
        """Return the gradient of left_j dA right_j, A = [A_1; ...; A_p]; left (k, p m), right (m, k)."""
        m, degree = self.inputs, left.shape[1] // self.inputs
        # A_0 is the identity, so that its rows are zero
        rows = np.concatenate([np.zeros((len(left), m)), -self.solved(degree, left.T).T], axis=1)
        return FractionInfluence(
            self.sums,
            rows.reshape(len(left), degree + 1, m),
            np.asarray(right.T, dtype=complex),
            all_lines(self.response.lines) if lines is None else lines,
        )

    @cached_property
    def factors(self) -> Factors:
        """Eigenvectors of M of the largest degree, and the roots of its eigenvalues: M is a Gram matrix, these are singular values."""
        squares, vectors = np.linalg.eigh(self.gram_matrices[-1])
        d, V = np.sqrt(np.clip(squares[::-1], 0, None)), vectors[:, ::-1]
        return Factors(V, d, V, d, d.size, f"normal equations, {d.size} unknowns per column")

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
        """Return the participation of each eigenvalue, and shapes and residual terms by least squares over the lines.

        The participation is the last m entries of the left eigenvector of the companion matrix.
        """
        participation = eigen.left[:, -self.inputs :]
        powers = self.response.outside_powers
        solution = self._fits.fit_shapes(self.to_s(eigen.values), participation)
        shapes, terms = solution.side.T, solution.terms.transpose(0, 2, 1)
        if self.weights is not None:
            return ModalFit(shapes, participation, terms, powers)
        misfit = self._misfit.of_left(solution.left.T)
        return ModalFit(shapes, participation, terms, powers, misfit=misfit, unexplained=solution.unexplained.T)

    @cached_property
    def _fits(self) -> LineFits:
        lines = self.response
        return LineFits(lines.frequencies, lines.sampling_rate, lines.values, lines.outside_powers, self.weights)

    @cached_property
    def _misfit(self) -> Misfit:
        return Misfit(self.response, self.output_scale)

    def compared(self, model: StateSpace, poles: Array, fit: ModalFit) -> Iterator[tuple[Array, Array]]:
        """Yield data and model; residual terms of out-of-band modes are part of the model, though no state holds them."""
        if fit.powers == (0,):
            yield from super().compared(model, poles, fit)
            return
        basis = self.response.basis(poles, fit.powers)
        yield basis.data, basis.rebuilt(fit.shapes, fit.participation, fit.terms)

    def describe(self) -> str:
        """Describe the normal equations in words."""
        f = self.response.frequencies
        validity = "exact for a sampled system" if self.dt is not None else "approximate for a continuous structure"
        offset = f", counted from {self.base:g} Hz" if self.base else ""
        weighting = ", weighted lines" if self.weights is not None else ""
        lines = f"{f.size} lines, {f[0]:g} to {f[-1]:g} Hz{offset}"
        return f"right matrix fraction to degree {self.degree} on {lines}, z = exp(j w T), {validity}{weighting}"
