"""The noise model that a projection of records knows beside the states: what is new in a sample, and what it changes later on.

In the coordinates of [inputs; past; y(t); y(t + 1); ...] the rows of y(t) hold the innovation e(t), what neither inputs nor past
predict, and of the later outputs y(t + k) what follows from it, C A^(k-1) K e(t).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from modalscope.model.checks import RealArray

__all__ = ["kalman_gain"]

#: Innovations below this share of the outputs are rounding.
_ROUNDING = 1e-11


def kalman_gain(future: RealArray, A: RealArray, C: RealArray, freedom: float) -> tuple[RealArray, RealArray]:
    """Return the gain K (n, l) of x(k+1) = A x + B u + K e, y = C x + D u + e, and the covariance of e (l, l).

    With E (l, l) the innovations in their own coordinates and F (l, l q) the later outputs there, F = E [C K; C A K; ...]', so that
    K = [C; C A; ...]# (E^-1 F)'. A gain that would not let errors decay (A - K C) is replaced by the one of the Riccati equation with
    the same covariances.

    Parameters
    ----------
    future : array, (l, l (q + 1))
        [E, F], divided by the root of the number of times.
    A, C : array
        Of a model of the outputs, sampled.
    freedom : float
        Times over times less what was fitted: the innovations' share that was fitted away is put back.
    """
    l, n = C.shape
    E, F = future[:, :l], future[:, l:]
    if np.abs(E).max() < _ROUNDING:
        return np.zeros((n, l)), np.zeros((l, l))
    rows, power = [], np.array(C)
    for _ in range(F.shape[1] // l):
        rows.append(power)
        power = power @ A
    follows = np.linalg.lstsq(E, F, rcond=_ROUNDING)[0]
    K = np.asarray(np.linalg.lstsq(np.concatenate(rows), follows.T, rcond=None)[0])
    covariance = np.asarray(freedom * (E.T @ E))
    if np.abs(np.linalg.eigvals(A - K @ C)).max() >= 1:
        K, covariance = _by_riccati(A, C, K, covariance)
    return K, covariance


def _by_riccati(A: RealArray, C: RealArray, K: RealArray, R: RealArray) -> tuple[RealArray, RealArray]:
    """Return the gain that stabilizes A - K C under the noise of a gain that does not, with its covariance."""
    S = K @ R
    try:
        P = sla.solve_discrete_are(A.T, C.T, S @ K.T, R, s=S)
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros_like(K), R
    covariance = C @ P @ C.T + R
    return np.asarray(np.linalg.solve(covariance, (A @ P @ C.T + S).T).T), np.asarray(covariance)
