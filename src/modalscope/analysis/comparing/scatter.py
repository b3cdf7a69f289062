"""Estimate the uncertainty of the consensus: by the noise, by what methods disagree beyond it, and no less than the refined modes have.

All methods read the same noise: the deviation of the difference of two of them is that of <g_1 - g_2, noise>, g their influences,
and is often far below that of either. What lies further apart than it explains is bias, of one or of the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri, stdtrit

from modalscope.analysis.checking.certificate import LARGEST_BIAS
from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.run import MethodResult, Moved, covariance
from modalscope.numerics.checks import RealArray
from modalscope.selection.likelihood.noise import Noise

#: Probability that the truth lies within the stated scatter, and that any of all comparisons calls noise a bias.
LEVEL, _FALSE_ALARM = 0.95, 0.01

#: Minimum stated scatter, relative: rounding and the noise-free case.
_MIN_SCATTER = 1e-9

_KINDS = ("frequency", "damping")


class Biased(NamedTuple):
    """Distance of a method's value from the consensus: as it is, and in standard deviations of the difference."""

    kind: str
    away: float
    deviations: float


@dataclass(frozen=True, eq=False)
class Scatter:
    """Half widths of 95 % intervals, and their parts (standard deviations).

    `frequency`, `damping` (n,): stated scatter: Hz and ratio, at least that of the same modes in the analysis. `degrees` (n,): of
    freedom of the noise; NaN where its deviation is exact. `frequency_noise`, `damping_noise` (n,): of the consensus, by the noise in the
    data; NaN where unknown. `frequency_bias`, `damping_bias` (n,): scatter of the votes beyond their differences by noise. `biased`: for
    every mode the methods that the noise does not explain. `known`: for every mode the methods on which the effect of the noise is known.
    `beside` (2, n): half widths of the same modes in the analysis, NaN where it lists none.
    """

    frequency: RealArray
    damping: RealArray
    frequency_noise: RealArray
    damping_noise: RealArray
    frequency_bias: RealArray
    damping_bias: RealArray
    degrees: RealArray
    biased: tuple[Mapping[str, tuple[Biased, ...]], ...] = ()
    known: tuple[frozenset[str], ...] = ()
    beside: RealArray = field(default_factory=lambda: np.full((2, 1), np.nan))

    def beyond_noise(self, kind: str) -> RealArray:
        """Return the half widths of what methods scatter by beyond the noise, z bias, of "frequency" or "damping", (n,)."""
        return np.asarray(self._quantiles * getattr(self, f"{kind}_bias"))

    def deviation(self, kind: str) -> RealArray:
        """Return half widths over Student's quantile, of "frequency" or "damping", (n,); NaN where neither noise nor interval is known."""
        known = np.isfinite(getattr(self, f"{kind}_noise")) | np.isfinite(self.beside[_KINDS.index(kind)])
        return np.where(known, getattr(self, kind) / self._quantiles, np.nan)

    def at_least(self, beside: RealArray) -> Scatter:
        """Return the scatter that is nowhere narrower than half widths (2, n) of the same modes: NaN where none is known.

        Where one is infinite the data do not determine the mode: NaN, no interval.
        """
        wider = {kind: np.fmax(getattr(self, kind), half) for kind, half in zip(_KINDS, beside, strict=True)}
        wider = {kind: np.where(np.isinf(half), np.nan, half) for kind, half in wider.items()}
        return replace(self, **wider, beside=beside)

    @property
    def _quantiles(self) -> RealArray:
        degrees = np.where(np.isfinite(self.degrees), self.degrees, np.inf)
        return np.array([_quantile((1 + LEVEL) / 2, d) for d in degrees])


class _Variances(NamedTuple):
    """Variances of one mode, of frequency and damping (2,): of the consensus, and of every method's distance from it."""

    consensus: RealArray
    distance: dict[str, RealArray]
    degrees: float


def stated(groups: Sequence[Group], results: Sequence[MethodResult]) -> Scatter:
    """Return the stated scatter of every mode: z sqrt(noise^2 + bias^2), bias^2 = between methods^2 - variance of differences by noise."""
    shared = _Covariances(groups, results)
    variances = [shared.variances(k, g) for k, g in enumerate(groups)]
    count = 2 * sum(max(len(v.distance) - 1, 0) for v in variances)
    degrees = np.array([v.degrees if np.isfinite(v.degrees) else np.nan for v in variances])
    columns: dict[str, list[float]] = {f"{kind}{part}": [] for part in ("", "_noise", "_bias") for kind in _KINDS}
    biased: list[dict[str, tuple[Biased, ...]]] = []
    for g, v in zip(groups, variances, strict=True):
        z = _quantile((1 + LEVEL) / 2, v.degrees)
        for i, kind in enumerate(_KINDS):
            by_noise = [v.distance[name][i] for name in g.votes if name in v.distance]
            between = getattr(g, f"{kind}_between") ** 2
            bias = np.sqrt(max(between - (float(np.mean(by_noise)) if by_noise else 0.0), 0.0))
            noise = float(np.sqrt(v.consensus[i]))
            half = z * np.sqrt(np.nan_to_num(noise) ** 2 + bias**2)
            columns[kind].append(max(half, _MIN_SCATTER * getattr(g, kind)))
            columns[f"{kind}_noise"].append(noise)
            columns[f"{kind}_bias"].append(float(bias))
        biased.append(_biased(g, v, _quantile(1 - _FALSE_ALARM / 2 / max(count, 1), v.degrees)))
    arrays = {name: np.array(values) for name, values in columns.items()}
    return Scatter(
        **arrays, degrees=degrees, biased=tuple(biased), known=tuple(frozenset(v.distance) for v in variances)
    )


