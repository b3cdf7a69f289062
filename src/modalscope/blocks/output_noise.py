"""How noisy each output is, seen on block rows whose noise is white: what brings outputs to one level of noise."""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import RealArray

__all__ = ["noise_beside_quietest"]

#: Where modes leave nothing the directions of an output's rows are noise; modes take the strongest, two each, so that a quarter is left
#: to noise up to 3 (q + 1) / 8 modes. More than that can only be taken for noise that is level with the modes.
_QUARTER = 4

#: Noise below this part of an output is not what limits it: forces that were not held and what is no structure leave as much.
_LEAST = 1e-4


def noise_beside_quietest(rows: RealArray, outputs: int) -> RealArray:
    """Return the noise of every output over that of the output with the least, all divided by their root mean squares, (l,).

    White noise of deviation s gives the rows of an output the covariance s^2 S, S the same for all outputs: s is read off a low
    eigenvalue of their products. Least squares weigh each output by 1 / s; levelled by its root mean square a channel that holds
    nothing but noise would have as many directions of size one as there are block rows, before those of weak modes.

    Parameters
    ----------
    rows : array, (l (q + 1), k)
        Block rows of outputs that are divided by their root mean squares.
    outputs : int
        l.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = np.tile([1e-2, 1e-2, 1.0], 20)[:, None] * rng.standard_normal((60, 4000)) / np.sqrt(4000)
    >>> mode = np.tile([1.0, 1.0, 0.0], 20)[:, None] * rng.standard_normal(4000)
    >>> noise_beside_quietest(mode + noise, 3).round(-1)
    array([  0.,   0., 100.])
    """
    noise = np.full(outputs, _LEAST)
    for o in range(outputs):
        own = rows[o::outputs]
        values = np.linalg.eigvalsh(own @ own.T)
        noise[o] = max(np.sqrt(max(values[len(values) // _QUARTER], 0.0)), _LEAST)
    return np.asarray(noise / noise.min(initial=np.inf))
