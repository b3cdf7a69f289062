"""Choose places of sensors and forces before a test, from the modes of a model or of an earlier test (`place`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.analysis.planning.foretold import deviations_foretold, information, slopes_left
from modalscope.data.geometry import indices_of, parse_dof
from modalscope.data.modes import ModalModel
from modalscope.data.responses import FrequencyResponse
from modalscope.data.shown import counted, figures, percent
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray, check_count, check_kind, real_array
from modalscope.numerics.errors import DataError, check_choice

#: What may be made small: the worst deviation of any mode, their mean square, the volume of their ellipsoid, its longest axis.
CRITERIA = ("worst", "A", "D", "E")

#: Lines over a half bandwidth of the narrowest mode, lines beyond the outermost modes in half bandwidths, and lines at most.
_LINES_OF_A_HALF_BANDWIDTH, _BEYOND, _MAX_LINES = 2.0, 20.0, 4000

#: Damping ratio of modes that have none, as those of a model of finite elements.
_DAMPING = 0.01

#: Exchanges of chosen places by others, at most, and the fall of the criterion that one has to bring.
_ROUNDS, _LEAST_FALL = 10, 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class Placement:
    """Places of a test, with what they will determine.

    Parameters
    ----------
    sensors, forces : tuple of str
        Labels, in the order in which they were chosen: the first ones tell most.
    frequencies : array, (n,)
        Hz.
    frequencies_std, damping_ratios_std : array, (n,)
        Foretold standard deviations: Hz, ratio.
    worst : float
        The largest of the relative deviations of damping ratios.
    compared : mapping of name to float
        The same of as many sensors that the rules of the field choose: "effective independence", "kinetic energy".
    """

    sensors: tuple[str, ...]
    forces: tuple[str, ...]
    frequencies: RealArray
    frequencies_std: RealArray
    damping_ratios_std: RealArray
    worst: float
    compared: dict[str, float]

    def __str__(self) -> str:
        rules = ", ".join(
            f"{figures(value / self.worst)} times that by {name}" for name, value in self.compared.items()
        )
        worst = f"Largest interval of a damping ratio (95 %) with the given noise (1 by default): ±{percent(1.96 * self.worst)}"
        return f"Sensors: {', '.join(self.sensors)}\nForces: {', '.join(self.forces)}\n{worst}; {rules}"


@named()
def place(
    modes: ModalModel,
    *,
    sensors: int,
    forces: int = 1,
    noise: ArrayLike = 1.0,
    keep: Iterable[str] = (),
    exclude: Iterable[str] = (),
    force_places: Iterable[str] | None = None,
    triaxial: bool = False,
    criterion: str = "worst",
) -> Placement:
    """Choose places of sensors and forces so that the test determines damping and frequencies best.

    The information of every place is computed, with the shape there unknown, and places are taken one after the other, each the one that
    lowers the criterion most; then single ones are exchanged as long as that lowers it further, from the start of each criterion. For
    `criterion="D"` the sum grows less with each place that is added, so that the first pass alone reaches 63 % of the best logarithm
    (G. L. Nemhauser, L. A. Wolsey and M. L. Fisher, Math. Programming 14, 1978).

    Parameters
    ----------
    modes : ModalModel
        Of a model or an earlier test, real shapes at all places that may be taken. Without participation they are taken as those of unit
        modal mass, driven at the same places; modes without damping have 1 %.
    sensors, forces : int
        How many.
    noise : float or array, (l,)
        Standard deviation of the noise of each place, in units of the response: only ratios count for the choice.
    keep, exclude : iterable of str
        Places of sensors that are taken in any case, and places that cannot be reached, unless they are kept.
    force_places : iterable of str, optional
        Where forces may act; by default everywhere.
    triaxial : bool
        Whether one sensor measures all directions of a node.
    criterion : {"worst", "A", "D", "E"}
        The largest relative deviation of a damping ratio, or the trace, determinant or largest eigenvalue of the covariance of relative
        deviations of poles.

    Returns
    -------
    Placement

    Raises
    ------
    DataError
        More sensors or forces than places, unknown places, noise that is not positive, modes that do not oscillate.

    References
    ----------
    D. C. Kammer, Sensor placement for on-orbit modal identification, J. Guidance 14, 1991 (effective independence).

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> found = place(chain5().modes(), sensors=2)
    >>> len(found.sensors), found.worst < found.compared["kinetic energy"] * 1.001
    (2, True)
    """
    check_kind("place", modes, ModalModel)
    check_choice("criterion", criterion, CRITERIA)
    check_count("sensors", sensors)
    check_count("forces", forces)
    problem = _Places(modes, noise)
    wanted = list(keep)
    groups = _groups(modes.output_dofs, [dof for dof in exclude if dof not in wanted], triaxial)
    stay = set(indices_of("output", wanted, modes.output_dofs))
    kept = [group for group in groups if stay & set(group)]
    may = indices_of("output", problem.labels if force_places is None else list(force_places), problem.labels)
    if sensors > len(groups) or forces > len(may) or len(kept) > sensors:
        have = f"there are {counted(len(groups), 'place')} of sensors, {len(kept)} kept, and {len(may)} of forces"
        raise DataError(f"sensors={sensors}, forces={forces}", have, "Ask for fewer, or exclude fewer places.")

    def cost(driven: Sequence[int], chosen: Sequence[tuple[int, ...]], by: str = criterion) -> float:
        return problem.cost(driven, [i for group in chosen for i in group], by)

    def sensed(by: str) -> list[tuple[int, ...]]:
        start = _chosen(lambda some: cost(driven, some, by), groups, sensors, kept)
        return _exchanged(lambda some: cost(driven, some), groups, start, len(kept))

    driven = _chosen(lambda some: cost(some, groups), list(may), forces, [])
    taken = sensed(criterion)
    driven = _exchanged(lambda some: cost(some, taken), list(may), driven, 0)
    # exchanges of single places end at the best one near a start
    starts = [_exchanged(lambda some: cost(driven, some), groups, taken, len(kept)), *map(sensed, CRITERIA[1:])]
    taken = min(starts, key=lambda some: cost(driven, some))
    rows = [i for group in taken for i in group]
    f_std, zeta_std = problem.foretold(driven, rows)
    rules = {"effective independence": _effective_independence, "kinetic energy": _kinetic_energy}
    shapes = np.abs(modes.shapes) * np.sign(modes.shapes.real)
    return Placement(
        sensors=tuple(modes.output_dofs[i] for i in rows),
        forces=tuple(problem.labels[i] for i in driven),
        frequencies=modes.frequencies,
        frequencies_std=f_std,
        damping_ratios_std=zeta_std,
        worst=problem.cost(driven, rows, "worst"),
        compared={
            name: problem.cost(driven, [i for g in rule(shapes, groups, sensors) for i in g], "worst")
            for name, rule in rules.items()
        },
    )


class _Places:
    """All places of a test, with what each tells of the poles when a force acts somewhere."""

    def __init__(self, modes: ModalModel, noise: ArrayLike) -> None:
        if not len(modes) or not np.all(modes.poles.imag > 0):
            raise DataError("place needs modes that oscillate", f"of {len(modes)} not all do", "Leave the others out.")
        level = real_array("noise", noise, "(places,)", (0, 1))
        if level.shape not in ((), (len(modes.shapes),)) or not np.all(level > 0):
            have = f"there are {level.size} numbers from {level.min():g} for {len(modes.shapes)} places"
            raise DataError("noise of places", have, "Give one standard deviation, or one for each place.")
        w, zeta = 2 * np.pi * modes.frequencies, modes.damping_ratios
        zeta = np.where(zeta > 0, zeta, _DAMPING)
        self.poles = w * (-zeta + 1j * np.sqrt(1 - zeta**2))
        self.labels, self.shapes = modes.input_dofs, modes.shapes / np.broadcast_to(level, len(modes.shapes))[:, None]
        if modes.participation is None:  # of unit modal mass, driven at its own places
            self.labels, self._drive = modes.output_dofs, modes.shapes.T / (2j * self.poles.imag[:, None])
        else:
            self._drive = modes.participation
        lines = _lines(self.poles)
        light = FrequencyResponse(values=np.full((len(lines), 1, 1), 1j), frequencies=lines, quantity="displacement")
        self._products = slopes_left(light, self.poles)
        self._told: dict[int, RealArray] = {}

    def of_outputs(self, source: int) -> RealArray:
        """Return what each place tells under one force, (l, 2 n, 2 n)."""
        if source not in self._told:
            self._told[source] = information(self._products, self.shapes * self._drive[:, source])
        return self._told[source]

    def foretold(self, driven: Sequence[int], rows: Sequence[int]) -> tuple[RealArray, RealArray]:
        """Return the deviations of frequencies (Hz) and damping ratios."""
        return deviations_foretold(self._sum(driven, rows), self.poles)

    def cost(self, driven: Sequence[int], rows: Sequence[int], criterion: str) -> float:
        """Return the criterion; infinite where a mode is not determined."""
        if criterion == "worst":
            return float(np.max(self.foretold(driven, rows)[1] / (-self.poles.real / np.abs(self.poles))))
        size = np.repeat(-self.poles.real, 2)  # deviations relative to half bandwidths
        d = np.linalg.eigvalsh(self._sum(driven, rows) * np.outer(size, size))
        if d[0] <= 0:
            return np.inf
        return float({"A": np.sum(1 / d), "D": -np.sum(np.log(d)), "E": 1 / d[0]}[criterion])

    def _sum(self, driven: Sequence[int], rows: Sequence[int]) -> RealArray:
        return np.asarray(np.sum([self.of_outputs(i)[list(rows)].sum(axis=0) for i in driven], axis=0))


def _lines(poles: Array) -> RealArray:
    """Return lines that resolve every mode, Hz."""
    half, f = -poles.real / (2 * np.pi), np.abs(poles) / (2 * np.pi)
    low, high = max(float(np.min(f - _BEYOND * half)), float(f.min()) / 10), float(np.max(f + _BEYOND * half))
    count = int(min((high - low) / half.min() * _LINES_OF_A_HALF_BANDWIDTH, _MAX_LINES)) + 2
    return np.linspace(low, high, count)


def _groups(dofs: Sequence[str], exclude: list[str], triaxial: bool) -> list[tuple[int, ...]]:
    """Return the places of sensors, each of the rows that it measures."""
    gone = set(indices_of("output", exclude, tuple(dofs)))
    rows: dict[Any, list[int]] = {}
    for i, dof in enumerate(dofs):
        parsed = parse_dof(dof) if triaxial else None
        if i not in gone:
            rows.setdefault(i if parsed is None else parsed.node, []).append(i)
    return [tuple(each) for each in rows.values()]


def _chosen(cost: Callable[[list[Any]], float], places: Sequence[Any], count: int, kept: list[Any]) -> list[Any]:
    """Return the kept places and others, each the one that lowers the cost most; ties go to the first."""
    taken = list(kept)
    while len(taken) < count:
        left = [p for p in places if p not in taken]
        costs = [cost([*taken, p]) for p in left]
        taken.append(left[int(np.argmin(costs))])
    return taken


def _exchanged(cost: Callable[[list[Any]], float], places: Sequence[Any], taken: list[Any], kept: int) -> list[Any]:
    """Return places of which none but the first `kept` can be exchanged for a better one."""
    best, taken = cost(taken), list(taken)
    for _ in range(_ROUNDS):
        before = best
        for k in range(kept, len(taken)):
            for other in (p for p in places if p not in taken):
                tried = [*taken[:k], other, *taken[k + 1 :]]
                if (reached := cost(tried)) < best:
                    best, taken = reached, tried
        if not best < before * (1 - np.sign(before) * _LEAST_FALL):
            break
    return taken


def _effective_independence(shapes: RealArray, groups: list[tuple[int, ...]], count: int) -> list[tuple[int, ...]]:
    """Return the places that are left when the one with the least leverage on the shapes goes, one by one."""
    left = list(groups)
    while len(left) > count:
        rows = [i for group in left for i in group]
        leverage = dict(zip(rows, np.einsum("ij,ji->i", shapes[rows], np.linalg.pinv(shapes[rows])), strict=True))
        left.remove(min(left, key=lambda group: sum(leverage[i] for i in group)))
    return left


def _kinetic_energy(shapes: RealArray, groups: list[tuple[int, ...]], count: int) -> list[tuple[int, ...]]:
    """Return the places that move most, each mode divided by its own size."""
    size = np.sum((shapes / np.linalg.norm(shapes, axis=0)) ** 2, axis=1)
    return sorted(groups, key=lambda group: -sum(size[i] for i in group))[:count]
