"""How much a fit leaves of the data, outputs brought level: from its own coefficients, or by rebuilding."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modalscope.blocks.triple import ModalFit
from modalscope.model.checks import Array, RealArray
from modalscope.model.response import Response

__all__ = ["Misfit"]


@dataclass(frozen=True, eq=False)
class Misfit:
    """norm(measured - rebuilt) / norm(measured), each output divided by a scale.

    Parameters
    ----------
    response : Response
    scale : array, (l,)
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

    def of_fit(self, poles: Array, fit: ModalFit) -> float:
        """Return the misfit of a fit, rebuilt some lines or samples after the other.

        Parameters
        ----------
        poles : array of complex, (k,)
            rad/s, as they are in the data.
        fit : ModalFit
        """
        basis = fit.basis or self.response.basis(poles, fit.powers)
        channels = basis.data.shape[1:]
        level = np.repeat(1 / self.scale, channels[1]).reshape(channels)  # in one piece, as what is left
        energy = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for left in basis.missed(fit.shapes, fit.participation, fit.terms[: basis.terms.shape[1]]):
                left *= level
                energy += float(np.vdot(left, left))
            return self._of_energy(energy)
