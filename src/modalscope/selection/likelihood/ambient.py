"""Maximize the likelihood of several ambient records with common poles, by Fisher scoring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.linalg as sla
import scipy.signal

from modalscope.data.records import Signals
from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.orthonormal import most_real
from modalscope.numerics.statistics import MANY_NUMBERS, few_channels
from modalscope.selection.likelihood.covariance import deviations_of_poles, gradients_of_poles, pole_blocks

# ------------------------------------------------------------------------------------------------- spectral likelihood
# Whittle's likelihood of the lines of an ambient record: poles, shapes, excitation and a smooth background spectrum.
#
#     S(w) = sum_j T_j(w) phi_j g_j + T_j*(w) conj(phi_j g_j) + its conjugate transpose + N0 + N1 x + N2 x^2,     x in [-1, 1] over the band
#
# T_j is the half spectrum of exp(s_j t) over the record, whose correlations are seen through a triangle of its length:
#
#     T = z / (z - mu) - 1/2 - mu z / (z - mu)^2 / n,     z = exp(i w dt), mu = exp(s dt), n samples
#
# phi and g are free and complex, so that forces may be correlated and noise enter anywhere, as in every stochastic realization; N is
# Hermitian. -log p = sum over cells of (log det S + tr S^-1 I) lines, I being the mean periodogram of the lines of a cell. Fisher's
# information of two unknowns is the sum of tr S^-1 dS_a S^-1 dS_b over the lines.
#
# Source: P. Whittle, Arkiv foer Matematik 2, 1953.

#: Cells a half bandwidth, at the distance of a half bandwidth; their width grows with the distance to the nearest pole.
_CELLS_PER_HALF_BANDWIDTH = 6.0

#: Number of powers of frequency of the background over the band.
_BACKGROUND_POWERS = 3

#: Pieces of a record in time, from whose scatter what changes in time follows.
_PIECES = 16

#: Complex numbers in the directions of lines that are computed at a time: 32 MB.
_MAX_NUMBERS = 1 << 21

#: Noise of a channel relative to its level, at least: combinations of noiseless channels remain numbers.
_LEAST_LEVEL = 1e-6

#: Directions of shapes below this part of the largest are left out.
_MIN_SIZE = 1e-2

#: Initial background: this quantile of the spectrum of every channel.
_BACKGROUND_QUANTILE = 0.1


@dataclass(frozen=True, eq=False, slots=True)
class Cells:
    """Periodograms of a record, neighbouring lines averaged; every channel divided by its root mean square in the band.

    `values` (c, l, l). `frequencies` (c,): hz. `counts` (c,): lines. `rate`: samples a second. `samples`: of the record. `views`: lines
    (F, l) and the cell of each, of the record, then of its pieces in time.
    """

    values: ComplexArray
    frequencies: RealArray
    counts: RealArray
    rate: float
    samples: int
    views: tuple[tuple[ComplexArray, IntArray], ...]

    def without(self, lost: BoolArray) -> Cells:
        """Return the other cells."""
        kept, place = ~lost, np.cumsum(~lost) - 1
        views = tuple((lines[kept[cell]], place[cell[kept[cell]]]) for lines, cell in self.views)
        return replace(
            self, values=self.values[kept], frequencies=self.frequencies[kept], counts=self.counts[kept], views=views
        )

    def functions(self, poles: ComplexArray) -> ComplexArray:
        """Return T of poles, (c, n)."""
        z = np.exp(2j * np.pi * self.frequencies / self.rate)[:, None]
        mu = np.exp(poles / self.rate)
        return np.asarray(z / (z - mu) - 0.5 - mu * z / (z - mu) ** 2 / self.samples)

    def slopes(self, poles: ComplexArray) -> ComplexArray:
        """Return dT/ds, (c, n)."""
        z = np.exp(2j * np.pi * self.frequencies / self.rate)[:, None]
        mu = np.exp(poles / self.rate)
        once = z / (z - mu) ** 2
        return np.asarray(mu / self.rate * (once - (once + 2 * mu * z / (z - mu) ** 3) / self.samples))

    @property
    def powers(self) -> RealArray:
        """1, x and x^2 of the background, (3, c)."""
        low, high = self.frequencies[[0, -1]]
        return np.asarray(
            (2 * (self.frequencies - low) / max(high - low, 1e-300) - 1) ** np.arange(_BACKGROUND_POWERS)[:, None]
        )


class Driven(NamedTuple):
    """Parameters of one record besides the poles.

    Attributes
    ----------
    shapes : array of complex, (l, n)
    drives : array of complex, (n, l)
    background : array of complex, (3, l, l)
        Hermitian.
    """

    shapes: ComplexArray
    drives: ComplexArray
    background: ComplexArray


class Equations(NamedTuple):
    """One step of scoring.

    Attributes
    ----------
    information : array, (p, p)
        Of Re and Im of every pole, then of the other parameters of the record.
    score : array, (p,)
    misfit : float
        Square of the whitened residual by degrees of freedom; about one where the model is right.
    """

    information: RealArray
    score: RealArray
    misfit: float


class Transformed(NamedTuple):
    """A record without inputs: samples (N, l), transforms (F, l) less the straight line, which leaks over all lines, Hz (F,), rate."""

    samples: RealArray
    lines: ComplexArray
    frequencies: RealArray
    rate: float

    @classmethod
    def of(cls, record: Signals) -> Transformed:
        """Transform a record; one serves all bands."""
        y = record.outputs
        f = np.asarray(np.fft.rfftfreq(len(y), 1 / record.sampling_rate), dtype=np.float64)
        lines = np.empty((len(f), y.shape[1]), dtype=complex)
        for few in few_channels(len(y), y.shape[1], MANY_NUMBERS):
            lines[:, few] = np.fft.rfft(scipy.signal.detrend(y[:, few], axis=0), axis=0)
        lines /= np.sqrt(len(y))
        return cls(y, lines, f, record.sampling_rate)


def cells_of(
    whole: Transformed, poles: ComplexArray, band: tuple[float, float], shapes: ComplexArray | None = None
) -> Cells:
    """Return the cells of a record in a band: fine near poles, coarse far from them.

    `poles` (n,): rad/s. `band`: hz. `shapes` (l, n): the combinations of outputs that they span are taken in place of the outputs, where
    they are fewer: of channels divided by their noise they tell all that the outputs tell of the poles.
    """
    y, lines, x, rate = whole
    count = len(y)
    first, last = (int(k) for k in np.searchsorted(x, band))
    first, last = max(first, 1), min(last, len(x) - 1)
    half, centre = np.abs(poles.real) / (2 * np.pi), poles.imag / (2 * np.pi)
    starts = [first]
    while starts[-1] < last:
        near = float(np.min(np.hypot(x[starts[-1]] - centre, half)))
        step = max(int(near / _CELLS_PER_HALF_BANDWIDTH * count / rate), 1)
        starts.append(
            min(starts[-1] + step, len(x) - 1)
        )  # far from poles a cell may reach over all lines that there are
    at = np.array(starts[:-1]) - first
    inside, own = lines[first : starts[-1]], x[first : starts[-1]]
    combined = np.eye(y.shape[1]) if shapes is None else _combinations(inside, shapes)
    inside = inside @ combined
    counts = np.diff(np.append(at, len(own))).astype(float)
    columns = [np.add.reduceat(inside * inside[:, [b]].conj(), at, axis=0) for b in range(inside.shape[1])]
    products = np.stack(columns, axis=2)
    scale = np.sqrt(np.maximum(np.einsum("kaa->a", products).real / counts.sum(), 1e-300))
    values = products / counts[:, None, None] / scale[:, None] / scale
    views, size = [(inside / scale, np.repeat(np.arange(len(at)), counts.astype(int)))], count // _PIECES
    f = np.fft.rfftfreq(size, 1 / rate)
    there = (f >= own[0]) & (f < x[starts[-1]])
    cell = np.searchsorted(own[at], f[there], side="right") - 1
    for start in range(0, size * _PIECES, size):
        piece = scipy.signal.detrend(y[start : start + size] @ combined, axis=0)
        views.append((np.fft.rfft(piece, axis=0)[there] / np.sqrt(size) / scale, cell))
    return Cells(values, np.add.reduceat(own, at) / counts, counts, rate, count, tuple(views))


def _combinations(lines: ComplexArray, shapes: ComplexArray) -> RealArray:
    """Return the combinations (l, r) of outputs that real shapes span in channels divided by their noise, r <= l."""
    power = np.abs(lines) ** 2
    rms = np.sqrt(np.mean(power, axis=0))
    level = np.maximum(np.sqrt(np.quantile(power, _BACKGROUND_QUANTILE, axis=0)), _LEAST_LEVEL * rms)
    level = np.where(rms > 0, level, np.inf)  # a dead channel tells nothing
    real = most_real(shapes / level[:, None]).real
    lengths = np.maximum(np.linalg.norm(real, axis=0), np.finfo(float).tiny)
    basis, sizes, _ = np.linalg.svd(real / lengths, full_matrices=False)
    return np.asarray(basis[:, sizes >= _MIN_SIZE * sizes[0]] / level[:, None])


def unknowns(modes: int, outputs: int) -> int:
    """Return how many real unknowns a record has with so many modes: poles, shapes, drives and background."""
    return 2 * modes + 4 * modes * outputs + _BACKGROUND_POWERS * outputs**2


def begun(cells: Cells, poles: ComplexArray) -> Driven:
    """Return initial parameters with positive definite S: leading vectors of the periodograms near poles, uncorrelated forces."""
    outputs = cells.values.shape[1]
    shapes, drives = np.zeros((outputs, len(poles)), complex), np.zeros((len(poles), outputs), complex)
    peaks = 2 * cells.functions(poles).real
    for j, pole in enumerate(poles):
        away = np.abs(2 * np.pi * cells.frequencies - pole.imag)
        near = away <= max(abs(pole.real), float(np.sort(away)[: outputs // 2 + 1].max()))
        mean = np.average(cells.values[near], axis=0, weights=cells.counts[near])
        values, vectors = np.linalg.eigh(mean)
        shapes[:, j] = vectors[:, -1]
        size = values[-1] / np.average(peaks[near, j], weights=cells.counts[near])
        drives[j] = 0.5 * size * vectors[:, -1].conj()
    background = np.zeros((_BACKGROUND_POWERS, outputs, outputs), complex)
    background[0] = np.diag(np.quantile(np.einsum("caa->ca", cells.values).real, _BACKGROUND_QUANTILE, axis=0))
    return Driven(shapes, drives, background)


def spectrum(cells: Cells, poles: ComplexArray, own: Driven) -> ComplexArray:
    """Return S of every cell at poles (n,), (c, l, l)."""
    T, turned = cells.functions(poles), cells.functions(poles.conj())
    half = (T[:, None, :] * own.shapes) @ own.drives + (turned[:, None, :] * own.shapes.conj()) @ own.drives.conj()
    background = np.einsum("pc,pab->cab", cells.powers, own.background)
    return np.asarray(half + half.conj().transpose(0, 2, 1) + background)


def loss(cells: Cells, poles: ComplexArray, own: Driven) -> float:
    """Return -log p, up to a number; infinite where S is not positive definite everywhere."""
    S = spectrum(cells, poles, own)
    try:
        L = np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        return np.inf
    root = np.linalg.inv(L)
    logs = 2 * np.log(np.einsum("caa->ca", L).real).sum(axis=1)
    traces = np.einsum("cab,cbd,cad->c", root, cells.values, root.conj(), optimize=True).real
    return float(cells.counts @ (logs + traces))


def equations(cells: Cells, poles: ComplexArray, own: Driven) -> Equations:
    """Return Fisher information and score at a point where S is positive definite."""
    S = spectrum(cells, poles, own)
    root: ComplexArray = np.asarray(np.linalg.inv(np.linalg.cholesky(S)), dtype=np.complex128)
    weight = np.sqrt(cells.counts)[:, None]
    left = root @ (cells.values - S) @ root.conj().transpose(0, 2, 1)
    flat = (_packed(left / 2) * weight).ravel()
    rows = (_packed(_directions(cells, poles, own, root)) * weight).reshape(-1, flat.size)
    free = max(len(S) * S.shape[1] ** 2 - len(rows), 1)
    return Equations(rows @ rows.T, rows @ flat, float(flat @ flat) / free)


def _packed(half: ComplexArray) -> RealArray:
    """Return H + H* of matrices (..., l, l) as real numbers of the same products, (..., l^2): the diagonal, sqrt 2 times what is above."""
    l = half.shape[-1]
    a, b = np.triu_indices(l, 1)
    flat, found = half.reshape(*half.shape[:-2], -1), np.empty((*half.shape[:-2], l * l))
    np.multiply(2, flat.real[..., :: l + 1], out=found[..., :l])
    above = np.take(flat, l * a + b, axis=-1)
    above += np.take(flat, l * b + a, axis=-1).conj()
    found[..., l:] = np.sqrt(2) * above.view(np.float64)
    return found


def _directions(cells: Cells, poles: ComplexArray, own: Driven, root: ComplexArray) -> ComplexArray:
    """Return half of L^-1 dS L^-H by every unknown, (p, c, l, l): the other half is its conjugate transpose."""
    c, l = root.shape[:2]
    T, turned = cells.functions(poles).T[:, None, :, None], cells.functions(poles.conj()).T[:, None, :, None]
    d, d_turned = cells.slopes(poles).T[:, :, None], cells.slopes(poles.conj()).T[:, :, None]
    x, x_turned = (np.einsum("cab,bj->jca", root, shapes) for shapes in (own.shapes, own.shapes.conj()))
    y, y_turned = (np.einsum("cab,jb->jca", root.conj(), drives) for drives in (own.drives, own.drives.conj()))
    unit, unit_turned = root.transpose(2, 0, 1)[None], root.conj().transpose(2, 0, 1)[None]  # (1, l, c, l)
    found = []
    for left, right, left_turned, right_turned in (
        ((d * x)[:, None], y[:, None], (d_turned * x_turned)[:, None], y_turned[:, None]),
        (T * unit, y[:, None], turned * unit, y_turned[:, None]),
        (T * x[:, None], unit_turned, turned * x_turned[:, None], unit_turned),
    ):
        one = left[..., :, None] * right[..., None, :]
        other = left_turned[..., :, None] * right_turned[..., None, :]
        both = np.stack([one + other, 1j * (one - other)], axis=2)  # (n, 1 or l, 2, c, l, l)
        found.append(both.reshape(-1, c, l, l))
    upper = [(a, b) for a in range(l) for b in range(a, l)]
    still = np.array([root[:, :, a, None] * root[:, None, :, b].conj() for a, b in upper])
    crossed = 1j * still[[a != b for a, b in upper]]
    still = np.concatenate([still, crossed])
    smooth = cells.powers[:, None, :, None, None] * still
    return np.concatenate([*found, smooth.reshape(-1, c, l, l)])


def moved(own: Driven, step: RealArray) -> Driven:
    """Return the parameters of a record after a step, in the order of `equations` behind the poles."""
    l, n = own.shapes.shape
    sides = step[: 4 * n * l].reshape(2, n, l, 2)
    change = sides[..., 0] + 1j * sides[..., 1]
    smooth = step[4 * n * l :].reshape(_BACKGROUND_POWERS, l * l)
    upper = [(a, b) for a in range(l) for b in range(a, l)]
    half = np.zeros((_BACKGROUND_POWERS, l, l), complex)
    for k, (a, b) in enumerate(upper):
        half[:, a, b] += smooth[:, k]
    for k, (a, b) in enumerate([(a, b) for a, b in upper if a != b], len(upper)):
        half[:, a, b] += 1j * smooth[:, k]
    background = own.background + half + half.conj().swapaxes(1, 2)
    return Driven(own.shapes + change[0].T, own.drives + change[1], background)


# ------------------------------------------------------------------------------------------------------------- scoring

#: Maximum number of scoring steps, of first steps of each record with fixed poles, and the decrease of -log p a record that ends them.
_MAX_STEPS, _STEPS_WITH_FIXED_POLES, _MIN_FALL = 20, 6, 1e-3

#: Levenberg-Marquardt damping: initial value, factors after a full step and after a failed one, and limit.
_INITIAL_DAMPING, _DAMPING_DECREASE, _DAMPING_INCREASE, _MAX_DAMPING = 1e-2, 1 / 6, 8.0, 1e6

#: Converged when the squared step, in standard deviations of the poles, is below this.
_MAX_SQUARED_STEP = 0.01

#: Maximum number of halvings of a step: S must remain positive definite.
_MAX_HALVINGS = 10

#: Minimum of one minus the leverage of a line.
_MIN_FREE = 0.1

#: Relative ridge on the information: shape and drive share an undetermined factor.
_RIDGE = 1e-9


class Scored(NamedTuple):
    """Where scoring ended.

    Attributes
    ----------
    poles : array of complex, (n,)
    informations : array, (records, 2n, 2n)
        Of Re and Im of the poles, in every record by itself.
    scores : array, (records, 2n)
    misfit : float
        As in `Equations`, the mean of all records.
    converged : bool
    told : tuple of Told
        What the lines of every record say of the errors; none where scoring did not begin.
    """

    poles: ComplexArray
    informations: RealArray
    scores: RealArray
    misfit: float
    converged: bool
    told: tuple[Told, ...] = ()


class Told(NamedTuple):
    """What the lines of a record say of the errors of Re and Im of the poles.

    Attributes
    ----------
    lines, pieces : array, (2n, 2n)
        Covariance of the scores: from lines left out one at a time, and from the scatter of pieces in time.
    cells : array, (c, 2n, 2n)
        Information of one line of each cell.
    counts : array, (c,)
        Lines.
    """

    lines: RealArray
    pieces: RealArray
    cells: RealArray
    counts: RealArray


class _Eliminated(NamedTuple):
    """The equations of a record reduced to the poles, and how its other parameters follow a step of the poles."""

    information: RealArray
    score: RealArray
    own: RealArray
    follows: RealArray


def scored(records: Sequence[Cells], poles: ComplexArray) -> Scored:
    """Maximize the likelihood of all records over common poles (n,), from a start near them."""
    parts = [begun(cells, poles) for cells in records]
    if not np.isfinite(_total(records, poles, parts)):
        nothing = np.zeros((len(records), 2 * len(poles)))
        return Scored(poles, nothing[:, :, None] * nothing[:, None], nothing, np.inf, False)
    parts = [_descended([cells], poles, [own], fixed=True)[1][0] for cells, own in zip(records, parts, strict=True)]
    found, parts = _descended(records, poles, parts, fixed=False)
    built = [equations(cells, found, own) for cells, own in zip(records, parts, strict=True)]
    last = [_eliminated(each, len(poles), 0.0) for each in built]
    informations, scores = np.array([e.information for e in last]), np.array([e.score for e in last])
    score = scores.sum(axis=0)
    left = score @ np.linalg.lstsq(informations.sum(axis=0), score, rcond=None)[0]
    misfit = float(np.mean([each.misfit for each in built]))
    lines = tuple(_told(*each) for each in zip(records, [found] * len(parts), parts, built, last, strict=True))
    return Scored(found, informations, scores, misfit, bool(left < _MAX_SQUARED_STEP), lines)


def _told(cells: Cells, poles: ComplexArray, own: Driven, built: Equations, last: _Eliminated) -> Told:
    """Return what lines say, with L and directions G of their cell: the score of a line is y* G y - tr G, y divided by L.

    G = L^-1 dS L^-H, all but the poles eliminated. A line left out has its score over one minus its leverage, the part of its cell's.
    """
    k, l = 2 * len(poles), own.shapes.shape[0]
    root = np.asarray(np.linalg.inv(np.linalg.cholesky(spectrum(cells, poles, own))), dtype=np.complex128)
    half = _directions(cells, poles, own, root)
    D = half + half.conj().swapaxes(2, 3)
    G = D[:k] - np.tensordot(last.follows.T, D[k:], 1)
    size = np.sqrt(np.maximum(np.diag(built.information), 1e-300))
    factor = np.linalg.cholesky(built.information / size[:, None] / size + _RIDGE * np.eye(len(size)))
    X = sla.solve_triangular(factor, (_packed(half) / size[:, None, None]).reshape(len(D), -1), lower=True)
    h = np.sum(X.reshape(len(D), len(root), -1) ** 2, axis=(0, 2)) / l**2
    free = 1 / np.maximum(1 - h, _MIN_FREE)
    traces, scores = np.einsum("pcaa->pc", G).real, []
    for lines, cell in cells.views:
        z, step = np.empty((k, len(cell))), max(_MAX_NUMBERS // (k * l**2), 1)
        for start in range(0, len(cell), step):
            s = slice(start, start + step)
            y = np.einsum("fab,fb->fa", root[cell[s]], lines[s])
            z[:, s] = np.einsum("fa,pfab,fb->pf", y.conj(), G[:, cell[s]], y, optimize=True).real - traces[:, cell[s]]
        scores.append(z)
    whole = scores[0] * free[cells.views[0][1]]
    pieces = np.array([z.sum(axis=1) for z in scores[1:]])
    pieces = pieces - pieces.mean(axis=0)
    information = np.einsum("pcab,qcba->cpq", G, G, optimize=True).real
    return Told(whole @ whole.T, pieces.T @ pieces * (_PIECES / (_PIECES - 1)), information, cells.counts)


def deviations(found: Scored) -> tuple[RealArray, RealArray]:
    """Return the standard deviations of frequencies (Hz) and damping ratios, (2, n), and their degrees of freedom.

    V of lines left out one at a time, times one factor: the mean over all of what pieces in time scatter, over V, where above one.
    Degrees (sum v)^2 / (4 sum v^2), v the variance of a line's score.
    """
    C = np.linalg.pinv(found.informations.sum(axis=0), hermitian=True)
    first = 2 * np.arange(len(found.poles))
    lines, pieces = (
        np.array(deviations_of_poles(found.poles, pole_blocks(C @ sum(part) @ C, first)))
        for part in ([each.lines for each in found.told], [each.pieces for each in found.told])
    )
    factor = max(float(np.mean((pieces / np.maximum(lines, 1e-300)) ** 2)), 1.0)
    gradients = np.array(gradients_of_poles(found.poles))  # (2, n, 2)
    steps = np.einsum("kna,nab->knb", gradients, C.reshape(len(first), 2, -1))
    v = [np.einsum("kna,cab,knb->knc", steps, each.cells, steps, optimize=True) for each in found.told]
    sums = [
        np.sum([(part**power) @ each.counts for part, each in zip(v, found.told, strict=True)], axis=0)
        for power in (1, 2)
    ]
    return np.sqrt(factor) * lines, sums[0] ** 2 / (4 * sums[1])


def _descended(
    records: Sequence[Cells], poles: ComplexArray, parts: list[Driven], *, fixed: bool
) -> tuple[ComplexArray, list[Driven]]:
    """Return poles and parts at the end of scoring, with poles fixed if asked."""
    cost, damping = _total(records, poles, parts), _INITIAL_DAMPING
    for _ in range(_STEPS_WITH_FIXED_POLES if fixed else _MAX_STEPS):
        built = [equations(cells, poles, own) for cells, own in zip(records, parts, strict=True)]
        while True:
            each = [_eliminated(one, len(poles), damping) for one in built]
            whole = np.zeros(2 * len(poles)) if fixed else _step(each, damping)
            part, there, tried, new = _halved(records, poles, parts, each, whole, cost)
            if new < cost or damping > _MAX_DAMPING:
                break
            damping *= _DAMPING_INCREASE
        if not new < cost:
            break
        done = cost - new < _MIN_FALL * len(records)
        poles, parts, cost = there, tried, new
        damping *= _DAMPING_DECREASE if part == 1 else 1
        if done:
            break
    return poles, parts


def _halved(
    records: Sequence[Cells],
    poles: ComplexArray,
    parts: Sequence[Driven],
    each: Sequence[_Eliminated],
    whole: RealArray,
    cost: float,
) -> tuple[float, ComplexArray, list[Driven], float]:
    """Return the largest part of a step, of its halves, that lowers -log p, where it leads, and -log p there."""
    for part in 0.5 ** np.arange(_MAX_HALVINGS):
        step = part * whole
        there = poles + step[::2] + 1j * step[1::2]
        tried = [moved(own, part * (one.own - one.follows @ whole)) for own, one in zip(parts, each, strict=True)]
        near = bool(np.all(np.abs(there - poles) < np.abs(poles.real)) and np.all(there.real < 0))
        new = _total(records, there, tried) if near else np.inf
        if new < cost:
            break
    return float(part), there, tried, new


def _total(records: Sequence[Cells], poles: ComplexArray, parts: Sequence[Driven]) -> float:
    total = 0.0
    for cells, own in zip(records, parts, strict=True):
        total += loss(cells, poles, own)
        if not np.isfinite(total):
            break
    return total


def _step(each: Sequence[_Eliminated], damping: float) -> RealArray:
    information = np.sum([one.information for one in each], axis=0)
    stiff = information + damping * np.diag(np.diag(information))
    return np.asarray(np.linalg.lstsq(stiff, np.sum([one.score for one in each], axis=0), rcond=None)[0])


def _eliminated(built: Equations, modes: int, damping: float) -> _Eliminated:
    """Eliminate all but the poles, by Schur's complement."""
    k = 2 * modes
    size = np.sqrt(np.maximum(np.diag(built.information), 1e-300))
    H, r = built.information / size[:, None] / size, built.score / size
    stiff = H[k:, k:] + (damping + _RIDGE) * np.eye(len(H) - k)
    both = sla.cho_solve(sla.cho_factor(stiff), np.column_stack([r[k:], H[k:, :k]]))
    own, follows = both[:, 0], both[:, 1:]
    information = (H[:k, :k] - H[:k, k:] @ follows) * size[:k, None] * size[:k]
    score = (r[:k] - H[:k, k:] @ own) * size[:k]
    back = size[k:]
    return _Eliminated(information, score, own / back, follows * size[:k] / back[:, None])
