"""Data matrices of sampled systems: their poles lie in the z-plane, and a mode goes on by z from one block to the next."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from modalscope.blocks.matrix import DataMatrix
from modalscope.model.checks import Array, ComplexArray
from modalscope.model.poles import powers_of, to_continuous, to_discrete

__all__ = ["SampledMatrix"]

#: Growth over all blocks, in exponents of e, whose square is a number with room for sums.
_GROWN = 300.0


class SampledMatrix(DataMatrix):
    """Block rows are samples, one after the other."""

    @property
    @abstractmethod
    def dt(self) -> float:
        """Sampling interval, seconds."""

    def to_s(self, poles: Array) -> ComplexArray:
        """Continuous poles ln(z) fs, rad/s."""
        return to_continuous(poles, self.dt)

    def from_s(self, poles: Array) -> ComplexArray:
        """Poles of the sampled system, exp(s / fs)."""
        return to_discrete(poles, self.dt)

    def evolution(self, poles: Array, blocks: int) -> ComplexArray:
        """Return z^k for blocks k = 0, 1, ...: how a mode runs down the rows; what outgrows all numbers is held below them."""
        most = np.exp(_GROWN / max(blocks, 1))
        return powers_of(np.asarray(poles) * (most / np.maximum(np.abs(poles), most)), blocks)
