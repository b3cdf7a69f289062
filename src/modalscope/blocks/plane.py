"""Where the lines of a response lie: the s-plane, scaled to the band, or a z-plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from modalscope.model.checks import Array, ComplexArray, DataError, RealArray
from modalscope.model.poles import to_continuous, to_discrete
from modalscope.model.response import Response

__all__ = ["Plane", "plane_of"]


@dataclass(frozen=True)
class Plane:
    """The plane in which the polynomials live: where a line lies, and how poles go back to rad/s.

    Parameters
    ----------
    name : str
        In words.
    point : callable
        Frequencies in Hz -> points x.
    to_s, from_s : callable
        Poles of the realization -> rad/s, and back.
    dt : float or None
        Sampling interval when x = exp(j w dt).
    scale : float or None
        s / x in the s-plane, 1 for the exponential, None for the bilinear map.
    residue_scale : callable
        Poles in this plane -> residue of 1 / (x - x_j) for one of 1 / (s - s_j), or of the sampled system.
    """

    name: str
    point: Callable[[RealArray], ComplexArray]
    to_s: Callable[[Array], ComplexArray]
    from_s: Callable[[Array], ComplexArray]
    dt: float | None = None
    scale: float | None = None
    residue_scale: Callable[[Array], ComplexArray] = np.ones_like


def plane_of(domain: str, response: Response) -> Plane:
    """Return the plane of a domain: s scaled to the band, z by the exponential for sampled responses, else the bilinear map.

    The bilinear map z = (1 + s T/2) / (1 - s T/2), T = 2 / w_max, is exact for continuous responses, the exponential is not.
    """
    top = 2 * np.pi * response.span[1]
    rate = response.sampling_rate
    if domain == "s":
        if rate is not None:
            raise DataError(
                "domain='s' was asked",
                f"the response is that of a system sampled at {rate:g} Hz, which is no rational function of j w",
                "Use domain='z', or leave sampling_rate out when the response is that of the structure itself.",
            )
        scale = top or 1.0
        return Plane(
            f"s-plane, scaled by {top / 2 / np.pi:g} Hz",
            lambda f: np.asarray(2j * np.pi * f / scale, dtype=complex),
            lambda x: np.asarray(np.asarray(x) * scale, dtype=complex),
            lambda s: np.asarray(np.asarray(s) / scale, dtype=complex),
            scale=scale,
            residue_scale=lambda x: np.full(np.shape(x), 1 / scale, dtype=complex),
        )
    if rate is not None:
        dt = 1 / rate
        return Plane(
            "z-plane, exponential",
            lambda f: np.exp(2j * np.pi * f * dt),
            lambda z: to_continuous(z, dt),
            lambda s: to_discrete(s, dt),
            dt,
            1.0,
        )
    return _bilinear(1 / (top or 1.0))


def _bilinear(half: float) -> Plane:
    """Return the plane of z = (1 + s T/2) / (1 - s T/2), with T/2 = `half`."""

    def into(s: Array) -> ComplexArray:
        return np.asarray((1 + np.asarray(s) * half) / (1 - np.asarray(s) * half), dtype=complex)

    def back(z: Array) -> ComplexArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((np.asarray(z) - 1) / (np.asarray(z) + 1) / half, dtype=complex)

    def residue_scale(z: Array) -> ComplexArray:
        # 1 / (s - s_j) = constant + (T / 4) (1 + z_j)^2 / (z - z_j)
        return np.asarray(half / 2 * (1 + np.asarray(z)) ** 2, dtype=complex)

    return Plane("z-plane, bilinear map", lambda f: into(2j * np.pi * f), back, into, residue_scale=residue_scale)
