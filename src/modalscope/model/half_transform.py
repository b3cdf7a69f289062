"""The transform of a long real record in the place of its result: a transform of a few million samples takes three times that beside it."""

from __future__ import annotations

import numpy as np
from scipy import fft

from modalscope.model.checks import Array, ComplexArray

__all__ = ["half_transform"]

#: Samples from which on a record is split in two.
_LONG = 1 << 19

#: Lines that are joined at a time.
_AT_A_TIME = 1 << 15


def half_transform(samples: Array, place: ComplexArray) -> None:
    """Write the transform of N real samples on the lines 0 ... N / 2 to a place, (N // 2 + 1,).

    With E and O the transforms of even and of odd samples and w = exp(-2 pi j / N), Y_k = E_k + w^k O_k and Y_(N/2 - k) = (E_k - w^k O_k)*
    for k up to N / 4: E is laid down from the front, O from the back, and each pair takes the place of the two that it is made of.

    Parameters
    ----------
    samples : array, (N,)
    place : array of complex, (N // 2 + 1,)

    Examples
    --------
    >>> x, place = np.random.default_rng(0).standard_normal(1 << 20), np.empty((1 << 19) + 1, complex)
    >>> half_transform(x, place)
    >>> bool(np.allclose(place, np.fft.rfft(x)))
    True
    """
    N = len(samples)
    if N < _LONG or N % 4:
        place[:] = fft.rfft(samples)
        return
    quarter, back = N // 4, place[::-1]
    half_transform(samples[1::2], back[: quarter + 1])
    middle = back[quarter]
    half_transform(samples[::2], place[: quarter + 1])
    place[quarter] -= 1j * middle  # E and O meet here, where w^k = -j and both are real
    for start in range(0, quarter, _AT_A_TIME):
        k = slice(start, min(start + _AT_A_TIME, quarter))
        even = place[k].copy()
        odd = back[k] * np.exp(np.arange(k.start, k.stop) * (-2j * np.pi / N))
        place[k], back[k] = even + odd, (even - odd).conj()
