"""Pair the modes of several methods, and summarize each group by its median and spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.analysis.comparing.kinship import Kinship
from modalscope.analysis.comparing.run import MethodResult
from modalscope.data.indicators import mac
from modalscope.data.modes import ModalModel
from modalscope.data.sameness import same_modes
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import poles_from
from modalscope.numerics.statistics import scatter

#: Maximum number of passes over all modes until every one lies in the nearest group.
_PASSES = 4


@dataclass(frozen=True, eq=False)
class Group:
    """One mode as every method identified it.

    `members`: index of the mode in each method's result. `mac`: of each member's shape with that of the consensus. `votes`: the methods
    whose values count: on untransformed data, and one of several that are the same. `voters`: number of methods with a vote.
    `frequency`, `damping`: median over the votes (over all members when none of them has one). `frequency_between`, `damping_between`:
    robust standard deviation between methods. `shape` (l,).
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
    """Pair the modes of all methods by frequency, damping and shape, at most one of a method in a group.

    Returns the modes of at least one method with a vote, and those of transformed data alone.

    `kin`: methods that are the same on these data have one vote together.
    """
    kept = [r for r in results if r.modes is not None]
    if not sum(len(r.modes) for r in kept if r.modes is not None):
        return (), ()
    flat = _flatten(kept)
    votes = _voters(kept, kin)
    names = [r.name for r in kept]
    members = _grouped(flat, len(kept), votes)
    groups = sorted((_group(m, flat, kept, names, votes) for m in members), key=lambda g: g.frequency)
    return tuple(g for g in groups if g.votes), tuple(g for g in groups if not g.votes)


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
    """Return the methods with a vote, the first of each class of equals, or of each route from records."""
    votes: dict[int | str, int] = {}
    for k, r in enumerate(kept):
        if r.exact:
            votes.setdefault(r.route or kin.class_of(r.name), k)
    return list(votes.values()) or list(range(len(kept)))


def _grouped(flat: _Flat, count: int, votes: Sequence[int]) -> list[list[int]]:
    """Assign modes to groups method by method, those with a vote first, and again until nothing moves."""
    order = [*votes, *(k for k in range(count) if k not in votes)]
    groups: list[list[int]] = []
    for turn in range(_PASSES):
        before = [sorted(g) for g in groups]
        for k in order:
            new = np.flatnonzero(flat.method == k)
            others = [[i for i in g if flat.method[i] != k] for g in groups]
            groups = _placed(flat, new, [g for g in others if g])
        if turn and [sorted(g) for g in groups] == before:
            break
    return groups


def _placed(flat: _Flat, new: Array, groups: list[list[int]]) -> list[list[int]]:
    """Return the groups with the modes of one method by `same_modes`, those that fit none in new groups.

    Deviations are not asked: methods differ by their bias, too.
    """
    assigned: set[int] = set()
    if groups and new.size:
        middle = poles_from(*(np.array([np.median(each[g]) for g in groups]) for each in (flat.f, flat.zeta)))
        known = ModalModel(poles=middle, shapes=flat.shape[[_central(flat, g) for g in groups]].T)
        modes = ModalModel(poles=poles_from(flat.f[new], flat.zeta[new]), shapes=flat.shape[new].T)
        for a, b in zip(*same_modes(modes, known), strict=True):
            groups[b].append(int(new[a]))
            assigned.add(int(new[a]))
    return groups + [[int(i)] for i in new if int(i) not in assigned]


def _central(flat: _Flat, group: Sequence[int]) -> int:
    """Return the member whose shape is nearest to all others'."""
    return group[int(np.argmax(mac(flat.shape[list(group)].T).sum(axis=1)))]


def _group(
    members: Sequence[int], flat: _Flat, kept: Sequence[MethodResult], names: Sequence[str], votes: Sequence[int]
) -> Group:
    """Return one mode with the values of its members."""
    counted = [i for i in members if flat.method[i] in votes] or list(members)
    central = _central(flat, counted)
    # of several routes from records the usual one gives the value, and the others confirm it
    usual = [i for i in members if flat.method[i] == votes[0]] if kept[votes[0]].route else []
    valued = usual or counted
    by_name = {names[flat.method[i]]: i for i in members}
    like = mac(flat.shape[list(members)].T, flat.shape[central][:, None])[:, 0]
    return Group(
        members={name: int(flat.index[i]) for name, i in by_name.items()},
        frequencies={name: float(flat.f[i]) for name, i in by_name.items()},
        damping_ratios={name: float(flat.zeta[i]) for name, i in by_name.items()},
        mac={names[flat.method[i]]: float(v) for i, v in zip(members, like, strict=True)},
        votes=tuple(names[flat.method[i]] for i in members if flat.method[i] in votes),
        voters=len(votes),
        frequency=float(np.median(flat.f[valued])),
        damping=float(np.median(flat.zeta[valued])),
        frequency_between=scatter(flat.f[counted]),
        damping_between=scatter(flat.zeta[counted]),
        shape=flat.shape[central],
    )
