"""Compute the likelihood of a modal model by variable projection.

    Y_o(k) = Re sum_j c_oj (b_j g_j(k)) + terms,      noise white after division by a deviation a row, an output and an input

b_j are unit vectors of the side with fewer channels, c_oj what the other side has of it; c and the terms follow from poles and b by
least squares, so that 2 p real unknowns per mode are left, whatever the number q of channels on the other side. The rows are compressed
at every point to the span of the functions g_j and their derivatives by poles, 4 n rows instead of thousands: no derivative that is
needed lies outside.

Source: G. Golub and V. Pereyra, SIAM J. Numer. Anal. 10, 1973; L. Kaufman, BIT 15, 1975.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla
from scipy.linalg.blas import dgemm

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.orthonormal import scaled_span, spanning
from modalscope.numerics.statistics import few_channels
from modalscope.selection.likelihood.matched import Peak, strongest_peaks
from modalscope.selection.likelihood.whitening import Levels

#: Singular values below this fraction of the largest are rounding, as of exactly repeated poles.
_ROUNDING = 1e-11

#: Orthogonalize against the terms first if they hold more than 99 % of the energy of a column: cancellation.
_MIN_REMAINDER = 1e-2

#: Numbers of divided data whose part in the terms is taken off at a time.
_NUMBERS_AT_A_TIME = 1 << 20

#: Orthogonal columns P W as (P, W), or P alone: a step does not need their product.
_Span = tuple[RealArray, RealArray | None]


@dataclass(frozen=True, eq=False, slots=True)
class Whitened(ABC):
    """Data whose noise is white and of one deviation, without what terms explain: K rows of q x p channels, q >= p.

    `light`: one channel of the data: it gives the functions of poles. `rows` (K,): what each row is divided by. `terms` (K, t):
    orthonormal columns that are free in every channel. `linear` (q,), `varying` (p,): what the channels of either side are divided by.
    `turned`: whether the inputs are the side that is eliminated.
    """

    light: Response
    rows: RealArray
    terms: RealArray
    linear: RealArray
    varying: RealArray
    turned: bool

    @property
    @abstractmethod
    def channels(self) -> tuple[int, int]:
        """How many channels either side of the data has, q and p."""

    @property
    @abstractmethod
    def size(self) -> float:
        """Sum of the squares of the data."""

    @abstractmethod
    def at(self, poles: ComplexArray, sides: ComplexArray, *, slopes: bool = True) -> Point:
        """Return the likelihood at poles (n,) and unit vectors (n, p), and all that a step needs unless there is to be none."""

    @abstractmethod
    def releveled(self, levels: Levels) -> tuple[Whitened, RealArray]:
        """Return the data divided by other deviations of the channels, and by how much they grow, (q, p)."""

    @abstractmethod
    def peaks(self, left: RealArray, known: Array, least: float) -> list[Peak]:
        """Return the strongest oscillation in a whitened residual (K, q, p), its sides in the scale of the data; see `strongest_peaks`."""

    @property
    def sides(self) -> tuple[RealArray, RealArray]:
        """What outputs and inputs are divided by, (l,), (m,)."""
        return (self.varying, self.linear) if self.turned else (self.linear, self.varying)

    @property
    def weights(self) -> RealArray | None:
        """What the data are multiplied with beside that, (q, p); None where all levels are products."""
        return None

    @property
    def parts(self) -> IntArray | None:
        """The part of the test that each row belongs to, (K,); None where the inputs are the parts."""
        return None

    @property
    def records(self) -> bool:
        """Whether these are records, whose lines have noise of their own each."""
        return self.parts is not None

    @property
    def count(self) -> int:
        """Real values of the data, K q p."""
        q, p = self.channels
        return len(self.rows) * q * p

    @property
    def freedom(self) -> int:
        """Real values that the terms leave."""
        q, p = self.channels
        return self.count - int(self.terms.shape[1]) * q * p

    def scaled_back(self, point: Point, fitted: Fitted) -> tuple[ComplexArray, ComplexArray]:
        """Return shapes (l, n) and participation (n, m) of the data as they were."""
        c, b = fitted.linear * self.linear[:, None], point.sides * self.varying
        return (b.T, c.T) if self.turned else (c, b)


@dataclass(frozen=True, eq=False, slots=True)
class WhitenedResponse(Whitened):
    """A response whose noise is white and of one deviation, without what terms explain.

    `data` (K, q, p): the divided data, less their part in the terms. `swift`: whether columns may be made orthogonal by their products, in
    a third of the time: what is left of the data is then known to a part of 1e-5 of the data, not to rounding. `energy` (q p,): squares of
    the data, channel by channel, for `swift`. `own` (l, m): see `Levels`.
    """

    data: RealArray
    swift: bool = False
    energy: RealArray | None = None
    own: RealArray | None = None

    @property
    def weights(self) -> RealArray | None:
        """What the data are multiplied with beside their division by both sides, (q, p)."""
        return None if self.own is None else 1 / (self.own.T if self.turned else self.own)

    @property
    def levels(self) -> Levels:
        """What the channels are divided by."""
        return Levels(*self.sides, self.own)

    @property
    def channels(self) -> tuple[int, int]:
        """How many channels either side of the data has, q and p."""
        _, q, p = self.data.shape
        return q, p

    @property
    def size(self) -> float:
        """Sum of the squares of the data."""
        return float(np.vdot(self.data, self.data))

    def releveled(self, levels: Levels) -> tuple[WhitenedResponse, RealArray]:
        """Return the data divided by other deviations of the channels, and by how much they grow, (q, p)."""
        linear, varying = (levels.inputs, levels.outputs) if self.turned else (levels.outputs, levels.inputs)
        growth = self.levels.channels / levels.channels
        growth = growth.T if self.turned else growth
        energy = None if self.energy is None else self.energy * growth.reshape(-1) ** 2
        new = replace(self, data=self.data * growth, linear=linear, varying=varying, energy=energy, own=levels.own)
        return new, growth

    def columns(self, poles: Array, *, slopes: bool = True) -> tuple[RealArray, RealArray]:
        """Return the functions of poles and their derivatives by Re s, divided as the data are, without the terms' part."""
        both = self._columns(poles, slopes)
        return both[:, : 2 * len(poles)], both[:, 2 * len(poles) :]

    def _columns(self, poles: Array, slopes: bool) -> RealArray:
        both = self._whole_columns(poles, slopes)
        return _less_terms(both, self.terms) if self.terms.shape[1] else both

    def _whole_columns(self, poles: Array, slopes: bool) -> RealArray:
        both = self.light.functions(poles, slopes=slopes)
        both /= self.rows[:, None]
        return both

    def at(self, poles: ComplexArray, sides: ComplexArray, *, slopes: bool = True) -> Point:
        """Return the likelihood at poles (n,) and unit vectors (n, p), and all that a step needs unless there is to be none."""
        columns = self._whole_columns if self.swift else self._columns
        Q, R, Z, beyond = self.compressed(columns(poles, slopes))
        g, e = R[:, : 2 * len(poles)], R[:, 2 * len(poles) :]
        Z, beyond = Z.reshape(len(Z), *self.data.shape[1:]), beyond.reshape(self.data.shape[1:])
        return Point(self, poles, sides, g[:, ::2] - 1j * g[:, 1::2], e[:, ::2] - 1j * e[:, 1::2], Z, beyond, Q)

    def compressed(self, columns: RealArray) -> tuple[_Span, RealArray, RealArray, RealArray]:
        """Return orthogonal Q as a `_Span`, in the columns' place, R of columns Q R, Q'Y of the data, squares of the rest by channel.

        Where products are enough the columns are whole: the terms' part is taken off the products.
        """
        flat = self.data.reshape(len(self.data), self.data[0].size)
        return _by_products(columns, flat, self.energy, self.terms) if self.swift else _by_reflections(columns, flat)

    def peaks(self, left: RealArray, known: Array, least: float) -> list[Peak]:
        """Return the strongest oscillation in a whitened residual (K, q, p), its sides in the scale of the data; see `strongest_peaks`."""
        whole = left.transpose(0, 2, 1) if self.turned else left
        outputs, inputs = self.sides
        return [
            Peak(peak.pole, peak.shape * outputs, peak.participation * inputs)
            for peak in strongest_peaks(self.light, whole, self.rows, known, least)
        ]