def _quantile(probability: float, degrees: float) -> float:
    """Return Student's quantile where the noise is known from few parts of a record, else the normal one."""
    return float(stdtrit(degrees, probability) if np.isfinite(degrees) else ndtri(probability))


def _biased(g: Group, variances: _Variances, limit: float) -> dict[str, tuple[Biased, ...]]:
    """Return the methods whose distance from the consensus is beyond the noise, and no small part of a standard deviation."""
    biased: dict[str, tuple[Biased, ...]] = {}
    for name, variance in variances.distance.items():
        of_method = []
        for i, (kind, values) in enumerate(zip(_KINDS, (g.frequencies, g.damping_ratios), strict=True)):
            distance, size = values[name] - getattr(g, kind), getattr(g, kind)
            deviation = np.sqrt(max(float(variance[i]), 0.0)) + _MIN_SCATTER * size
            if abs(distance) > limit * deviation and distance**2 > LARGEST_BIAS**2 * variances.consensus[i]:
                of_method.append(Biased(kind, distance, distance / deviation))
        if of_method:
            biased[name] = tuple(of_method)
    return biased


class _Covariances:
    """Covariances of the methods that read the same data, mode by mode, each pair of methods computed once."""

    def __init__(self, groups: Sequence[Group], results: Sequence[MethodResult]) -> None:
        self._groups, self._modes = groups, {r.name: r.modes for r in results}
        moved = {r.name: r.moved for r in results if r.moved is not None and r.exact}
        first = next((moved[name] for g in groups for name in g.votes if name in moved), None)
        self._moved = {name: m for name, m in moved.items() if first is not None and _same_data(m, first)}
        self._noise = _middle_noise([m.noise for m in self._moved.values()])
        self._pairs: dict[tuple[str, str], dict[int, RealArray]] = {}

    def variances(self, k: int, g: Group) -> _Variances:
        """Return the variances of one mode."""
        names = [name for name, j in g.members.items() if name in self._moved and self._moved[name].row[j] >= 0]
        middle = self._middle(g, names)
        if not any(middle):
            return _Variances(self._reported(g), {}, np.inf)
        consensus = np.array([np.mean([self._pair(a, b, k)[i] for a in m for b in m]) for i, m in enumerate(middle)])
        distance = {}
        for name in names:
            variance = self._pair(name, name, k)
            across = np.array([np.mean([self._pair(name, m, k)[i] for m in part]) for i, part in enumerate(middle)])
            distance[name] = variance + consensus - 2 * across
        degrees = self._noise.note.numbers.get("degrees_of_freedom", np.inf) if self._noise is not None else np.inf
        return _Variances(np.maximum(consensus, 0), distance, degrees)

    def _reported(self, g: Group) -> RealArray:
        """Return the median of the variances (2,) that methods report themselves; NaN where none does."""
        variances = []
        for name in g.votes:
            modes, j = self._modes[name], g.members[name]
            if modes is not None and modes.frequencies_std is not None and modes.damping_ratios_std is not None:
                variances.append([modes.frequencies_std[j] ** 2, modes.damping_ratios_std[j] ** 2])
        return np.asarray(np.median(variances, axis=0) if variances else np.full(2, np.nan))

    @staticmethod
    def _middle(g: Group, names: Sequence[str]) -> tuple[list[str], list[str]]:
        """Return the methods whose values are the consensus of frequency and damping: the one or two votes nearest to it."""
        votes = [name for name in g.votes if name in names] or list(names)
        parts = []
        for values, middle in ((g.frequencies, g.frequency), (g.damping_ratios, g.damping)):
            ordered = sorted(votes, key=lambda name: abs(values[name] - middle))
            parts.append(ordered[: 1 if len(votes) % 2 else 2])
        return parts[0], parts[1]

    def _pair(self, one: str, other: str, k: int) -> RealArray:
        """Return the covariances (2,) of a mode's frequency and damping by two methods."""
        first, second = sorted((one, other))
        if (first, second) not in self._pairs:
            self._pairs[first, second] = self._computed(first, second)
        return self._pairs[first, second][k]

    def _computed(self, one: str, other: str) -> dict[int, RealArray]:
        a, b = self._moved[one], self._moved[other]
        common = [(k, g.members) for k, g in enumerate(self._groups) if one in g.members and other in g.members]
        rows = [(k, a.row[members[one]], b.row[members[other]]) for k, members in common]
        rows = [row for row in rows if min(row[1:]) >= 0]
        assert self._noise is not None
        rows_a, rows_b = np.array([row[1:] for row in rows], dtype=np.intp).reshape(-1, 2).T
        f, zeta = covariance(a, b, rows_a, rows_b, self._noise)
        return {k: np.array([f[i], zeta[i]]) for i, (k, _, _) in enumerate(rows)}


def _middle_noise(noises: Sequence[Noise]) -> Noise | None:
    """Return the noise of the data by the method in the middle: each estimates it from the residual of its own order; None without any.

    A low order leaves structure in it, and a high one takes noise away: the median holds against either.
    """
    levels = [float(np.mean(getattr(noise, "variance", 0.0))) for noise in noises]
    return noises[int(np.argsort(levels, kind="stable")[(len(levels) - 1) // 2])] if noises else None


def _same_data(one: Moved, other: Moved) -> bool:
    """Return whether two methods have the same data, value by value."""
    a, b = one.response.values, other.response.values
    return a is b or bool(np.array_equal(a, b))
