"""Decide from responses whether files were driven at one place or at several, by their amplitudes at the resonances.

Mode r answers a force at the place x with a line shape of its own times phi_r(x). Over files, the amplitudes at resonance r are a vector
a_r proportional to phi_r at the places of the files. The files have one place if and only if these vectors are parallel for all
resonances, and equal over files but for a gain of each file. With b_r = a_r / rms(a_r) and weights w_r proportional to rms(a_r), the
distance of two files is

    d_ij^2 = 2 - 2 cos_ij - noise + max(0, |ln g_ij| - .3)^2,
    cos_ij = sum w b_i b_j / sqrt(sum w b_i^2 sum w b_j^2),    g_ij^2 = sum w b_i^2 / sum w b_j^2:

d^2 = 2 where files have nothing in common, 4 where they have opposite signs. Lines between resonances are not asked: there other modes and
noise decide.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from modalscope.numerics.checks import ComplexArray, IntArray, RealArray

#: Resonances are peaks of this prominence (dB) and height over the noise (power); so many of the strongest are asked.
_PROMINENCE_DB, _MIN_PEAK_RATIO, _MAX_RESONANCES = 6.0, 10.0, 40

#: Lines of a resonance on either side of its peak: half bandwidths, a minimum, and at most this part of all lines.
_HALF_BANDWIDTHS, _MIN_SIDE_LINES, _MAX_SIDE = 2.0, 2, 1 / 20

#: Minimum correlation with the common line shape of an amplitude that is that of the resonance. Two line shapes whose frequencies differ by
#: s half bandwidths have 1 / (1 + s^2 / 4): half where they differ by the window. Below, the skirts of other resonances give the energy.
_MIN_LIKENESS = 0.5

#: Lines over which the noise of second differences is a median. Such a difference of white noise has 6 times its variance, and the median
#: of an exponential variable is ln 2 of its mean.
_NOISE_LINES, _SECOND_DIFFERENCE = 33, 6 * np.log(2)

#: Logarithm of the gain between two files that may be scatter of one place: 1.35.
_FREE_GAIN = 0.3

#: Files of one place are at most the first number apart, files of several at least the second, by the last join of average linkage. The
#: study: 12 measured tests on one place have .02 to .09, true places 1.38 to 1.94 as a whole and .81 at least in pairs.
ONE, _SEVERAL = 0.25, 0.5

#: Below so many resonances parallel vectors prove little; and so many tell that a file has one shape, but another size.
_MIN_RESONANCES, _MIN_OF_SIZE = 3, 5

#: In a test of several places some files are repeats where joins up to the first number are followed by a gap of the second factor, and
#: most files, the third number, have a repeat: repeats are planned. Joins below the last number, the least of measured repeats, are alike.
ALIKE, _GAP, _PLANNED, _REPEATED = 0.15, 2.0, 0.7, 0.02

#: Least power that counts as any.
_TINY = float(np.finfo(float).tiny)


class Placed(NamedTuple):
    """Decision on files: "one" place, "several", "ask" (one until answered), "size" (one, but for the size of a file) or "unknown".

    Place of every file from 0 in the order of appearance; resonances that were compared; the height of the last join; gains of the
    files, (files, files); of several places the share of the resonances that two files have in common, and of one the share of the
    energy at resonances that line shapes common to all files give.
    """

    kind: str
    places: list[int]
    resonances: int
    apart: float
    gains: RealArray
    shared: float = 1.0

    @property
    def is_sure(self) -> bool:
        """Whether so many resonances were compared that nothing else need say the places."""
        return self.resonances >= _MIN_OF_SIZE


def white_noise(H: ComplexArray) -> RealArray:
    """Return the noise power of responses (files, lines, outputs) on each line, from the second differences of neighbouring lines."""
    from scipy import ndimage  # slow to load

    if H.shape[1] < 3:
        return np.zeros(H.shape)
    squares = np.abs(np.diff(H, 2, axis=1)) ** 2 / _SECOND_DIFFERENCE
    padded = np.pad(squares, ((0, 0), (1, 1), (0, 0)), mode="edge")
    return np.asarray(ndimage.median_filter(padded, size=(1, _NOISE_LINES, 1), mode="nearest"))


def not_compared(files: int) -> Placed:
    """Return the decision on files of which nothing can be compared."""
    return Placed("unknown", [0] * files, 0, np.nan, np.ones((files, files)))


def decide(H: ComplexArray, noise: RealArray) -> Placed:
    """Decide on files with responses H (files, lines, outputs) and their noise power on each line.

    Examples
    --------
    >>> f = np.linspace(1, 10, 2000)
    >>> modes = [1 / (g**2 - f**2 + 0.02j * g * f) for g in (2, 4, 7)]
    >>> at = lambda x: sum(np.sin(r * x) * mode for r, mode in enumerate(modes, 1))[:, None]
    >>> [decide(np.stack([at(0.7), at(x)]), np.zeros((2, 2000, 1))).kind for x in (0.71, 1.4)]
    ['one', 'several']
    """
    a, scatter, shared = _amplitudes(H, noise)
    files, count = H.shape[0], len(a)
    if count == 0:
        return not_compared(files)
    same_size, any_size, gains = _distances(a, scatter)
    beyond = np.maximum(np.abs(np.log(gains)) - _FREE_GAIN, 0.0)
    d = same_size if count < _MIN_RESONANCES else np.sqrt(any_size**2 + beyond**2)
    apart = float(_joins(d)[-1, 2])
    if apart <= ONE and count >= _MIN_RESONANCES:
        kind = "one"
    elif count >= _MIN_OF_SIZE and _joins(any_size)[-1, 2] <= ONE:
        kind = "size"
    else:
        kind = "ask" if apart < _SEVERAL else "several"
    if kind != "several":
        return Placed(kind, [0] * files, count, apart, gains, shared)
    return Placed(kind, _repeats(same_size), count, apart, gains, _shared(H, noise))


def _shared(H: ComplexArray, noise: RealArray) -> float:
    """Return the mean share of the resonances that two files have in common, within two half bandwidths, of those of either."""
    lines = [_windows(p, n) for p, n in zip(np.sum(np.abs(H) ** 2, axis=2), np.sum(noise, axis=2), strict=True)]
    peaks = [np.array([(s.start + s.stop, s.stop - s.start) for s in own]).reshape(-1, 2) / 2 for own in lines]
    pairs = [(a, b) for a, b in combinations(peaks, 2) if len(a) and len(b)]
    near = [abs(np.subtract.outer(a[:, 0], b[:, 0])) <= np.minimum.outer(a[:, 1], b[:, 1]) for a, b in pairs]
    return float(np.mean([min(n.any(0).sum(), n.any(1).sum()) / min(n.shape) for n in near])) if near else 1.0


def _joins(d: RealArray) -> RealArray:
    from scipy.cluster.hierarchy import linkage  # slow to load
    from scipy.spatial.distance import squareform

    return np.asarray(linkage(squareform(d, checks=False), "average"))


def _repeats(d: RealArray) -> list[int]:
    """Return the place of every file of a test of several places: repeats share one where they are clearly apart from all others."""
    from scipy.cluster.hierarchy import fcluster  # slow to load

    joins = _joins(d)
    heights = np.maximum(joins[:, 2], _REPEATED)
    gaps = np.where(heights[:-1] <= ALIKE, heights[1:] / heights[:-1], 0.0)
    if gaps.size and gaps.max() >= _GAP:
        k = int(np.argmax(gaps))
        number = fcluster(joins, np.sqrt(heights[k] * heights[k + 1]), "distance")
        if np.mean(np.bincount(number)[number] > 1) >= _PLANNED:
            order = {n: j for j, n in enumerate(dict.fromkeys(number.tolist()))}
            return [order[n] for n in number.tolist()]
    return list(range(len(d)))


def _windows(power: RealArray, noise: RealArray) -> list[slice]:
    """Return the lines of every resonance of a mean power (lines,)."""
    from scipy import signal  # slow to load

    level = 10 * np.log10(np.maximum(power, max(1e-30 * float(power.max()), _TINY)))
    peaks: IntArray = signal.find_peaks(level, prominence=_PROMINENCE_DB)[0]
    peaks = peaks[power[peaks] > _MIN_PEAK_RATIO * noise[peaks]]
    peaks = np.sort(peaks[np.argsort(power[peaks], kind="stable")[-_MAX_RESONANCES:]])
    half = signal.peak_widths(power, peaks, rel_height=0.5)[0] / 2
    sides = np.ceil(np.clip(_HALF_BANDWIDTHS * half, None, _MAX_SIDE * len(power)))
    sides = np.maximum(sides, _MIN_SIDE_LINES).astype(int)
    return [slice(max(0, k - side), k + side + 1) for k, side in zip(peaks.tolist(), sides.tolist(), strict=True)]


def _amplitudes(H: ComplexArray, noise: RealArray) -> tuple[RealArray, RealArray, float]:
    """Return the signed amplitudes of the files at every resonance, the deviations of their noise, (resonances, files), and a share.

    The amplitude is the root of the energy about the resonance, which shifts of the resonance between files leave. With
    G_ij = Re sum H_i H_j* and its first eigenvector v its sign is that of (G v)_i. The share is that of the energy which this vector
    explains, a mean over resonances by their amplitudes.
    """
    size = np.maximum(np.mean(np.abs(H) ** 2, axis=(0, 1)), _TINY)
    H, noise = H / np.sqrt(size), noise / size
    amplitudes, scatter, common, every = [], [], 0.0, _TINY
    for lines in _windows(np.mean(np.sum(np.abs(H) ** 2, axis=2), axis=0), np.mean(np.sum(noise, axis=2), axis=0)):
        X = H[:, lines].reshape(len(H), -1)
        G = np.real(X @ X.conj().T)
        own = np.sum(noise[:, lines], axis=(1, 2))
        values, vectors = np.linalg.eigh(G)
        along = np.sqrt(max(float(values[-1]), 0.0)) * vectors[:, -1]
        sign = np.clip(along / np.maximum(_MIN_LIKENESS * np.sqrt(np.diag(G)), _TINY), -1.0, 1.0)
        energy = np.maximum(np.diag(G) - own, 0.0)
        amplitudes.append(sign * np.sqrt(energy))
        scatter.append(np.sqrt(own / X.shape[1]))
        root = np.sqrt(max(float(np.sum(energy)), _TINY))
        common, every = common + min(root, float(values[-1]) / root), every + root
    return np.array(amplitudes).reshape(-1, len(H)), np.array(scatter).reshape(-1, len(H)), float(common / every)


def _distances(a: RealArray, scatter: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Return the distances of the files with gain one and with the best gain, and these gains, (files, files)."""
    usual = np.maximum(np.sqrt(np.mean(a**2, axis=1, keepdims=True)), _TINY)
    w = usual / usual.sum()
    b = np.sqrt(w) * a / usual
    products = b.T @ b
    energy = np.maximum(np.diag(products), _TINY)
    noise = 2 * np.sum(w * (scatter / usual) ** 2, axis=0)
    mean = np.add.outer(energy, energy) / 2
    free = np.add.outer(noise, noise) / mean
    cosine = products / np.sqrt(np.outer(energy, energy))

    def root(square: RealArray) -> RealArray:
        return np.asarray(np.sqrt(np.maximum(square - free, 0.0)) * (1 - np.eye(len(square))))

    return root(2 - 2 * products / mean), root(2 - 2 * cosine), np.asarray(np.sqrt(np.divide.outer(energy, energy)))
