"""Outputs that serve as references of correlations where there are too many for all."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import RealArray
from modalscope.model.signals import Signals

__all__ = ["MOST_REFERENCES", "spanning_outputs"]

#: References that are taken where none are asked: enough for any group of modes that lie within one resonance of each other.
MOST_REFERENCES = 30

#: A channel of which others leave less than this part says nothing that they do not.
_LEFT = 1e-12

#: Of channels that explain the same to this part the first is taken.
_EQUAL = 1e-9


def spanning_outputs(signals: Signals, most: int = MOST_REFERENCES) -> tuple[int, ...]:
    """Return the outputs that together explain most of all, in their own order: all of few.

    Of the correlation coefficients at lag zero, R, one channel j after the other is taken that explains most of what those before it have
    left, sum_i R_ij^2 / R_jj, and what it explains is taken off, R - R_j R_j' / R_jj. A channel of noise explains only itself.

    Parameters
    ----------
    signals : Signals
    most : int

    Examples
    --------
    >>> y = np.random.default_rng(0).standard_normal((500, 2))
    >>> spanning_outputs(Signals(outputs=y @ [[1.0, 2.0, 3.0, 0.0], [0.0, 0.0, 0.0, 1.0]], sampling_rate=1.0), 2)
    (0, 3)
    """
    outputs, _ = signals.by_run()
    count = outputs.shape[2]
    if count <= most:
        return tuple(range(count))
    R = _coefficients(outputs)
    chosen: list[int] = []
    for _ in range(most):
        own = np.diag(R)
        explained = np.where(own > _LEFT, np.sum(R**2, axis=0) / np.maximum(own, _LEFT), 0.0)
        if explained.max() <= 0:
            break
        j = int(np.argmax(explained >= (1 - _EQUAL) * explained.max()))
        chosen.append(j)
        R = R - np.outer(R[:, j], R[j]) / own[j]
    return tuple(sorted(chosen)) or tuple(range(most))


def _coefficients(outputs: RealArray) -> RealArray:
    """Return correlation coefficients of runs (R, N, l) at lag zero; zero for channels at rest."""
    y = outputs - outputs.mean(axis=1, keepdims=True)
    covariance = np.einsum("rti,rtj->ij", y, y, optimize=True)
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, np.inf)
    return np.asarray(covariance / np.outer(size, size))
