"""The noise of a response as users have it: what whitens the data, and the likelihood, significance and covariance that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_kind, check_shape
from modalscope.numerics.errors import DataError
from modalscope.selection.likelihood.covariance import pole_blocks
from modalscope.selection.likelihood.information import inverse, normal
from modalscope.selection.likelihood.likelihood import Point, unit_vectors
from modalscope.selection.likelihood.settling import Settled, settle, task_of

#: The terms of the error model, and where each comes from.
TERMS: Mapping[str, str] = MappingProxyType(
    {
        "rows": "deviation of each line or sample: the stated variance of a response, the fading under an exponential window, else even",
        "outputs": "deviation of each output: the stated variance, else the residual of the modes",
        "inputs": "deviation of each input, which multiplies that of the outputs",
        "variance": "of all whitened values: the squared residual over its degrees of freedom",
        "residual terms": "polynomials of poles outside the band, free in every channel: no noise",
    }
)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Noise:
    """Noise of a response that is white once values are divided by a deviation of their row, output and input (see `TERMS`).

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
    modes : ModalModel
        Whose residual tells the noise where the response states no variance; with participation.

    Raises
    ------
    DataError
        Other data, modes of other channels, no more data than unknowns.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> lines, truth = np.linspace(0.3, 8, 400), chain5().modes(quantity="acceleration")
    >>> frf = chain5().frequency_response(lines, quantity="acceleration", noise=0.01, seed=0)
    >>> noise = Noise(response=frf, modes=truth)
    >>> bool(abs(np.mean(noise.whiten(frf.values - truth.frequency_response(lines).values) ** 2) - 1) < 0.05)
    True
    """

    response: FrequencyResponse | ImpulseResponse
    modes: ModalModel
    _settled: Settled = field(init=False, repr=False)

    def __post_init__(self) -> None:
        check_kind("response of Noise", self.response, (FrequencyResponse, ImpulseResponse))
        check_kind("modes of Noise", self.modes, ModalModel)
        object.__setattr__(self, "_settled", _settled(self.response, self.modes))

    @named()
    def whiten(self, values: Array) -> RealArray:
        """Return values in deviations: real rows, imaginary parts of lines after the real ones, (K, l, m).

        Parameters
        ----------
        values : array, (F, l, m)
        """
        check_shape("values", np.asarray(values), "those of the response", self.response.values.shape)
        problem, each = self._settled.descent.point.problem, np.asarray(values)
        real = np.concatenate([each.real, each.imag]) if np.iscomplexobj(self.response.values) else each.real
        outputs, inputs = problem.sides
        return np.asarray(
            real / problem.rows[:, None, None] / np.outer(outputs, inputs) / np.sqrt(self._settled.variance)
        )

    @named(modes=ModalModel)
    def log_likelihood(self, modes: ModalModel) -> float:
        """Return the logarithm of the density of the data under modes, shapes or participation (the longer side) fitted.

        Parameters
        ----------
        modes : ModalModel
        """
        point, variance = self._at(modes), self._settled.variance
        problem = point.problem
        q, p = problem.channels
        deviations = np.log(problem.rows).sum() * q * p
        deviations += len(problem.rows) * np.add.outer(*(np.log(side) for side in problem.sides)).sum()
        count = problem.count
        misfit = point.cost(point.fitted()) / variance
        return float(-(misfit + count * np.log(2 * np.pi * variance)) / 2 - deviations)

    @named(modes=ModalModel)
    def rise(self, modes: ModalModel) -> RealArray:
        """Return twice the logarithm of the likelihood ratio with and without each mode, all linear parts fitted again, (n,).

        Parameters
        ----------
        modes : ModalModel
        """
        return np.asarray(self._at(modes).fitted().gain / self._settled.variance)

    @named(modes=ModalModel)
    def covariance(self, modes: ModalModel) -> RealArray:
        """Return the covariance of the real and the imaginary part of each pole, (n, 2, 2): the Cramér-Rao bound of this noise.

        Parameters
        ----------
        modes : ModalModel
        """
        point = self._at(modes)
        information, _ = normal(point, point.fitted())
        first = 2 * point.sides.shape[1] * np.arange(len(modes))
        return pole_blocks(inverse(information) * self._settled.variance, first)

    def _at(self, modes: ModalModel) -> Point:
        """Return the likelihood at modes."""
        problem = self._settled.descent.point.problem
        outputs, inputs = problem.sides
        sides = modes.shapes.T / outputs if problem.turned else _participation(modes) / inputs
        return problem.at(modes.poles - self.response.added_damping, unit_vectors(sides))


def _settled(response: FrequencyResponse | ImpulseResponse, modes: ModalModel) -> Settled:
    """Return the noise that modes leave, without moving them."""
    task = task_of(response, np.zeros(0, complex), None, None)
    return settle(task, modes.poles - response.added_damping, modes.shapes, _participation(modes), most=0)


def _participation(modes: ModalModel) -> ComplexArray:
    if modes.participation is None:
        raise DataError("the noise of a response:", "its modes have no participation", "Use fit_residues first.")
    return modes.participation
