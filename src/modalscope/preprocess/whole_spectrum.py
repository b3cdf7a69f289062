"""The transform of a whole record: made once, for its levels and for the lines of machines in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from scipy import fft

from modalscope.model.checks import Array, ComplexArray, RealArray
from modalscope.model.signals import Signals

__all__ = ["Spectrum", "binary_size"]


class Spectrum(NamedTuple):
    """Transforms of the outputs of all runs, without straight lines and under a Hann window.

    Attributes
    ----------
    lines : array of complex, (R, lines, l)
        Whose squares are the power of a line, all outputs over one number.
    step : float
        Distance of lines, Hz.
    power : float
        Of all outputs.
    rate : float
        Samples a second.
    """

    lines: ComplexArray
    step: float
    power: float
    rate: float

    @classmethod
    def of(cls, signals: Signals) -> Spectrum:
        """Return that of a record.

        Parameters
        ----------
        signals : Signals
        """
        outputs, _ = signals.by_run()
        y = _without_straight_lines(outputs / binary_size(outputs))
        power = float(np.einsum("rnl,rnl->", y, y)) / (len(y) * y.shape[1])
        window = scipy.signal.get_window("hann", y.shape[1])
        y *= (window * np.sqrt(2 / (y.shape[1] * float(window @ window))))[:, None]
        return cls(np.asarray(fft.rfft(y, axis=1)), signals.sampling_rate / y.shape[1], power, signals.sampling_rate)


def _without_straight_lines(y: RealArray) -> RealArray:
    """Return runs (R, n, l) without the straight line that fits each channel best, in their place."""
    t = np.arange(y.shape[1]) - (y.shape[1] - 1) / 2
    slope = (t @ y) / max(float(t @ t), 1.0)
    y -= y.mean(axis=1, keepdims=True)
    y -= t[:, None] * slope[:, None, :]
    return y


def binary_size(x: Array) -> float:
    """Return a power of two near the largest value, so that squares of x over it are numbers whatever its unit; 1 of zeros.

    Parameters
    ----------
    x : array
    """
    largest = max(float(np.max(x, initial=0.0)), -float(np.min(x, initial=0.0)))
    return float(np.ldexp(1.0, int(np.frexp(largest)[1]) - 1)) if largest else 1.0
