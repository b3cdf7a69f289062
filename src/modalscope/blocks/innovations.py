"""The noise model that belongs to a model of records: what is new in a sample beside the inputs, and what it changes later on.

What a model does not simulate, v = y - y^(u, x(0)), is the output of x(k+1) = A x + K e, v = C x + e. In triangular coordinates of
[v(t - p); ...; v(t - 1); v(t); ...; v(t + q)] the rows of v(t) hold the innovation e(t), what the past does not predict, and of the
later v(t + k) what follows from it, C A^(k-1) K e(t).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.linalg as sla
from numpy.lib.stride_tricks import sliding_window_view

from modalscope.blocks.sums import TriangleSum
from modalscope.model.checks import RealArray
from modalscope.model.statespace import StateSpace

__all__ = ["innovations", "kalman_gain"]

#: Innovations below this share of the outputs are rounding.
_ROUNDING = 1e-11

#: Samples of the past, rows of it, and its share of the times: what is predicted by chance.
_PAST, _ROWS, _SHARE = 60, 400, 0.02

#: Samples of the future beyond what the states need.
_FUTURE = 10


def innovations(model: StateSpace, runs: Iterable[tuple[RealArray, RealArray]]) -> tuple[RealArray, RealArray] | None:
    """Return the gain (n, l) and the covariance of the innovations (l, l) of a model, from records; None of one that grows.

    Parameters
    ----------
    model : StateSpace
        Sampled; outputs and inputs of about the same size in all channels.
    runs : iterable of (outputs (N, l), inputs (N, m))
    """
    if np.abs(model.poles).max(initial=0.0) > 1:
        return None
    left = [_not_simulated(model, y, u) for y, u in runs]
    l, times = model.C.shape[0], sum(len(v) for v in left)
    future = -(-model.order // l) + _FUTURE
    past = max(min(_PAST, _ROWS // l, int(_SHARE * times / l)), 1)
    total, count, width = TriangleSum(l * (past + 1 + future)), 0, past + 1 + future
    for v in left:
        if len(v) >= width:
            windows = sliding_window_view(v, width, axis=0).transpose(0, 2, 1)
            count += len(windows)
            for start in range(0, len(windows), 4 * l * width):
                part = windows[start : start + 4 * l * width]
                total.add(part.reshape(len(part), -1))
    R, known = total.finish(), l * past
    if count <= R.shape[1]:
        return None
    own = R[known : known + l, known:] / np.sqrt(count - known)
    return kalman_gain(own, model.A, model.C)


def _not_simulated(model: StateSpace, y: RealArray, u: RealArray) -> RealArray:
    """Return y less what the inputs, the first state that fits best and a constant give."""
    left = y - model.simulate(u)
    l, n = model.C.shape
    free = np.empty((len(y), l, n))
    power = np.array(model.C)
    for row in free:
        row[:] = power
        power = power @ model.A
    constants = np.tile(np.eye(l), (len(y), 1))
    columns = np.hstack([free.reshape(-1, n), constants])
    R = np.asarray(sla.qr(np.column_stack([columns, left.reshape(-1)]), mode="r", check_finite=False)[0][: n + l + 1])
    first = np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=None)[0]
    return np.asarray(left - (columns @ first).reshape(left.shape))


def kalman_gain(future: RealArray, A: RealArray, C: RealArray) -> tuple[RealArray, RealArray]:
    """Return the gain K (n, l) of x(k+1) = A x(k) + K e, v = C x + e, and the covariance of e (l, l).

    With E (l, l) the innovations in their own coordinates and F (l, l q) what follows from them, F = E [C K; C A K; ...]', so that
    K = [C; C A; ...]# (E^-1 F)'. A gain under which errors would not decay (A - K C) is replaced by that of the Riccati equation with
    the same covariances.

    Parameters
    ----------
    future : array, (l, l (q + 1))
        [E, F], with E'E the covariance.
    A, C : array
    """
    l, n = C.shape
    E, F = future[:, :l], future[:, l:]
    covariance = np.asarray(E.T @ E)
    if np.abs(E).max() < _ROUNDING:
        return np.zeros((n, l)), covariance
    rows, power = [], np.array(C)
    for _ in range(F.shape[1] // l):
        rows.append(power)
        power = power @ A
    follows = np.linalg.lstsq(E, F, rcond=_ROUNDING)[0]
    K = np.asarray(np.linalg.lstsq(np.concatenate(rows), follows.T, rcond=None)[0])
    if np.abs(np.linalg.eigvals(A - K @ C)).max() < 1:
        return K, covariance
    return _by_riccati(A, C, K, covariance)


def _by_riccati(A: RealArray, C: RealArray, K: RealArray, R: RealArray) -> tuple[RealArray, RealArray]:
    """Return the gain that stabilizes A - K C under the noise of a gain that does not, with its covariance; zero where there is none."""
    S = K @ R
    try:
        P = sla.solve_discrete_are(A.T, C.T, S @ K.T, R, s=S)
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros_like(K), R
    covariance = C @ P @ C.T + R
    return np.asarray(np.linalg.solve(covariance, (A @ P @ C.T + S).T).T), np.asarray(covariance)
