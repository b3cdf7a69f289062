"""Decompose the cross spectra of ambient records into singular values and vectors (FDD), and pick their peaks (enhanced FDD)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from modalscope.data.records import Signals
from modalscope.data.sizes import check_size
from modalscope.numerics.arguments import named, plain_methods
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray, check_count
from modalscope.signals.preprocess.spectra import Segments, cross_spectra, segment_transforms

#: Minimum prominence of a peak, a factor in power (6 dB).
_PROMINENCE = 4.0

#: Minimum MAC of the first vectors of a peak's bell; the levels between which its decay is fitted, and the minimum number of samples there.
_BELL_MAC, _DECAY_LEVELS, _MIN_DECAY_SAMPLES = 0.8, (0.9, 0.3), 5


class DampedPeaks(NamedTuple):
    """Peaks of a decomposition: frequencies (Hz), damping ratios (NaN where a bell has too few lines), shapes (l, n)."""

    frequencies: RealArray
    damping_ratios: RealArray
    shapes: ComplexArray


class Decomposition(NamedTuple):
    """Singular values and vectors of the cross spectral matrix of the outputs, line by line.

    Attributes
    ----------
    frequencies : array, (F,)
        Hz.
    singular_values : array, (F, k)
        Power spectral densities, unit^2 / Hz, largest first: k = min(l, averages), as all others are zero.
    vectors : array, (F, l, k)
        Left singular vectors in columns: near a resonance the first is the mode's shape.
    averages : int
        Segments averaged.
    window : array, (samples,)
        Of every segment.
    """

    frequencies: RealArray
    singular_values: RealArray
    vectors: ComplexArray
    averages: int
    window: RealArray

    def peaks(self, count: int | None = None) -> tuple[RealArray, ComplexArray]:
        """Return frequencies (n,) and shapes (l, n) of the first singular value's peaks, in order of frequency.

        A peak has a prominence of at least 6 dB.

        Parameters
        ----------
        count : int, optional
            How many, the most prominent ones; all by default.
        """
        places = self._peaks(count)
        return self.frequencies[places], np.ascontiguousarray(self.vectors[places, :, 0].T)

    def damped_peaks(self, count: int | None = None) -> DampedPeaks:
        """Return frequencies, damping ratios and shapes of the peaks by the decay of their correlations (enhanced FDD).

        Around a peak the spectrum u* S u, with u its singular vector, is that of one mode where the MAC of the first vectors with u is
        above 0.8. Its inverse transform, over the correlation of the window, is that of the mode: the logarithm of its envelope falls by
        zeta w t, its phase turns by w t.

        Parameters
        ----------
        count : int, optional
            As in `peaks`.

        References
        ----------
        Brincker, Ventura and Andersen, "Damping estimation by frequency domain decomposition", IMAC 19, 2001; Zhang, Wang and Tamura, "A
        frequency-spatial domain decomposition (FSDD) method", Mechanical Systems and Signal Processing 24, 2010.
        """
        places = self._peaks(count)
        f, zeta = np.array([self._decay(place) for place in places]).reshape(-1, 2).T
        return DampedPeaks(f, zeta, np.ascontiguousarray(self.vectors[places, :, 0].T))

    def _decay(self, place: int) -> tuple[float, float]:
        """Return frequency (Hz) and damping ratio of the bell around a line; the ratio is NaN where it has too few lines."""
        u = self.vectors[place, :, 0]
        other = np.flatnonzero(np.abs(self.vectors[:, :, 0] @ u.conj()) ** 2 <= _BELL_MAC)
        first = int(np.max(other[other < place], initial=-1)) + 1
        last = int(np.min(other[other > place], initial=len(self.vectors)))
        power = np.einsum("fk,fk->f", self.singular_values, np.abs(np.einsum("flk,l->fk", self.vectors, u.conj())) ** 2)
        bell = np.zeros(self.window.size, dtype=complex)
        bell[first:last] = power[first:last]
        lags = self.window.size // 2
        window = scipy.signal.correlate(self.window, self.window)[self.window.size - 1 :][:lags]
        decay = np.fft.ifft(bell)[:lags] / (window / window[0])
        size = np.abs(decay) / np.abs(decay[0])
        ends = np.flatnonzero(size < _DECAY_LEVELS[1])
        used = np.arange(int(np.argmax(size < _DECAY_LEVELS[0])), int(ends[0]) if ends.size else 0)
        if last - first < _MIN_DECAY_SAMPLES or used.size < _MIN_DECAY_SAMPLES:
            return float(self.frequencies[place]), float("nan")
        step = (self.frequencies[1] - self.frequencies[0]) * self.window.size
        rate = -float(np.polyfit(used / step, np.log(size[used]), 1)[0])
        turning = float(np.polyfit(used / step, np.unwrap(np.angle(decay[used])), 1)[0])
        w = float(np.hypot(turning, rate))
        return w / (2 * np.pi), rate / w

    def _peaks(self, count: int | None) -> IntArray:
        """Return the lines of the peaks of the first singular value."""
        level = np.log(np.maximum(self.singular_values[:, 0], np.finfo(float).tiny))
        places = scipy.signal.find_peaks(level, prominence=np.log(_PROMINENCE))[0]
        if count is not None:
            most = np.argsort(scipy.signal.peak_prominences(level, places)[0])[::-1][: check_count("count", count)]
            places = np.sort(places[most])
        return np.asarray(places)


@named(signals=Signals)
def decomposition(
    signals: Signals, *, segment: int | None = None, overlap: float = 0.5, window: str = "hann"
) -> Decomposition:
    """Compute the frequency-domain decomposition (FDD): singular values of the outputs' cross spectra, which peak at resonances.

    S(f) = sum_i s_i(f) u_i(f) u_i(f)*.

    Parameters
    ----------
    signals : Signals
        The mean of every channel and run is removed; inputs are not used.
    segment : int, optional
        Samples of a segment; a twentieth of a run times the number of runs by default.
    overlap : float
        Part of a segment that the next one shares.
    window : str
        As in `estimate_frf`.

    References
    ----------
    Brincker, Zhang and Andersen, "Modal identification of output-only systems using frequency domain decomposition", Smart
    Materials and Structures 10, 2001.

    Examples
    --------
    >>> t = np.arange(20000) / 100
    >>> y = np.stack([np.sin(2 * np.pi * 5 * t), -np.sin(2 * np.pi * 5 * t)], axis=1)
    >>> y = y + np.random.default_rng(0).standard_normal(y.shape)
    >>> f, shapes = decomposition(Signals(outputs=y, sampling_rate=100.0)).peaks(1)
    >>> f.round(1), round(float((shapes[1, 0] / shapes[0, 0]).real), 1)
    (array([5.]), -1.0)
    """
    check_size(signals)
    outputs, _ = signals.by_run()
    y = outputs - outputs.mean(axis=1, keepdims=True)
    length = max(2, min(signals.samples * signals.runs // 20, signals.samples)) if segment is None else segment
    segments = Segments.of(signals.samples, length, overlap, window)
    averages = len(y) * len(segments.starts)
    if averages < y.shape[2]:  # no more singular values than segments: those of their transforms, squared
        f, X = segment_transforms(y, signals.sampling_rate, segments)
        vectors, root, _ = np.linalg.svd(X, full_matrices=False)
        return Decomposition(f, root**2, vectors, averages, segments.output_window)
    spectra = cross_spectra(y, None, signals.sampling_rate, segments, whole=True)
    vectors, values, _ = np.linalg.svd(spectra.outputs, hermitian=True)
    return Decomposition(spectra.frequencies, values, vectors, averages, segments.output_window)


plain_methods(Decomposition)
