"""Convert poles to frequencies and damping ratios, and classify poles that do not oscillate.

A pole `s` (rad/s) of a continuous system has the undamped frequency `|s| / 2 pi` (Hz) and the damping ratio `-Re s / |s|`;
a pole `z` of the system sampled every `dt` seconds is `exp(s dt)`. Nothing is dropped here: poles that have no frequency
in the usual sense are kept and labelled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modalscope.numerics.checks import BoolArray, ComplexArray, IntArray, RealArray

#: Derivatives of the displacement that each quantity is.
QUANTITIES = {"displacement": 0, "velocity": 1, "acceleration": 2}

#: A pole whose imaginary part is below this fraction of its modulus is called real: eigenvalues of a real matrix carry
#: imaginary parts of rounding size only when they are exactly paired, so the limit needs to cover conversions, no more.
_MAX_IMAGINARY_SHARE = 1e-13

#: A sampled system's pole below this modulus forgets its state within one sample, to rounding.
_MIN_MODULUS = 1e-13

#: Powers below this have subnormal squares, which processors compute up to a hundred times slower.
_MIN_POWER = 1e-150


def frequencies_and_damping(poles: ArrayLike) -> tuple[RealArray, RealArray]:
    """Return undamped frequencies `|s| / 2 pi` in Hz and damping ratios `-Re s / |s|` of continuous poles (rad/s).

    A pole at the origin has frequency and damping ratio 0.

    Examples
    --------
    >>> f, zeta = frequencies_and_damping([-0.1 + 6.2j, -3.0])
    >>> f.round(4), zeta.round(4)
    (array([0.9869, 0.4775]), array([0.0161, 1.    ]))
    """
    s = np.asarray(poles, dtype=np.complex128)
    modulus = np.abs(s)
    zeta = np.divide(-s.real, modulus, out=np.zeros_like(modulus), where=modulus > 0)
    return modulus / (2 * np.pi), zeta


def poles_from(frequencies: ArrayLike, damping_ratios: ArrayLike) -> ComplexArray:
    """Return the poles `2 pi f (-zeta + j sqrt(1 - zeta^2))` in rad/s with non-negative imaginary part, |zeta| <= 1."""
    w = 2 * np.pi * np.asarray(frequencies, dtype=np.float64)
    zeta = np.asarray(damping_ratios, dtype=np.float64)
    return np.asarray(w * (-zeta + 1j * np.sqrt(np.clip(1 - zeta**2, 0, None))), dtype=np.complex128)


def to_continuous(poles: ArrayLike, dt: float) -> ComplexArray:
    """Return `ln(z) / dt`. A negative real z lands on the Nyquist frequency; z = 0 far out on the negative real axis."""
    z = np.asarray(poles, dtype=np.complex128)
    # adding 0.0 turns an imaginary part of -0.0 around, which would put a negative real pole below the axis
    return (np.log(np.maximum(np.abs(z), _MIN_MODULUS**20)) + 1j * np.arctan2(z.imag + 0.0, z.real)) / dt


def to_discrete(poles: ArrayLike, dt: float) -> ComplexArray:
    """Return `exp(s dt)`."""
    return np.exp(np.asarray(poles, dtype=np.complex128) * dt)


def powers_of(poles: ArrayLike, count: int, first: int = 0, *, rows: bool = False) -> ComplexArray:
    """Return z^first, z^(first + 1), ... of each z, (count, n), by doubling: log2(count) products instead of powers.

    With `rows` those of each z are a row, (n, count). What has faded below 1e-150 is zero.

    Examples
    --------
    >>> powers_of([0.5], 4).real.ravel()
    array([1.   , 0.5  , 0.25 , 0.125])
    """
    z = np.atleast_1d(np.asarray(poles, dtype=np.complex128))
    whole = np.empty((z.size, count) if rows else (count, z.size), dtype=np.complex128)
    out = whole.T if rows else whole
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        out[:1], step, done = z**first, z, 1
        while done < count:
            fresh = min(done, count - done)
            np.multiply(out[:fresh], step, out=out[done : done + fresh])
            done, step = done + fresh, step * step
    with np.errstate(divide="ignore", invalid="ignore"):
        lasting = np.log(_MIN_POWER) / np.log(np.abs(z)) - first
    for j in np.flatnonzero((np.abs(z) < 1) & (lasting < count)):
        out[max(int(lasting[j]), 0) + 1 :, j] = 0
    return whole


def one_of_each_pair(poles: ArrayLike) -> IntArray:
    """Return the indices of one pole of each conjugate pair (the one above the axis) and of all real ones, by frequency."""
    s = np.asarray(poles, dtype=np.complex128)
    keep = np.flatnonzero((s.imag > 0) | is_real(s))
    return keep[np.lexsort((s[keep].imag, np.abs(s[keep])))]


def is_real(s: ComplexArray, share: float = _MAX_IMAGINARY_SHARE) -> BoolArray:
    """Return which poles lie on the real axis: imaginary parts of no more than a share of a pole are rounding."""
    return np.abs(s.imag) <= share * np.abs(s)


def overlap(s: ComplexArray, others: ComplexArray) -> BoolArray:
    """Return which poles lie nearer in frequency to which others than their half bandwidths together, (n, k)."""
    return np.abs(s.imag[:, None] - others.imag) < -(s.real[:, None] + others.real)


def pole_kinds(poles: ArrayLike, dt: float | None = None) -> tuple[str, ...]:
    """Name each continuous pole: `mode`, `real`, `unstable`, `nyquist` or `zero`.

    `poles`: continuous poles, rad/s. `dt`: sampling interval of the identified system, seconds. A pole at half the sampling rate (a
    negative real pole of the sampled system) cannot be told from its alias and is called `nyquist`.

    Returns
    -------
    tuple of str
        `zero`: the sampled system forgets it within one sample; `unstable`: it grows.
    """
    s = np.atleast_1d(np.asarray(poles, dtype=np.complex128))
    at_nyquist = np.zeros(s.shape, bool) if dt is None else np.isclose(np.abs(s.imag) * dt, np.pi, rtol=1e-9, atol=0)
    forgotten = np.zeros(s.shape, bool) if dt is None else s.real * dt < np.log(_MIN_MODULUS)
    names = np.select(
        [forgotten, at_nyquist, s.real > 0, is_real(s)], ["zero", "nyquist", "unstable", "real"], default="mode"
    )
    return tuple(str(name) for name in names)


class HasPoles:
    """What data classes say of the continuous poles that they hold; `dt` is the sampling interval of the identified system."""

    __slots__ = ()

    poles: ComplexArray
    dt: float | None

    @property
    def frequencies(self) -> RealArray:
        """Undamped natural frequencies |s| / 2 pi of all poles, Hz."""
        return frequencies_and_damping(self.poles)[0]

    @property
    def damping_ratios(self) -> RealArray:
        """Damping ratios -Re s / |s| of all poles (0.01 is 1 %)."""
        return frequencies_and_damping(self.poles)[1]

    @property
    def kinds(self) -> tuple[str, ...]:
        """What each pole is: mode, real, unstable, nyquist or zero."""
        return pole_kinds(self.poles, self.dt)
