"""Fit shapes and participation to responses by least squares, with the functions of given poles as regressors.

A conjugate pair of poles with residue R = a + j b contributes a g1 + b g2, two functions of the line (or sample) that are the
same for every output and input. One orthogonal decomposition of these functions therefore serves all channels: the data
enter only through their few coefficients. The constant (and residual) terms come first in it, so that they take one
coefficient each and leave the rest to the modes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.pole_functions import line_functions, sample_functions
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.numerics.orthonormal import resolved, resolved_by_products


class LineData(NamedTuple):
    """Values on lines for any number of fits.

    `values` (2 F, l, m): weighted, real parts above imaginary parts. `energy` (l, m): of every channel.
    """

    values: RealArray
    energy: RealArray


def line_data(values: ComplexArray, weights: Array | None) -> LineData:
    """Return values on lines, (F, l, m), as fits take them."""
    data = real_data(values, weights)
    return LineData(data, energy_of(data))


def energy_of(values: RealArray) -> RealArray:
    """Return sum over the rows of |v|^2 of every channel, (l, m)."""
    return np.asarray(np.einsum("klm,klm->lm", values, values))


def real_rows(columns: Array, weights: Array | None) -> RealArray:
    """Return real parts above imaginary parts, (F, k) -> (2 F, k), with the weights of the lines."""
    weighted = columns if weights is None else columns * np.asarray(weights)[:, None]
    return np.concatenate([weighted.real, weighted.imag])


def real_data(values: Array, weights: Array | None) -> RealArray:
    """Return the same of values of channels, (F, l, m) -> (2 F, l, m)."""
    lines, *channels = values.shape
    return real_rows(values.reshape(lines, -1), weights).reshape(2 * lines, *channels)


#: Share of an output's energy below which the residual energy, a difference of sums, is computed from the rebuilt data instead.
_MIN_SHARE_OF_DIFFERENCE = 1e-10

#: Numbers rebuilt at a time: they stay in the cache.
_NUMBERS_AT_A_TIME = 32_000

#: Numbers of functions and data on the lines that are taken at a time, and least number of these lines: products of fewer take longer.
_NUMBERS_OF_A_PIECE, _MIN_LINES_OF_A_PIECE = 64_000, 128

#: Share of a channel's energy below which a difference of sums has fewer than eight digits of the residual energy.
_MIN_SHARE_OF_EIGHT_DIGITS = 1e-7


class FittedSide(NamedTuple):
    """Participation fitted to shapes.

    `side` (n, m). `terms` (t, l, m): coefficients of the constant and residual terms. `left` (l, m): residual energy of every
    channel. `unexplained` (l, m): what the best terms and residues of every channel leave; NaN where that is near rounding.
    """

    side: ComplexArray
    terms: RealArray
    left: RealArray
    unexplained: RealArray


@dataclass(frozen=True, eq=False, slots=True)
class ModalBasis:
    """What poles (and constant terms) can contribute, as real columns.

    `terms` (K, t): constant and residual terms, which every channel has for itself. `functions` (K, 2 n): g1 and g2 of every pole; for a
    real pole g2 is zero. `data` (K, l, m): the response on the same rows. `whole` (l, m): energy of the data of every channel, where it
    is known.
    """

    terms: RealArray
    functions: RealArray
    data: RealArray
    whole: RealArray | None = None

    @property
    def columns(self) -> RealArray:
        """Terms and functions side by side, (K, t + 2 n): all that the poles can explain."""
        if not self.terms.size:
            return self.functions
        if not self.functions.size:
            return self.terms
        if self.functions.flags.f_contiguous:  # functions that lie in one piece each stay so
            return np.concatenate([self.terms.T, self.functions.T]).T
        return np.hstack([self.terms, self.functions])

    @property
    def by_pole(self) -> RealArray:
        """The functions of each pole, (K, n, 2)."""
        return self.functions.reshape(len(self.functions), -1, 2)

    @property
    def reach(self) -> RealArray:
        """Norm of each pole's functions over the rows, (n,): how much of the data a pole can be seen in."""
        return np.asarray(np.sqrt(np.einsum("kj,kj->j", self.functions, self.functions).reshape(-1, 2).sum(axis=1)))

    def compressed(self) -> ModalBasis:
        """Return the same problem on as many rows as there are columns: fits are the same, the misfit less what no column can explain."""
        rows, outputs, inputs = self.data.shape
        if not 0 < self.columns.shape[1] < rows:
            return self
        factors = sla.qr(self.columns, mode="economic", check_finite=False)
        Q, R = (np.asarray(factor, dtype=np.float64) for factor in factors)
        t = self.terms.shape[1]
        data = (Q.T @ self.data.reshape(rows, -1)).reshape(-1, outputs, inputs)
        return ModalBasis(R[:, :t], R[:, t:], data)

    def fit_participation(self, shapes: Array) -> tuple[ComplexArray, RealArray]:
        """Fit participation rows l_j to known shapes c_j, with the terms of every channel, by least squares over all rows.

        `shapes` (l, n).

        Returns
        -------
        participation : array of complex, (n, m)
        terms : array, (t, l, m)
            Coefficients of the constant and residual terms.
        """
        solution = self.solved(shapes)
        return solution.side, solution.terms

    def fit_shapes(self, participation: Array) -> tuple[ComplexArray, RealArray]:
        """Fit shapes to known participation rows, the other way round: shapes (l, n) and terms (t, l, m)."""
        solution = self.turned.solved(np.asarray(participation).T)
        return solution.side.T, solution.terms.transpose(0, 2, 1)

    @property
    def turned(self) -> ModalBasis:
        """Outputs and inputs in each other's places."""
        return ModalBasis(self.terms, self.functions, self.data.transpose(0, 2, 1))

    def solved(self, shapes: Array) -> FittedSide:
        """Return what `fit_participation` does, and how much is left of every channel: |data|^2 - |Q'data|^2 + |Q'data - R theta|^2.

        Nothing is rebuilt for that, unless so little is left that the difference is rounding.

        `shapes` (l, n).
        """
        columns = self.columns
        used = np.flatnonzero(np.any(columns, axis=0))
        data = self.data.reshape(len(columns), -1)
        seen, R = resolved(columns if used.size == columns.shape[1] else columns[:, used], data)

        def left(side: ComplexArray, terms: RealArray) -> RealArray:
            return energy_of(self.data - self.rebuilt(shapes, side, terms))

        whole = energy_of(self.data) if self.whole is None else self.whole
        return _fitted(_Seen(seen.reshape(-1, *self.data.shape[1:]), R, used, self.terms.shape[1]), shapes, whole, left)

    def of_terms(self, coefficients: RealArray) -> RealArray:
        """Return coefficients (t, channels) of the terms as `fit_participation` gives them, (t, l, m)."""
        return coefficients.reshape(self.terms.shape[1], *self.data.shape[1:])

    def rebuilt(self, shapes: Array, participation: Array, terms: Array) -> RealArray:
        """Return what modes and terms give on the rows, (K, l, m): the counterpart of `fit_participation`."""
        coefficients = _residues(shapes, participation).reshape(-1, self.data[0].size)
        flat = self.functions @ coefficients + self.terms @ terms.reshape(len(terms), coefficients.shape[1])
        return flat.reshape(self.data.shape)

    def missed(self, shapes: Array, participation: Array, terms: Array) -> Iterator[RealArray]:
        """Yield `rebuilt` without the data, (rows, l, m), some rows after the other: what is left in the cache."""
        coefficients = _residues(shapes, participation).reshape(-1, self.data[0].size)
        own, step = terms.reshape(len(terms), coefficients.shape[1]), max(_NUMBERS_AT_A_TIME // self.data[0].size, 1)
        for start in range(0, len(self.data), step):
            rows = slice(start, start + step)
            flat = self.functions[rows] @ coefficients
            if len(own):
                flat += self.terms[rows] @ own
            residual = flat.reshape(-1, *self.data.shape[1:])
            residual -= self.data[rows]
            yield residual


def _residues(shapes: Array, participation: Array) -> RealArray:
    """Return the residues c_j l_j as the functions take them, (2 n, l, m): real and imaginary part of every pole."""
    residues = shapes.T[:, :, None] * participation[:, None, :]
    return np.stack([residues.real, residues.imag], axis=1).reshape(2 * len(residues), *residues.shape[1:])


class _Seen(NamedTuple):
    """What columns see of data: Q'D (k, l, m) and R (k, k) of those that are `used`, the first t of them `terms`."""

    data: RealArray
    R: RealArray
    used: Array
    terms: int


def _fitted(
    seen: _Seen, shapes: Array, whole: RealArray, left: Callable[[ComplexArray, RealArray], RealArray]
) -> FittedSide:
    """Return the participation of shapes (l, n), the terms, and the residual energy of `whole` (l, m).

    `left`: the same of participation and terms from the rebuilt data, where so little is left that a difference is rounding.
    """
    coefficients, R, used, t = seen
    _, outputs, inputs = coefficients.shape
    n = shapes.shape[1]
    kept = used[t:] - t
    by_mode = _with_shapes(R[t:, t:], kept, shapes)
    theta = np.zeros((2 * n, inputs))
    target = coefficients[t:].transpose(1, 0, 2)
    theta[kept] = scaled_least_squares(by_mode.reshape(outputs * (len(R) - t), kept.size), target.reshape(-1, inputs))
    side = theta[::2] + 1j * theta[1::2]
    rest = _residues(shapes, side)[kept]
    remainder = coefficients[:t] - np.tensordot(R[:t, t:], rest, axes=1)
    terms = sla.solve_triangular(R[:t, :t], remainder.reshape(t, outputs * inputs)) if t else remainder
    own = terms.reshape(t, outputs, inputs)
    with np.errstate(over="ignore", invalid="ignore"):
        missed = np.tensordot(R[t:, t:], rest, axes=1) - coefficients[t:]
        unexplained = whole - energy_of(coefficients)
        energy = unexplained + energy_of(missed)
        if not np.all(energy.sum(axis=1) > _MIN_SHARE_OF_DIFFERENCE * whole.sum(axis=1)):
            energy = left(side, own)
    known = unexplained > _MIN_SHARE_OF_EIGHT_DIGITS * whole
    return FittedSide(side, own, energy, np.where(known, unexplained, np.nan))


def _with_shapes(functions: RealArray, kept: Array, shapes: Array) -> RealArray:
    """Return what (Re l_1, Im l_1, ...) give in the rows of every output, (l, K, kept): g1 a + g2 b with a + j b = c l.

    `functions` (K, kept): g1 and g2 of every pole, but for some that are zero. `kept`: which of all 2 n they are. `shapes` (l, n).
    """
    whole = np.zeros((len(functions), 2 * shapes.shape[1]))
    whole[:, kept] = functions
    product = (whole[:, ::2] - 1j * whole[:, 1::2]) * shapes[:, None]
    return np.stack([product.real, -product.imag], axis=3).reshape(len(shapes), *whole.shape)[:, :, kept]


def scaled_least_squares(known: RealArray, target: RealArray) -> RealArray:
    """Solve least squares with columns scaled to length one, so that the units of distant poles do not decide the rank."""
    scale = np.linalg.norm(known, axis=0)
    scale = np.where(scale > 0, scale, 1)
    return np.linalg.lstsq(known / scale, target, rcond=None)[0] / scale[:, None]


def line_basis(
    frequencies: RealArray,
    rate: float | None,
    data: LineData,
    poles: Array,
    powers: tuple[int, ...],
    weights: Array | None,
) -> ModalBasis:
    """Return the functions 1 / (x - pole) and conjugates on lines, real and imaginary parts stacked.

    x is j w with poles in rad/s; for the response of a sampled system x = exp(j w dt) and the poles go along. The terms are powers
    of the relative frequency j f / f_max: only their span matters, and it is better conditioned. The data have the
    weights already.
    """
    terms = real_rows(_line_terms(frequencies, powers), weights)
    return ModalBasis(terms, _weighted_functions(frequencies, rate, poles, weights), data.values, data.energy)


def _line_terms(frequencies: RealArray, powers: tuple[int, ...]) -> ComplexArray:
    """Return powers of the relative frequency j f / f_max, (F, t)."""
    relative = 1j * frequencies / (float(frequencies[-1]) or 1.0)
    return (
        np.stack([relative**power for power in powers], axis=1) if powers else np.zeros((frequencies.size, 0), complex)
    )


def _weighted_functions(frequencies: RealArray, rate: float | None, poles: Array, weights: Array | None) -> RealArray:
    """Return `line_functions` with the weights of the lines."""
    functions = line_functions(frequencies, rate, poles)
    if weights is not None:
        functions *= np.tile(weights, 2)[:, None]
    return functions


@dataclass(frozen=True, eq=False)
class LineFits:
    """Fits to one response on lines by the functions of any poles, from products that are summed over pieces in the cache.

    `frequencies` (F,): Hz. `rate`: of a sampled system's response. `values` (F, l, m). `powers`: of the terms; see `line_basis`. `weights`
    (F,): of the lines.
    """

    frequencies: RealArray
    rate: float | None
    values: ComplexArray
    powers: tuple[int, ...]
    weights: Array | None

    @cached_property
    def _energy(self) -> RealArray:
        """Return the energy of every channel, (l, m)."""
        return sum(
            (energy_of(real_data(self.values[lines], self._of(lines))) for lines in self._pieces(0)), np.zeros(1)
        )

    @cached_property
    def _terms(self) -> ComplexArray:
        return _line_terms(self.frequencies, self.powers)

    def _of(self, lines: slice) -> Array | None:
        return None if self.weights is None else self.weights[lines]

    def _pieces(self, columns: int) -> list[slice]:
        """Return lines, some after the other, of which columns and data stay in the cache."""
        step = max(_NUMBERS_OF_A_PIECE // (2 * (columns + self.values[0].size)), _MIN_LINES_OF_A_PIECE)
        return [slice(start, start + step) for start in range(0, len(self.values), step)]

    def fit_shapes(self, poles: Array, participation: Array) -> FittedSide:
        """Return the shapes of poles as `side` (n, l) by their participation (n, m); inputs and outputs have changed places."""
        columns, size = self._terms.shape[1] + 2 * poles.size, self.values[0].size
        gram, projected = np.zeros((columns, columns)), np.zeros((columns, size))
        for lines in self._pieces(columns):
            functions = _weighted_functions(self.frequencies[lines], self.rate, poles, self._of(lines))
            some = np.concatenate([real_rows(self._terms[lines], self._of(lines)).T, functions.T])
            gram += some @ some.T
            projected += some @ real_data(self.values[lines], self._of(lines)).reshape(-1, size)
        used = np.flatnonzero(np.diag(gram))
        found = resolved_by_products(gram[np.ix_(used, used)], projected[used]) if used.size else None
        if found is None:
            return self._basis(poles).turned.solved(participation.T)

        def left(side: ComplexArray, terms: RealArray) -> RealArray:
            basis = self._basis(poles).turned
            return energy_of(basis.data - basis.rebuilt(participation.T, side, terms))

        coefficients = found[0].reshape(-1, *self.values.shape[1:]).transpose(0, 2, 1)
        seen = _Seen(coefficients, found[1], used, self._terms.shape[1])
        return _fitted(seen, participation.T, self._energy.T, left)

    def _basis(self, poles: Array) -> ModalBasis:
        data = line_data(self.values, self.weights)
        return line_basis(self.frequencies, self.rate, data, poles, self.powers, self.weights)


def sample_basis(rate: float, first: int, values: RealArray, poles: Array) -> ModalBasis:
    """Return the functions Re and Im of exp(s t_k) at samples, counted from the impulse."""
    return ModalBasis(np.zeros((len(values), 0)), sample_functions(rate, first, len(values), poles), values)


def stacked_basis(
    own: ComplexArray, pair: ComplexArray, alone: Array, terms: Array, data: ComplexArray, weights: Array | None
) -> ModalBasis:
    """Return g1 = own + pair and g2 = j (own - pair) for pairs, own for real poles, with real and imaginary parts stacked.

    `own`, `pair` (F, n): the functions of the poles and of their conjugates. `alone` (n,): real poles. `terms` (F, t). `data` (F, l, m).
    `weights` (F,).
    """
    pairs = [np.where(alone, own, own + pair), np.where(alone, 0, 1j * (own - pair))]
    functions = np.stack(pairs, axis=2).reshape(len(data), -1)
    return ModalBasis(real_rows(terms, weights), real_rows(functions, weights), real_data(data, weights))


def residual_powers(quantity: str | None, residuals: bool) -> tuple[int, ...]:
    """Return the powers of j w that stand beside the modes: of the direct term or, with residuals, of lower and upper modes.

    Modes below the band look like a mass line, (j w)^(p - 2), and modes above it like a stiffness line, (j w)^p, with p = 0, 1, 2 for
    displacement, velocity and acceleration. Without a known quantity there is the constant alone.
    """
    if quantity is None or not residuals:
        return (0,)
    p = QUANTITIES[quantity]
    return (p - 2, p)


def scaled_terms(terms: Array, powers: tuple[int, ...], frequencies: RealArray) -> RealArray:
    """Return coefficients of powers of j w from those of the basis, which are of the relative frequency."""
    factor = (2 * np.pi * (float(frequencies[-1]) or 1.0)) ** -np.asarray(powers, dtype=float)
    return terms * factor[:, None, None]
