"""How well a factor of the data matrix follows the modes read off it: EMAC and amplitude coherence of one side."""

from __future__ import annotations

import numpy as np

from modalscope.blocks.matrix import Evolved
from modalscope.modal.indicators import amplitude_coherence, decay_step, emac_channels, weighted_mean
from modalscope.model.checks import Array, ComplexArray, RealArray

__all__ = ["side_coherence", "side_emac"]


def side_emac(side: Evolved) -> RealArray:
    """Return the EMAC of one side: an identified block in states against the first block of the modes, grown; NaN where nothing is seen."""
    step = decay_step(side.evolution)
    identified = np.einsum("jcN,Nj->cj", side.blocks[step], side.states, optimize=True)
    expected = side.first * side.evolution[step, np.arange(step.size)]
    return _seen(side, weighted_mean(emac_channels(identified, expected), side.first))


def side_coherence(side: Evolved) -> RealArray:
    """Return the amplitude coherence of one side, over all its blocks; NaN where nothing is seen."""
    return _seen(side, amplitude_coherence(_times(side.blocks, side.states), side.first, side.evolution))


def _seen(side: Evolved, values: RealArray) -> RealArray:
    return values if side.seen is None else np.where(side.seen, values, np.nan)


def _times(blocks: Array, states: ComplexArray) -> ComplexArray:
    """Return blocks (K, c, N) times states (N, k); real blocks as one product of real arrays."""
    flat = blocks.reshape(-1, blocks.shape[2])
    if np.iscomplexobj(flat):
        return np.asarray(flat @ states).reshape(*blocks.shape[:2], -1)
    real = np.ascontiguousarray(states).view(np.float64)
    product = np.ascontiguousarray(flat @ real)
    return product.view(np.complex128).reshape(*blocks.shape[:2], -1)
