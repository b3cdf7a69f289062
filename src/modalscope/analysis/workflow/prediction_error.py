"""Refine a sampled model of records with inputs to the least errors of prediction.

    y(t) = sum_j c_j x_j(t) + conjugate + D u(t) + offset,   x_j(t + 1) = z_j x_j(t) + b_j' u(t),   e = W (y - y^) white

W is an autoregression of the errors of the model (`simulation.whitener`). Poles, shapes, participation, D and the first states of all runs
descend together by damped least squares (Levenberg and Marquardt), W after them, in turn: a Box-Jenkins model, whose errors are least
where the errors of simulation are coloured by forces that were not measured.

References
----------
Ljung, System Identification, 2nd ed., 1999, chapters 4 and 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.signal import lfilter

from modalscope.analysis.workflow.simulation import Whitener, free_run, whitener
from modalscope.data.records import Records
from modalscope.data.statespace import StateSpace
from modalscope.identification.matrices.driven import runs_of
from modalscope.identification.modal.state_space import from_modes
from modalscope.numerics.checks import BoolArray, ComplexArray, RealArray

#: Derivatives at most (unknowns times samples of all outputs), 80 MB, and products of an iteration (unknowns once more): seconds.
MOST_NUMBERS, MOST_PRODUCTS = 1e7, 4e9

#: Rounds of an autoregression, iterations of each at most, and the relative gain below which they end.
_ROUNDS, _ITERATIONS, _LEAST_GAIN = 3, 12, 1e-4

#: First damping of steps, its factor after a step that is no gain, and tries of a step.
_DAMPING, _FACTOR, _TRIES = 1e-3, 5.0, 8

#: Curvature of the errors, relative to the greatest, below which a step changes nothing that is seen.
_FREE = 1e-12

#: Condition of eigenvectors beyond which modes are no coordinates.
_MAX_CONDITION = 1e8


class _Modal(NamedTuple):
    """Poles (n,), shapes (l, n), participation of inputs and first states (n, m + R), and D (l, m), channels divided by their size."""

    z: ComplexArray
    C: ComplexArray
    B: ComplexArray
    D: RealArray


@dataclass(frozen=True, eq=False)
class _Runs:
    """Outputs and inputs of all runs, divided by their size; `real` (n,): poles of one state."""

    outputs: Sequence[RealArray]
    inputs: Sequence[RealArray]
    real: BoolArray

    @property
    def twice(self) -> RealArray:
        """How often a mode counts: once, or with its conjugate."""
        return np.where(self.real, 1.0, 2.0)

    def states(self, m: _Modal, r: int) -> ComplexArray:
        """Return x_j of a run, (n, N)."""
        u, inputs = self.inputs[r], self.inputs[r].shape[1]
        pushed = m.B[:, :inputs] @ u.T
        free = m.z[:, None] ** np.arange(len(u)) * m.B[:, inputs + r, None]
        return np.stack([lfilter([0, 1], [1, -z], p) for z, p in zip(m.z, pushed, strict=True)]) + free

    def left(self, m: _Modal, r: int, X: ComplexArray) -> RealArray:
        """Return y - y^ of a run without its mean, (N, l)."""
        v = self.outputs[r] - ((m.C * self.twice) @ X).real.T - self.inputs[r] @ m.D.T
        return np.asarray(v - v.mean(axis=0))

    def slopes(self, m: _Modal, r: int, X: ComplexArray, W: RealArray) -> RealArray:
        """Return the derivatives of W y^ by z, B, C of each mode in turn (of a pair real and imaginary parts), and by D: (l, P, N - p)."""
        u, p, runs = self.inputs[r].T, len(W) - 1, len(self.inputs)
        (l, n), count = m.C.shape, u.shape[1]
        size = fft.next_fast_len(count)  # what wraps around comes to lie on the first p samples, which are left out
        filters = fft.fft(W, size, axis=0).transpose(1, 2, 0)
        by_pole = np.concatenate([X[:, None], np.broadcast_to(u, (n, *u.shape))], axis=1)
        driven = np.stack([lfilter([0, 1], [1, -z], own) for z, own in zip(m.z, by_pole, strict=True)])
        free = np.zeros((n, runs, count), dtype=complex)
        free[:, r] = m.z[:, None] ** np.arange(count)
        own = fft.fft(np.concatenate([driven, free], axis=1), size)
        sides = np.einsum("ocf,cj->jof", filters, m.C)[:, :, None] * own[:, None]
        shapes = filters[None] * fft.fft(X, size)[:, None, None]
        both = fft.ifft(np.concatenate([sides, shapes], axis=2))[..., p:count]
        parts = [part for one, real in zip(both, self.real, strict=True) for part in _real_parts(one, real)]
        direct = fft.ifft(filters[:, :, None] * fft.fft(u, size)[None, None]).real[..., p:count]
        J = np.concatenate([*parts, direct.reshape(l, -1, count - p)], axis=1)
        return np.asarray(J - J.mean(axis=2, keepdims=True))

    def moved(self, m: _Modal, step: RealArray) -> _Modal:
        """Return the model after a step in the coordinates of `slopes`."""
        l, n = m.C.shape
        k = 1 + m.B.shape[1] + l
        z, C, B = m.z.copy(), m.C.copy(), m.B.copy()
        at = 0
        for j in range(n):
            own = step[at : at + k].astype(complex)
            at += k
            if not self.real[j]:
                own += 1j * step[at : at + k]
                at += k
            z[j] += own[0]
            B[j] += own[1 : k - l]
            C[:, j] += own[k - l :]
        return _Modal(z, C, B, m.D + step[at:].reshape(m.D.shape))


def _real_parts(slopes: ComplexArray, real: bool) -> list[RealArray]:
    """Return derivatives by real and imaginary parts of what counts with its conjugate; of a real pole by itself."""
    return [slopes.real] if real else [2 * slopes.real, -2 * slopes.imag]


def affordable(model: StateSpace, records: Records) -> bool:
    """Whether the derivatives fit into memory, and an iteration takes seconds at most."""
    (l, m), n = model.D.shape, model.order
    unknowns, numbers = n * (1 + m + len(records.runs) + l) + l * m, sum(records.samples) * l
    return bool(numbers * unknowns <= MOST_NUMBERS and numbers * unknowns**2 <= MOST_PRODUCTS)


def least_prediction_errors(model: StateSpace, records: Records) -> StateSpace | None:
    """Return a stable sampled model refined to the least errors of prediction of records, without its gain.

    None of a model that grows, that has no modal coordinates, or that is not `affordable`.
    """
    begun = _begun(model, records)
    if begun is None:
        return None
    runs, m, basis = begun
    for _ in range(_ROUNDS):
        W = _whitener(runs, m)
        if W is None:
            break
        m, gain = _descended(runs, m, W)
        if gain < _LEAST_GAIN * _ITERATIONS:
            break
    inputs, of_outputs = m.D.shape[1], basis.of_outputs[:, None]
    B, D = m.B[:, :inputs] / basis.of_inputs, m.D / basis.of_inputs * of_outputs
    return from_modes(m.z, m.C * of_outputs, B, D, model.dt)


def directions(model: StateSpace, records: Records) -> RealArray | None:
    """Return directions (p, n + l, n + m) of [[A, B], [C, D]], a standard deviation each: their outer products add to the covariance.

    (J'J)^-1 of the whitened errors, the first states of all runs unknown beside the model; what only scales a mode's shape against its
    participation is left out. None where modes are no coordinates, where nothing is left to predict, or of what is not `affordable`.
    """
    begun = _begun(model, records)
    W = None if begun is None else _whitener(*begun[:2])
    if begun is None or W is None:
        return None
    runs, m, basis = begun
    N, _ = _normal(runs, m, *_errors(runs, m, W), W)
    size = np.sqrt(np.diag(N))
    size = np.where(size > 0, size, 1.0)
    d, Q = np.linalg.eigh(N / np.outer(size, size))
    kept = d > _FREE * d[-1]
    steps = (Q[:, kept] / np.sqrt(d[kept]) / size[:, None]).T
    return np.array([basis.in_states(m, runs.moved(m, step), runs.twice) for step in steps])


class _Basis(NamedTuple):
    """States of modes: their vectors (n, k), what reads them (k, n), and the sizes of outputs and inputs."""

    vectors: ComplexArray
    readers: ComplexArray
    of_outputs: RealArray
    of_inputs: RealArray

    def in_states(self, m: _Modal, moved: _Modal, twice: RealArray) -> RealArray:
        """Return what a step of modes changes in [[A, B], [C, D]], (n + l, n + m)."""
        inputs, of_outputs = m.D.shape[1], self.of_outputs[:, None]
        columns, rows = self.vectors * twice, self.readers
        A = (columns * (moved.z - m.z)) @ rows
        B = columns @ (moved.B - m.B)[:, :inputs] / self.of_inputs
        C = of_outputs * ((moved.C - m.C) * twice) @ rows
        D = of_outputs * (moved.D - m.D) / self.of_inputs
        return np.asarray(np.block([[A, B], [C, D]]).real)


def _begun(model: StateSpace, records: Records) -> tuple[_Runs, _Modal, _Basis] | None:
    """Return runs, the model in modal coordinates with the first states that fit best, and the basis; None where these are none."""
    values, V = np.linalg.eig(model.A)
    if np.abs(values).max(initial=0.0) >= 1 or np.linalg.cond(V) > _MAX_CONDITION or not affordable(model, records):
        return None
    each = list(runs_of(records))
    one = replace(model, gain=None, innovation_covariance=None)
    first = np.stack([free_run(one, y, u).first for y, u in each], axis=1)
    level = [
        np.sqrt(np.mean(np.concatenate([run[side] - run[side].mean(axis=0) for run in each]) ** 2, axis=0))
        for side in (0, 1)
    ]
    of_outputs, of_inputs = (np.where(size > 0, size, 1.0) for size in level)
    kept = np.flatnonzero(values.imag >= 0)
    vectors: ComplexArray = V[:, kept].astype(complex)
    readers: ComplexArray = np.linalg.inv(V.astype(complex))[kept]
    driven = np.hstack([model.B * of_inputs, first])
    C = model.C @ vectors / of_outputs[:, None]
    left = np.linalg.norm(readers @ driven, axis=1)
    size = np.sqrt(np.linalg.norm(C, axis=0) / np.maximum(left, np.finfo(float).tiny))
    size = np.where(size > 0, size, 1.0)
    vectors, readers = vectors / size, readers * size[:, None]
    runs = _Runs([y / of_outputs for y, _ in each], [u / of_inputs for _, u in each], values[kept].imag == 0)
    D = model.D * of_inputs / of_outputs[:, None]
    made = _Modal(values[kept].astype(np.complex128), C / size, readers @ driven, D)
    return runs, made, _Basis(vectors, readers, of_outputs, of_inputs)


def _whitener(runs: _Runs, m: _Modal) -> Whitener | None:
    return whitener([runs.left(m, r, runs.states(m, r)) for r in range(len(runs.outputs))])


def _descended(runs: _Runs, m: _Modal, W: Whitener) -> tuple[_Modal, float]:
    """Return the model of least errors under an autoregression that stays, and the share of the errors that went."""
    states, errors = _errors(runs, m, W)
    cost = first = _cost(errors)
    damping = _DAMPING
    for _ in range(_ITERATIONS):
        N, g = _normal(runs, m, states, errors, W)
        size = np.sqrt(np.diag(N))
        size = np.where(size > 0, size, 1.0)
        N, g = N / np.outer(size, size), g / size
        for _ in range(_TRIES):
            step = np.linalg.solve(N + damping * np.eye(len(N)), g) / size
            tried = runs.moved(m, step)
            if np.abs(tried.z).max() < 1:
                there = _errors(runs, tried, W)
                if _cost(there[1]) < cost:
                    break
            damping *= _FACTOR
        else:
            break
        gain = (cost - _cost(there[1])) / cost
        m, (states, errors), damping = tried, there, damping / _FACTOR
        cost = _cost(errors)
        if gain < _LEAST_GAIN:
            break
    return m, (first - cost) / first


def _errors(runs: _Runs, m: _Modal, W: Whitener) -> tuple[list[ComplexArray], list[RealArray]]:
    """Return states and whitened errors of every run, their mean, which an offset takes, removed."""
    states = [runs.states(m, r) for r in range(len(runs.outputs))]
    errors = [W(runs.left(m, r, X)) for r, X in enumerate(states)]
    return states, [e - e.mean(axis=0) for e in errors]


def _cost(errors: Sequence[RealArray]) -> float:
    return float(sum(np.sum(e**2) for e in errors))


def _normal(
    runs: _Runs, m: _Modal, states: Sequence[ComplexArray], errors: Sequence[RealArray], W: Whitener
) -> tuple[RealArray, RealArray]:
    """Return J'J and J'e over all runs."""
    N: RealArray | float = 0.0
    g: RealArray | float = 0.0
    for r, (X, e) in enumerate(zip(states, errors, strict=True)):
        J = runs.slopes(m, r, X, W.filters)
        N = N + sum(own @ own.T for own in J)
        g = g + sum(own @ error for own, error in zip(J, e.T, strict=True))
    return np.asarray(N), np.asarray(g)
