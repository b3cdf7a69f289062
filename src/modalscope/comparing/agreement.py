"""Pair the modes of several methods, and summarize each group by its median and spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.comparing.kinship import Kinship
from modalscope.comparing.run import MethodResult
from modalscope.functions.poles import poles_from
from modalscope.modal.indicators import mac
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.statistics import assign, scatter

#: Two modes of different methods can be the same within this many half bandwidths, but at least and at most these fractions of f ...
_HALF_BANDWIDTHS, _LEAST, _MOST = 1.5, 0.002, 0.05
#: ... and with a MAC above this; repeated modes may be any basis of their plane, so that it is low.
_LIKE = 0.4

#: Passes over all modes until every one lies with the group it is nearest to.
_PASSES = 4


@dataclass(frozen=True, eq=False)
class Group:
    """One mode as every method identified it.

    `members`: which mode of each method it is. `mac`: likeness of each member's shape to that of the consensus. `votes`: the methods
    whose values count: they worked on the data themselves, and of several that are the same one only. `voters`: methods that had a vote.
    `frequency`, `damping`: median over the votes (over all members when none of them has one). `frequency_between`, `damping_between`:
    standard deviation between methods, robustly. `shape` (l,).
    """

    members: Mapping[str, int]
    frequencies: Mapping[str, float]
    damping_ratios: Mapping[str, float]
    mac: Mapping[str, float]
    votes: tuple[str, ...]
    voters: int
    frequency: float
    damping: float
    frequency_between: float
    damping_between: float
    shape: ComplexArray

    @property
    def pole(self) -> complex:
        """The consensus, rad/s."""
        return complex(poles_from(self.frequency, self.damping))

    @property
    def half_bandwidth(self) -> float:
        """Hz."""
        return self.frequency * self.damping


@dataclass(frozen=True, eq=False)
class _Flat:
    """Modes of all methods in one list."""

    method: Array
    index: Array
    f: RealArray
    zeta: RealArray
    shape: ComplexArray


def pair(results: Sequence[MethodResult], kin: Kinship) -> tuple[tuple[Group, ...], tuple[Group, ...]]:
    """Pair the modes of all methods by frequency, damping and shape, one mode of a method in a group, and sum every group up.

    Returns the modes that at least one method with a vote found, and those that only transformed data show.

    `kin`: methods that are the same on these data have one vote together.
    """
    kept = [r for r in results if r.modes is not None]
    if not kept or not sum(len(r.modes) for r in kept if r.modes is not None):
        return (), ()
    flat = _flatten(kept)
    votes = _voters(kept, kin)
    names = [r.name for r in kept]
    groups = _grouped(flat, len(kept), votes)
    found = [_summed(members, flat, kept, names, votes) for members in groups]
    found.sort(key=lambda g: g.frequency)
    return tuple(g for g in found if g.votes), tuple(g for g in found if not g.votes)


def _flatten(kept: Sequence[MethodResult]) -> _Flat:
    models = [r.modes for r in kept if r.modes is not None]
    return _Flat(
        np.concatenate([np.full(len(m), k) for k, m in enumerate(models)]),
        np.concatenate([np.arange(len(m)) for m in models]),
        np.concatenate([m.frequencies for m in models]),
        np.concatenate([m.damping_ratios for m in models]),
        np.concatenate([m.shapes.T for m in models]),
    )


def _voters(kept: Sequence[MethodResult], kin: Kinship) -> list[int]:
    """Return the methods with a vote, one of each class of equals, or one of each way from records."""
    seen: set[int | str] = set()
    votes = []
    for k, r in enumerate(kept):
        kind = r.route or kin.class_of(r.name)
        if r.exact and kind not in seen:
            seen.add(kind)
            votes.append(k)
    return votes or list(range(len(kept)))


def _cost(flat: _Flat, new: Array, f: RealArray, zeta: RealArray, shapes: ComplexArray) -> RealArray:
    """Return what it costs to take modes for groups, infinity where they cannot be the same."""
    wide = np.maximum(flat.zeta[new][:, None], zeta)
    apart = np.abs(flat.f[new][:, None] - f) / np.minimum(flat.f[new][:, None], f)
    like = mac(flat.shape[new].T, shapes.T)
    limit = np.clip(_HALF_BANDWIDTHS * wide, _LEAST, _MOST)
    damping = np.abs(flat.zeta[new][:, None] - zeta) / np.maximum(wide, 1e-12)
    return np.where((apart < limit) & (like > _LIKE), apart / limit + damping + 4 * (1 - like), np.inf)


def _grouped(flat: _Flat, count: int, votes: Sequence[int]) -> list[list[int]]:
    """Assign modes to groups method by method, those with a vote first, and again until nothing moves."""
    order = [*votes, *(k for k in range(count) if k not in votes)]
    groups: list[list[int]] = []
    for turn in range(_PASSES):
        before = [sorted(g) for g in groups]
        for k in order:
            new = np.flatnonzero(flat.method == k)
            groups = [[i for i in g if flat.method[i] != k] for g in groups]
            groups = [g for g in groups if g]
            groups = _placed(flat, new, groups)
        if turn and [sorted(g) for g in groups] == before:
            break
    return groups


def _placed(flat: _Flat, new: Array, groups: list[list[int]]) -> list[list[int]]:
    taken: set[int] = set()
    if groups and new.size:
        f = np.array([np.median(flat.f[g]) for g in groups])
        zeta = np.array([np.median(flat.zeta[g]) for g in groups])
        shapes = np.array([flat.shape[_central(flat, g)] for g in groups])
        cost = _cost(flat, new, f, zeta, shapes)
        never = 1e6
        for a, b in zip(*assign(np.where(np.isfinite(cost), cost, never)), strict=True):
            if np.isfinite(cost[a, b]):
                groups[b].append(int(new[a]))
                taken.add(int(new[a]))
    return groups + [[int(i)] for i in new if int(i) not in taken]


def _central(flat: _Flat, group: Sequence[int]) -> int:
    """Return the member whose shape is nearest to all others'."""
    return group[int(np.argmax(mac(flat.shape[list(group)].T).sum(axis=1)))]


def _summed(
    members: Sequence[int], flat: _Flat, kept: Sequence[MethodResult], names: Sequence[str], votes: Sequence[int]
) -> Group:
    count = np.array([i for i in members if flat.method[i] in votes] or list(members))
    central = _central(flat, list(count))
    # of several routes from records the usual one gives the value, and the others confirm it
    usual = [i for i in members if flat.method[i] == votes[0]] if kept[votes[0]].route else []
    valued = usual or list(count)
    of = {names[flat.method[i]]: i for i in members}
    like = mac(flat.shape[list(members)].T, flat.shape[central][:, None])[:, 0]
    voted = [i for i in members if flat.method[i] in votes]
    return Group(
        members={name: int(flat.index[i]) for name, i in of.items()},
        frequencies={name: float(flat.f[i]) for name, i in of.items()},
        damping_ratios={name: float(flat.zeta[i]) for name, i in of.items()},
        mac={names[flat.method[i]]: float(v) for i, v in zip(members, like, strict=True)},
        votes=tuple(names[flat.method[i]] for i in voted),
        voters=len(votes),
        frequency=float(np.median(flat.f[valued])),
        damping=float(np.median(flat.zeta[valued])),
        frequency_between=scatter(flat.f[count]),
        damping_between=scatter(flat.zeta[count]),
        shape=flat.shape[central],
    )
