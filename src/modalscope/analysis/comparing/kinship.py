"""Compute distances between methods: of pole sets, angles between observability subspaces, and a map by classical scaling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from modalscope.analysis.comparing.run import MethodResult, alike_sets
from modalscope.data.modes import ModalModel
from modalscope.identification.method import Method
from modalscope.identification.orders import states_each, sufficient_order
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.statistics import assign
from modalscope.selection.judging.evidence import oscillations
from modalscope.selection.judging.tracking import Poles

#: Maximum distance (in half bandwidths) of the poles of methods that are one on these data: rounding, with room.
SAME = 1e-6

#: Samples a period of the highest mode, and minimum samples in all, of the observability subspaces that are compared.
_SAMPLES_PER_PERIOD, _MIN_SAMPLES = 2.56, 128


@dataclass(frozen=True, eq=False)
class Kinship:
    """Distances between methods, and which are the same on these data.

    `names`: methods with modes, as `era (s)`. `order`: the order at which pole sets are compared. `distances` (k, k): mean distance
    of paired poles in half bandwidths, each weighted by its share of the response; 0 the same poles, 1 no pole in common. `angles` (k, k):
    largest principal angle, in degrees, between the observability subspaces of the reported modes. `places` (k, 2): a map of the methods
    by classical scaling of the distances. `classes`: methods that are one and the same on these data. `methods`: those of `names`.
    """

    names: tuple[str, ...]
    order: int
    distances: RealArray
    angles: RealArray
    places: RealArray
    classes: tuple[tuple[int, ...], ...]
    methods: tuple[Method, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the methods in the literature."""
        return tuple(m.label for m in self.methods) or self.names

    @property
    def equals(self) -> tuple[tuple[str, ...], ...]:
        """Labels of methods that are one and the same on these data, for every class of more than one."""
        return tuple(tuple(self.labels[i] for i in members) for members in self.classes if len(members) > 1)

    def class_of(self, name: str) -> int:
        """Return the class of a method, -1 for one that is not compared."""
        index = self.names.index(name) if name in self.names else -1
        return next((k for k, members in enumerate(self.classes) if index in members), -1)


def kinship(results: Sequence[MethodResult]) -> Kinship:
    """Compare the methods with modes, at the order at which the best of them explain the data."""
    kept = [r for r in results if r.diagram is not None and r.modes is not None]
    diagrams = [r.diagram for r in kept if r.diagram is not None]
    models = [r.modes for r in kept if r.modes is not None]
    k = len(kept)
    order = int(np.median([sufficient_order(d) for d in diagrams])) if diagrams else 0
    sets = [oscillations(d) for d in diagrams]
    distances, angles = np.zeros((k, k)), np.zeros((k, k))
    for a in range(k):
        for b in range(a):
            n_a, n_b = _orders_to_compare(kept[a], kept[b], order)
            distances[a, b] = distances[b, a] = pole_distance(_poles(sets[a], n_a), _poles(sets[b], n_b))
            angles[a, b] = angles[b, a] = subspace_angle(models[a], models[b])
    names, methods = tuple(r.name for r in kept), tuple(r.method for r in kept)
    return Kinship(names, order, distances, angles, _map(distances), _classes(distances), methods)


def _orders_to_compare(a: MethodResult, b: MethodResult, order: int) -> tuple[int, int]:
    """Return the order of each at which two methods are compared: a shared one where both count states, else the nearest in states."""
    orders = [r.diagram.orders if r.diagram is not None else () for r in (a, b)]
    states = [_states(r) for r in (a, b)]
    shared = set(orders[0]) & set(orders[1])
    if shared and states[0] == states[1]:
        n = min(shared, key=lambda n: (abs(n - order), n))
        return n, n
    first, second = (min(o, key=lambda n: abs(n * s - order)) for o, s in zip(orders, states, strict=True))
    return first, second


def _states(result: MethodResult) -> int:
    """States an order: one, or as many as inputs where the order is a degree."""
    return 1 if result.diagram is None else states_each(result.method.orders, result.diagram.response)


