"""How alike identified amplitudes and expected ones are, from their products: what amplitude coherence and EMAC are made of."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import Array, RealArray

__all__ = ["agreement", "coherence"]


def coherence(inner: Array, identified: Array, expected: Array) -> RealArray:
    """Return |<q, e>| / (|q| |e|) of each mode from the inner product and the squared norms, 0 to 1; 0 without amplitude."""
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.abs(inner) / (np.sqrt(identified) * np.sqrt(expected))
    return np.where(np.isfinite(value), np.minimum(value, 1.0), 0.0)


def agreement(real: RealArray, imaginary: RealArray, identified: RealArray, expected: RealArray) -> RealArray:
    """Return `emac_channels` from Re and Im of a conj(e), whose angle is the phase between both, |a|^2 and |e|^2."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore", under="ignore"):
        ratio = np.sqrt(np.minimum(identified, expected) / np.maximum(identified, expected))
    phase = np.arctan2(np.abs(imaginary), real)
    # where both are zero, or beyond numbers, there is no ratio, and nothing agrees
    return np.asarray(np.fmax(ratio * (1 - 4 / np.pi * phase), 0.0))
