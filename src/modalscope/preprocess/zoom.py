"""Compute the spectrum of a narrow band at fine resolution, by the chirp-z transform or by frequency shift and decimation.

The chirp transform is not that of SciPy, which does not reduce phases in integers: its error is 1e-10 for 16 000 samples, 1e-8 for two
million.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft

from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_count
from modalscope.numerics.errors import DataError
from modalscope.preprocess.spectra import Transform

ZOOMS = ("chirp-z", "decimation")

#: Attenuation of the low-pass behind the frequency shift, dB.
_STOP_BAND = 100.0


def zoom_lines(band: tuple[float, float], length: int, sampling_rate: float, lines: int | None) -> RealArray:
    """Return the lines of a band: those of the transform of `length` samples, or `lines` equally spaced ones, ends included.

    Raises DataError for a band outside 0 to half the sampling rate, or with fewer than two lines.
    """
    low, high = float(band[0]), float(band[1])
    if not 0 <= low < high <= sampling_rate / 2:
        have = f"the record contains 0 to {sampling_rate / 2:g} Hz"
        raise DataError(
            f"a zoom into {low:g} to {high:g} Hz was asked", have, "Give the lower end first, within these."
        )
    if lines is not None:
        return np.linspace(low, high, check_count("zoom_lines", lines, least=2))
    step = sampling_rate / length
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    if last <= first:
        have = f"segments of {length} samples give lines {step:g} Hz apart, fewer than two inside"
        change = "Lengthen segment, widen the band, or give zoom_lines."
        raise DataError(f"a zoom into {low:g} to {high:g} Hz was asked", have, change)
    return np.asarray(np.arange(first, last + 1) * step, dtype=float)


def chirp_z(samples: Array, frequencies: RealArray, sampling_rate: float) -> ComplexArray:
    """Return X(f) = sum_k x(k) exp(-j 2 pi f k / fs) on equally spaced lines, along axis 1 of (p, N, channels).

    Bluestein's convolution: with n k = (n^2 + k^2 - (n - k)^2) / 2 the sum over k is a convolution with a chirp, which
    costs three fast transforms for any lines. On lines of the record's transform the phase of the chirp is reduced to one turn in
    integers, so that long records lose no digits.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal((1, 1000, 1))
    >>> zoomed = chirp_z(x, np.arange(100, 120) * 1.0, 1000.0)
    >>> bool(np.allclose(zoomed, np.fft.rfft(x, axis=1)[:, 100:120]))
    True
    """
    N, count = samples.shape[1], frequencies.size
    step = (frequencies[-1] - frequencies[0]) / (count - 1) / sampling_rate if count > 1 else 0.0
    k = np.arange(max(N, count))
    chirp = np.exp(-2j * np.pi * _turns(k * k, step / 2, 2 * N))
    start = np.exp(-2j * np.pi * _turns(k[:N], frequencies[0] / sampling_rate, N))
    length = fft.next_fast_len(N + count - 1)
    kernel = np.zeros(length, dtype=complex)
    kernel[:count] = np.conj(chirp[:count])
    kernel[length - N + 1 :] = np.conj(chirp[1:N][::-1])
    weighted = fft.fft(samples * (start * chirp[:N])[:, None], n=length, axis=1)
    product = fft.ifft(weighted * fft.fft(kernel)[:, None], axis=1)[:, :count]
    return np.asarray(product * chirp[:count, None])


def _turns(whole: Array, part: float, grid: int) -> RealArray:
    """Return whole * part modulo 1, in integers when `part` is a multiple of 1 / grid to rounding."""
    multiple = round(part * grid)
    if abs(part * grid - multiple) < 1e-9:
        return np.asarray(whole % grid * (multiple % grid) % grid / grid)
    return np.asarray(np.mod(whole * part, 1.0))


class Shifted(NamedTuple):
    """Records shifted so that `centre` lies at 0 Hz, at a lower sampling rate: complex."""

    outputs: ComplexArray
    inputs: ComplexArray
    sampling_rate: float
    centre: float
    factor: int

    def transform(self, length: int, frequencies: RealArray) -> Transform:
        """Return the transform of segments of `length` samples to lines of its grid around the centre."""
        step = self.sampling_rate / length
        bins = np.rint((frequencies - self.centre) / step).astype(int)
        return Transform(frequencies, lambda x: np.asarray(fft.fft(x, axis=1)[:, bins % length]))


def heterodyne(
    outputs: RealArray, inputs: RealArray, sampling_rate: float, frequencies: RealArray, segment: int
) -> Shifted:
    """Shift the band of the lines to 0 Hz, low-pass filter and keep one sample in q, with q a divisor of the segment.

    q is the largest that leaves twice the width of the band. The filter (Kaiser window, 100 dB, no delay) is the same for all channels
    and cancels in every ratio.
    """
    step = sampling_rate / segment
    width = float(frequencies[-1] - frequencies[0]) + 2 * step
    most = max(int(sampling_rate / (2 * width)), 1)
    factor = max(q for q in range(1, most + 1) if segment % q == 0)
    middle = round(float(frequencies[0] + frequencies[-1]) / 2 / step)
    rate = sampling_rate / factor
    # the pass-band is the band; frequencies from rate - width / 2 on would alias into it
    taps, beta = scipy.signal.kaiserord(_STOP_BAND, (rate - width) / (sampling_rate / 2))
    low_pass = np.ones(1)
    if factor > 1:
        low_pass = scipy.signal.firwin(taps | 1, rate / 2, window=("kaiser", beta), fs=sampling_rate)
    phase = np.arange(outputs.shape[1]) * middle % segment / segment
    mixer = np.exp(-2j * np.pi * phase)

    def change(x: RealArray) -> ComplexArray:
        mixed = x * mixer[:, None]
        smooth = scipy.signal.oaconvolve(mixed, low_pass[None, :, None], mode="same", axes=1)
        return np.ascontiguousarray(smooth[:, ::factor])

    return Shifted(change(outputs), change(inputs), rate, middle * step, factor)