def _poles(poles: Poles, order: int) -> tuple[ComplexArray, RealArray]:
    """Return the decaying oscillations of one order and the share of each in the response; the nearest order where it is missing."""
    nearest = min(poles.orders, key=lambda n: (abs(n - order), n))
    of_order = poles.take(np.flatnonzero(poles.order == nearest))
    return of_order.pole, of_order.own


def pole_distance(a: tuple[ComplexArray, RealArray], b: tuple[ComplexArray, RealArray]) -> float:
    """Return the distance of two pole sets, 0 to 1: |s_a - s_b| over the half bandwidth, at most 1, weighted by the poles' shares.

    Poles are paired one to one so that the sum is least; one without a partner is at distance 1.

    Examples
    --------
    >>> import numpy as np
    >>> s, w = np.array([-1 + 10j, -1 + 20j]), np.ones(2)
    >>> print(round(pole_distance((s, w), (s + 0.1, w)), 3), pole_distance((s, w), (s[:0], w[:0])))
    0.1 1.0
    """
    (s, v), (t, w) = a, b
    if not s.size or not t.size:
        return 0.0 if s.size == t.size else 1.0
    v, w = v / v.sum(), w / w.sum()
    half = np.maximum(np.abs(s.real)[:, None], np.abs(t.real))
    distance = np.minimum(np.abs(s[:, None] - t) / np.maximum(half, 1e-300), 1.0)
    weight = (v[:, None] + w) / 2
    rows, columns = assign(weight * (distance - 1))
    paired = weight[rows, columns]
    # a pole without a partner counts in full: the shares of both sides sum to one
    return float(np.clip(1 - np.sum(paired * (1 - distance[rows, columns])), 0, 1))


def subspace_angle(a: ModalModel, b: ModalModel) -> float:
    """Return the largest principal angle in degrees between the observability subspaces [c; c z; c z^2; ...] of two sets of modes.

    Real and imaginary parts span the subspace, z = exp(s t) with samples in time that the modes share. With different numbers of modes
    the smaller subspace is compared with its nearest part of the larger.
    """
    if not len(a) or not len(b):
        return 0.0 if len(a) == len(b) else 90.0
    step = 1 / (_SAMPLES_PER_PERIOD * max(a.frequencies.max(), b.frequencies.max()))
    angles = sla.subspace_angles(_evolution(a, step), _evolution(b, step))
    return float(np.degrees(angles.max()))


def _evolution(modes: ModalModel, step: float) -> RealArray:
    blocks = max(_MIN_SAMPLES, -(-4 * len(modes) // modes.shapes.shape[0]))
    decay = np.exp(np.outer(np.arange(blocks) * step, modes.poles))
    V = (decay[:, None, :] * modes.shapes).reshape(-1, len(modes))
    V = V / np.linalg.norm(V, axis=0)
    return np.hstack([V.real, V.imag])


def _map(distances: RealArray) -> RealArray:
    """Classical scaling: coordinates from the centred squared distances, two largest directions."""
    k = len(distances)
    if k < 2:
        return np.zeros((k, 2))
    centre = np.eye(k) - 1 / k
    values, vectors = np.linalg.eigh(-0.5 * centre @ distances**2 @ centre)
    size = np.sqrt(np.clip(values[::-1][:2], 0, None))
    places = vectors[:, ::-1][:, :2] * size
    # signs of eigenvectors are arbitrary: the largest entry is positive
    sign = np.sign(places[np.argmax(np.abs(places), axis=0), np.arange(places.shape[1])])
    signed = np.zeros((k, 2))
    signed[:, : places.shape[1]] = places * np.where(sign == 0, 1, sign)
    return signed


def _classes(distances: Array) -> tuple[tuple[int, ...], ...]:
    return tuple(map(tuple, alike_sets(range(len(distances)), lambda i, j: bool(distances[i, j] < SAME))))
