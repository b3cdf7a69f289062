"""Estimate the uncertainty of the consensus: by the noise, and by what methods disagree beyond it.

All methods read the same noise: the deviation of the difference of two of them is that of <g_1 - g_2, noise>, g their influences,
and is often far below that of either. What lies further apart than it explains is bias, of one or of the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri, stdtrit

from modalscope.checking.certificate import LARGEST_BIAS, Certificate, certified, replicates_of
from modalscope.comparing.agreement import Group
from modalscope.comparing.run import MethodResult, Moved, covariance
from modalscope.data.records import Signals
from modalscope.numerics.checks import RealArray

# ----------------------------------------------------------------------------------------------------------- certified
# Intervals of a comparison tried on simulations of its own case, by the method that fits best.


class Tried(NamedTuple):
    """The certificate of one method, by its `MethodResult.name`."""

    method: str
    certificate: Certificate


def certified_best(results: Sequence[MethodResult], records: Sequence[Signals | None], replicates: int) -> Tried | None:
    """Return the certificate of the method that fits best of those whose deviations are known; None where none was asked.

    `records`: behind the responses of each, where they are correlations.
    """
    able = [
        (r, signals)
        for r, signals in zip(results, records, strict=True)
        if r.exact and r.moved is not None and r.modes is not None and r.diagram is not None
    ]
    if not replicates or not able:
        return None
    best, signals = min(able, key=lambda pair: np.inf if pair[0].fit_error is None else pair[0].fit_error)
    assert best.diagram is not None
    assert best.modes is not None
    made = replicates_of(best.diagram, best.modes, signals)
    return Tried(best.name, certified(made, replicates, np.random.default_rng(0)))


def interval_trouble(group: Group, frequency_noise: float, damping_noise: float, tried: Tried | None) -> str:
    """Say what is wrong with the interval of a mode: it is not known, or its certificate refutes it; nothing otherwise.

    `frequency_noise`, `damping_noise`: deviations; NaN where they are not known.
    """
    unknown = [w for w, v in (("frequency", frequency_noise), ("damping", damping_noise)) if not np.isfinite(v)]
    if unknown:
        return f"no deviation of its {' and '.join(unknown)} is known"
    if tried is None or tried.method not in group.members or tried.certificate.holds[group.members[tried.method]]:
        return ""
    return "its interval does not hold, by its certificate"


# ------------------------------------------------------------------------------------------------------------- scatter

#: Probability that the truth lies within the stated scatter, and that any of all comparisons calls noise a bias.
LEVEL, FALSE = 0.95, 0.01

#: Nothing is stated more exactly than this (relative): rounding and the noise-free case.
_LEAST = 1e-9

_KINDS = ("frequency", "damping")


class Biased(NamedTuple):
    """How far a method's value lies from the consensus: as it is, and in deviations of the difference."""

    kind: str
    away: float
    deviations: float


@dataclass(frozen=True, eq=False)
class Scatter:
    """Half-widths within which the truth is expected in 95 %, and what they are made of (standard deviations).

    `frequency`, `damping` (n,): stated scatter: Hz and ratio. `frequency_noise`, `damping_noise` (n,): of the consensus, by the noise in
    the data; NaN where it is not known. `frequency_bias`, `damping_bias` (n,): what the votes scatter by beyond what the noise moves them
    apart. `biased`: for every mode the methods that the noise does not explain. `known`: for every mode the methods of which it is known
    how the noise moves them.
    """

    frequency: RealArray
    damping: RealArray
    frequency_noise: RealArray
    damping_noise: RealArray
    frequency_bias: RealArray
    damping_bias: RealArray
    biased: tuple[Mapping[str, tuple[Biased, ...]], ...] = ()
    known: tuple[frozenset[str], ...] = ()

    def deviation(self, kind: str) -> RealArray:
        """Return sqrt(noise^2 + bias^2) of "frequency" or "damping", (n,); NaN where the noise is not known."""
        return np.asarray(np.hypot(getattr(self, f"{kind}_noise"), getattr(self, f"{kind}_bias")))


class _Known(NamedTuple):
    """What is known of one mode: variances of the consensus, of every method's distance from it, (2,) each."""

    consensus: RealArray
    apart: dict[str, RealArray]
    degrees: float


