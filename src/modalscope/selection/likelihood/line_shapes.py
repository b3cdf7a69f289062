"""Estimate mode shapes of an ambient record once more on its own lines, with all poles fixed, and what is not known of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.records import Signals
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.numerics.orthonormal import most_real
from modalscope.signals.preprocess.spectra import Spectrum

#: A shape is estimated from the lines within this many half bandwidths; the noise from those in this range of half bandwidths.
_SHAPE_HALF_BANDWIDTHS, _NOISE_HALF_BANDWIDTHS = 6.0, (1.5, 5.0)

#: Rounds over all modes, and steps of expectation and maximization for each.
_ROUNDS, _STEPS_PER_MODE = 2, 10

#: Maximum number of lines of a mode, evenly spread, and minimum.
_MAX_LINES, _MIN_LINES = 1000, 8

#: Minimum noise of a channel relative to its level next to the mode: channels may be linearly dependent.
_MIN_NOISE = 1e-8

#: Minimum initial power of a mode, relative to the power of its lines in its shape.
_MIN_POWER = 0.05

#: Modes whose forces may be correlated with those of a mode: at most so many, with this part of its power on its lines at least; and the
#: largest correlation.
_MAX_BESIDE, _MIN_POWER_BESIDE, _MAX_CORRELATION = 4, 1e-3, 0.98

#: Maximum number of passes over the modes that moved by more than this part of a deviation, or beside which others did; scoring steps of
#: each mode, of which one shorter than this is the last, and times that a step is shortened; damping at first, after a failed step at
#: least, and its factors.
_MAX_PASSES, _SETTLED, _SCORING_STEPS, _LAST_STEP, _MAX_SHORTENED = 8, 0.5, 10, 0.1, 5
_FIRST_DAMPING, _FAILED_DAMPING, _GROWTH, _FALL = 1e-3, 1e-2, 10.0, 0.2

#: Squared correlations of spectral lines 0, 1 and 2 apart, by the number of sine tapers, summed over these; 0: a Hann window. Each line
#: stands for one over their sum, both sides counted.
_CORRELATED = {0: np.array([1.0, 2 / 3, 1 / 6]) ** 2, 2: np.array([1.0, 0.586, 0.1625])}

#: Mean square of the imaginary parts of a given shape, over the variances of its components by lines, up to which they are errors: of 234
#: modes of 40 random chains with real shapes (`arena.sets.readers.chain`, seeds 301-340) it is .8 in the median, and less than 4 for 99 %.
#: What the given shape's real part differs by from the lines' is an error of the same size.
_MOST_IMAGINARY = 4.0

#: A shape stays as it is where the mean square of the whitened lines exceeds this: something is on them that is no mode of the list. Of 455
#: modes of random records, in half of which the strongest mode was missing, lines gave the better shapes below and fits above it.
_MAX_MISFIT = 10.0


#: Least part of the error of a component that lies across its shape: one that is nearly alone has hardly any.
_LEAST_ACROSS = 0.05


class _Lines(NamedTuple):
    """Lines of a record, channels at a root mean square of one: transforms Y (R, F, l), Hz (F,), responses h of all modes (n, F).

    `correlated`: one of `_CORRELATED`.
    """

    Y: ComplexArray
    frequencies: RealArray
    responses: ComplexArray
    correlated: RealArray

    @property
    def powers(self) -> RealArray:
        """|h|^2, (n, F)."""
        return np.asarray(np.abs(self.responses) ** 2)


class LineShapes(NamedTuple):
    """Shapes (l, n), the standard deviations of their components, NaN where lines are too few to tell, and levels of the channels (l,)."""

    shapes: ComplexArray
    deviations: RealArray
    level: RealArray

    @property
    def with_size(self) -> RealArray:
        """Deviations s / sqrt(1 - u^2), u a component of the shape of length one: of components whose common size is not taken off."""
        unit = np.abs(self.shapes) / np.maximum(np.linalg.norm(self.shapes, axis=0), np.finfo(float).tiny)
        return np.asarray(self.deviations / np.sqrt(np.maximum(1 - unit**2, _LEAST_ACROSS)))


def line_shapes(record: Signals, modes: ModalModel, avoided: Sequence[tuple[float, float]] = ()) -> LineShapes:
    """Return the shapes of modes as the lines of the record have them.

    Lines are Y = sum_j h_j phi_j a_j + e under white modal forces a_j, with h = 2 zeta r^p / (1 - r^2 + 2 i zeta r), r = f / f_j,
    p = 0, 1, 2 of displacement, velocity and acceleration, and real phi_j. For one mode at a time, the strongest first, with E the
    spectral matrix of all others and of the noise and P = |h|^2, ten steps of

        v = 1 / (phi' E^-1 phi),  q = v phi' E^-1 Y,  m = q P / (P + v),  p = |m|^2 + P v / (P + v),
        phi = (sum p E^-1)^-1 Re sum E^-1 Y m*

    are those of expectation and maximization of Whittle's likelihood by phi, with uncorrelated forces. From there Fisher scoring leads to
    the maximum by phi, by the shapes of strong modes whose peaks stand among its lines, and by the correlations of all their forces, which
    are real where forces act at one time. The covariance of phi is its part of the inverse of the information there, with all these poles
    unknown as well, times the misfit where that exceeds one; what only the size of the mode has is no error of its shape. Noise is
    independent from channel to channel, its size the smallest eigenvalue of the normed spectral matrix beside the mode.

    What is complex in the given shape stays where it is more than errors, of the lines and of the given shape, and more than forces in step
    with those of other modes can turn it by. A given shape stays where the misfit says that there is more on the lines than the modes; what
    the two shapes differ by is then part of its deviation.

    `avoided`: frequencies and half widths (Hz) of lines that are no random vibration.
    """
    lines = _lines_of(record, modes, avoided)
    size = np.sqrt(
        np.mean([sum(np.einsum("fl,fl->l", x, x) for x in (Y.real, Y.imag)) for Y in lines.Y], axis=0)
        / lines.Y.shape[1]
    )
    size = np.where(size > 0, size, 1.0)
    np.divide(lines.Y, size, out=lines.Y)
    given = _turned_real(modes.shapes / size[:, None])
    shapes = _with_power(lines, modes, given.real)
    for _ in range(_ROUNDS):
        for j in _strongest_first(shapes):
            shapes[:, j] = _estimated(lines, modes, shapes, j)
    shapes, deviations, misfits = _at_maximum(lines, modes, shapes)
    length = np.einsum("aj,aj->j", given.real, shapes)
    fitted = given * length
    strange = misfits > _MAX_MISFIT
    differ, over = fitted.real - shapes, _overlay(lines, modes, shapes)
    errors = np.sqrt(np.nan_to_num(deviations) ** 2 + differ**2)  # the given shape has errors of its own
    squares = (fitted.imag / np.where(errors > 0, errors, np.nan)) ** 2
    unreal = np.mean(np.nan_to_num(squares, posinf=0.0), axis=0) > _MOST_IMAGINARY
    unreal &= np.sum(fitted.imag**2, axis=0) > over * np.sum(fitted.real**2, axis=0)
    found = shapes + 1j * np.where(unreal, fitted.imag, 0.0)
    deviations = np.where(strange | unreal, np.hypot(deviations, differ), deviations)
    known = np.isfinite(misfits) & (length != 0)
    return LineShapes(
        np.where(known, np.where(strange, fitted, found) * size[:, None], modes.shapes),
        np.where(known, deviations * size[:, None], np.nan),
        size,
    )


def _at_maximum(lines: _Lines, modes: ModalModel, shapes: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return shapes and their deviations where every mode's lines are most likely given all others, and the misfits (n,), NaN unknown."""
    count = len(modes)
    forces, deviations, misfits = [np.eye(count)] * count, np.full(shapes.shape, np.nan), np.full(count, np.nan)
    depends, moved = np.eye(count, dtype=bool), np.ones(count, dtype=bool)
    for _ in range(_MAX_PASSES):
        before, shapes = shapes, shapes.copy()
        for j in _strongest_first(shapes):
            found = _scored(lines, modes, shapes, forces[j], j) if np.any(moved & depends[j]) else None
            if found is not None:
                shapes[:, j], forces[j] = found.shape, found.forces
                depends[j, found.beside] = True
                deviations[:, j], misfits[j] = found.deviations, found.misfit
        moved = np.any(np.abs(shapes - before) > _SETTLED * deviations, axis=0)
    return shapes, deviations, misfits


def _strongest_first(shapes: RealArray) -> list[int]:
    return [int(j) for j in np.argsort(-np.linalg.norm(shapes, axis=0))]


def _turned_real(shapes: ComplexArray) -> ComplexArray:
    """Return shapes turned to be as real as they can, their real parts of length one."""
    turned = most_real(shapes)
    return np.asarray(turned / np.linalg.norm(turned.real, axis=0))


#: The lines before hold the remainder of the straight line.
_FIRST = 2


def _lines_of(record: Signals, modes: ModalModel, avoided: Sequence[tuple[float, float]]) -> _Lines:
    tapers = 0 if avoided else 2  # under a Hann window less of a tone is beside it
    spectrum = Spectrum.of(record, tapers=tapers)
    f = spectrum.step * np.arange(spectrum.lines.shape[1])
    kept = np.arange(len(f)) >= _FIRST
    for frequency, half in avoided:
        kept &= np.abs(f - frequency) > half
    power = QUANTITIES.get(record.quantity or "acceleration", 2)
    h = np.empty((len(modes), np.count_nonzero(kept)), dtype=complex)
    for row, f_k, zeta in zip(h, modes.frequencies, modes.damping_ratios, strict=True):
        r = f[kept] / f_k
        row[:] = 2 * zeta * r**power / (1 - r**2 + 2j * zeta * r)
    Y = spectrum.lines[:, kept] if avoided else spectrum.lines[:, _FIRST:]  # no copy
    return _Lines(Y, np.asarray(f[kept], dtype=np.float64), np.asarray(h), _CORRELATED[tapers])


def _with_power(lines: _Lines, modes: ModalModel, real: RealArray) -> RealArray:
    """Return shapes whose lengths are the roots of the power of the modal forces, each given the stronger ones."""
    own = [_within(lines, f, 0.0, f * z) for f, z in zip(modes.frequencies, modes.damping_ratios, strict=True)]
    seen = [
        float(np.mean(np.abs(lines.Y[:, k] @ phi) ** 2)) if k.size else 0.0 for k, phi in zip(own, real.T, strict=True)
    ]
    found = np.zeros_like(real)
    for j in np.argsort(seen)[::-1]:
        near = _near(lines, modes, int(j))
        if near is None:
            continue
        inverse, weighted = _given_others(lines, found, int(j), near)
        v = 1 / np.einsum("a,fab,b->f", real[:, j], inverse, real[:, j])
        power = np.mean(np.abs(v * (weighted @ real[:, j])) ** 2, axis=0)
        excess = max(float(np.sum(power - v)), _MIN_POWER * float(np.sum(power)))
        found[:, j] = real[:, j] * np.sqrt(excess / max(float(np.sum(lines.powers[j, near.own])), 1e-300))
    return np.asarray(found)


def _overlay(lines: _Lines, modes: ModalModel, shapes: RealArray) -> RealArray:
    """Return the power of all other modes at the frequency of each, relative to its own: forces in step turn its shape by its root."""
    power = np.sum(shapes**2, axis=0)
    at = np.clip(np.searchsorted(lines.frequencies, modes.frequencies), 0, len(lines.frequencies) - 1)
    there = power[:, None] * lines.powers[:, at]
    own = np.diag(there)
    return np.asarray((there.sum(axis=0) - own) / np.maximum(own, np.finfo(float).tiny))


def _within(lines: _Lines, f: float, near: float, far: float) -> IntArray:
    """Return the lines between two distances of a frequency on both sides, evenly spread where they are many."""
    away = np.abs(lines.frequencies - f)
    found = np.flatnonzero((away <= far) & (away >= near))
    return found[:: -(-found.size // _MAX_LINES)] if found.size else found


class _Near(NamedTuple):
    """Lines of one mode `own` (f,), and the noise there (l,)."""

    own: IntArray
    noise: RealArray


def _near(lines: _Lines, modes: ModalModel, j: int) -> _Near | None:
    """Return the lines of a mode; None where they are too few."""
    f, outputs = float(modes.frequencies[j]), lines.Y.shape[2]
    if len(lines.frequencies) < 2:
        return None
    half = max(f * float(modes.damping_ratios[j]), 2 * float(lines.frequencies[1] - lines.frequencies[0]))
    own, beside = (
        _within(lines, f, 0.0, _SHAPE_HALF_BANDWIDTHS * half),
        _within(lines, f, _NOISE_HALF_BANDWIDTHS[0] * half, _NOISE_HALF_BANDWIDTHS[1] * half),
    )
    if len(lines.Y) * min(own.size, beside.size) < max(_MIN_LINES, 2 * outputs):
        return None
    return _Near(own, _noise(lines.Y[:, beside].reshape(-1, outputs)))


def _given_others(lines: _Lines, shapes: RealArray, j: int, near: _Near) -> tuple[RealArray, ComplexArray]:
    """Return E^-1 of all other modes and of the noise on the lines of one, (f, l, l), and E^-1 Y (R, f, l)."""
    inverse = _inverse_of_others(lines, shapes, j, near.own, near.noise)
    return inverse, np.einsum("fab,rfb->rfa", inverse, lines.Y[:, near.own])


def _estimated(lines: _Lines, modes: ModalModel, shapes: RealArray, j: int) -> RealArray:
    """Return the shape of one mode given all others; as it is where its lines are too few, or it has no power in them."""
    near, phi = _near(lines, modes, j), shapes[:, j]
    if near is None or not np.any(phi):
        return phi
    inverse, weighted = _given_others(lines, shapes, j, near)
    runs, P = len(lines.Y), lines.powers[j, near.own]
    for _ in range(_STEPS_PER_MODE):
        v = 1 / np.einsum("a,fab,b->f", phi, inverse, phi)
        share = P / (P + v)
        m = share * v * (weighted @ phi)
        p = np.sum(np.abs(m) ** 2, axis=0) + runs * v * share
        left = np.einsum("f,fab->ab", p, inverse)
        phi = np.linalg.solve(left, np.einsum("rfa,rf->a", weighted, m.conj()).real)
    return np.asarray(phi)


def _noise(Y: ComplexArray) -> RealArray:
    """Return the noise of every channel, (l,): its level times the smallest eigenvalue of the normed spectral matrix."""
    S = (Y.T @ Y.conj()).real / len(Y)
    level = np.maximum(np.diag(S), 1e-300)
    smallest = float(np.linalg.eigvalsh(S / np.sqrt(np.outer(level, level)))[0])
    return np.asarray(level * max(smallest, _MIN_NOISE))


def _inverse_of_others(lines: _Lines, shapes: RealArray, j: int, own: IntArray, noise: RealArray) -> RealArray:
    """Return E^-1 on the lines of a mode, (f, l, l): E = sum_k |h_k|^2 phi_k phi_k' over the others, and the noise."""
    powers = np.delete(lines.powers, j, axis=0)[:, own]
    unit, Q, T = _in_noise(np.delete(shapes, j, axis=1), noise)
    inside = np.linalg.inv(np.einsum("ak,kf,bk->fab", T, powers, T, optimize=True) + np.eye(len(T))) - np.eye(len(T))
    back = unit[:, None] * Q
    return np.asarray(back @ inside @ back.T + np.diag(unit**2))


def _in_noise(shapes: RealArray, noise: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return N^-1/2 (l,), and Q (l, k) and T (k, n) of N^-1/2 [phi] = Q T: beside what shapes span there is noise of variance one alone."""
    unit = 1 / np.sqrt(noise)
    Q, T = np.linalg.qr(unit[:, None] * shapes)
    return unit, Q, T


# ------------------------------------------------------------------------------------------------------------- scoring


class _Scored(NamedTuple):
    """The shape of a mode where its lines are most likely, correlations of forces there, modes beside it, its deviations, the misfit."""

    shape: RealArray
    forces: RealArray
    beside: list[int]
    deviations: RealArray
    misfit: float


class _Spectral(NamedTuple):
    """S = A R A* + N on the lines of a mode, A = [phi_k h_k], in the span of shapes: N^-1/2 S N^-1/2 is L L* in Q, and one beside.

    `Q` (l, k): of N^-1/2 [phi]. `root`, `sides`, `driven` (f, k, ...): L^-1, and L^-1 of the coordinates of A and of A R. `seen` (f, k,
    R), `beside` (R, f, l): L^-1 of those of Y, and what Y N^-1/2 has beside. `squares`: of both. `cost`: -log p.
    """

    Q: RealArray
    root: ComplexArray
    sides: ComplexArray
    driven: ComplexArray
    seen: ComplexArray
    beside: ComplexArray
    squares: float
    cost: float


class _Equations(NamedTuple):
    """Fisher's information and the score, of shapes divided by the noise.

    `inside` (p, p), `pull` (p,): by coordinates in Q of shapes, mode by mode, by poles, and by correlations. `beside` (m, m): by what
    shapes have beside Q, the same in every direction, so that many outputs cost nothing. `pull_beside` (m, l).
    """

    inside: RealArray
    pull: RealArray
    beside: RealArray
    pull_beside: RealArray

    def step(self, damping: float) -> tuple[RealArray, RealArray, float]:
        """Return the steps inside (p,) and beside (m, l), and the square of their size, deviations being one."""
        inside, beside = (each + damping * np.diag(np.diag(each)) for each in (self.inside, self.beside))
        x, y = np.linalg.solve(inside, self.pull), np.linalg.solve(beside, self.pull_beside)
        return np.asarray(x), np.asarray(y), float(x @ self.pull + np.vdot(y, self.pull_beside))


class _Lobe(NamedTuple):
    """What is held while modes are scored: lines Y (R, f, l) of one, h of all there (f, n), noise (l,), what is unknown.

    `unknown`: the mode, then those whose shapes are unknown as well. `pairs`: of modes whose forces may be correlated.
    """

    Y: ComplexArray
    h: ComplexArray
    noise: RealArray
    unknown: list[int]
    pairs: list[tuple[int, int]]

    def spectral(self, shapes: RealArray, forces: RealArray) -> _Spectral | None:
        """Return S at shapes (l, n) and correlations (n, n); None where it is not positive definite."""
        unit, Q, T = _in_noise(shapes, self.noise)
        A = T * self.h[:, None, :]
        driven = A @ forces
        try:
            L = np.linalg.cholesky(driven @ A.conj().swapaxes(1, 2) + np.eye(len(T)))
        except np.linalg.LinAlgError:
            return None
        root: ComplexArray = np.asarray(np.linalg.inv(L), dtype=np.complex128)
        Y = self.Y * unit
        inside = Y @ Q
        seen, beside = root @ inside.transpose(1, 2, 0), Y - inside @ Q.T
        squares = float(np.vdot(seen, seen).real + np.vdot(beside, beside).real)
        logs = 2 * len(Y) * float(np.log(np.einsum("faa->fa", L).real).sum())
        return _Spectral(Q, root, root @ A, root @ driven, seen, beside, squares, logs + squares)

    def equations(self, at: _Spectral, slopes: ComplexArray | None = None) -> _Equations:
        """Return Fisher's information and the score of shapes, of poles if asked, and of correlations.

        Every derivative of S is u v* + v u*: of a component of phi u = e_a h and v a column of A R, of a pole u = phi dh and the same v,
        of a correlation u and v are columns of A. The information of two unknowns is the sum over lines and runs of

            2 Re (v_p* S^-1 u_q) (v_q* S^-1 u_p) + (v_p* S^-1 v_q) (u_q* S^-1 u_p),

        the score that of 2 Re (u* S^-1 y) (y* S^-1 v) - u* S^-1 v. Columns v lie in the span of shapes; e_a has a part beside, too.

        `slopes` (f, m, e): of log h by what is unknown of each pole.
        """
        h, D, runs = self.h[:, self.unknown], at.driven[:, :, self.unknown], len(self.Y)
        U, V = self._others(at, D, slopes)
        crossed = _times(D, at.root)  # v* S^-1 e of shapes, (f, m, k)
        Z = (crossed * h[:, :, None]).reshape(len(h), -1)
        alike, of_sides = _times(D, D) * h[:, :, None] * h[:, None].conj(), _times(at.root, at.root)
        m, k = crossed.shape[1:]
        twice = (Z.T @ Z).real.reshape(m, k, m, k).transpose(0, 3, 2, 1)
        shapes = (twice + _over_lines(alike, of_sides).transpose(0, 3, 1, 2)).reshape(m * k, m * k)
        mixed = sum(
            np.einsum("fmq,fqa->maq", _times(D, left) * h[:, :, None], _times(right, at.root)).real
            for left, right in ((U, V), (V, U))
        )
        others = np.einsum("fpq,fqp->pq", *(_times(V, U),) * 2) + np.einsum("fpq,fqp->pq", _times(V, V), _times(U, U))
        mixed = np.reshape(mixed, (m * k, -1))
        inside = np.block([[shapes, mixed], [mixed.T, others.real]])
        drawn = _times(at.seen, D) * h[:, None].conj()  # y* S^-1 v h*, (f, R, m)
        of_shapes = np.sum(
            _times(at.root, at.seen) @ drawn - runs * (crossed.conj() * h[:, :, None].conj()).swapaxes(1, 2), axis=0
        )
        of_others = np.sum(_times(U, at.seen) * _times(V, at.seen).conj(), axis=2) - runs * np.einsum(
            "fkp,fkp->fp", U.conj(), V
        )
        pull = np.concatenate([of_shapes.T.ravel(), of_others.sum(axis=0)]).real
        pull_beside = np.einsum("rfa,frm->ma", at.beside, drawn, optimize=True).real
        return _Equations(2 * runs * inside, 2 * pull, 2 * runs * alike.sum(axis=0).real, 2 * pull_beside)

    def _others(
        self, at: _Spectral, driven: ComplexArray, slopes: ComplexArray | None
    ) -> tuple[ComplexArray, ComplexArray]:
        """Return columns u and v of poles and of correlations, (f, k, p)."""
        first, second = (at.sides[:, :, [pair[k] for pair in self.pairs]] for k in (0, 1))
        if slopes is None:
            return first, second
        count, (lines, k, _) = slopes.shape[2], driven.shape
        by_pole = at.sides[:, :, self.unknown, None] * slopes[:, None]
        U = np.concatenate([by_pole.reshape(lines, k, -1), first], axis=2)
        return U, np.concatenate([np.repeat(driven, count, axis=2), second], axis=2)

    def covariance(self, at: _Spectral, slopes: ComplexArray) -> RealArray:
        """Return the covariance of phi, (l, l), with all else of `equations` unknown."""
        built, k, root = self.equations(at, slopes), at.Q.shape[1], np.sqrt(self.noise)
        inside, beside = (np.linalg.pinv(each, hermitian=True) for each in (built.inside, built.beside))
        back = root[:, None] * at.Q
        return np.asarray(
            back @ (inside[:k, :k] - beside[0, 0] * np.eye(k)) @ back.T + beside[0, 0] * np.diag(self.noise)
        )

    def moved(
        self, shapes: RealArray, forces: RealArray, at: _Spectral, inside: RealArray, beside: RealArray
    ) -> tuple[RealArray, RealArray]:
        """Return shapes and correlations after a step."""
        m, shapes, forces = len(self.unknown), shapes.copy(), forces.copy()
        count = m * at.Q.shape[1]
        change = inside[:count].reshape(m, -1) @ at.Q.T + beside
        shapes[:, self.unknown] += np.sqrt(self.noise)[:, None] * change.T
        if self.pairs:
            i, k = np.array(self.pairs).T
            forces[i, k] = np.clip(forces[i, k] + inside[count:], -_MAX_CORRELATION, _MAX_CORRELATION)
            forces[k, i] = forces[i, k]
        return shapes, forces


def _times(rows: ComplexArray, columns: ComplexArray) -> ComplexArray:
    """Return the products of conjugate rows with columns on every line."""
    return np.asarray(rows.conj().swapaxes(1, 2) @ columns)


def _over_lines(one: ComplexArray, other: ComplexArray) -> RealArray:
    """Return Re sum_f one_ij other_ab, (i, j, a, b)."""
    flat = one.reshape(len(one), -1).T @ other.reshape(len(other), -1)
    return np.asarray(flat.real.reshape(one.shape[1:] + other.shape[1:]))


def _scored(lines: _Lines, modes: ModalModel, shapes: RealArray, forces: RealArray, j: int) -> _Scored | None:
    """Return the shape of one mode, and of those beside it, at the maximum of the likelihood of its lines; None where they are too few."""
    near = _near(lines, modes, j)
    if near is None or not np.any(shapes[:, j]):
        return None
    lobe, beside = _lobe_of(lines, modes, shapes, near, j)
    at, damping = lobe.spectral(shapes, forces), _FIRST_DAMPING
    if at is None:
        return None
    for _ in range(_SCORING_STEPS):
        built = lobe.equations(at)
        for _ in range(_MAX_SHORTENED):
            *step, size = built.step(damping)
            there = lobe.moved(shapes, forces, at, *step)
            new = lobe.spectral(*there) if np.linalg.eigvalsh(there[1])[0] > 0 else None
            if new is not None and new.cost < at.cost:
                break
            damping = max(_GROWTH * damping, _FAILED_DAMPING)
        else:
            break
        (shapes, forces), at, damping = there, new, _FALL * damping
        if size < _LAST_STEP**2:
            break
    misfit = at.squares / lobe.Y.size
    covariance = lobe.covariance(at, _slopes(lines.frequencies[near.own], modes.take(np.array(lobe.unknown))))
    unit = shapes[:, j] / np.linalg.norm(shapes[:, j])
    across = np.eye(len(unit)) - np.outer(unit, unit)
    variances = np.diag(across @ covariance @ across) * _lines_a_line(near.own, lines.correlated) * max(misfit, 1.0)
    return _Scored(shapes[:, j], forces, beside, np.sqrt(np.maximum(variances, 0)), misfit)


def _lobe_of(lines: _Lines, modes: ModalModel, shapes: RealArray, near: _Near, j: int) -> tuple[_Lobe, list[int]]:
    """Return what is scored on the lines of a mode, and the modes that are strong there."""
    power = np.sum(shapes**2, axis=0) * np.mean(lines.powers[:, near.own], axis=1)
    beside = [int(k) for k in np.argsort(-power) if k != j and power[k] >= _MIN_POWER_BESIDE * power[j]][:_MAX_BESIDE]
    f, reach = modes.frequencies, np.ptp(lines.frequencies[near.own]) / 2
    unknown = [j, *(k for k in beside if abs(f[k] - f[j]) < reach)]
    pairs = [*combinations(unknown, 2), *((j, k) for k in beside if k not in unknown)]
    return _Lobe(lines.Y[:, near.own], lines.responses[:, near.own].T, near.noise, unknown, pairs), beside


def _slopes(lines: RealArray, modes: ModalModel) -> ComplexArray:
    """Return the derivatives of log h of modes by log f and log zeta on lines (Hz), (f, m, 2), less what only the size has."""
    r, zeta = lines[:, None] / modes.frequencies, modes.damping_ratios
    by_zeta = -2j * zeta * r / (1 - r**2 + 2j * zeta * r)
    return np.stack([-by_zeta * (1 + 1j * r / zeta), by_zeta], axis=2)


def _lines_a_line(lines: IntArray, correlated: RealArray) -> float:
    """Return how many lines count as an independent one, by their distance: 35/18 of neighbours under a Hann window."""
    step = int(np.diff(lines).min()) if lines.size > 1 else 1
    return float(2 * np.sum(correlated[::step]) - 1)
