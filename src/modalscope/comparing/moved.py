"""How the noise moves the modes of every method, and of two methods together: they read the same data and share its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.blocks.influence import Lines
from modalscope.identification.sweep import Sweep
from modalscope.judging.replicates import nearest_order
from modalscope.model.checks import ComplexArray, DataError, IntArray, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response
from modalscope.uncertainty.covariance import covariances_of_poles
from modalscope.uncertainty.influence import PoleInfluence, influence_on
from modalscope.uncertainty.noise import Noise
from modalscope.uncertainty.of_modes import SPLIT

__all__ = ["Moved", "covariance", "moved_by_noise"]

#: Lines that influences are kept on; of more every second to eighth stands for its neighbours.
_LINES, _MOST = 2000, 8


@dataclass(frozen=True, eq=False, slots=True)
class Moved:
    """What noise in the data does to the modes of one method.

    Parameters
    ----------
    response : Response
        The data: only methods on the same ones share their noise value by value.
    noise : Noise
    influence : PoleInfluence
        On the poles nearest to the modes, at the order that is nearest to all of them.
    poles : array of complex, (k,)
        These poles, rad/s.
    row : array of int, (n,)
        Where each mode stands among them; -1 for a mode that this order has not, or has split in two.
    """

    response: Response
    noise: Noise
    influence: PoleInfluence
    poles: ComplexArray
    row: IntArray


def moved_by_noise(found: Sweep, diagram: StabilizationDiagram, modes: ModalModel) -> Moved | None:
    """Return how the noise moves modes that were selected from the diagram of a sweep; None where that is not known.

    Parameters
    ----------
    found : Sweep
    diagram : StabilizationDiagram
    modes : ModalModel
    """
    if found.noise is None or not len(modes):
        return None
    pipeline = found.pipeline
    cut = found.cut(nearest_order(diagram, modes))
    response = pipeline.matrix.judged
    poles = cut.modal.poles + response.added_damping
    away = np.abs(poles[:, None] - modes.poles) / np.abs(modes.poles.real)
    nearest = np.argmin(away, axis=0)
    there = away[nearest, np.arange(len(modes))] < 1
    if cut.std is not None and modes.frequencies_std is not None:  # a split mode is not the mode
        there &= ~(cut.std.frequency[nearest] > SPLIT * modes.frequencies_std)
    index = nearest[there]
    if not index.size:  # modes that no pole of the order is: what the orders do not show was found in the residual
        return None
    try:
        influence = influence_on(
            pipeline.matrix, pipeline.realization, cut.order, cut.triple, cut.modal.eigen.take(index), _lines(response)
        )
    except DataError:  # a way of reading poles off whose first order is not known
        return None
    noise = found.noise_beside(cut)
    row = np.where(there, np.cumsum(there) - 1, -1)
    return None if noise is None else Moved(response, noise, influence, poles[index], row)


def _lines(response: Response) -> Lines | None:
    """Return the same lines for every method on the same data; None for all."""
    every = int(np.clip(response.count // _LINES, 1, _MOST))
    if every == 1 or response.grid is None or response.added_damping > 0:
        return None
    index = np.arange(every // 2, response.count, every)
    return Lines(index, np.full(index.size, float(every)))


def covariance(one: Moved, other: Moved, rows: IntArray, beside: IntArray, noise: Noise) -> tuple[RealArray, RealArray]:
    """Return the covariances of frequencies (Hz) and of damping ratios of modes of two methods, one to one.

    Parameters
    ----------
    one, other : Moved
        Of the same data.
    rows, beside : array of int, (k,)
        Which of their poles.
    noise : Noise
    """
    with np.errstate(all="ignore"):
        moments = noise.moments(one.influence.take(rows), other.influence.take(beside))
        f, zeta = covariances_of_poles(one.poles[rows], other.poles[beside], moments.covariance)
        return f, np.where(noise.damping_is_told(one.poles[rows]), zeta, np.nan)