def _less_terms(columns: RealArray, terms: RealArray) -> RealArray:
    """Return columns (K, k) less their part in orthonormal terms (K, t), in their own place where each lies in one piece."""
    part = columns.T @ terms
    if columns.size and columns.flags.f_contiguous:
        return np.asarray(dgemm(-1.0, terms, part, beta=1.0, c=columns, trans_b=True, overwrite_c=True))
    return columns - terms @ part.T


def _by_reflections(columns: RealArray, flat: RealArray) -> tuple[_Span, RealArray, RealArray, RealArray]:
    """Return what `Whitened.compressed` does, exact to rounding."""
    factors = sla.qr(columns, mode="economic", overwrite_a=True, check_finite=False)
    Q, R = (np.asarray(factor, dtype=np.float64) for factor in factors)
    Z = Q.T @ flat
    rest = Q @ Z
    rest -= flat
    return (Q, None), R, Z, np.einsum("kq,kq->q", rest, rest)


def _by_products(
    columns: RealArray, flat: RealArray, energy: RealArray | None, terms: RealArray
) -> tuple[_Span, RealArray, RealArray, RealArray]:
    """Return the same of whole columns, less their part in terms that the data have no part in, from products alone; see `spanning`."""
    gram, seen = columns.T @ columns, terms.T @ columns
    whole = np.diag(gram).copy()
    gram -= seen.T @ seen
    if np.any(np.diag(gram) < _MIN_REMAINDER * whole):
        columns = _less_terms(columns, terms)
        gram = columns.T @ columns
    W, R = spanning(gram)
    Z = W.T @ (columns.T @ flat)
    energy = np.einsum("kq,kq->q", flat, flat) if energy is None else energy
    beyond = np.maximum(energy - np.sum(Z**2, axis=0), 0)
    return (columns, W), R, Z, beyond


