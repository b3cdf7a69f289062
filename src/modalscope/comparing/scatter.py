"""How far a value may be from the truth: between methods, over orders, and what the noise alone leaves open.

Methods that read the same record share its noise, so that their scatter alone says too little. What the noise leaves open is
the Cramer-Rao bound of each pole: residues are free in every channel, the noise is what the rebuilt responses leave, white
over lines or samples.
For an ambient record of known length Au's uncertainty laws take its place (S.-K. Au, Mech. Syst. Signal Process. 48, 2014).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modalscope.comparing.agreement import Group
from modalscope.model.checks import Array, RealArray
from modalscope.model.modes import ModalModel
from modalscope.model.response import Response, window_damping

__all__ = ["COVERAGE", "Scatter", "noise_floor", "stated"]

#: The stated scatter is this many times the root of the squared parts together.
COVERAGE = 2.5

#: Methods are not efficient: on impulse responses at 40 dB their errors are two to three times what the noise leaves open at best.
EFFICIENCY = 2.5

#: Nothing is stated more exactly than this (relative): rounding and the noise-free case.
_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class Scatter:
    """Half-widths within which the truth is expected, and what they are made of (standard deviations).

    Parameters
    ----------
    frequency, damping : array, (n,)
        Stated scatter: Hz and ratio.
    frequency_noise, damping_noise : array, (n,)
        What the noise leaves open; NaN where it is not known.
    """

    frequency: RealArray
    damping: RealArray
    frequency_noise: RealArray
    damping_noise: RealArray


def stated(groups: tuple[Group, ...], noise: tuple[RealArray, RealArray]) -> Scatter:
    """Return the stated scatter of every mode: COVERAGE sqrt(between methods^2 + over orders^2 + (EFFICIENCY noise)^2).

    Parameters
    ----------
    groups : tuple of Group
    noise : (array, array)
        Standard deviations of frequency and damping that the noise leaves open.
    """
    parts = []
    for name, open_to_noise in (("frequency", noise[0]), ("damping", noise[1])):
        between = np.array([getattr(g, f"{name}_between") for g in groups])
        orders = np.array([getattr(g, f"{name}_over_orders") for g in groups])
        size = np.array([getattr(g, name) for g in groups])
        known = np.nan_to_num(EFFICIENCY * open_to_noise)
        parts.append(np.maximum(COVERAGE * np.sqrt(between**2 + orders**2 + known**2), _LEAST * size))
    return Scatter(parts[0], parts[1], *noise)


def noise_floor(
    response: Response, modes: ModalModel, rebuilt: Array, cycles: float | None
) -> tuple[RealArray, RealArray]:
    """Return the standard deviations of frequency (Hz) and damping ratio that the noise leaves open.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
    modes : ModalModel
    rebuilt : array, shape of the response
        What is left over is taken for the noise.
    cycles : float, optional
        Length in seconds of the ambient record behind correlations.
    """
    n = len(modes)
    if not response.separable:
        return np.full(n, np.nan), np.full(n, np.nan)
    if response.ambient:
        f, zeta = modes.frequencies, modes.damping_ratios
        if cycles is None or not n:
            return np.full(n, np.nan), np.full(n, np.nan)
        # Au: c.o.v. of f squared = zeta / (2 pi N), of zeta squared = 1 / (2 pi zeta N), N = f T cycles
        return f * np.sqrt(zeta / (2 * np.pi * f * cycles)), zeta * np.sqrt(1 / (2 * np.pi * zeta * f * cycles))
    if not n:
        return np.zeros(0), np.zeros(0)
    information = _information(response, modes, rebuilt)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    covariance = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12, hermitian=True) / np.outer(
        scale, scale
    )
    return _of_poles(modes.poles, covariance)


def _of_poles(poles: Array, covariance: RealArray) -> tuple[RealArray, RealArray]:
    """Carry the covariance of Re s and Im s to f = |s| / 2 pi and zeta = -Re s / |s|."""
    w = np.abs(poles)
    j = 2 * np.arange(poles.size)
    blocks = np.stack([covariance[j, j], covariance[j, j + 1], covariance[j + 1, j + 1]])
    to_f = np.stack([poles.real, poles.imag]) / w / (2 * np.pi)
    to_zeta = np.stack([-(poles.imag**2), poles.real * poles.imag]) / w**3
    variances = [a[0] ** 2 * blocks[0] + 2 * a[0] * a[1] * blocks[1] + a[1] ** 2 * blocks[2] for a in (to_f, to_zeta)]
    return np.sqrt(np.maximum(variances[0], 0)), np.sqrt(np.maximum(variances[1], 0))


def _information(response: Response, modes: ModalModel, rebuilt: Array) -> RealArray:
    """Fisher information of (Re s_1, Im s_1, Re s_2, ...) with residues and direct terms of all channels eliminated.

    In channel c the derivative with respect to Re s is a e1 + b e2 and to Im s it is -b e1 + a e2, with the residue a + j b and
    the functions e1, e2 of the squared pole; sum_c S_c' E'(I - Q Q')E S_c / variance_c, Q spanning what residues can explain.
    """
    poles = modes.poles - window_damping(response)
    basis = response.basis(poles)
    linear = np.hstack([basis.terms, basis.functions])
    Q = np.linalg.qr(linear / np.maximum(np.linalg.norm(linear, axis=0), 1e-300))[0]
    E = response.derivatives(poles)
    E = E - Q @ (Q.T @ E)
    gram = E.T @ E
    rows, unknown = E.shape[0], Q.shape[1]
    left = response.values - rebuilt
    variance = np.sum(np.abs(left) ** 2, axis=0) / max(rows - unknown, 1)
    level = np.mean(np.abs(response.values) ** 2, axis=0)
    variance = np.maximum(variance, 1e-28 * level.max())
    residues = modes.residues
    n = len(modes)
    total = np.zeros((2 * n, 2 * n))
    j = 2 * np.arange(n)
    for o, i in np.ndindex(variance.shape):
        S = np.zeros((2 * n, 2 * n))
        S[j, j], S[j + 1, j] = residues[:, o, i].real, residues[:, o, i].imag
        S[j, j + 1], S[j + 1, j + 1] = -residues[:, o, i].imag, residues[:, o, i].real
        total += S.T @ gram @ S / variance[o, i]
    return total
