"""What modes outside a band leave in it: their skirts, told by poles beside the band that stay where they are.

A skirt has its only singularities at the poles of its mode and is smooth in the band, the less so the nearer these lie. With d the
distance from an end, functions of this kind are told by fixed poles at distances d, d / 2, d / 4, ... to an error that falls with
exp(-c sqrt(n)) for n of them, however near the singularity comes, and their residues follow by least squares.

Source: A. Gopal and L. N. Trefethen, SIAM J. Numer. Anal. 57, 2019.
"""

from __future__ import annotations

import numpy as np

from modalscope.model.checks import ComplexArray
from modalscope.model.response import Response
from modalscope.model.window import line_step

__all__ = ["skirts"]

#: Each pole lies so many times nearer to its end of the band than the one before, the nearest so many lines off: nearer ones would be
#: modes at the end.
_NEARER, _LINES = 2.0, 8.0


def skirts(response: Response) -> ComplexArray:
    """Return poles on either side of the band of lines (n,) in rad/s, at 45 degrees off each end; none for samples and few lines.

    Parameters
    ----------
    response : Response
    """
    if response.grid is None or len(response.grid) < 2 * _LINES:
        return np.zeros(0, dtype=complex)
    low, high = 2 * np.pi * np.array(response.span)
    farthest, nearest = high - low, 2 * np.pi * _LINES * line_step(response)
    count = int(np.log(farthest / nearest) / np.log(_NEARER)) + 1
    away = farthest / _NEARER ** np.arange(count) / np.sqrt(2)
    below, above = 1j * low - (1 + 1j) * away, 1j * high - (1 - 1j) * away
    top = np.inf if response.sampling_rate is None else np.pi * response.sampling_rate
    poles = np.concatenate([below[below.imag > 0], above[above.imag < top]]) + response.added_damping
    return np.asarray(poles, dtype=complex)