def whitened(
    response: Response,
    fixed: Array,
    powers: tuple[int, ...],
    rows: RealArray,
    outputs: RealArray,
    inputs: RealArray,
    *,
    own: RealArray | None = None,
    swift: bool = False,
) -> WhitenedResponse:
    """Divide the data by the deviation of rows, outputs and inputs, and take out what the terms explain.

    `fixed`: poles that stay as they are, free in every channel. `powers`: as in `Response.basis`. `rows` (K,): standard deviations, of K
    real rows. `outputs`, `inputs` (l,), `own` (l, m): see `Levels`. `swift`: whether a step may be a little inaccurate and much faster; for
    noise of more than 1e-4 of the data.
    """
    basis = response.basis(fixed, powers)
    data = basis.data / Levels(outputs, inputs, own).channels
    data /= rows[:, None, None]
    terms = scaled_span(basis.columns / rows[:, None])
    turned = len(outputs) < len(inputs)
    data = np.ascontiguousarray(data.transpose(0, 2, 1) if turned else data)
    flat = data.reshape(len(data), -1)
    for few in few_channels(len(flat), flat.shape[1], _NUMBERS_AT_A_TIME):  # of many channels each product is large
        flat[:, few] -= terms @ (terms.T @ flat[:, few])
    sides = (inputs, outputs) if turned else (outputs, inputs)
    light = response.select(outputs=[0], inputs=[0])
    energy = np.einsum("kq,kq->q", flat, flat) if swift else None
    return WhitenedResponse(light, rows, terms, *sides, turned, data, swift, energy, own)


@dataclass(frozen=True, eq=False, slots=True)
class Side:
    """The channels of the eliminated side whose data have the same weights: one least-squares problem.

    `channels`: which, of q. `weights` (p,): None where they are one. `back` (2 n, r): from coefficients of `kept` to (Re c_1, Im c_1, ...).
    `kept` (4 n p, r): orthonormal columns of what the modes can explain.
    """

    channels: slice | IntArray
    weights: RealArray | None
    back: RealArray
    kept: RealArray

    @property
    def spread(self) -> RealArray:
        """Covariance of (Re c_1, Im c_1, ...) of one channel for noise of variance one, (2 n, 2 n)."""
        return np.asarray(self.back @ self.back.T)

    def weighted(self, columns: Array) -> Array:
        """Return columns (4 n p, a) as the data of these channels are weighted."""
        return _weighted(columns, self.weights)


