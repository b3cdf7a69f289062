"""Track poles over model orders: merge split poles, join tracks, and average their members.

Everything here is deterministic: an optimal assignment from one order to the next, no random starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modalscope.data.indicators import mac
from modalscope.numerics.checks import Array, ComplexArray, IntArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.statistics import assign

# ------------------------------------------------------------------------------------------------------------ likeness
# Which poles act as one mode.

#: Minimum MAC of overlapping poles that are one mode; poles of single channels are one within this fraction of both half bandwidths.
ONE_SHAPE, _MERGE_HALF_BANDWIDTHS = 0.9, 0.25


def collinear(poles: ComplexArray, shapes: ComplexArray, participation: ComplexArray) -> Array:
    """Return which pairs of poles act as one mode, (n, n): they overlap, and their shapes are one.

    With a single output or input, shapes or participation tell little: there any two poles are one that lie much closer yet.
    """
    w, half = poles.imag, -poles.real
    apart = np.abs(w[:, None] - w) / (half[:, None] + half)
    one = (apart < 1) & (mac(shapes) > ONE_SHAPE)
    if 1 in (len(shapes), participation.shape[1]):
        one |= apart < _MERGE_HALF_BANDWIDTHS
    return np.asarray(one)


# ------------------------------------------------------------------------------------------------------------ tracking

#: Minimum MAC of two poles of one order that are one mode split in two.
SPLIT = 0.9

#: Poles further apart than this many times the sum of their standard deviations are different modes.
_MIN_DISTANCE_DEVIATIONS = 3.0

#: A pole with this many times the decay rate is merged without changing the decay rate: background of the same shape. Parts of a
#: resonance that drifts by its own bandwidth differ by a factor of up to three.
_MAX_DECAY_RATIO = 5.0

#: Poles of different orders agree within this relative frequency difference, this fraction of the half bandwidth ...
SAME_FREQUENCY, SAME_BANDWIDTH = 0.005, 0.25
#: ... this relative damping difference, and above this MAC.
SAME_DAMPING, SAME_SHAPE = 0.25, 0.95

#: Maximum number of consecutive orders that a track may miss.
GAP = 3

#: Cost of poles that cannot be one mode.
_COST_OF_NO_PAIR = 1e6


#: Fields of `Poles` with one entry a pole.
_FIELDS_PER_POLE = ("order", "pole", "shape", "participation", "own", "index")


@dataclass(frozen=True, eq=False)
class Poles:
    """Decaying oscillations of all orders, flat.

    `order` (p,). `pole` (p,). `shape` (p, l). `participation` (p, m). `own` (p,): norm of the pole's own contribution over the norm of
    the data. `index` (p,): where each stands in the diagram that it came from; of a merged one where the stronger stood. Their own places
    by default.
    """

    orders: tuple[int, ...]
    order: IntArray
    pole: ComplexArray
    shape: ComplexArray
    participation: ComplexArray
    own: RealArray
    index: IntArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.index is None:
            object.__setattr__(self, "index", np.arange(len(self.pole)))

    @cached_property
    def frequency(self) -> RealArray:
        """Hz."""
        return frequencies_and_damping(self.pole)[0]

    @cached_property
    def damping(self) -> RealArray:
        """Damping ratios."""
        return frequencies_and_damping(self.pole)[1]

    def take(self, index: Array) -> Poles:
        """Return some of the poles."""
        return replace(self, **{name: getattr(self, name)[index] for name in _FIELDS_PER_POLE})

    def beside(self, others: Poles) -> Poles:
        """Return these poles and behind them others of the same orders."""
        return Poles(
            self.orders, *(np.concatenate([getattr(p, name) for p in (self, others)]) for name in _FIELDS_PER_POLE)
        )


def merge_splits(
    poles: Poles, deviation: RealArray | None = None, levels: tuple[RealArray, RealArray] | None = None
) -> Poles:
    """Merge, within every order, neighbours that act as one mode; their value is the energy-weighted mean.

    Of two that differ in width more than parts of one resonance do, it is that of the one with more energy.

    Data whose lines shift a little from run to run (a roving hammer, a structure that warms up) make one resonance come out
    as two or three poles within their bandwidths. They are one when their summed residue is of rank one,
    1 - 2.5 (s_2 / s_1)^2 at least .9; with a single output or input, where every residue is, when the shapes' MAC is.
    Repeated modes have a summed residue of rank two and stay apart.

    Few inputs drive two modes alike by chance: two of them one pair in four. Where all outputs were measured at once, poles of
    unlike shapes that lie further apart than their deviations are two modes all the same.

    `deviation`: rad/s: how well the data tell every pole of the diagram, by its index; NaN where that is not known. `levels`: of outputs
    (l,) and of inputs (m,), in which shapes and participation are compared, or units of channels would count; ones by default.
    """
    outputs, inputs = (1.0, 1.0) if levels is None else levels
    poles = replace(poles, shape=poles.shape / outputs, participation=poles.participation / inputs)
    kept = [_merged(poles.take(np.flatnonzero(poles.order == order)), deviation) for order in poles.orders]
    merged = Poles(poles.orders, *(np.concatenate([getattr(k, name) for k in kept]) for name in _FIELDS_PER_POLE))
    return replace(merged, shape=merged.shape * outputs, participation=merged.participation * inputs)


def _merged(poles: Poles, deviation: RealArray | None) -> Poles:
    while poles.pole.size > 1:
        like = _likeness(poles)
        if deviation is not None:
            like[_told_apart(poles, deviation[poles.index])] = 0.0
        a, b = np.unravel_index(np.argmax(like), like.shape)
        if like[a, b] < SPLIT:
            break
        poles = _merge_two(poles, int(a), int(b))
    return poles


def _likeness(poles: Poles) -> RealArray:
    """How much each pair (a < b) of overlapping poles acts as one mode."""
    w, half = np.abs(poles.pole.imag), np.abs(poles.pole.real)
    overlap = np.triu(np.abs(w[:, None] - w) < half[:, None] + half, 1)
    shapes, parts = poles.shape, poles.participation
    if min(shapes.shape[1], parts.shape[1]) == 1:
        alike = mac(shapes.T) if shapes.shape[1] > 1 else mac(parts.T)
        return np.where(overlap, alike, 0.0)
    # squares of the singular values of two residues together: eigenvalues of a product of two Gram matrices, by trace and determinant
    G, H = shapes.conj() @ shapes.T, parts.conj() @ parts.T
    g, h = np.diag(G).real, np.diag(H).real
    own = g * h
    trace = own[:, None] + own + 2 * (G * H).real
    determinant = np.maximum(np.outer(g, g) - np.abs(G) ** 2, 0) * np.maximum(np.outer(h, h) - np.abs(H) ** 2, 0)
    first = (trace + np.sqrt(np.maximum(trace**2 - 4 * determinant, 0))) / 2
    ratio = determinant / np.where(first > 0, first, 1.0) ** 2
    return np.where(overlap & (first > 0), np.maximum(1 - 2.5 * ratio, 0.0), 0.0)


def _told_apart(poles: Poles, deviation: RealArray) -> Array:
    """Return which pairs have unlike shapes and lie further apart than `_MIN_DISTANCE_DEVIATIONS` times what both may be off, (p, p)."""
    off = deviation[:, None] + deviation
    apart = (
        np.abs(poles.pole[:, None] - poles.pole) > _MIN_DISTANCE_DEVIATIONS * off
    )  # never where a deviation is not known
    return np.asarray(apart & (mac(poles.shape.T) < SPLIT))


def _merge_two(poles: Poles, a: int, b: int) -> Poles:
    first = np.outer(poles.shape[a], poles.participation[a])
    second = np.outer(poles.shape[b], poles.participation[b])
    # energies are positive weights: the mean lies between the two and never extrapolates
    energy = [np.linalg.norm(r) ** 2 / abs(poles.pole[i].real) for r, i in ((first, a), (second, b))]
    decay = np.abs(poles.pole.real[[a, b]])
    if decay.max() > _MAX_DECAY_RATIO * decay.min():
        energy[int(np.argmin(energy))] = 0.0
    pole = (energy[0] * poles.pole[a] + energy[1] * poles.pole[b]) / sum(energy)
    U, s, Vt = np.linalg.svd(first + second, full_matrices=False)
    own = poles.own[a] * s[0] / np.linalg.norm(first) * np.sqrt(abs(poles.pole[a].real / pole.real))
    merged = replace(
        poles,
        pole=np.where(np.arange(poles.pole.size) == a, pole, poles.pole),
        shape=_with_row(poles.shape, a, U[:, 0] * s[0]),
        participation=_with_row(poles.participation, a, Vt[0]),
        own=np.where(np.arange(poles.own.size) == a, own, poles.own),
        index=np.where(np.arange(poles.index.size) == a, poles.index[a if energy[0] >= energy[1] else b], poles.index),
    )
    return merged.take(np.delete(np.arange(poles.pole.size), b))


def _with_row(array: Array, row: int, values: Array) -> Array:
    changed = np.array(array)
    changed[row] = values
    return changed


def _compare(poles: Poles, new: Array, old: Array) -> tuple[Array, RealArray]:
    """Return which of `new` agree with which of `old`, and what it costs to take them for the same."""
    f, zeta = poles.frequency[new][:, None], poles.damping[new][:, None]
    g, eta = poles.frequency[old][None], poles.damping[old][None]
    wide = np.maximum(zeta, eta)
    apart, damped = np.abs(f - g) / np.minimum(f, g), np.abs(zeta - eta) / wide
    alike = mac(poles.shape[new].T, poles.shape[old].T)
    agree = (
        (apart < np.minimum(SAME_FREQUENCY, SAME_BANDWIDTH * wide) + 1e-9)
        & (damped < SAME_DAMPING)
        & (alike > SAME_SHAPE)
    )
    near = (apart < np.clip(2 * wide, 0.001, 0.02)) & (alike > 0.5)
    cost = apart / np.clip(wide, 0.0005, 0.02) + damped + 4 * (1 - alike)
    return agree, np.where(near, cost, _COST_OF_NO_PAIR)


def tracks(poles: Poles) -> list[Array]:
    """Follow poles from order to order: one pole an order in each track, assigned at least cost in all."""
    found: list[list[int]] = []
    place = {order: k for k, order in enumerate(poles.orders)}
    for order in poles.orders:
        new = np.flatnonzero(poles.order == order)
        live = [t for t in found if place[order] - place[int(poles.order[t[-1]])] <= GAP]
        taken: set[int] = set()
        if live and new.size:
            last = np.array([t[-1] for t in live])
            _, cost = _compare(poles, new, last)
            missed = np.array([place[order] - place[int(n)] - 1 for n in poles.order[last]])
            cost = np.where(cost < _COST_OF_NO_PAIR, cost + 0.5 * missed, cost)
            for a, b in zip(*assign(cost), strict=True):
                if cost[a, b] < _COST_OF_NO_PAIR:
                    live[b].append(int(new[a]))
                    taken.add(int(a))
        found += [[int(i)] for a, i in enumerate(new) if a not in taken]
    return [np.array(t) for t in found]


def consensus(poles: Poles, track: Array) -> Array:
    """Return the members of a track that agree with the one that most agree with."""
    agree, _ = _compare(poles, track, track)
    return np.asarray(track[agree[np.argmax(agree.sum(axis=1))]])


def join_broken(poles: Poles, groups: Sequence[Array]) -> list[Array]:
    """Join groups of one mode that was lost and taken up again: same shape, within a half bandwidth, no order in common."""
    joined: list[Array] = []
    for group in sorted(groups, key=lambda g: (-len(g), float(poles.frequency[g[0]]))):
        for k, host in enumerate(joined):
            f, g = np.median(poles.frequency[host]), np.median(poles.frequency[group])
            zeta, eta = np.median(poles.damping[host]), np.median(poles.damping[group])
            alike = np.median(mac(poles.shape[host].T, poles.shape[group].T)) > 0.9
            if abs(f - g) < f * zeta + g * eta and alike:
                free = ~np.isin(poles.order[group], poles.order[host])
                near = np.abs(poles.damping[group] - zeta) < 0.5 * zeta
                joined[k] = np.concatenate([host, group[free & near]])
                break
        else:
            joined.append(group)
    return joined
