"""Tell which modes of different results are the same: frequency, damping and shape in one probability, one assignment on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import betaln, expit

from modalscope.data.modes import ModalModel, Mode
from modalscope.data.shown import figures
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, IntArray, RealArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import assign

#: Part of the modes that are worse than their deviations say, and how many times: the contaminated normal distribution of
#: J. W. Tukey, "A survey of sampling from contaminated distributions", 1960.
_SPOILT, _WIDER = 0.05, 10.0

#: Other modes come evenly over a decade of frequencies and two of damping ratios, on the scale of the logarithm.
_DECADES = np.array([1.0, 2.0])

#: Standard deviation of a frequency in half-power half-bandwidths, and of a damping ratio relative to it, where a result tells none.
_USUAL_FREQUENCY, _USUAL_DAMPING = 0.5, 0.5

#: Smaller MAC are as small: the density of even directions is infinite at zero.
_LEAST_MAC = 0.01

#: Mean of 1 - MAC of one mode measured twice, where deviations of shapes are not known.
_USUAL_MISFIT = 0.02


@dataclass(frozen=True, slots=True)
class Sameness:
    """Whether two modes are the same one.

    Parameters
    ----------
    probability : float
        That they are, where either answer was as likely before.
    distance : float
        Between frequency and damping ratio of both, in standard deviations of the difference.
    mac : float
        Of the shapes on the channels that both have; NaN where these are fewer than two.
    text : str
        All of it in words.
    """

    probability: float
    distance: float
    mac: float
    text: str

    def __bool__(self) -> bool:
        return self.probability > 0.5

    def __str__(self) -> str:
        return self.text


@named()
def same_mode(a: Mode | ModalModel, b: Mode | ModalModel) -> Sameness:
    """Tell whether two modes, of two results or of one, are the same mode.

    p / (1 - p) = prod over x = ln f, ln zeta, 1 - MAC of p(x | same) / p(x | different). Of the same mode the logarithms differ by their
    standard deviations (of noise or between groups, the wider), and 1 - MAC is exponential with the mean that the deviations of the shapes
    tell; one in twenty of all these is ten times too small. Different modes come evenly over a decade of frequencies, two decades of
    damping ratios, and all directions of real shapes. Where a result tells no deviations these are half a half-power half-bandwidth, half
    the damping ratio, and a mean of 1 - MAC of .02.

    Parameters
    ----------
    a, b : Mode or ModalModel
        `modes[i]`, or a model of a single mode. Shapes are compared on the outputs of the same labels.

    Returns
    -------
    Sameness

    Raises
    ------
    DataError
        A model of several modes, or none.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> bool(same_mode(modes[0], modes[0])), bool(same_mode(modes[0], modes[1]))
    (True, False)
    """
    one, other = _single("a", a), _single("b", b)
    found = _compared(one, other)
    probability, distance, mac = (float(x[0, 0]) for x in (expit(found.log_ratio), found.distance, found.mac))
    alike = "" if np.isnan(mac) else f", MAC {mac:.2f}"
    text = (
        f"{one.frequencies[0]:.5g} Hz and {other.frequencies[0]:.5g} Hz: {figures(distance, 2)} standard deviations apart{alike}; "
        f"probability {probability:.2g} that they are the same mode"
    )
    return Sameness(probability, distance, mac, text)


def log_ratios(a: ModalModel, b: ModalModel, room: float = 0.0, misfit: float = 0.0) -> RealArray:
    """Return ln p(x | same) / p(x | different) of all pairs of two lists, (n, k); see `same_mode`: above zero they are the same rather.

    `room`: relative standard deviation of a frequency from one list to the other, where the structure itself may differ. `misfit`: mean of
    1 - MAC beyond what deviations tell, then.
    """
    return _compared(a, b, room, misfit).log_ratio


def divided(modes: ModalModel, level: RealArray) -> ModalModel:
    """Return modes with shapes, and their deviations, divided by levels of the outputs (l,), in which no unit counts."""
    level, stated = level[:, None], modes.shapes_std
    return replace(modes, shapes=modes.shapes / level, shapes_std=None if stated is None else stated / level)


def same_modes(a: ModalModel, b: ModalModel) -> tuple[IntArray, IntArray]:
    """Return pairs of modes of two lists that are the same rather, each mode at most once, with the largest sum of log ratios."""
    return likeliest(log_ratios(a, b))


def likeliest(log_ratio: RealArray) -> tuple[IntArray, IntArray]:
    """Return rows and columns of the pairs above zero with the largest sum, each row and column at most once."""
    rows, columns = assign(-np.maximum(log_ratio, 0.0))
    kept = log_ratio[rows, columns] > 0
    return rows[kept], columns[kept]


def _single(name: str, given: Mode | ModalModel) -> ModalModel:
    check_kind(name, given, (Mode, ModalModel))
    if isinstance(given, Mode):
        return given.modes.take([given.index])
    if len(given) != 1:
        raise DataError(f"{name} needs a single mode", f"it has {len(given)}", f"Give one, such as {name}[0].")
    return given


class _Compared(NamedTuple):
    """Of all pairs of two lists (n, k): ln of the ratio, distance in standard deviations, and MAC; NaN without common outputs."""

    log_ratio: RealArray
    distance: RealArray
    mac: RealArray


def _compared(a: ModalModel, b: ModalModel, room: float = 0.0, misfit: float = 0.0) -> _Compared:
    logs = [np.log(np.maximum(np.abs([each.frequencies, each.damping_ratios]), 1e-300)) for each in (a, b)]
    spread = np.hypot(_deviations(a)[:, :, None], _deviations(b)[:, None])
    spread[0] = np.hypot(spread[0], room)
    apart = logs[0][:, :, None] - logs[1][:, None]
    told = (a.damping_ratios > 0)[:, None] & (b.damping_ratios > 0)  # a model without damping tells nothing of it
    decades = (np.log(10) * _DECADES)[:, None, None]
    usual = (1 - _SPOILT) * _normal(apart, spread) + _SPOILT * _normal(apart, _WIDER * spread)
    each = np.log(np.maximum(usual * decades, 1e-300))
    each[1] = np.where(told, each[1], 0.0)
    away = np.where(np.stack([np.ones_like(told), told]), apart / spread, 0.0)
    mac, of_shape = _of_shapes(a, b, misfit)
    return _Compared(each.sum(axis=0) + of_shape, np.linalg.norm(away, axis=0), mac)


def _normal(x: RealArray, deviation: RealArray) -> RealArray:
    return np.asarray(np.exp(-0.5 * (x / deviation) ** 2) / (np.sqrt(2 * np.pi) * deviation))


def _deviations(modes: ModalModel) -> RealArray:
    """Return the standard deviations of ln f and ln zeta, (2, n): the wider of those that are known, else the usual ones."""
    f, zeta = modes.frequencies, np.maximum(np.abs(modes.damping_ratios), 1e-300)
    found = []
    for value, usual, fields in (
        (f, _USUAL_FREQUENCY * zeta, ("frequencies_std", "frequencies_repeatability")),
        (zeta, np.full(len(f), _USUAL_DAMPING), ("damping_ratios_std", "damping_ratios_repeatability")),
    ):
        columns = [np.asarray(column) / value for name in fields if (column := getattr(modes, name)) is not None]
        known = [np.where(np.isfinite(column) & (column > 0), column, np.nan) for column in columns]
        widest = np.fmax.reduce([np.full(len(f), np.nan), *known])
        found.append(np.maximum(np.where(np.isnan(widest), usual, widest), 1e-12))
    return np.array(found)


def _of_shapes(a: ModalModel, b: ModalModel, misfit: float) -> tuple[RealArray, RealArray]:
    """Return the MAC on the outputs that both have, and ln of the ratio of its densities, (n, k) each; NaN and 0 where these are too few.

    Real directions of n outputs that come evenly have 1 - MAC = x with the density x^((n - 3) / 2) (1 - x)^(-1/2) / B((n - 1) / 2, 1 / 2).

    `misfit`: mean of 1 - MAC of the same mode beyond what deviations tell.
    """
    place = {dof: k for k, dof in enumerate(b.output_dofs)}
    rows = [i for i, dof in enumerate(a.output_dofs) if dof in place]
    unknown = np.full((len(a), len(b)), np.nan)
    if (n := len(rows)) < 2:
        return unknown, np.zeros(unknown.shape)
    others = [place[a.output_dofs[i]] for i in rows]
    u, v = a.shapes[rows], b.shapes[others]
    size = np.outer(*(np.sum(np.abs(shapes) ** 2, axis=0) for shapes in (u, v)))
    seen = size > 0
    mac = np.where(seen, np.minimum(np.abs(u.conj().T @ v) ** 2 / np.where(seen, size, 1), 1.0), np.nan)
    mean = np.maximum(_misfit(a, u, rows)[:, None] + _misfit(b, v, others) + misfit, 1e-12)
    x = np.maximum(1 - np.where(seen, mac, 0), mean / 100)
    log_even = (n - 3) / 2 * np.log(x) - 0.5 * np.log(np.maximum(1 - x, _LEAST_MAC)) - betaln((n - 1) / 2, 0.5)
    same = (1 - _SPOILT) * np.exp(-x / mean) / mean + _SPOILT * np.exp(-x / (_WIDER * mean)) / (_WIDER * mean)
    return mac, np.where(seen, np.log(np.maximum(same, 1e-300)) - log_even, 0.0)


def _misfit(modes: ModalModel, shapes: ComplexArray, rows: list[int]) -> RealArray:
    """Return the mean of 1 - MAC that the deviations of shapes tell, (n,): their squares over the own; half the usual where unknown."""
    if modes.shapes_std is None:
        return np.full(len(modes), _USUAL_MISFIT / 2)
    found = np.sum(modes.shapes_std[rows] ** 2, axis=0) / np.maximum(np.sum(np.abs(shapes) ** 2, axis=0), 1e-300)
    return np.where(np.isfinite(found), found, _USUAL_MISFIT / 2)
