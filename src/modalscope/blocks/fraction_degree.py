"""Where the lines of a band lie on the unit circle, and the degree up to which they tell powers of z apart."""

from __future__ import annotations

import numpy as np

from modalscope.model.response import Response

__all__ = ["half_circle", "largest_degree"]

#: A band that starts above this share of its end is shifted to zero, so that its lines fill the half circle.
_SHIFTED_FROM = 0.3

#: The least eigenvalue of a Gram matrix that still has a triangular factor, of one with ones on its diagonal.
_ROUNDING = 1e-13


def half_circle(response: Response) -> tuple[float, float]:
    """Return the frequencies that lie at z = 1 and z = -1, Hz."""
    (low, high), rate = response.span, response.sampling_rate
    if rate is not None:
        return 0.0, rate / 2
    return (0.0 if low < _SHIFTED_FROM * high else low), high


def largest_degree(response: Response) -> int:
    """Return the degree up to which powers of z are told apart by the lines of a band.

    Of p + 1 powers on a circle with a gap from -theta to theta the least eigenvalue of the Gram matrix falls like exp(-c p),
    c = ln(1 + 2 sqrt(a) / (sqrt 2 - sqrt a)), a = 1 - cos theta; it has to stay above rounding.

    Parameters
    ----------
    response : Response

    Source
    ------
    D. Slepian, Bell System Technical Journal 57, 1978, section 2.5.
    """
    (first, last), (low, high) = response.span, half_circle(response)
    gap = np.pi * max(first - low, high - last, 0.0) / (high - low)
    a = np.sqrt(min(1 - np.cos(gap), 2 - 1e-9))
    falls = np.log1p(2 * a / (np.sqrt(2) - a))
    return int(min(np.log(1 / _ROUNDING) / max(falls, 1e-6), 1e6))
