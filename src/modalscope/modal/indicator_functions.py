"""Mode indicator functions: curves over the lines of a response that show where modes are, before anything is identified."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modalscope.model.channels import known_quantity
from modalscope.model.checks import Array, DataError, RealArray, check_kind, complex_array, real_array
from modalscope.model.entries import plainly
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.sizes import check_size

__all__ = ["cmif", "mmif", "prominence"]


@plainly
def cmif(values: ArrayLike) -> RealArray:
    """Complex mode indicator function: the singular values of H at every line, (F, min(l, m)), largest first.

    Parameters
    ----------
    values : array of complex, (F, l, m)
        H on F lines.
    """
    H = complex_array("values", values, "(lines, outputs, inputs)", 3)
    return np.asarray(np.linalg.svd(H, compute_uv=False))


@plainly
def mmif(response: FrequencyResponse) -> tuple[RealArray, RealArray]:
    """Multivariate mode indicator function: the least in-phase share of the response that a force pattern can reach.

    The eigenvalues of min over f of |Re H f|^2 / |H f|^2 on every line; for velocities, which are in phase with the force at
    resonance, of |Im H f|^2 / |H f|^2. A minimum near 0 is an undamped natural frequency; further curves drop with it where
    modes repeat.

    Parameters
    ----------
    response : FrequencyResponse
        With a known quantity.

    Returns
    -------
    curves : array, (F, k)
        Between 0 and 1, rising; k = min(m, 2 l).
    forces : array, (F, m, k)
        The patterns, of length one.

    Raises
    ------
    DataError
        An unknown quantity.

    Notes
    -----
    Williams, Crowley and Vold, The multivariate mode indicator function in modal analysis, IMAC III (1985). By the singular value
    decomposition [Re H; Im H] = U S V' the eigenvalues are those of U_re' U_re, and f = V S^-1 w.
    """
    check_kind("a mode indicator function", response, FrequencyResponse)
    check_size(response)
    lost = ", and with it the phase at resonance"
    quantity = known_quantity(response.quantity, "a mode indicator function was asked", lost=lost)
    H = response.values / (1j if quantity == "velocity" else 1)
    U, s, Vt = np.linalg.svd(np.concatenate([H.real, H.imag], axis=1), full_matrices=False)
    part = U[:, : H.shape[1]]
    curves, w = np.linalg.eigh(part.transpose(0, 2, 1) @ part)
    floor = np.finfo(float).eps * np.maximum(s[:, :1], np.finfo(float).tiny)
    forces = Vt.transpose(0, 2, 1) @ (w / np.maximum(s, floor)[:, :, None])
    return np.clip(curves, 0, 1), forces / np.linalg.norm(forces, axis=1, keepdims=True)


@plainly
def prominence(curves: ArrayLike, frequencies: ArrayLike, frequency: float, damping_ratio: float) -> float:
    """Largest topographic prominence, as a ratio, of a peak at a frequency in any of several curves over lines.

    The peak within half a bandwidth (damping ratio x frequency) of `frequency`, over the higher of its two saddles: on
    each side the lowest value on the way to something higher, looked for within eight half bandwidths and at least eight lines.
    1 or less means that nothing stands out.

    Parameters
    ----------
    curves : array, (F, k)
        Mode indicator curves, for instance `cmif`.
    frequencies : array, (F,)
        Hz.
    frequency, damping_ratio : float
        Of the mode.

    Raises
    ------
    DataError
        Curves of another number of lines than the frequencies.
    """
    f, c = real_array("frequencies", frequencies, "lines", 1), real_array("curves", curves, "lines, curves", 2)
    if len(c) != len(f):
        raise DataError(
            f"the prominence of peaks on {len(f)} lines was asked",
            f"the curves have {len(c)}",
            "Give both on one axis.",
        )
    step = float(np.median(np.diff(f)))
    half, far = max(damping_ratio * frequency, 2 * step), max(8 * damping_ratio * frequency, 8 * step)
    near = np.flatnonzero(np.abs(f - frequency) <= half)
    first, last = np.searchsorted(f, [frequency - far, frequency + far])
    best = 0.0
    for curve in c.T if near.size else ():
        k = int(near[np.argmax(curve[near])])
        if k in (0, f.size - 1) or curve[k] < max(curve[k - 1], curve[k + 1]):
            continue
        sides = curve[first:k][::-1], curve[k + 1 : min(int(last), f.size - 1) + 1]
        if min(side.size for side in sides):
            saddle = max(_lowest_before_higher(side, curve[k]) for side in sides)
            best = max(best, float(curve[k] / saddle)) if saddle > 0 else np.inf
    return best


def _lowest_before_higher(side: Array, level: float) -> float:
    higher = np.flatnonzero(side > level)
    return float(np.min(side[: higher[0] + 1] if higher.size else side))