@dataclass(frozen=True, eq=False, slots=True)
class Fitted:
    """What least squares gives at a point: the eliminated side, its own information, and what is left over.

    `linear` (q, n): c. `sides`: its channels, by their weights. `left` (4 n p, q).
    """

    linear: ComplexArray
    sides: tuple[Side, ...]
    left: RealArray

    @property
    def only(self) -> Side:
        """The side, of data without weights."""
        (side,) = self.sides
        return side

    @property
    def parts(self) -> list[RealArray]:
        """Re c_1, Im c_1, Re c_2, ... of the channels of each side, (2 n, q) each."""
        c = np.stack([self.linear.real.T, self.linear.imag.T], axis=1).reshape(-1, len(self.linear))
        return [c[:, side.channels] for side in self.sides]

    @property
    def alone(self) -> RealArray:
        """Variance of c, all else held, for noise of variance one, (q, n)."""
        alone = np.empty(self.linear.shape)
        for side in self.sides:
            alone[side.channels] = np.diag(side.spread).reshape(-1, 2).sum(axis=1)
        return alone

    @property
    def gain(self) -> RealArray:
        """By how much the squared misfit rises when a mode goes and all linear parts are fitted again, (n,)."""
        gain = np.zeros(self.linear.shape[1])
        for side, part in zip(self.sides, self.parts, strict=True):
            pairs = side.back.reshape(len(gain), 2, side.back.shape[1])
            own = np.linalg.pinv(pairs @ pairs.transpose(0, 2, 1), hermitian=True)
            c = part.reshape(len(gain), 2, part.shape[1])
            gain += np.sum(c * (own @ c), axis=(1, 2))
        return gain