def stated(groups: Sequence[Group], results: Sequence[MethodResult]) -> Scatter:
    """Return the stated scatter of every mode: z sqrt(noise^2 + bias^2), bias^2 = between methods^2 - what noise puts between them."""
    shared = _Shared(groups, results)
    known = [shared.known(k, g) for k, g in enumerate(groups)]
    count = 2 * sum(max(len(k.apart) - 1, 0) for k in known)
    columns: dict[str, list[float]] = {f"{kind}{part}": [] for part in ("", "_noise", "_bias") for kind in _KINDS}
    biased: list[dict[str, tuple[Biased, ...]]] = []
    for g, k in zip(groups, known, strict=True):
        z = _quantile((1 + LEVEL) / 2, k.degrees)
        for i, kind in enumerate(_KINDS):
            by_noise = [k.apart[name][i] for name in g.votes if name in k.apart]
            between = getattr(g, f"{kind}_between") ** 2
            bias = np.sqrt(max(between - (float(np.mean(by_noise)) if by_noise else 0.0), 0.0))
            noise = float(np.sqrt(k.consensus[i]))
            half = z * np.sqrt(np.nan_to_num(noise) ** 2 + bias**2)
            columns[kind].append(max(half, _LEAST * getattr(g, kind)))
            columns[f"{kind}_noise"].append(noise)
            columns[f"{kind}_bias"].append(float(bias))
        biased.append(_biased(g, k, _quantile(1 - FALSE / 2 / max(count, 1), k.degrees)))
    return Scatter(
        **{name: np.array(values) for name, values in columns.items()},
        biased=tuple(biased),
        known=tuple(frozenset(k.apart) for k in known),
    )


def _quantile(probability: float, degrees: float) -> float:
    """Return Student's quantile where the noise is known from few parts of a record, else the normal one."""
    return float(stdtrit(degrees, probability) if np.isfinite(degrees) else ndtri(probability))


def _biased(g: Group, known: _Known, limit: float) -> dict[str, tuple[Biased, ...]]:
    """Return the methods whose distance from the consensus no noise explains, and is no small share of a deviation."""
    found: dict[str, tuple[Biased, ...]] = {}
    for name, variance in known.apart.items():
        each = []
        for i, (kind, values) in enumerate(zip(_KINDS, (g.frequencies, g.damping_ratios), strict=True)):
            away, size = values[name] - getattr(g, kind), getattr(g, kind)
            deviation = np.sqrt(max(float(variance[i]), 0.0)) + _LEAST * size
            if abs(away) > limit * deviation and away**2 > LARGEST_BIAS**2 * known.consensus[i]:
                each.append(Biased(kind, away, away / deviation))
        if each:
            found[name] = tuple(each)
    return found


class _Shared:
    """Covariances of the methods that read the same data, mode by mode, each pair of methods computed once."""

    def __init__(self, groups: Sequence[Group], results: Sequence[MethodResult]) -> None:
        self._groups, self._modes = groups, {r.name: r.modes for r in results}
        there = {r.name: r.moved for r in results if r.moved is not None and r.exact}
        first = next((there[name] for g in groups for name in g.votes if name in there), None)
        self._moved = {name: m for name, m in there.items() if first is not None and _same(m, first)}
        errors = {r.name: np.inf if r.fit_error is None else r.fit_error for r in results}
        best = min(self._moved, key=lambda name: errors[name], default=None)
        self._noise = None if best is None else self._moved[best].noise
        self._pairs: dict[tuple[str, str], dict[int, RealArray]] = {}

    def known(self, k: int, g: Group) -> _Known:
        """Return what is known of one mode."""
        names = [name for name, j in g.members.items() if name in self._moved and self._moved[name].row[j] >= 0]
        middle = self._middle(g, names)
        if not any(middle):
            return _Known(self._reported(g), {}, np.inf)
        consensus = np.array([np.mean([self._pair(a, b, k)[i] for a in m for b in m]) for i, m in enumerate(middle)])
        apart = {}
        for name in names:
            own = self._pair(name, name, k)
            across = np.array([np.mean([self._pair(name, m, k)[i] for m in part]) for i, part in enumerate(middle)])
            apart[name] = own + consensus - 2 * across
        degrees = self._noise.note.numbers.get("degrees_of_freedom", np.inf) if self._noise is not None else np.inf
        return _Known(np.maximum(consensus, 0), apart, degrees)

    def _reported(self, g: Group) -> RealArray:
        """Return the variances (2,) that methods report themselves, in the middle; NaN where none does."""
        found = []
        for name in g.votes:
            modes, j = self._modes[name], g.members[name]
            if modes is not None and modes.frequencies_std is not None and modes.damping_ratios_std is not None:
                found.append([modes.frequencies_std[j] ** 2, modes.damping_ratios_std[j] ** 2])
        return np.asarray(np.median(found, axis=0) if found else np.full(2, np.nan))

    @staticmethod
    def _middle(g: Group, names: Sequence[str]) -> tuple[list[str], list[str]]:
        """Return whose values the consensus is, of frequency and damping: the one or two votes nearest to it."""
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
        modes, rows, beside = [], [], []
        for k, g in enumerate(self._groups):
            if one in g.members and other in g.members:
                i, j = a.row[g.members[one]], b.row[g.members[other]]
                if min(i, j) >= 0:
                    modes.append(k)
                    rows.append(i)
                    beside.append(j)
        assert self._noise is not None
        f, zeta = covariance(a, b, np.array(rows, dtype=np.intp), np.array(beside, dtype=np.intp), self._noise)
        return {k: np.array([f[i], zeta[i]]) for i, k in enumerate(modes)}


def _same(one: Moved, other: Moved) -> bool:
    """Whether two methods read the same data, value by value."""
    a, b = one.response.values, other.response.values
    return a is b or (a.shape == b.shape and bool(np.array_equal(a, b)))
