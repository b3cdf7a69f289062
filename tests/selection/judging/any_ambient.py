"""Ambient records of every kind, and which of their modes the Cramer-Rao bound of Whittle's likelihood lets anyone see."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modalscope.data import ModalModel, Signals
from modalscope.data.indicators import mac

Array = NDArray[np.float64]

#: A mode can be seen where the bound leaves so much of a half bandwidth, of the damping, and of one minus MAC open.
OPEN_FREQUENCY, OPEN_DAMPING, OPEN_SHAPE = 0.5, 0.5, 0.02


class Truth(NamedTuple):
    """Modes: Hz, ratios, real shapes (l, n), coefficients of correlated white forces (n, forces) and noise (l,), in the same units."""

    frequencies: Array
    damping_ratios: Array
    shapes: Array
    forces: Array
    noise: Array
    rate: float
    samples: int


class Bound(NamedTuple):
    """Least standard deviations: of frequencies (Hz), damping ratios, and the least mean of one minus MAC of a shape."""

    frequencies: Array
    damping_ratios: Array
    shapes: Array


class Case(NamedTuple):
    """A record, what is true of it, and the units of its channels (l,)."""

    record: Signals
    truth: Truth
    units: Array

    def visible(self) -> NDArray[np.bool_]:
        """Return the modes that the bound lets anyone see."""
        f, zeta = self.truth.frequencies, self.truth.damping_ratios
        bound = bound_of(self.truth)
        open_there = np.array(
            [
                bound.frequencies / (OPEN_FREQUENCY * f * zeta),
                bound.damping_ratios / (OPEN_DAMPING * zeta),
                bound.shapes / OPEN_SHAPE,
            ]
        )
        return np.asarray(np.all(open_there < 1, axis=0))


def responses(truth: Truth, frequencies: Array) -> NDArray[np.complex128]:
    """Return h of accelerations under unit forces, (F, n)."""
    r = frequencies[:, None] / truth.frequencies
    return np.asarray(2 * truth.damping_ratios * r**2 / (1 - r**2 + 2j * truth.damping_ratios * r))


def bound_of(truth: Truth) -> Bound:
    """Return the bound: all shapes and noise unknown, forces of modes near each other correlated in an unknown way.

    S = P R P^H + diag N, P = [phi_j h_j]. Every derivative is u v^H + v u^H; tr(S^-1 dS_a S^-1 dS_b) then is twice the real part of
    (v_a S^-1 u_b)(v_b S^-1 u_a) + (v_a S^-1 v_b)(u_b S^-1 u_a).
    """
    f, half = truth.frequencies, truth.frequencies * truth.damping_ratios
    l, n = truth.shapes.shape
    step = truth.rate / truth.samples
    grid = np.unique(np.concatenate([c + h * np.sinh(np.linspace(-5, 5, 121)) for c, h in zip(f, half, strict=True)]))
    grid = grid[(grid > step) & (grid < 0.45 * truth.rate)]
    weight = np.gradient(grid) / step
    pairs = [(i, j) for i in range(n) for j in range(i) if abs(f[i] - f[j]) < 20 * (half[i] + half[j])]
    information = sum(_information(truth, grid[k : k + 64], weight[k : k + 64], pairs) for k in range(0, len(grid), 64))
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    C = np.linalg.pinv(information / size[:, None] / size, rcond=1e-12, hermitian=True) / size[:, None] / size
    std, level, shapes = np.sqrt(np.maximum(np.diag(C), 0)), level_of(truth), np.zeros(n)
    for j in range(n):
        k = slice(2 * n + j * l, 2 * n + (j + 1) * l)
        normed = truth.shapes[:, j] / level
        away = np.eye(l) - np.outer(normed, normed) / (normed @ normed)
        shapes[j] = np.trace(away @ (C[k, k] / level[:, None] / level) @ away) / (normed @ normed)
    return Bound(std[:n], std[n : 2 * n], shapes)


def _information(truth: Truth, grid: Array, weight: Array, pairs: list[tuple[int, int]]) -> Array:
    """Return the information of some lines, (p, p): of frequencies, damping ratios, shapes, noise, correlations."""
    f, zeta, phi = truth.frequencies, truth.damping_ratios, truth.shapes
    (l, n), d, h = phi.shape, 1e-6, responses(truth, grid)
    moved = truth._replace(frequencies=f * (1 + d)), truth._replace(damping_ratios=zeta * (1 + d))
    slopes = [(responses(m, grid) - h) / (d * x) for m, x in zip(moved, (f, zeta), strict=True)]
    P = phi * h[:, None, :]
    driven = P @ (truth.forces @ truth.forces.T)
    root = np.linalg.inv(np.linalg.cholesky(driven @ P.conj().swapaxes(1, 2) + np.diag(truth.noise)))
    sides, whitened, noise = root @ P, root @ driven, root * np.sqrt(truth.noise)
    own = (h[:, None, :, None] * root[:, :, None, :]).reshape(len(grid), l, n * l)
    first, second = [i for i, _ in pairs for _ in range(2)], [j for _, j in pairs for _ in range(2)]
    turns = np.tile([1, 1j], len(pairs))
    u = np.concatenate(
        [*(root @ (phi * slope[:, None, :]) for slope in slopes), own, noise / 2, sides[:, :, first] * turns], axis=2
    )
    v = np.concatenate([whitened, whitened, np.repeat(whitened, l, axis=2), noise, sides[:, :, second]], axis=2)
    vu, vv, uu = (a.conj().swapaxes(1, 2) @ b for a, b in ((v, u), (v, v), (u, u)))
    return np.asarray(np.einsum("c,cab->ab", weight, 2 * (vu * vu.swapaxes(1, 2) + vv * uu.swapaxes(1, 2)).real))


def level_of(truth: Truth) -> Array:
    """Return the size of every channel, (l,): shapes are compared in channels of size one."""
    own = np.linalg.norm(truth.shapes * np.linalg.norm(truth.forces, axis=1) * np.sqrt(truth.frequencies), axis=1)
    return np.asarray(np.where(own > 0, own, 1.0))


def made(rng: np.random.Generator, truth: Truth, sensor: float) -> tuple[Array, Array]:
    """Return accelerations and the noise of each channel: `sensor` times its root mean square.

    Forces are white below half the rate and nothing above, as a recorder's filter leaves them: of forces that are held from sample to
    sample what lies above would be folded back, and bend shapes by more than the bound. The record is cut from a longer, periodic one.
    """
    settle = int(5 * truth.rate / (2 * np.pi * float(np.min(truth.frequencies * truth.damping_ratios))))
    count = truth.samples + settle
    e = np.fft.rfft(rng.standard_normal((count, truth.forces.shape[1])), axis=0) @ truth.forces.T
    q = np.fft.irfft(responses(truth, np.fft.rfftfreq(count, 1 / truth.rate)) * e, count, axis=0)
    y = q[settle:] @ truth.shapes.T
    noise = sensor * y.std(axis=0)
    return y + noise * rng.standard_normal(y.shape), noise**2


def _shapes(rng: np.random.Generator, l: int, n: int) -> Array:
    """Return smooth shapes along a structure, seen by sensors at random places, or random ones."""
    if rng.random() < 0.5:
        x = np.sort(rng.uniform(0.05, 1, l))[:, None]
        phi = np.sin((np.arange(1, n + 1) - 0.5) * np.pi * x + rng.uniform(-0.3, 0.3, n))
    else:
        phi = rng.standard_normal((l, n))
    return np.asarray(phi / np.linalg.norm(phi, axis=0))


def _case(rng: np.random.Generator, f: Array, zeta: Array, phi: Array, sizes: Array, correlated: bool) -> Case:
    """Return a case of modes of given sizes (root mean square), with drift, offsets and units in a quarter of records each."""
    n, l = len(f), len(phi)
    rate = float(rng.uniform(2.5, 6) * f.max())
    samples = int(min(rng.uniform(300, 3600) * rate, 400_000))
    forces = rng.standard_normal((n, l)) if correlated else np.eye(n)
    forces = forces / np.linalg.norm(forces, axis=1)[:, None]
    # the mean square of 2 zeta h under white forces goes with zeta f
    forces = forces * (sizes / np.sqrt(zeta * f))[:, None]
    truth = Truth(f, zeta, phi, forces, np.zeros(l), rate, samples)
    y, noise = made(rng, truth, float(np.exp(rng.uniform(np.log(1e-3), np.log(0.1)))))
    truth = truth._replace(noise=noise)
    spoilt = rng.random(3) < 0.25
    units = np.ones(l)
    if spoilt[0]:
        y = y + rng.uniform(1, 10, l) * y.std(axis=0) * np.linspace(-1, 1, len(y))[:, None]
    if spoilt[1]:
        y = y + rng.uniform(10, 1000, l) * y.std(axis=0)
    if spoilt[2]:
        units = 10.0 ** rng.uniform(-2, 2, l)
        y = y * units
    return Case(Signals(outputs=y, sampling_rate=rate), truth, units)


def _damping(rng: np.random.Generator, n: int, most: float = 0.05) -> Array:
    return np.asarray(np.exp(rng.uniform(np.log(0.003), np.log(most), n)))


def dominated(seed: int) -> Case:
    """Return two to six modes on three to eight channels, the strongest 1 to 1000 times the others."""
    rng = np.random.default_rng([91, seed])
    n, l = int(rng.integers(2, 7)), int(rng.integers(3, 9))
    f = rng.uniform(0.3, 3) * np.cumprod(np.r_[1, rng.uniform(1.15, 1.9, n - 1)])
    sizes = np.exp(-rng.uniform(0, np.log(rng.choice([3.0, 30.0, 1000.0])), n))
    sizes[rng.integers(n)] = 1.0
    return _case(rng, f, _damping(rng, n), _shapes(rng, l, n), sizes, rng.random() < 0.3)


def tower(seed: int) -> Case:
    """Return pairs .5 to 4 % apart with orthogonal shapes, the second 1 to 1/30 of the first."""
    rng = np.random.default_rng([92, seed])
    pairs, l = int(rng.integers(1, 4)), 2 * int(rng.integers(2, 6))
    first = rng.uniform(0.15, 0.8) * np.cumprod(np.r_[1, rng.uniform(2.5, 6, pairs - 1)])
    f = np.sort(np.concatenate([first, first * (1 + np.exp(rng.uniform(np.log(0.005), np.log(0.04), pairs)))]))
    heights = np.linspace(0.3, 1, l // 2)[:, None] ** np.linspace(1, 3, pairs)
    turns = rng.uniform(0, np.pi, pairs)
    phi = np.zeros((l, 2 * pairs))
    for k, turn in enumerate(turns):
        sway = np.cos(np.pi * k * heights[:, k]) * heights[:, k]
        phi[:, 2 * k] = np.r_[sway * np.cos(turn), sway * np.sin(turn)]
        phi[:, 2 * k + 1] = np.r_[-sway * np.sin(turn), sway * np.cos(turn)]
    sizes = np.repeat(np.exp(-rng.uniform(0, np.log(10), pairs)), 2)
    weak = np.exp(-rng.uniform(0, np.log(30), pairs))
    side = rng.integers(0, 2, pairs)
    sizes[2 * np.arange(pairs) + side] *= weak
    zeta = np.repeat(_damping(rng, pairs, 0.015), 2) * rng.uniform(0.8, 1.25, 2 * pairs)
    return _case(rng, f, zeta, phi / np.linalg.norm(phi, axis=0), sizes, rng.random() < 0.3)


def long_list(seed: int) -> Case:
    """Return five to twelve modes on 10 to 30 channels, sizes within a factor of thirty."""
    rng = np.random.default_rng([93, seed])
    n, l = int(rng.integers(5, 13)), int(rng.integers(10, 31))
    f = rng.uniform(0.5, 2) * np.cumprod(np.r_[1, rng.uniform(1.05, 1.5, n - 1)])
    sizes = np.exp(-rng.uniform(0, np.log(30), n))
    return _case(rng, f, _damping(rng, n, 0.02), _shapes(rng, l, n), sizes, rng.random() < 0.5)


def damped(seed: int) -> Case:
    """Return three to eight modes of 1 to 5 % on four to twelve channels under forces on the structure, which correlate them."""
    rng = np.random.default_rng([94, seed])
    n, l = int(rng.integers(3, 9)), int(rng.integers(4, 13))
    f = rng.uniform(0.5, 3) * np.cumprod(np.r_[1, rng.uniform(1.15, 1.7, n - 1)])
    zeta = np.exp(rng.uniform(np.log(0.01), np.log(0.05), n))
    return _case(rng, f, zeta, _shapes(rng, l, n), np.exp(-rng.uniform(0, np.log(10), n)), True)


def cable(seed: int) -> Case:
    """Return 20 minutes of a cable in wind: fifteen modes nearly at equal distances, three sensors near its end."""
    rng, k = np.random.default_rng([95, seed]), np.arange(1, 16)
    f, zeta = 1.05 * k * np.sqrt(1 + 2e-4 * k**2), np.exp(rng.uniform(np.log(0.001), np.log(0.004), 15))
    phi = np.sin(np.pi * k * np.array([0.06, 0.11, 0.17])[:, None])
    truth = Truth(f, zeta, phi, np.diag(rng.uniform(0.5, 1.5, 15) / np.sqrt(zeta * f)), np.zeros(3), 64.0, 76_800)
    y, noise = made(rng, truth, 0.02)
    truth = truth._replace(noise=noise)
    return Case(Signals(outputs=y, sampling_rate=truth.rate), truth, np.ones(3))


def gust(y: Array, part: slice, rng: np.random.Generator) -> None:
    """Make a part of a record eight times as loud."""
    y[part] = y[part].mean(axis=0) + 8 * (y[part] - y[part].mean(axis=0))


def burst(y: Array, part: slice, rng: np.random.Generator) -> None:
    """Add noise of ten times the signal to a part of a record."""
    y[part] += 10 * y[part].std(axis=0) * rng.standard_normal(y[part].shape)


def knocks(y: Array, part: slice, rng: np.random.Generator) -> None:
    """Add fading noise of thirty times the signal to the first channel in a part of a record."""
    count = part.stop - part.start
    fading = np.exp(-10 * np.arange(count) / count)
    y[part, 0] += 30 * y[part, 0].std() * fading * rng.standard_normal(count)


def weather(y: Array, part: slice, rng: np.random.Generator) -> None:
    """Change the level of a whole record slowly, by e^.7 in one standard deviation."""
    knots = np.linspace(0, len(y), 21)
    y *= np.exp(0.7 * np.interp(np.arange(len(y)), knots, rng.standard_normal(21)))[:, None]


#: What happens to records by name: to three hundredths of them, or to all.
DISTURBANCES = {"gust": gust, "burst": burst, "knocks": knocks, "weather": weather}


def disturbed(case: Case, kind: str, seed: int) -> Case:
    """Return a case to whose record something happens."""
    rng, y = np.random.default_rng([96, seed]), np.array(case.record.outputs - case.record.outputs.mean(axis=0))
    start = int(rng.uniform(0.1, 0.8) * len(y))
    DISTURBANCES[kind](y, slice(start, start + int(0.03 * len(y))), rng)
    return case._replace(record=Signals(outputs=y, sampling_rate=case.record.sampling_rate))


#: The kinds of records by name.
FAMILIES: dict[str, Callable[[int], Case]] = {
    "one mode dominates, 1 to 1000 times": dominated,
    "pairs .5 to 4 % apart, 1 : 1 to 1 : 30": tower,
    "5 to 12 modes on 10 to 30 channels": long_list,
    "damping to 5 %, forces correlated": damped,
}


def paired(case: Case, modes: ModalModel) -> tuple[NDArray[np.int64], Array]:
    """Return the found mode of each true one (-1 for none), near and of its shape first, and the MAC with it, (n,)."""
    truth, level = case.truth, level_of(case.truth)
    f, half = truth.frequencies, truth.frequencies * truth.damping_ratios
    own, at = np.full(len(f), -1), np.zeros(len(f))
    if not len(modes):
        return own, at
    alike = mac((truth.shapes / level[:, None]).astype(complex), modes.shapes / (case.units * level)[:, None])
    apart = np.abs(modes.frequencies[None, :] - f[:, None])
    score = np.where(apart < np.maximum(0.01 * f, half)[:, None], alike, -1.0)
    while np.any(score >= 0):
        i, j = np.unravel_index(np.argmax(score), score.shape)
        own[i], at[i] = j, alike[i, j]
        score[i], score[:, j] = -1, -1
    return own, at