@dataclass(frozen=True, eq=False, slots=True)
class Point:
    """Poles and unit vectors, with the functions on the compressed rows.

    `poles` (n,). `sides` (n, p): b, of length one. `own`, `derived` (4 n, n): g and dg/ds, with real part and minus imaginary part the
    two real functions of a pole. `data` (4 n, q, p). `beyond` (q, p): squared norm of the data outside the span of all columns. `basis`:
    P and W of `span`.
    """

    problem: Whitened
    poles: ComplexArray
    sides: ComplexArray
    own: ComplexArray
    derived: ComplexArray
    data: RealArray
    beyond: RealArray
    basis: _Span

    @property
    def span(self) -> RealArray:
        """Orthonormal columns, from compressed rows to rows, (K, 4 n)."""
        P, W = self.basis
        return P if W is None else _less_terms(P @ W, self.problem.terms)

    def spanned(
        self, coefficients: RealArray, lines: int | None = None
    ) -> Iterator[tuple[slice | IntArray, RealArray, RealArray]]:
        """Yield some rows, `span` times coefficients (4 n, k) and the data (rows, q, p) there: both parts of some lines, or samples.

        `lines`: so many at a time; by default all rows of a response, real parts first.
        """
        (P, W), problem = self.basis, self.problem
        assert isinstance(problem, WhitenedResponse)
        weights = coefficients if W is None else W @ coefficients
        # the columns still have a part in the terms where they were made orthogonal by their products
        taken = None if W is None else (problem.terms.T @ P) @ weights
        parts = 1 if problem.light.grid is None else 2
        count = len(P) // parts
        step = min(lines or count, count)
        for start in range(0, count, step):
            some = np.arange(start, min(start + step, count))
            rows = slice(None) if step == count else (some + count * np.arange(parts)[:, None]).ravel()
            on_rows = P[rows] @ weights
            if taken is not None:
                on_rows -= problem.terms[rows] @ taken
            yield rows, on_rows, problem.data[rows]

    def columns(self) -> ComplexArray:
        """Return b g of every mode, complex columns (4 n p, n): a coefficient c contributes Re(c b g)."""
        size = len(self.own) * self.sides.shape[1]
        return np.asarray(np.einsum("kj,ji->kij", self.own, self.sides).reshape(size, len(self.poles)))

    def fitted(self) -> Fitted:
        """Fit the eliminated side by least squares; columns of equal poles and vectors share what they explain."""
        n, q = len(self.poles), self.data.shape[1]
        columns = self.columns()
        psi = np.stack([columns.real, -columns.imag], axis=2).reshape(len(columns), 2 * n)  # Re(x g b), Re(j y g b)
        target = self.data.transpose(0, 2, 1).reshape(-1, q)
        sides, c, left = [], np.empty((2 * n, q)), np.empty(target.shape)
        for channels, weights in _alike(self.problem.weights):
            of_side = _weighted(psi, weights)
            size = np.maximum(np.linalg.norm(of_side, axis=0), 1e-300)
            U, d, Vt = sla.svd(of_side / size, full_matrices=False, check_finite=False)
            rank = int(np.count_nonzero(d > _ROUNDING * d[0])) if d.size else 0
            U, back = U[:, :rank], Vt[:rank].T / d[:rank] / size[:, None]
            part = U.T @ target[:, channels]
            c[:, channels], left[:, channels] = back @ part, target[:, channels] - U @ part
            sides.append(Side(channels, weights, back, U))
        return Fitted((c[::2] + 1j * c[1::2]).T, tuple(sides), left)

    def cost(self, fitted: Fitted) -> float:
        """Return the squared misfit."""
        return float(np.sum(self.beyond)) + float(np.sum(fitted.left**2))

    def left_by_channel(self, fitted: Fitted) -> RealArray:
        """Return the squared misfit of every channel, (l, m), outputs first."""
        q, p = self.beyond.shape
        both = self.beyond + np.sum(fitted.left.reshape(-1, p, q) ** 2, axis=0).T
        return np.asarray(both.T if self.problem.turned else both)

    def kept(self) -> RealArray:
        """Return which part of white noise the fit leaves on every row, (K,).

        Of the q p directions of the channels a mode's function takes up q + p - 1, those in which its residue of rank one may change, and
        its slope one, the terms all.
        """
        (q, p), terms = self.problem.channels, self.problem.terms
        own = np.stack([self.own.real, -self.own.imag], axis=2).reshape(len(self.own), 2 * len(self.poles))
        span = self.span
        functions, whole = (np.einsum("kj,kj->k", each, each) for each in (span @ np.linalg.qr(own)[0], span))
        taken = np.einsum("kj,kj->k", terms, terms) + ((q + p - 1) * functions + whole - functions) / (q * p)
        return np.asarray(1 - taken)

    def directions(self) -> ComplexArray:
        """Return d(b g) by the pole and by b across itself, complex columns (4 n p, n p), mode by mode."""
        n, p = self.sides.shape
        columns = np.empty((len(self.own), p, n, p), dtype=complex)
        columns[:, :, :, 0] = np.einsum("kj,ji->kij", self.derived, self.sides)
        if p > 1:
            columns[:, :, :, 1:] = np.einsum("kj,jia->kija", self.own, across(self.sides))
        return columns.reshape(len(self.own) * p, n * p)

    def releveled(self, levels: Levels) -> Point:
        """Return the same poles and unit vectors under other deviations of the channels: what rows are compressed to stays."""
        problem, growth = self.problem.releveled(levels)
        sides = unit_vectors(self.sides * self.problem.varying / problem.varying)
        data, beyond = self.data * growth, self.beyond * growth**2
        return replace(self, problem=problem, sides=sides, data=data, beyond=beyond)

    def moved(self, step: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return poles and unit vectors after a step (n, p) in the unknowns of `directions`."""
        sides = self.sides + np.einsum("jia,ja->ji", across(self.sides), step[:, 1:])
        return self.poles + step[:, 0], sides / np.linalg.norm(sides, axis=1, keepdims=True)


def _alike(weights: RealArray | None) -> Iterator[tuple[slice | IntArray, RealArray | None]]:
    """Yield the channels of the eliminated side that have the same weights (q, p), and these, (p,)."""
    if weights is None:
        yield slice(None), None
        return
    profiles, of_channel = np.unique(weights, axis=0, return_inverse=True)
    for k, profile in enumerate(profiles):
        yield np.flatnonzero(of_channel.ravel() == k), profile


def _weighted(columns: Array, weights: RealArray | None) -> Array:
    """Return columns (4 n p, a) times the weights (p,) of the channels of their rows."""
    return columns if weights is None else columns * np.tile(weights, len(columns) // len(weights))[:, None]


def unit_vectors(sides: ComplexArray) -> ComplexArray:
    """Return vectors (n, p) at length one; the first unit vector for one that is zero, which has no direction."""
    size = np.linalg.norm(sides, axis=1, keepdims=True)
    first = np.eye(1, sides.shape[1], dtype=complex)
    return np.asarray(np.where(size > 0, sides / np.where(size > 0, size, 1), first))


def across(sides: ComplexArray) -> ComplexArray:
    """Return an orthonormal basis of all that is orthogonal to each unit vector, (n, p, p - 1): columns of Householder's reflection."""
    p = sides.shape[1]
    phase = np.where(sides[:, 0] == 0, 1, sides[:, 0] / np.maximum(np.abs(sides[:, 0]), 1e-300))
    v = sides.copy()
    v[:, 0] += phase
    reflection = np.eye(p) - 2 * v[:, :, None] * v[:, None, :].conj() / np.sum(np.abs(v) ** 2, axis=1)[:, None, None]
    return np.asarray(reflection[:, :, 1:])
