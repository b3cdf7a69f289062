"""Estimate mode shapes of an ambient record once more on its own lines, with all poles fixed, and what is not known of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla

from modalscope.data.modes import ModalModel
from modalscope.data.records import Signals
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import QUANTITIES
from modalscope.numerics.orthonormal import most_real
from modalscope.numerics.statistics import few_channels
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
#: each mode, and times that a step is shortened; damping at first, after a failed step at least, and its factors.
_MAX_PASSES, _SETTLED, _SCORING_STEPS, _MAX_SHORTENED = 8, 0.5, 2, 5
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


#: Products of unknowns on lines that are formed at a time.
_NUMBERS_AT_A_TIME = 1 << 20

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

    are those of expectation and maximization of Whittle's likelihood by phi, with uncorrelated forces. From there Fisher scoring by phi
    and by the correlations of its force with those of the modes that are strongest on its lines, which are real where forces act at one
    time, leads to the maximum. The covariance of phi is the inverse of the information there times the misfit where that exceeds one; what
    only the size of the mode has is no error of its shape; its pole, and poles and shapes of modes whose peaks stand among these lines, are
    unknown as well. Noise is independent from channel to channel, its size the smallest eigenvalue of the normed spectral matrix beside
    the mode.

    Shapes of close modes, and correlations of all their forces, sought at once reach a larger likelihood and worse shapes: what is wrong
    with poles and model goes into them. Three setups of a building that agree on its closest modes to a MAC of .9 then have .2.

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
    forces, deviations, misfits = np.eye(len(modes)), np.full(shapes.shape, np.nan), np.full(len(modes), np.nan)
    depends = np.eye(len(modes), dtype=bool)
    moved = np.ones(len(modes), dtype=bool)
    for _ in range(_MAX_PASSES):
        before = shapes
        for j in _strongest_first(shapes):
            found = _scored(lines, modes, shapes, forces, j) if np.any(moved & depends[j]) else None
            if found is not None:
                shapes, forces = found.shapes, found.forces
                depends[j, found.beside] = True
                deviations[:, j], misfits[j] = found.deviations, found.misfit
        moved = np.any(np.abs(shapes - before) > _SETTLED * deviations, axis=0)
    return shapes, deviations, misfits


def _strongest_first(shapes: RealArray) -> list[int]:
    return [int(j) for j in np.argsort(-np.linalg.norm(shapes, axis=0), kind="stable")]


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
    for j in np.argsort(seen, kind="stable")[::-1]:
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
    whole = there.sum(axis=0)
    return np.asarray((whole - own) / np.maximum(own, np.finfo(float).eps * whole + np.finfo(float).tiny))


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
    own = _within(lines, f, 0.0, _SHAPE_HALF_BANDWIDTHS * half)
    beside = _within(lines, f, _NOISE_HALF_BANDWIDTHS[0] * half, _NOISE_HALF_BANDWIDTHS[1] * half)
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
    """All shapes and correlations of forces with those of one mode at the maximum, the modes beside it, its deviations, and the misfit."""

    shapes: RealArray
    forces: RealArray
    beside: list[int]
    deviations: RealArray
    misfit: float


class _Spectral(NamedTuple):
    """S = A R A* + N on the lines of a mode, A = [phi_k h_k], in the span of shapes: N^-1/2 S N^-1/2 is L L* in Q, and one beside.

    `back` (l, k): N^-1/2 Q. `root`, `sides`, `driven` (f, k, ...): L^-1, and L^-1 of the coordinates of A and of A R. `seen` (f, k, R),
    `beside` (R, f, l): L^-1 of those of Y, and what Y N^-1/2 has beside. `squares`: of both. `cost`: -log p.
    """

    back: RealArray
    root: ComplexArray
    sides: ComplexArray
    driven: ComplexArray
    seen: ComplexArray
    beside: ComplexArray
    squares: float
    cost: float


class _Lobe(NamedTuple):
    """What is held while one mode is scored: its lines Y (R, f, l), h of all modes there (f, n), noise (l,), itself, those beside it."""

    Y: ComplexArray
    h: ComplexArray
    noise: RealArray
    mode: int
    beside: list[int]

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
        return _Spectral(unit[:, None] * Q, root, root @ A, root @ driven, seen, beside, squares, logs + squares)

    def equations(self, at: _Spectral) -> tuple[RealArray, RealArray]:
        """Return Fisher's information and the score of phi and of the correlations, (p, p) and (p,).

        Every derivative of S is u v* + v u*: of a component of phi u = e_a h and v a column of A R, of a correlation u and v are columns
        of A. The score is 2 Re (u* S^-1 y)(y* S^-1 v) - u* S^-1 v. Columns v lie in the span of shapes; e_a has a part beside, too.
        """
        h, runs, unit, l = self.h[:, self.mode, None], len(self.Y), 1 / np.sqrt(self.noise), len(self.noise)
        d, s, B = at.driven[:, :, self.mode], at.sides[:, :, self.mode], at.sides[:, :, self.beside]
        inside, beside = self.information(at)
        back = sla.block_diag(at.back, np.eye(len(self.beside)))
        information = back @ inside @ back.T
        information[:l, :l] += beside[0, 0] * (np.diag(unit**2) - at.back @ at.back.T)
        of_d = _times(d[:, None], at.root)[:, 0] * h
        drawn = _times(d[:, None], at.seen)[:, 0].conj()  # y* S^-1 v of components, (f, R)
        of_inside = _times((at.seen @ drawn[:, :, None])[:, None, :, 0], at.root)[:, 0].conj() * h.conj()
        of_beside = unit * np.einsum("rfa,fr->a", at.beside, drawn * h.conj())
        by_component = at.back @ np.sum(of_inside - runs * of_d.conj(), axis=0) + of_beside
        each = _times(s[:, None], at.seen) * _times(B.swapaxes(1, 2), at.seen).conj()
        score = np.concatenate([by_component, np.sum(each.sum(axis=2) - runs * _times(s[:, None], B)[:, 0], axis=0)])
        return information, 2 * score.real

    def information(
        self, at: _Spectral, close: Sequence[int] = (), slopes: ComplexArray | None = None
    ) -> tuple[RealArray, RealArray]:
        """Return Fisher's information of all that is unknown along Q, and of shapes beside it.

        The sum of 2 Re (v_p* S^-1 u_q)(v_q* S^-1 u_p) + (v_p* S^-1 v_q)(u_q* S^-1 u_p) over lines and runs, by N^-1/2 phi in the
        coordinates of Q, mode by mode, by poles, of which u = phi dh and v a column of A R, and by the correlations. Beside Q that of
        shapes is one number a pair of modes, (m, m), the same in every direction: many outputs cost nothing.

        `close`: modes besides itself that are unknown. `slopes` (f, m, e): of log h by what is unknown of each pole.
        """
        M, (lines, k, _) = [self.mode, *close], at.sides.shape
        D, H, e = at.driven[:, :, M], self.h[:, M], 0 if slopes is None else slopes.shape[2]
        by_shape = (at.root[:, :, None] * H[:, None, :, None]).reshape(lines, k, -1)
        by_pole = at.sides[:, :, M, None] * (np.zeros((1, 1, 1, 0)) if slopes is None else slopes[:, None])
        of_mode = at.sides[:, :, [self.mode] * len(self.beside)]
        U = np.concatenate([by_shape, by_pole.reshape(lines, k, -1), of_mode], axis=2)
        V = np.concatenate([np.repeat(D, k, axis=2), np.repeat(D, e, axis=2), at.sides[:, :, self.beside]], axis=2)
        inside = np.zeros((U.shape[2], U.shape[2]))
        for few in few_channels(U.shape[2] ** 2, lines, _NUMBERS_AT_A_TIME):
            u, v = U[few], V[few]
            pairs = (_times(v.swapaxes(1, 2), u),) * 2, (_times(v.swapaxes(1, 2), v), _times(u.swapaxes(1, 2), u))
            inside += sum(np.einsum("fpq,fqp->pq", *pair).real for pair in pairs)
        beside = np.einsum("fkj,fkm,fj,fm->jm", D.conj(), D, H, H.conj()).real
        return 2 * len(self.Y) * inside, 2 * len(self.Y) * beside

    def covariance(self, at: _Spectral, close: Sequence[int], slopes: ComplexArray) -> RealArray:
        """Return the covariance of phi, (l, l), with all of `information` unknown."""
        inside, beside = (np.linalg.pinv(each, hermitian=True) for each in self.information(at, close, slopes))
        back, k = self.noise[:, None] * at.back, at.back.shape[1]
        return np.asarray(
            back @ (inside[:k, :k] - beside[0, 0] * np.eye(k)) @ back.T + beside[0, 0] * np.diag(self.noise)
        )

    def moved(self, shapes: RealArray, forces: RealArray, step: RealArray) -> tuple[RealArray, RealArray]:
        """Return shapes and correlations after a step of one shape and its correlations."""
        l, j = len(shapes), self.mode
        shapes, forces = shapes.copy(), forces.copy()
        shapes[:, j] += step[:l]
        forces[j, self.beside] = np.clip(forces[j, self.beside] + step[l:], -_MAX_CORRELATION, _MAX_CORRELATION)
        forces[self.beside, j] = forces[j, self.beside]
        return shapes, forces


def _times(rows: ComplexArray, columns: ComplexArray) -> ComplexArray:
    """Return the products of conjugate rows with columns on every line."""
    return np.asarray(rows.conj() @ columns)


def _scored(lines: _Lines, modes: ModalModel, shapes: RealArray, forces: RealArray, j: int) -> _Scored | None:
    """Return the shape of one mode at the maximum of the likelihood of its lines; None where they are too few."""
    near = _near(lines, modes, j)
    if near is None or not np.any(shapes[:, j]):
        return None
    power = np.sum(shapes**2, axis=0) * np.mean(lines.powers[:, near.own], axis=1)
    beside = [int(k) for k in np.argsort(-power) if k != j and power[k] >= _MIN_POWER_BESIDE * power[j]][:_MAX_BESIDE]
    lobe = _Lobe(lines.Y[:, near.own], lines.responses[:, near.own].T, near.noise, j, beside)
    at, damping = lobe.spectral(shapes, forces), _FIRST_DAMPING
    if at is None:
        return None
    for _ in range(_SCORING_STEPS):
        information, score = lobe.equations(at)
        for _ in range(_MAX_SHORTENED):
            stiff = information + damping * np.diag(np.diag(information))
            step = np.asarray(np.linalg.solve(stiff, score), dtype=np.float64)
            there = lobe.moved(shapes, forces, step)
            new = lobe.spectral(*there) if np.linalg.eigvalsh(there[1])[0] > 0 else None
            if new is not None and new.cost < at.cost:
                break
            damping = max(_GROWTH * damping, _FAILED_DAMPING)
        else:
            break
        (shapes, forces), at, damping = there, new, _FALL * damping
    misfit = at.squares / lobe.Y.size
    f, reach = modes.frequencies, np.ptp(lines.frequencies[near.own]) / 2
    close = [k for k in beside if abs(f[k] - f[j]) < reach]
    covariance = lobe.covariance(at, close, _slopes(lines.frequencies[near.own], modes.take(np.array([j, *close]))))
    unit = shapes[:, j] / np.linalg.norm(shapes[:, j])
    across = np.eye(len(unit)) - np.outer(unit, unit)
    variances = np.diag(across @ covariance @ across) * _lines_a_line(near.own, lines.correlated) * max(misfit, 1.0)
    return _Scored(shapes, forces, beside, np.sqrt(np.maximum(variances, 0)), misfit)


def _slopes(lines: RealArray, modes: ModalModel) -> ComplexArray:
    """Return the derivatives of log h of modes by log f and log zeta on lines (Hz), (f, m, 2), less what only the size has."""
    r, zeta = lines[:, None] / modes.frequencies, modes.damping_ratios
    by_zeta = -2j * zeta * r / (1 - r**2 + 2j * zeta * r)
    return np.stack([-by_zeta * (1 + 1j * r / zeta), by_zeta], axis=2)


def _lines_a_line(lines: IntArray, correlated: RealArray) -> float:
    """Return how many lines count as an independent one, by their distance: 35/18 of neighbours under a Hann window."""
    step = int(np.diff(lines).min()) if lines.size > 1 else 1
    return float(2 * np.sum(correlated[::step]) - 1)
