"""Tell whether two modes of different results are the same one: frequency, damping and shape in one probability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, expit

from modalscope.data.modes import ModalModel, Mode
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import RealArray, check_kind
from modalscope.numerics.errors import DataError

#: Part of the modes that are worse than their deviations say, and how many times: the contaminated normal distribution of
#: J. W. Tukey, "A survey of sampling from contaminated distributions", 1960.
_SPOILT, _WIDER = 0.05, 10.0

#: Other modes come evenly over a decade of frequencies and two of damping ratios, on the scale of the logarithm.
_DECADES_OF_FREQUENCY, _DECADES_OF_DAMPING = 1.0, 2.0

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
    f, zeta = (np.array([mode.frequency, mode.damping_ratio]) for mode in (one, other))
    deviations = [_deviations(mode) for mode in (one, other)]
    apart = np.log(np.maximum(f, 1e-300) / np.maximum(zeta, 1e-300))
    spread = np.hypot(*deviations)
    decades = np.log(10) * np.array([_DECADES_OF_FREQUENCY, _DECADES_OF_DAMPING])
    usual = (1 - _SPOILT) * _normal(apart, spread) + _SPOILT * _normal(apart, _WIDER * spread)
    log_ratio = float(np.sum(np.log(np.maximum(usual * decades, 1e-300))))
    mac, of_shape = _of_shapes(one, other)
    probability = float(expit(log_ratio + of_shape))
    distance = float(np.linalg.norm(apart / spread))
    alike = "" if np.isnan(mac) else f", MAC {mac:.2f}"
    text = (
        f"{one.frequency:.5g} Hz and {other.frequency:.5g} Hz: {distance:.2g} standard deviations apart{alike}; "
        f"probability {probability:.2g} that they are the same mode"
    )
    return Sameness(probability, distance, mac, text)


def _single(name: str, given: Mode | ModalModel) -> Mode:
    check_kind(name, given, (Mode, ModalModel))
    if isinstance(given, Mode):
        return given
    if len(given) != 1:
        raise DataError(f"{name} needs a single mode", f"it has {len(given)}", f"Give one, such as {name}[0].")
    return given[0]


def _normal(x: RealArray, deviation: RealArray) -> RealArray:
    return np.asarray(np.exp(-0.5 * (x / deviation) ** 2) / (np.sqrt(2 * np.pi) * deviation))


def _deviations(mode: Mode) -> RealArray:
    """Return the standard deviations of ln f and ln zeta, (2,): the wider of those that are known, else the usual ones."""
    f, zeta = mode.frequency, max(abs(mode.damping_ratio), 1e-300)
    found = []
    for value, usual, fields in (
        (f, _USUAL_FREQUENCY * zeta, ("frequencies_std", "frequencies_repeatability")),
        (zeta, _USUAL_DAMPING, ("damping_ratios_std", "damping_ratios_repeatability")),
    ):
        columns = [getattr(mode.modes, name) for name in fields]
        known = [float(column[mode.index]) / value for column in columns if column is not None]
        found.append(max((each for each in known if np.isfinite(each) and each > 0), default=usual))
    return np.array(found)


def _of_shapes(one: Mode, other: Mode) -> tuple[float, float]:
    """Return the MAC on the channels that both have, and the log ratio of its densities; NaN and 0 where these are fewer than two.

    Real directions of n channels that come evenly have 1 - MAC = x with the density x^((n - 3) / 2) (1 - x)^(-1/2) / B((n - 1) / 2, 1 / 2).
    """
    shared = [dof for dof in one.modes.output_dofs if dof in other.modes.output_dofs]
    if len(shared) < 2:
        return np.nan, 0.0
    rows = [[mode.modes.output_dofs.index(dof) for dof in shared] for mode in (one, other)]
    u, v = (mode.shape[row] for mode, row in zip((one, other), rows, strict=True))
    size = float(np.vdot(u, u).real * np.vdot(v, v).real)
    if size == 0:
        return np.nan, 0.0
    mac = min(float(abs(np.vdot(u, v)) ** 2 / size), 1.0)
    means = [_misfit(mode, row) for mode, row in zip((one, other), rows, strict=True)]
    mean = max(sum(means), 1e-12)
    x, n = max(1 - mac, mean / 100), len(shared)
    log_even = (n - 3) / 2 * np.log(x) - 0.5 * np.log(max(mac, _LEAST_MAC)) - betaln((n - 1) / 2, 0.5)
    same = sum(part * np.exp(-x / m) / m for part, m in ((1 - _SPOILT, mean), (_SPOILT, _WIDER * mean)))
    return mac, float(np.log(max(same, 1e-300)) - log_even)


def _misfit(mode: Mode, rows: list[int]) -> float:
    """Return the mean of 1 - MAC that the deviations of a shape tell: their squares over its own; half the usual where they are unknown."""
    std = mode.modes.shapes_std
    if std is None or not np.isfinite(std[rows, mode.index]).all():
        return _USUAL_MISFIT / 2
    shape = mode.shape[rows]
    return float(np.sum(std[rows, mode.index] ** 2) / np.vdot(shape, shape).real)
