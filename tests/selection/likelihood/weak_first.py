"""Accelerances whose errors are a part of themselves: the first mode lies far below the others, and below the errors of their peaks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modalscope.data import FrequencyResponse
from modalscope.numerics.checks import RealArray
from modalscope.numerics.functions.poles import poles_from

#: Frequencies of a cantilever relative to its sixth.
_CANTILEVER = np.array([0.0118, 0.0735, 0.206, 0.405, 0.669, 1.0])


class WeakFirst(NamedTuple):
    """Responses, and frequencies (Hz) and damping ratios of their modes, (6,)."""

    response: FrequencyResponse
    frequencies: RealArray
    damping_ratios: RealArray


def weak_first(seed: int) -> WeakFirst:
    """Return six modes at one point (even seeds) or five, errors of .3, 1 or 3 % of the response, the first mode 20 to 50 dB down."""
    rng = np.random.default_rng([seed, 4141])
    f = 965 * _CANTILEVER * rng.uniform(0.97, 1.03, 6)
    zeta = np.exp(rng.uniform(np.log(0.004), np.log(0.01), 6))
    lines, error = np.arange(0.25, 1100.1, 0.25), (0.003, 0.01, 0.03)[seed % 3]
    peaks = np.append(10 ** (-rng.uniform(20, 50) / 20), rng.uniform(0.3, 1, 5))
    shapes = rng.uniform(0.3, 2, (5 if seed % 2 else 1, 6)) * rng.choice([-1, 1], 6)
    s, w = poles_from(f, zeta), 2j * np.pi * lines[:, None]
    R = shapes / np.mean(np.abs(shapes), axis=0) * peaks * zeta / (1j * np.abs(s))
    H = w**2 * ((1 / (w - s)) @ R.T + (1 / (w - s.conj())) @ R.conj().T)

    def noise() -> np.ndarray:
        return (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2)

    H = H + error * np.abs(H) * noise() + 1e-4 * np.sqrt(np.mean(np.abs(H) ** 2)) * noise()
    return WeakFirst(FrequencyResponse(values=H[:, :, None], frequencies=lines, quantity="acceleration"), f, zeta)
