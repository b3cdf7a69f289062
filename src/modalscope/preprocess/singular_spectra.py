"""Frequency-domain decomposition: a quick look at ambient records before anything is identified."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from modalscope.model.checks import ComplexArray, RealArray, check_count, check_kind
from modalscope.model.keywords import named
from modalscope.model.signals import Signals
from modalscope.model.sizes import check_size
from modalscope.preprocess.spectra import Segments, check_window, cross_spectra, segment_starts, window_samples

__all__ = ["Decomposition", "decomposition"]

#: A peak stands out of its surroundings by this factor in power (6 dB).
_STANDS_OUT = 4.0


class Decomposition(NamedTuple):
    """Singular values and vectors of the cross spectral matrix of the outputs, line by line.

    Attributes
    ----------
    frequencies : array, (F,)
        Hz.
    singular_values : array, (F, l)
        Power spectral densities, unit^2 / Hz, largest first.
    vectors : array, (F, l, l)
        Left singular vectors in columns: near a resonance the first is the mode's shape.
    averages : int
        Segments averaged.
    """

    frequencies: RealArray
    singular_values: RealArray
    vectors: ComplexArray
    averages: int

    def peaks(self, count: int | None = None) -> tuple[RealArray, ComplexArray]:
        """Return frequencies (n,) and shapes (l, n) of the first singular value's peaks, in order of frequency.

        A peak stands out of its surroundings by at least 6 dB.

        Parameters
        ----------
        count : int, optional
            How many, those that stand out most; all by default.
        """
        level = np.log(np.maximum(self.singular_values[:, 0], np.finfo(float).tiny))
        places = scipy.signal.find_peaks(level, prominence=np.log(_STANDS_OUT))[0]
        if count is not None:
            most = np.argsort(scipy.signal.peak_prominences(level, places)[0])[::-1][: check_count("count", count)]
            places = np.sort(places[most])
        return self.frequencies[places], np.ascontiguousarray(self.vectors[places, :, 0].T)


@named()
def decomposition(
    signals: Signals, *, segment: int | None = None, overlap: float = 0.5, window: str = "hann"
) -> Decomposition:
    """Show ambient resonances as peaks: singular values of the outputs' cross spectra over frequency (FDD).

    Frequency-domain decomposition: S(f) = sum_i s_i(f) u_i(f) u_i(f)*.

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
    check_kind("decomposition", signals, Signals)
    check_size(signals)
    outputs, _ = signals.by_run()
    y = outputs - outputs.mean(axis=1, keepdims=True)
    length = max(2, min(signals.samples * signals.runs // 20, signals.samples)) if segment is None else segment
    starts = segment_starts(signals.samples, length, overlap)
    w = window_samples(check_window(window), length)
    spectra = cross_spectra(y, None, signals.sampling_rate, Segments(starts, w, w), whole=True)
    vectors, values, _ = np.linalg.svd(spectra.outputs, hermitian=True)
    return Decomposition(spectra.frequencies, values, vectors, spectra.averages)
