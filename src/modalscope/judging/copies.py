"""Tell which poles of a joint fit are one resonance whose line differs by row or by column, and which are modes of their own.

A column of a test (a hit, a run) has one line shape, whatever it is, and all rows share it; so has a row (a sensor that was moved) for all
columns. A resonance of shape u and participation v that shifts, or is no Lorentzian, is then in channel (i, j)

    u_i v_j q(f; a_i, b_j) = u_i v_j [q(f) + a_i q_a(f) + b_j q_b(f) + a_i b_j q_ab(f) + ...]

and a fit needs several poles for it. What a and b do alone has the participation v or the shape u, whatever functions of f they are: across
both nothing is left of them, but the part of a second mode is that is across u and across v.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betainc, betaincinv

from modalscope.judging.recount import (
    UNCERTAINTY_OF_VARIANCE,
    ChannelFits,
    ColouredErrors,
    Recount,
    inverse,
    lines_of_rows,
)
from modalscope.likelihood.information import residual
from modalscope.likelihood.whitening import free_bound
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray

#: Lines of a cluster: so many half bandwidths to either side of its poles, and so many at least.
_REACH, _MIN_LINES = 10.0, 40

#: Chance that real modes show as little across both as the poles that are taken for copies do, in a whole test: where errors are white,
#: and where they are not, so that something is known to differ.
_CHANCE, _CHANCE_AMONG_COLOURED = 1e-3, 0.05

#: What is seen of a mode across others may be so many deviations too small.
_DEVIATIONS = 2.0

#: Step of the difference that gives a second derivative, in half bandwidths.
_STEP = 0.05

#: Steps to the best pole of a main line.
_CENTRE_STEPS = 12

#: Margin of what products of deviations leave, for each order beyond the first: shifts are no small ones, and rows are few.
_MARGIN = 2.5

#: A shift is told no better where nearly all of a mode lies in one row.
_MIN_WEIGHT_LEFT = 0.1

#: Quantiles by which a mean over shapes is taken.
_QUANTILES = (np.arange(400) + 0.5) / 400


@dataclass(frozen=True, eq=False, slots=True)
class Copies:
    """The mode that each pole belongs to, by default itself, (n,), and what is known of modes with copies.

    `poles` (n,): where each lies, of a mode with copies the pole that fits the main line of all together best. `shifts` (2,): by which part
    resonances usually scatter from row to row and from column to column.
    """

    host: IntArray
    poles: ComplexArray
    shifts: RealArray

    def facts(self, *, turned: bool) -> dict[str, float]:
        """Return the shifts as outputs and inputs have them; `turned`: whether inputs are the rows."""
        by_row, by_column = (float(shift) for shift in self.shifts)
        return {"shift_by_output": by_column if turned else by_row, "shift_by_input": by_row if turned else by_column}


def copies_of(recount: Recount) -> Copies | None:
    """Return which poles are copies of stronger modes; None where that is not evident: real modes might hide as well.

    Of a single row or column nothing is across, and no pole is a copy.
    """
    if min(recount.left.shape[1:]) == 1:
        return None
    s, chance = recount.descent.point.poles, 0.0
    clusters = [_Cluster(recount, c) for c in _clusters(s)]
    usual = np.median([each.deviations(1) for each in clusters], axis=0) if clusters else np.zeros(2)
    host, centres = np.arange(len(s)), s.copy()
    for cluster in clusters:
        modes, others, own = cluster.parted(usual)
        chance += own
        host[others] = modes[np.argmin(np.abs(s[others, None] - s[modes]) / -s[modes].real, axis=1)]
        for mode in modes[np.isin(modes, host[others])]:
            centres[mode] = cluster.centre(mode, host)
    most = _CHANCE_AMONG_COLOURED if recount.selection.coloured else _CHANCE
    shifts = np.median([each.shifts() for each in clusters], axis=0) if clusters else usual
    return Copies(host, centres, shifts) if chance < np.log(most) else None


def _clusters(s: ComplexArray) -> list[IntArray]:
    """Return the poles that hang together, where they are several: neighbours lie nearer than twice the narrower half bandwidth."""
    from scipy.sparse.csgraph import connected_components

    near = np.abs(s.imag[:, None] - s.imag) < -2 * np.maximum(s.real[:, None], s.real)
    count, which = connected_components(near)
    each = (np.flatnonzero(which == k) for k in range(count))
    return [cluster for cluster in each if cluster.size > 1]


class _Cluster:
    """Poles that hang together, on the lines around them, with what all others are fitted to taken off the data."""

    def __init__(self, recount: Recount, which: IntArray) -> None:
        point, fitted = recount.descent.point, recount.descent.fitted
        self.problem, self.poles, self.which = recount.selection.problem, point.poles, which
        self.lines, self.left = self._lines(), recount.selection.bar
        self.residues = np.einsum("qn,np->nqp", fitted.linear, point.sides)
        self.functions = self._taken(self.problem.columns(point.poles, slopes=False)[0])
        self.own = self._response(which)
        self.data = self.own + lines_of_rows(residual(point, fitted))[self.lines]
        self.errors = recount.errors.on(self.lines)
        self.beside = np.hstack([self._taken(self.problem.terms), self._functions(self._others())])

    def parted(self, usual: RealArray) -> tuple[IntArray, IntArray, float]:
        """Return which poles are modes, which are copies, and the logarithm of the chance that real modes show as little across both.

        `usual` (2,): deviations by row and by column of all clusters, as in `deviations`.
        """
        modes = [self._strongest()]
        others = [int(k) for k in self.which if k != modes[0]]
        chance = 0.0
        while others and len(modes) < min(self.data.shape[1:]):
            excess, shown = self._excess(modes, others, usual)
            best = int(np.argmax(excess))
            if excess[best] <= 1:
                whole = self._gains(self.data, self.errors, self._functions(modes), others).max()
                chance = _log_chance(shown / whole, *self.data.shape[1:])
                break
            modes.append(others.pop(best))
        return np.array(modes), np.array(others, dtype=int), chance

    def _lines(self) -> slice:
        grid = self.problem.light.grid
        assert grid is not None
        f, reach = self.poles[self.which].imag / (2 * np.pi), -_REACH * self.poles[self.which].real.min() / (2 * np.pi)
        low, high = np.searchsorted(grid, [f.min() - reach, f.max() + reach])
        return slice(int(max(min(low, grid.size - _MIN_LINES), 0)), int(max(high, _MIN_LINES)))

    def _others(self) -> IntArray:
        """Return the other poles whose resonance lies on the lines."""
        low, high = 2 * np.pi * np.asarray(self.problem.light.grid)[self.lines][[0, -1]]
        w = self.poles.imag
        return np.setdiff1d(np.flatnonzero((w >= low) & (w <= high)), self.which)

    def _taken(self, columns: RealArray) -> RealArray:
        """Return columns (K, k) on the lines."""
        return np.concatenate([half[self.lines] for half in np.split(columns, 2)])

    def _functions(self, which: Array | list[int]) -> RealArray:
        """Return the functions of some poles."""
        return self.functions[:, (2 * np.asarray(which, dtype=int)[:, None] + [0, 1]).ravel()]

    def _derivatives(self, which: list[int]) -> RealArray:
        """Return the first and second derivatives of functions by their poles."""
        s = self.poles[which]
        step = -_STEP * s.real
        first, ahead, behind = (self.problem.columns(s + by)[1] for by in (0 * step, step, -step))
        return self._taken(np.hstack([first, (ahead - behind) / np.repeat(2 * step, 2)]))

    def _strongest(self) -> int:
        """Return the pole that explains most by itself of what the cluster does in its own shape and participation."""
        rows = self._main_line(self.own)
        parts = (np.linalg.qr(g)[0].T @ rows for g in (self._functions([k]) for k in self.which))
        return int(self.which[np.argmax([part @ part for part in parts])])

    def _excess(self, modes: list[int], others: list[int], usual: RealArray) -> tuple[RealArray, float]:
        """Return what others explain across modes, over what may be none of theirs, (k,), and the most that any of them may have.

        What a joint fit leaves below its threshold counts as errors do.
        """
        U, V = (each[:, len(modes) :] for each in _leading(self.own, len(modes)))
        data, errors = U.conj().T @ self.data @ V.conj(), self.errors.combined(U, V)
        bar = UNCERTAINTY_OF_VARIANCE * free_bound(data[0].size, 2 * len(data))
        energy = 2 * float(np.sum(np.abs(self.own) ** 2 / errors.variance.mean(axis=(1, 2))[:, None, None]))
        alone, across = self._functions(modes), float(self._gains(data, errors, self.functions[:, :0], others).max())
        gains = [
            self._gains(data, errors, held, others) for held in (alone, np.hstack([alone, self._derivatives(modes)]))
        ]
        least = [bar + self.left + left for left in self._products(len(modes), usual, energy, across)]
        excess = np.max([gain / each for gain, each in zip(gains, least, strict=True)], axis=0)
        return excess, float(np.sqrt(gains[0].max()) + _DEVIATIONS) ** 2

    def deviations(self, count: int) -> RealArray:
        """Return the energies of deviations by row and by column, relative to that of so many modes and in units of 1 / zeta^2, (2,)."""
        U, V = _leading(self.own, count)
        E = np.sum(np.abs(U.conj().T @ self.own @ V.conj()) ** 2, axis=0)
        whole = max(float(E[:count, :count].sum()), 1e-300)
        return np.array([E[count:, :count].sum(), E[:count, count:].sum()]) / whole * self.damping**2

    def shifts(self) -> RealArray:
        """Return by which part of its frequency a resonance scatters from row to row and from column to column, (2,).

        Shifts e of variance a about their mean leave a (1 - sum w^2) of it, w = |u|^2 the weights of rows; see `_products`.
        """
        left = [1 - np.sum(np.abs(each[:, 0]) ** 4) for each in _leading(self.own, 1)]
        return 2 * np.sqrt(self.deviations(1) / np.maximum(left, _MIN_WEIGHT_LEFT))

    @property
    def damping(self) -> float:
        """The least damping ratio of the poles."""
        s = self.poles[self.which]
        return float(np.min(-s.real / np.abs(s)))

    def _products(self, count: int, usual: RealArray, energy: float, across: float) -> tuple[float, float]:
        """Return what products of deviations may leave across both: beside q, and beside q and two derivatives.

        With B = (1 - j x) / (1 + j x), x the distance from the resonance in half bandwidths h, a pole shifted by e (in 2 h) has the
        line q sum_k e^k / (1 - e)^(k + 1) B^k, in which q B^k are orthogonal. Shifts e by row and d by column of variances a and b, which
        are the energies of deviations across u and across v, leave e d (1 + 2 B + 2 B^2) q across both, of which 8 a b is beside q. Beside
        q, q' and q'', the span of the first three, it is 3 (e^2 d + e d^2) B^3 q, 27 a b (a + b) at normal shifts. What is across both
        in q itself, of gains or of a second mode, shifts with its row and its column: of it a + b is beside q, and 15 (a^3 + b^3) beside
        all three: a second mode counts where it lies further from the first than resonances usually shift. It deviates from the first in
        both, too, so that here its own deviations count for no more than the usual ones.

        `usual` (2,): of all clusters. `energy`, `across`: of the whole, and of what is across both in q, in variances.
        """
        own = self.deviations(count)
        (a, b), (c, d) = own / self.damping**2, np.minimum(own, usual) / self.damping**2
        first = 8 * a * b * energy + (c + d) * across
        third = 27 * a * b * (a + b) * energy + 15 * (c**3 + d**3) * across
        return _MARGIN * float(first), _MARGIN**2 * float(third)

    def centre(self, mode: int, host: IntArray) -> complex:
        """Return the pole that fits the main line of a mode and its copies best."""
        rows, s = self._main_line(self._response(self.which[host[self.which] == mode])), self.poles[[mode]]
        for _ in range(_CENTRE_STEPS):
            both = np.hstack([self._taken(each) for each in self.problem.columns(s)])
            c = np.linalg.lstsq(both, rows, rcond=None)[0]
            step = complex(c[2], c[3]) / complex(c[0], c[1])
            s = s + step * min(1.0, -0.5 * s.real[0] / max(abs(step), 1e-300))
        return complex(s[0])

    @staticmethod
    def _main_line(response: ComplexArray) -> RealArray:
        """Return a response in its leading shape and participation, rows of real and imaginary parts."""
        u, v = (each[:, 0] for each in _leading(response, 1))
        main = u.conj() @ response @ v.conj()
        return np.concatenate([main.real, main.imag])

    def _response(self, which: IntArray) -> ComplexArray:
        """Return what some poles are fitted with, on the lines."""
        R = self.residues[which]
        rows = np.stack([R.real, R.imag], axis=1).reshape(2 * len(which), *R.shape[1:])
        return lines_of_rows(np.tensordot(self._functions(which), rows, axes=1))

    def _gains(self, data: ComplexArray, errors: ColouredErrors, held: RealArray, which: list[int]) -> RealArray:
        """Return what each pole explains alone beside what is held, in variances, residues free in every channel, (k,)."""
        fixed = np.hstack([self.beside, held])
        rows, found = np.concatenate([data.real, data.imag]), []
        for k in which:
            a, B = ChannelFits(fixed, self._functions([k]), rows, errors).residues(np.array([0]))
            found.append(float(np.einsum("cki,ckij,ckj->", a, inverse(B), a)))
        return np.array(found)


def _leading(own: ComplexArray, count: int) -> tuple[ComplexArray, ComplexArray]:
    """Return the strongest shapes (q, q) and participations (p, p) of a response (F, q, p), and behind them what is across.

    Each has the phase in which it is most real: what is across is as real then, and a pole and its mirror image stay one.
    """
    rows, columns = (np.moveaxis(own, axis, 0).reshape(own.shape[axis], -1) for axis in (1, 2))
    products = rows @ rows.conj().T, columns @ columns.conj().T
    return _completed(products[0], count), _completed(products[1], count)


def _completed(product: ComplexArray, count: int) -> ComplexArray:
    vectors = np.linalg.eigh(product)[1][:, : -count - 1 : -1]
    vectors = vectors * np.exp(-0.5j * np.angle(np.sum(vectors**2, axis=0)))
    return np.asarray(np.linalg.qr(np.hstack([vectors, np.eye(len(product))]))[0])


def _log_chance(share: float, q: int, p: int) -> float:
    """Return the logarithm of the chance that a mode of any real shape and participation has less than this share across another's.

    Across a vector of n real numbers is a share that follows the beta distribution of (n - 1) / 2 and 1 / 2.
    """
    of_shape = betaincinv((q - 1) / 2, 0.5, _QUANTILES)
    return float(np.log(np.mean(betainc((p - 1) / 2, 0.5, np.minimum(share / of_shape, 1.0)))))
