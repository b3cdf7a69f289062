"""Compute spectra of records: cross spectral matrices averaged over segments and runs, and transforms of whole runs.

A segment x_p (samples, channels) under a window w has the transform X_p(f) = sum_k w(k) x_p(k) exp(-j 2 pi f k / fs), and
S(f) = 2 / (fs sum w^2) mean_p X_p X_p* is the one-sided power spectral density matrix, element (i, j) = E[X_i conj(X_j)].
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft

from modalscope.data.records import Signals
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.statistics import MANY_NUMBERS, few_channels

#: Windows, by their names in SciPy; "none" is the rectangle.
WINDOWS = ("none", "hann", "hamming", "flattop", "blackman", "blackmanharris", "tukey")

#: Lines with less than this part of an input's largest power have no force, only rounding.
_SILENT_POWER = 1e-20

#: Complex numbers transformed at a time (16 bytes each).
_MAX_NUMBERS = 2_000_000


def check_window(window: str | None) -> str:
    """Return the name of a window; None and "boxcar" are "none"."""
    if window is None or window == "boxcar":
        return "none"
    return check_choice("window", window, WINDOWS)


def window_of(name: str, length: int) -> RealArray:
    """Return a periodic window by its name."""
    if name == "none" or length == 1:
        return np.ones(length)
    if name == "hann":  # SciPy's package of signals takes a third of a second to import
        return np.asarray(0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, length + 1)[:-1]))
    return np.asarray(scipy.signal.get_window(name, length))


def segment_starts(samples: int, segment: int, overlap: float) -> list[int]:
    """Return the first samples of all whole segments of a run.

    Raises DataError for a segment longer than a run, and an overlap outside 0 to below 1.
    """
    check_count("segment", segment, least=2)
    if segment > samples:
        change = f"Lower segment to at most {samples}."
        raise DataError(f"segments of {segment} samples:", f"a run has {samples}", change)
    if not 0 <= overlap < 1:
        raise DataError(f"overlap={overlap!r}:", "it is a part of a segment, 0 to below 1", "Give 0.5 for half.")
    return list(range(0, samples - segment + 1, max(1, round(segment * (1 - overlap)))))


def fast_length(samples: int) -> int:
    """Return the largest length up to a number of samples whose transform is fast: a product of 2, 3 and 5.

    The transform of a prime number of samples takes four times as long.

    Examples
    --------
    >>> fast_length(2133)
    2048
    """
    return next((n for n in range(samples, 1, -1) if fft.next_fast_len(n, real=True) == n), samples)


class Segments(NamedTuple):
    """Segments of records: first samples, and the windows of outputs and inputs."""

    starts: list[int]
    output_window: RealArray
    input_window: RealArray

    @property
    def length(self) -> int:
        """Samples of a segment."""
        return int(self.output_window.size)

    @classmethod
    def of(cls, samples: int, length: int, overlap: float = 0.5, window: str = "hann") -> Segments:
        """Return the whole segments of a run under a (periodic) window by name; each shares a part `overlap` with the next."""
        name, starts = check_window(window), segment_starts(samples, length, overlap)  # which checks the length, too
        w = window_of(name, length)
        return cls(starts, w, w)


class Transform(NamedTuple):
    """Transform of segments (p, samples, channels) to lines (p, F, channels), and the lines in Hz."""

    frequencies: RealArray
    apply: Callable[[Array], ComplexArray]


class CrossSpectra(NamedTuple):
    """Averaged spectral densities of l outputs and m inputs on F lines.

    Frequencies are in Hz, outputs are powers (F, l) or the whole matrix (F, l, l), cross is E[Y conj(U)] (F, l, m), inputs E[U conj(U)]
    (F, m, m), averages the number of segments, and effective that of independent ones (see `effective_averages`).
    """

    frequencies: RealArray
    outputs: Array
    cross: ComplexArray
    inputs: ComplexArray
    averages: int
    effective: float

    @property
    def output_powers(self) -> RealArray:
        """Powers of the outputs, (F, l)."""
        diagonal = self.outputs if self.outputs.ndim == 2 else np.einsum("fii->fi", self.outputs)
        return np.asarray(diagonal.real)

    def at_lines(self, lines: Array) -> CrossSpectra:
        """Return the spectra on some of the lines, given by a mask or by indices."""
        arrays = {name: getattr(self, name)[lines] for name in ("frequencies", "outputs", "cross", "inputs")}
        return self._replace(**arrays)


def effective_averages(window: RealArray, starts: list[int], runs: int) -> float:
    """Return the number of independent segments equivalent to overlapping ones, n / (1 + 2 sum_q (1 - q/n) rho(q)^2).

    rho(q) is the correlation of the window with itself after q steps; different runs are independent. Welch, "The use of fast Fourier
    transform for the estimation of power spectra", 1967.
    """
    n = len(starts)
    if n == 1:
        return float(runs)
    step, power = starts[1] - starts[0], float(window @ window)
    shifts = range(step, min(n * step, window.size), step)
    rho = [float(window[shift:] @ window[:-shift]) / power for shift in shifts]
    return runs * n / (1 + 2 * sum((1 - q / n) * r**2 for q, r in enumerate(rho, 1)))


def silent_lines(spectra: CrossSpectra) -> Array:
    """Return (F,) whether an input has no power on a line but rounding."""
    power = np.einsum("fii->fi", spectra.inputs).real
    return np.asarray(np.any(power <= _SILENT_POWER * power.max(axis=0), axis=1))


def _pieces(records: Array, segments: Segments, window: RealArray, at_once: int, centred: bool) -> Iterator[Array]:
    """Yield groups of segments (p, samples, channels) of all runs under a window, `centred` without the means of their run.

    All are copied to one place, as the system takes long to give large ones: each is gone with the next.
    """
    place = np.empty((min(at_once, len(segments.starts)), segments.length, records.shape[2]), records.dtype)
    for run in records:
        mean = run.mean(axis=0) if centred else 0.0
        for first in range(0, len(segments.starts), at_once):
            group = segments.starts[first : first + at_once]
            for segment, start in zip(place, group, strict=False):
                np.subtract(run[start : start + segments.length], mean, out=segment)
                segment *= window[:, None]
            yield place[: len(group)]


def cross_spectra(
    outputs: Array,
    inputs: Array | None,
    sampling_rate: float,
    segments: Segments,
    *,
    transform: Transform | None = None,
    whole: bool = False,
    centred: bool = False,
) -> CrossSpectra:
    """Average the cross spectral matrices of records (R, N, l) and (R, N, m) over segments and runs.

    The lines are those of the discrete Fourier transform by default. `whole` computes the whole matrix of the outputs instead of their
    powers, `centred` subtracts the means of every run.
    """
    if transform is None:
        lines_hz = fft.rfftfreq(segments.length, 1 / sampling_rate)
        transform = Transform(lines_hz, lambda x: np.asarray(fft.rfft(x, axis=1)))
    inputs = np.zeros((*outputs.shape[:2], 0)) if inputs is None else inputs
    lines, l, m = transform.frequencies.size, outputs.shape[2], inputs.shape[2]
    Syy = np.zeros((lines, l, l) if whole else (lines, l), dtype=complex if whole else float)
    Syu, Suu = np.zeros((lines, l, m), dtype=complex), np.zeros((lines, m, m), dtype=complex)
    at_once = max(1, _MAX_NUMBERS // (segments.length * (l + m)))
    sides = ((outputs, segments.output_window), (inputs, segments.input_window))
    for y, u in zip(*(_pieces(x, segments, window, at_once, centred) for x, window in sides), strict=True):
        Y = transform.apply(y).transpose(1, 2, 0)  # (F, l, p)
        U = transform.apply(u).transpose(1, 2, 0)
        conjugate = np.conj(U).transpose(0, 2, 1)
        step = max(_MAX_NUMBERS // max(l * m, 1), 1)
        for k in range(0, lines, step):
            Syu[k : k + step] += Y[k : k + step] @ conjugate[k : k + step]
        Suu += U @ conjugate
        Syy += Y @ np.conj(Y).transpose(0, 2, 1) if whole else np.sum(Y.real**2 + Y.imag**2, axis=2)
    count = outputs.shape[0] * len(segments.starts)
    scale = _density_of_squares(transform.frequencies, sampling_rate, segments, count)
    for S in (Syy, Syu, Suu):
        S *= scale.reshape(-1, *(1,) * (S.ndim - 1))
    return CrossSpectra(
        frequencies=transform.frequencies,
        outputs=Syy,
        cross=Syu,
        inputs=Suu,
        averages=count,
        effective=effective_averages(segments.output_window, segments.starts, outputs.shape[0]),
    )


def _density_of_squares(f: RealArray, rate: float, segments: Segments, count: int) -> RealArray:
    """Return the mean density of `count` segments over the sum of the squares of their transforms, (F,)."""
    scale = np.full(f.size, 2 / (rate * float(np.sum(segments.output_window**2)) * count))
    # lines include their negative frequencies, except at both ends
    scale[(f == 0) | (np.abs(f - rate / 2) < 1e-9 * rate)] *= 0.5
    return scale


def segment_transforms(outputs: RealArray, sampling_rate: float, segments: Segments) -> tuple[RealArray, ComplexArray]:
    """Return lines (F,) in Hz and transforms X (F, l, segments) of real records (R, N, l): X X* are their averaged spectral densities."""
    f = np.asarray(fft.rfftfreq(segments.length, 1 / sampling_rate))
    count, runs = len(segments.starts), len(outputs)
    X = np.empty((f.size, outputs.shape[2], runs * count), dtype=complex)
    for k, piece in enumerate(_pieces(outputs, segments, segments.output_window, 1, centred=False)):
        X[:, :, k] = fft.rfft(piece[0], axis=0)
    X *= np.sqrt(_density_of_squares(f, sampling_rate, segments, runs * count))[:, None, None]
    return f, X


class Spectrum(NamedTuple):
    """Transforms (R, lines, l) of the outputs of all runs, without straight lines and under a Hann window, or under each of some tapers.

    The squares of `lines` are powers, relative to a power of two near the largest sample, so that they do not overflow; `step` is their
    distance in Hz, `power` that of all outputs, `rate` the sampling rate.
    """

    lines: ComplexArray
    step: float
    power: float
    rate: float

    @classmethod
    def of(cls, signals: Signals, *, tapers: int = 0) -> Spectrum:
        """Compute the spectrum of a record.

        `tapers`: so many sine tapers in the place of the Hann window, each as further runs: lines of one window tell half of what the
        samples do, of two of these four fifths (K. S. Riedel and A. Sidorenko, IEEE Trans. Signal Process. 43, 1995).
        """
        outputs, _ = signals.by_run()
        largest = max(float(np.max(outputs, initial=0.0)), -float(np.min(outputs, initial=0.0)))
        unit = np.ldexp(1.0, int(np.frexp(largest)[1]) - 1) if largest else 1.0
        runs, n, channels = outputs.shape
        t = np.arange(n) - (n - 1) / 2
        k, at = np.arange(1, tapers + 1)[:, None], np.pi * np.arange(1, n + 1) / (n + 1)
        windows = np.sin(k * at) if tapers else window_of("hann", n)[None]
        windows *= np.sqrt(2 / (n * np.einsum("kn,kn->k", windows, windows)))[:, None]
        lines, power = np.empty((len(windows), runs, n // 2 + 1, channels), dtype=complex), 0.0
        for few in few_channels(runs * n, channels, MANY_NUMBERS):
            y = outputs[..., few] / unit
            slope = (t @ y) / max(float(t @ t), 1.0)
            y -= y.mean(axis=1, keepdims=True)
            y -= t[:, None] * slope[:, None, :]
            power += float(np.einsum("rnl,rnl->", y, y)) / (runs * n)
            for under, window in zip(lines, windows, strict=True):
                under[..., few] = fft.rfft(y * window[:, None], axis=1)
        return cls(lines.reshape(-1, *lines.shape[2:]), signals.sampling_rate / n, power, signals.sampling_rate)
