"""Measurement noise: white, a fraction of each channel's RMS."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from modalscope.model.checks import (
    Array,
    DataError,
    check_count,
    check_number,
)
from modalscope.model.entries import plainly
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.signals import Signals

__all__ = ["Seed", "add_noise", "generator", "white_noise"]

#: What makes random numbers repeatable; None draws new ones each time.
Seed = int | np.random.Generator | None

Noisy = TypeVar("Noisy", ImpulseResponse, FrequencyResponse, Signals)


def generator(seed: Seed) -> np.random.Generator:
    """Return the random numbers of a seed, or raise when it is not a whole number, a generator or None."""
    if seed is not None and not isinstance(seed, np.random.Generator):
        check_count("seed", seed, least=0)
    return np.random.default_rng(seed)


def white_noise(values: Array, fraction: float, rng: np.random.Generator, axis: int = 0) -> Array:
    """Return Gaussian noise of the RMS `fraction` times that of `values` along `axis`; circular when values are complex."""
    if not (isinstance(fraction, int | float | np.number) and 0 <= fraction < np.inf):
        raise DataError(
            "noise needs a fraction of the channel's RMS, 0 or more", f"it is {fraction!r}", "Give 0.01 for 40 dB."
        )
    scale = fraction * np.sqrt(np.mean(np.abs(values) ** 2, axis=axis, keepdims=True))
    if values.dtype.kind == "c":
        return np.asarray(
            scale / np.sqrt(2) * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
        )
    return np.asarray(scale * rng.standard_normal(values.shape))


@plainly
def add_noise(data: Noisy, fraction: float, seed: Seed = None) -> Noisy:
    """Return a response or record with white noise on every channel, as a fraction of the channel's RMS.

    Parameters
    ----------
    data : ImpulseResponse, FrequencyResponse or Signals
        Of a record, the outputs get noise.
    fraction : float
        Noise RMS over signal RMS of each channel: 10^(-SNR / 20), so 0.01 is 40 dB. Complex responses get it in equal
        parts on the real and the imaginary part.
    seed : int or numpy Generator, optional
        Makes the noise repeatable.

    Examples
    --------
    >>> clean = Signals(outputs=np.ones((1000, 1)), sampling_rate=1.0)
    >>> noisy = add_noise(clean, 0.1, seed=0)
    >>> round(float(np.std(noisy.outputs)), 1)
    0.1
    """
    rng = generator(seed)
    check_number("noise", fraction)
    note = f"white noise of {100 * fraction:g} % of each channel's RMS added"
    if isinstance(data, Signals):
        return replace(data, outputs=data.outputs + white_noise(data.outputs, fraction, rng, axis=-2)).processed(note)
    return replace(data, values=data.values + white_noise(data.values, fraction, rng)).processed(note)
