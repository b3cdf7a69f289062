"""Model the noise of a response: variances of values, or deviations of segments, and their effect on poles.

Every kind is one contraction with the influence of the data on the poles (`modalscope.selection.likelihood.covariance`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from modalscope.data.mode_fields import half_widths
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.response import Response, faded_noise, line_step
from modalscope.data.stored import StoredSignals
from modalscope.data.whitening import Whitening
from modalscope.identification.matrices.influence import Moments
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.selection.likelihood.covariance import PoleInfluence
from modalscope.signals.preprocess.correlation import BLOCKS, correlation_blocks
from modalscope.signals.preprocess.frf import LEAKING

# --------------------------------------------------------------------------------------------------------------- drawn
# Noise drawn at random for replicates: with the correlation of lines under a window, or with the spectrum of what a model leaves.

#: Neighbours on either side whose spectrum is used for that of a line.
_NEIGHBOUR_LINES = 20


def correlated(shape: tuple[int, ...], correlation: Array, rng: np.random.Generator) -> ComplexArray:
    """Return circular noise of variance one on lines that correlate as given, by circulant embedding.

    `shape`: lines, outputs and inputs. `correlation` (F,): of one line with that k lines below it.

    Notes
    -----
    C. R. Dietrich and G. N. Newsam, SIAM J. Sci. Comput. 18 (1997) 1088-1107.
    """
    weights = np.maximum(np.fft.fft(np.concatenate([correlation, [0], correlation[:0:-1].conj()])).real, 0)
    long = (weights.size, *shape[1:])
    drawn = np.sqrt(weights / 2)[:, None, None] * (rng.standard_normal(long) + 1j * rng.standard_normal(long))
    return np.asarray(np.fft.ifft(drawn, axis=0)[: shape[0]] * np.sqrt(weights.size))


def coloured(left: Array, rng: np.random.Generator) -> ComplexArray:
    """Return circular noise whose covariance on every line is that of the neighbouring lines of a residual.

    n(f) = sum_j g_j e(f + j) / sqrt(2 k + 1), g_j normal and new for every line: channels keep what they have in common.

    `left` (F, l, m): e.
    """
    count = len(left)
    total = np.zeros(left.shape, dtype=complex)
    for j in range(-_NEIGHBOUR_LINES, _NEIGHBOUR_LINES + 1):
        weights = (rng.standard_normal(count) + 1j * rng.standard_normal(count)) / np.sqrt(
            2 * (2 * _NEIGHBOUR_LINES + 1)
        )
        index = np.abs(np.arange(count) + j)
        index = np.minimum(np.where(index >= count, 2 * (count - 1) - index, index), count - 1)
        total += weights[:, None, None] * left[np.maximum(index, 0)]
    return total


# --------------------------------------------------------------------------------------------------------------- noise

#: The kind of every note on deviations.
KIND = "deviations"

#: Minimum number of segments for their scatter.
_MIN_SEGMENTS = 5

#: Minimum bandwidth 2 zeta f, in lines, for a standard deviation of damping in spite of leakage.
_MIN_BANDWIDTH_LINES = 4.0

#: Maximum count of numbers in the deviations of all segments.
_MAX_NUMBERS = 100_000_000


class Noise(ABC):
    """A model of the noise of a response."""

    of_residual: ClassVar[bool] = False  # whether `beside` uses the residual of a model

    @property
    @abstractmethod
    def note(self) -> Note:
        """Where the deviations come from."""

    @abstractmethod
    def moments(self, influence: PoleInfluence, other: PoleInfluence | None = None) -> Moments:
        """Return the moments of poles under the noise, or of poles and as many others.

        `other`: of the same response; by default `influence` itself.
        """

    def beside(self, residual: RealArray, left: Array | None = None) -> Noise:
        """Return the noise given the residual of a model.

        `residual` (l, m): its variance. `left` (K, l, m): the residual, whose spectrum is then that of drawn noise.
        """
        return self

    def damping_is_told(self, poles: ComplexArray) -> BoolArray:
        """Return for which poles (rad/s) the deviation of the damping ratio means something."""
        return np.ones(np.shape(poles), bool)

    @abstractmethod
    def drawn(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        """Return noise of this kind for a response of a given shape (K, l, m)."""


@dataclass(frozen=True, eq=False)
class White(Noise):
    """Noise that differs from value to value; under an exponential window noise that fades.

    `variance` (l, m): e|noise|^2. `source`: where it is known from, in words. `is_complex`: whether the values are lines. `resolution`:
    distance of lines that leak into each other, Hz; 0 where none do. `fading`: what an exponential window makes of it, see
    `Influence.joint`; None without one. `left` (F, l, m): what a model leaves on lines: noise is drawn with its spectrum.
    """

    variance: RealArray
    source: str
    is_complex: bool = False
    resolution: float = 0.0
    fading: Array | None = None
    left: ComplexArray | None = None

    @property
    def note(self) -> Note:
        """Where the deviations come from, and where leakage forbids them."""
        text = f"standard deviations from {self.source}"
        if self.resolution:
            text += (
                f"; none for damping of modes narrower than {_MIN_BANDWIDTH_LINES:g} lines "
                f"(2 zeta f, lines {self.resolution:.4g} Hz apart): leakage widens them"
            )
        return Note(KIND, {"resolution_hz": self.resolution} if self.resolution else {}, text)

    def moments(self, influence: PoleInfluence, other: PoleInfluence | None = None) -> Moments:
        """Return the moments of poles."""
        return influence.joint(other or influence, self.variance, self.fading)

    def damping_is_told(self, poles: ComplexArray) -> BoolArray:
        """Return which poles have a bandwidth that leakage does not widen."""
        return np.asarray(np.abs(np.real(poles)) / np.pi >= _MIN_BANDWIDTH_LINES * self.resolution)

    def drawn(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        """Return noise of this variance, circular on lines: as a window makes it, with the spectrum that is known, or white."""
        size = np.sqrt(np.broadcast_to(self.variance, shape))
        if not self.is_complex:
            fading = np.ones(shape[0]) if self.fading is None else self.fading[: shape[0]]
            return np.asarray(size * np.sqrt(fading)[:, None, None] * rng.standard_normal(shape))
        if self.left is not None:
            return coloured(self.left, rng)
        return np.asarray(size * correlated(shape, np.eye(1, shape[0])[0] if self.fading is None else self.fading, rng))


@dataclass(frozen=True, eq=False)
class Residual(Noise):
    """Noise estimated from the residual of a model: white, of one variance a channel."""

    of_residual: ClassVar[bool] = True
    is_complex: bool = False
    fading: Array | None = None

    @property
    def note(self) -> Note:
        """Where the deviations come from, and what they are not."""
        text = "standard deviations from the residual, taken as white noise; differences between inputs, runs or setups are not included"
        return Note(KIND, {}, text)

    def beside(self, residual: RealArray, left: Array | None = None) -> Noise:
        """Return noise of the variance that the model leaves."""
        shown = left if self.is_complex and self.fading is None else None
        return White(residual, "the residual", self.is_complex, fading=self.fading, left=shown)

    def moments(self, influence: PoleInfluence, other: PoleInfluence | None = None) -> Moments:
        """Raise: a model is needed first."""
        raise TypeError("the residual of a model is needed first: beside()")

    def drawn(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        """Raise: a model is needed first."""
        raise TypeError("the residual of a model is needed first: beside()")


@dataclass(frozen=True, eq=False)
class Parts(Noise):
    """Noise as the deviations of a record's parts from the whole.

    `deviations` (K, T, l, m): scaled so that the sum of their squares is the variance of the whole. `duration`: seconds of a part: a mode
    that forgets its state more slowly is not seen to scatter.
    """

    deviations: RealArray
    duration: float

    @property
    def note(self) -> Note:
        """Where the deviations come from."""
        count = len(self.deviations)
        text = (
            f"standard deviations from the scatter of {count} segments of {self.duration:.4g} s; none for modes "
            "whose decay time exceeds a segment"
        )
        return Note(KIND, {"parts": count, "degrees_of_freedom": count - 1}, text)

    def moments(self, influence: PoleInfluence, other: PoleInfluence | None = None) -> Moments:
        """Return sum dp dq* and sum dp dq over the parts."""
        moved = influence.of(self.deviations)
        beside = moved if other is None else other.of(self.deviations)
        return Moments(np.sum(moved * beside.conj(), axis=0), np.sum(moved * beside, axis=0))

    def damping_is_told(self, poles: ComplexArray) -> BoolArray:
        """Return which poles decay within a part."""
        return np.asarray(np.abs(np.real(poles)) * self.duration >= 1)

    def drawn(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        """Return a random sum of the deviations: noise of their covariance."""
        drawn = np.tensordot(rng.standard_normal(len(self.deviations)), self.deviations, axes=1)
        return np.asarray(drawn[: shape[0]])


@dataclass(frozen=True, eq=False)
class Unknown(Noise):
    """Unknown noise: every standard deviation is withheld; `cure` says which data would give some."""

    why: str
    cure: str = "Give other data, or another method."
    numbers: dict[str, float] = field(default_factory=dict)

    @property
    def note(self) -> Note:
        """Why deviations are withheld."""
        return Note(KIND, {"withheld": 1.0, **self.numbers}, f"no standard deviations: {self.why}")

    def moments(self, influence: PoleInfluence, other: PoleInfluence | None = None) -> Moments:
        """Return NaN."""
        nothing = np.full(influence.slope.shape, np.nan)
        return Moments(nothing, nothing.astype(complex))

    def drawn(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        """Raise: nothing is known of it."""
        raise DataError("a certificate:", f"the noise is unknown: {self.why}", self.cure)


def noise_of(
    response: Response, records: Signals | StoredSignals | None = None, whitening: Whitening | None = None
) -> Noise:
    """Return the noise model of a response.

    The variance of the estimates where the response has it; else their coherence with the number of averages; for correlations the
    scatter of parts of the record, and nothing for their half spectra; else the residual of whatever model is fitted.

    `records`: that correlations were made from. `whitening`: of their channels, where the response is that of whitened ones.
    """
    if response.ambient:
        return _of_parts(response, records, whitening)
    if response.of_correlations:
        return Unknown(
            "errors of half spectra are correlated between lines and channels",
            "Identify the record in the time domain, such as method='alternate', domain='time'.",
        )
    is_complex, fading = bool(np.iscomplexobj(response.values)), faded_noise(response)
    leaks = any(LEAKING in step for step in response.processing)
    given = getattr(response, "variance", None)
    if given is not None:
        apart = line_step(response) if leaks else 0.0
        return White(given, "the variance of the frequency responses", is_complex, apart, fading)
    coherence, averages = getattr(response, "coherence", None), getattr(response, "averages", None)
    if coherence is not None and averages is not None and averages > 1:
        g2 = np.clip(coherence.reshape(response.count, response.values.shape[1], -1), 1e-6, 1 - 1e-12)
        variance = np.abs(response.values) ** 2 * (1 - g2) / (g2 * averages)
        return White(variance, f"the coherence of {averages} averages", is_complex, line_step(response), fading)
    return Residual(is_complex, fading)


def _of_parts(response: Response, records: Signals | StoredSignals | None, whitening: Whitening | None) -> Noise:
    """Return D_k = (R_k - R) pairs_k / sum pairs sqrt(K / (K - 1)) over the lags of the correlation."""
    if records is None:
        why = "errors of a correlation are correlated, and its record is missing"
        return Unknown(why, "Give the record of the correlation.")
    lags = response.count
    size = BLOCKS * response.values[0].size * (lags + 1)
    if size > _MAX_NUMBERS:
        why = f"{BLOCKS} segments of the record need {size} numbers in memory"
        return Unknown(why, "Select fewer channels or references.", {"numbers": float(size)})
    most = records.runs * (records.samples // (lags + 2))
    if most < _MIN_SEGMENTS:
        why = f"the record has {most} segments of {lags} lags, fewer than {_MIN_SEGMENTS}"
        return Unknown(why, "Give a longer record.")
    blocks = correlation_blocks(records, references=response.input_dofs, lags=lags, blocks=min(BLOCKS, most))
    count = len(blocks.sums)
    weights = (blocks.pairs / blocks.pairs.sum(axis=0))[:, 1:, None, None]
    deviations = (blocks.values - blocks.mean)[:, 1:] * weights * np.sqrt(count / (count - 1))
    deviations = deviations if whitening is None else whitening.of_values(deviations)
    duration = records.samples * records.runs / count / records.sampling_rate
    return Parts(np.asarray(deviations), float(duration))


# ------------------------------------------------------------------------------------------------------------ of modes
# Deviations of modes that were found at several orders.

#: Members with a standard deviation above this many times the lower quartile belong to split poles or to an insufficient order.
SPLIT = 2.0


def typical_deviation(values: RealArray) -> float:
    """Return the median of the deviations that are not large beside the smallest; NaN where none is known.

    Where a mode splits in two at an order, the deviation of each part is, rightly, many times that of the whole.

    Examples
    --------
    >>> typical_deviation(np.array([1.0, 1.1, 1.2, 40.0]))
    1.1
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return float("nan")
    return float(np.median(known[known <= SPLIT * np.quantile(known, 0.25)]))


def withheld(modes: ModalModel) -> tuple[Note, ...]:
    """Return a note that names the modes without a deviation of frequency or damping; none where all have theirs."""
    notes = []
    for what, values in (("frequency", modes.frequencies_std), ("damping ratio", modes.damping_ratios_std)):
        if values is None or not np.any(np.isnan(values)) or not len(modes):
            continue
        names = ", ".join(f"{f:.5g}" for f in modes.frequencies[np.isnan(values)])
        count = float(np.count_nonzero(np.isnan(values)))
        notes.append(Note(KIND, {"withheld": count}, f"no standard deviation of the {what} at {names} Hz"))
    return tuple(notes)


def undenied(modes: ModalModel, notes: Iterable[Note]) -> tuple[Note, ...]:
    """Return notes without those that deny deviations, where all modes have theirs from elsewhere."""
    known = bool(np.isfinite(half_widths(modes)).all())
    return tuple(note for note in notes if not (known and note.kind == KIND and "withheld" in note.numbers))
