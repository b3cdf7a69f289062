"""Estimate mode shapes of an ambient record once more on its own lines, where stronger modes lie over them, with all poles fixed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.records import Signals
from modalscope.functions.poles import QUANTITIES
from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray
from modalscope.preprocess.spectra import Spectrum

#: A shape is estimated from the lines within this many half bandwidths; the noise from those in this range of half bandwidths.
_SHAPE_HALF_BANDWIDTHS, _NOISE_HALF_BANDWIDTHS = 6.0, (1.5, 5.0)

#: A shape is kept where all other modes together have less than this fraction of its power at its frequency: correlated forces, which
#: the model lacks, would change it more.
_MIN_OVERLAP = 0.2

#: Rounds over all modes, and steps of expectation and maximization for each.
_ROUNDS, _STEPS_PER_MODE = 2, 10

#: Maximum number of lines of a mode, evenly spread, and minimum.
_MAX_LINES, _MIN_LINES = 1000, 8

#: Minimum noise of a channel relative to its level next to the mode: channels may be linearly dependent.
_MIN_NOISE = 1e-8

#: Minimum initial power of a mode, relative to the power of its lines in its shape.
_MIN_POWER = 0.05


class _Lines(NamedTuple):
    """Lines of a record, channels at a root mean square of one: transforms Y (R, F, l), Hz (F,), powers |h|^2 of all modes (n, F)."""

    Y: ComplexArray
    frequencies: RealArray
    powers: RealArray


def line_shapes(record: Signals, modes: ModalModel, avoided: Sequence[tuple[float, float]] = ()) -> ComplexArray:
    """Return the shapes of modes (l, n): those that other modes overlay as the lines of the record have them, all others as they are.

    Lines are Y = sum_j h_j phi_j a_j + e under independent white modal forces a_j, with h = 2 zeta r^p / (1 - r^2 + 2 i zeta r),
    r = f / f_j, p = 0, 1, 2 of displacement, velocity and acceleration. For one mode at a time, the strongest first, with E the spectral
    matrix of all others and of the noise and P = |h|^2, ten steps of

        v = 1 / (phi' E^-1 phi),  q = v phi' E^-1 Y,  m = q P / (P + v),  p = |m|^2 + P v / (P + v),
        phi = (sum p E^-1)^-1 Re sum E^-1 Y m*

    are those of expectation and maximization of Whittle's likelihood by phi. Noise is independent from channel to channel, its size the
    smallest eigenvalue of the normed spectral matrix beside the mode.

    `avoided`: frequencies and half widths (Hz) of lines that are no random vibration.
    """
    lines = _lines_of(record, modes, avoided)
    size = np.sqrt(np.mean(np.abs(lines.Y) ** 2, axis=(0, 1)))
    size = np.where(size > 0, size, 1.0)
    lines = lines._replace(Y=lines.Y / size)
    shapes = _with_power(lines, modes, modes.shapes / size[:, None])
    before = shapes.copy()
    for _ in range(_ROUNDS):
        for j in np.argsort(-np.linalg.norm(shapes, axis=0)):
            shapes[:, j] = _estimated(lines, modes, shapes, int(j))
    changed = _overlaid(lines, modes, shapes) & np.any(shapes != before, axis=0)
    return np.asarray(np.where(changed, shapes * size[:, None], modes.shapes))


def _lines_of(record: Signals, modes: ModalModel, avoided: Sequence[tuple[float, float]]) -> _Lines:
    spectrum = Spectrum.of(record)
    f = spectrum.step * np.arange(spectrum.lines.shape[1])
    kept = np.arange(len(f)) >= 2  # the first lines hold the remainder of the straight line
    for frequency, half in avoided:
        kept &= np.abs(f - frequency) > half
    r = f[kept] / modes.frequencies[:, None]
    zeta = modes.damping_ratios[:, None]
    power = QUANTITIES.get(record.quantity or "acceleration", 2)
    h = 2 * zeta * r**power / (1 - r**2 + 2j * zeta * r)
    return _Lines(spectrum.lines[:, kept], np.asarray(f[kept], dtype=np.float64), np.asarray(np.abs(h) ** 2))


def _with_power(lines: _Lines, modes: ModalModel, shapes: ComplexArray) -> RealArray:
    """Return real shapes whose lengths are the roots of the power of the modal forces, each given the stronger ones."""
    angle = np.angle(np.sum(shapes**2, axis=0)) / 2
    real = (shapes * np.exp(-1j * angle)).real
    real = real / np.linalg.norm(real, axis=0)
    own = [_within(lines, f, 0.0, f * z) for f, z in zip(modes.frequencies, modes.damping_ratios, strict=True)]
    seen = [
        float(np.mean(np.abs(lines.Y[:, k] @ phi) ** 2)) if k.size else 0.0 for k, phi in zip(own, real.T, strict=True)
    ]
    found = np.zeros_like(real)
    for j in np.argsort(seen)[::-1]:
        near = _near(lines, modes, found, int(j))
        if near is None:
            continue
        v = 1 / np.einsum("a,fab,b->f", real[:, j], near.inverse, real[:, j])
        power = np.mean(np.abs(v * (near.weighted @ real[:, j])) ** 2, axis=0)
        excess = max(float(np.sum(power - v)), _MIN_POWER * float(np.sum(power)))
        found[:, j] = real[:, j] * np.sqrt(excess / max(float(np.sum(lines.powers[j, near.own])), 1e-300))
    return np.asarray(found)


def _overlaid(lines: _Lines, modes: ModalModel, shapes: RealArray) -> BoolArray:
    """Return the modes at whose frequencies the others have more than a fifth of their own power."""
    power = np.sum(shapes**2, axis=0)
    at = np.clip(np.searchsorted(lines.frequencies, modes.frequencies), 0, len(lines.frequencies) - 1)
    there = power[:, None] * lines.powers[:, at]
    own = np.diag(there).copy()
    return np.asarray(there.sum(axis=0) - own >= _MIN_OVERLAP * own)


def _within(lines: _Lines, f: float, near: float, far: float) -> IntArray:
    """Return the lines between two distances of a frequency on both sides, evenly spread where they are many."""
    away = np.abs(lines.frequencies - f)
    found = np.flatnonzero((away <= far) & (away >= near))
    return found[:: -(-found.size // _MAX_LINES)] if found.size else found


class _Near(NamedTuple):
    """Lines of one mode `own` (f,), E^-1 of all others and of the noise there (f, l, l), and E^-1 Y (R, f, l)."""

    own: IntArray
    inverse: RealArray
    weighted: ComplexArray


def _near(lines: _Lines, modes: ModalModel, shapes: RealArray, j: int) -> _Near | None:
    """Return the lines of a mode given all others; None where they are too few."""
    f, outputs = float(modes.frequencies[j]), len(shapes)
    half = max(f * float(modes.damping_ratios[j]), 2 * float(lines.frequencies[1] - lines.frequencies[0]))
    own, beside = (
        _within(lines, f, 0.0, _SHAPE_HALF_BANDWIDTHS * half),
        _within(lines, f, _NOISE_HALF_BANDWIDTHS[0] * half, _NOISE_HALF_BANDWIDTHS[1] * half),
    )
    if len(lines.Y) * min(own.size, beside.size) < max(_MIN_LINES, 2 * outputs):
        return None
    inverse = _inverse_of_others(lines, shapes, j, own, _noise(lines.Y[:, beside].reshape(-1, outputs)))
    return _Near(own, inverse, np.einsum("fab,rfb->rfa", inverse, lines.Y[:, own]))


def _estimated(lines: _Lines, modes: ModalModel, shapes: RealArray, j: int) -> RealArray:
    """Return the shape of one mode given all others; as it is where its lines are too few, or it has no power in them."""
    near, phi = _near(lines, modes, shapes, j), shapes[:, j]
    if near is None or not np.any(phi):
        return phi
    runs, P = len(lines.Y), lines.powers[j, near.own]
    for _ in range(_STEPS_PER_MODE):
        v = 1 / np.einsum("a,fab,b->f", phi, near.inverse, phi)
        share = P / (P + v)
        m = share * v * (near.weighted @ phi)
        p = np.sum(np.abs(m) ** 2, axis=0) + runs * v * share
        left = np.einsum("f,fab->ab", p, near.inverse)
        phi = np.linalg.solve(left, np.einsum("rfa,rf->a", near.weighted, m.conj()).real)
    return np.asarray(phi)


def _noise(Y: ComplexArray) -> RealArray:
    """Return the noise of every channel, (l,): its level times the smallest eigenvalue of the normed spectral matrix."""
    S = (Y.T @ Y.conj()).real / len(Y)
    level = np.maximum(np.diag(S), 1e-300)
    smallest = float(np.linalg.eigvalsh(S / np.sqrt(np.outer(level, level)))[0])
    return np.asarray(level * max(smallest, _MIN_NOISE))


def _inverse_of_others(lines: _Lines, shapes: RealArray, j: int, own: IntArray, noise: RealArray) -> RealArray:
    """Return E^-1 on the lines of a mode, (f, l, l): E = sum_k |h_k|^2 phi_k phi_k' over the others, and the noise."""
    others = np.delete(shapes, j, axis=1)
    powers = np.delete(lines.powers, j, axis=0)[:, own]
    E = np.einsum("ak,kf,bk->fab", others, powers, others, optimize=True) + np.diag(noise)
    return np.asarray(np.linalg.inv(E))
