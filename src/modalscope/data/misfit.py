"""Compute what modes leave of a response: norm(measured - rebuilt) / norm(measured), each output divided by a scale."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.data.response import Response
from modalscope.numerics.checks import Array, RealArray
from modalscope.numerics.functions.pole_basis import ModalBasis


@dataclass(frozen=True, eq=False)
class Misfit:
    """norm(measured - rebuilt) / norm(measured), each output divided by a scale.

    `scale` (l,).
    """

    response: Response
    scale: RealArray

    @cached_property
    def _whole(self) -> float:
        values = self.response.values
        energy = sum(np.einsum("klm,klm->l", part, part) for part in (values.real, values.imag))
        return float(np.sqrt(np.sum(energy / self.scale**2)))

    def of_left(self, left: RealArray) -> float:
        """Return the misfit by the energy (l, m) that is left of every channel."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._of_energy(float(np.sum(left / self.scale[:, None] ** 2)))

    def _of_energy(self, energy: float) -> float:
        ratio = np.sqrt(energy) / self._whole
        return float(ratio) if np.isfinite(ratio) else np.inf

    def of_modes(self, basis: ModalBasis, shapes: Array, participation: Array, terms: Array) -> float:
        """Return the misfit of modes, rebuilt some lines or samples after the other.

        `basis`: of their poles. `shapes` (l, k). `participation` (k, m). `terms` (t, l, m).
        """
        channels = basis.data.shape[1:]
        level = np.repeat(1 / self.scale, channels[1]).reshape(channels)  # in one piece, as what is left
        energy = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for left in basis.missed(shapes, participation, terms[: basis.terms.shape[1]]):
                left *= level
                energy += float(np.vdot(left, left))
            return self._of_energy(energy)
