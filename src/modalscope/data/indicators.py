"""Compute indicators of modes: MAC, phase collinearity, amplitude coherence, EMAC, and mode indicator functions.

A modal coordinate's rows of the observability factor are c_j g_0, c_j g_1, ... and its columns of the controllability factor
b_j h_0, b_j h_1, ...: in the time domain g_k = h_k = z_j^k, in the frequency domain the basis polynomials and 1 / (x_i - s_j).
How well the identified factors obey that is the amplitude coherence and the extended modal amplitude coherence (EMAC).
All are invariant under a change of coordinates of the model and lie between 0 and 1 (MSV up to its scale, MPD in degrees).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import known_quantity
from modalscope.data.modes import ModalModel
from modalscope.data.responses import FrequencyResponse
from modalscope.data.sizes import check_size
from modalscope.numerics.arguments import named, plainly
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_axes, check_kind, complex_array, real_array
from modalscope.numerics.errors import DataError

__all__ = [
    "cluster_mpc",
    "clusters",
    "cmif",
    "decay_step",
    "mac",
    "mmif",
    "modal_singular_values",
    "mpc",
    "mpd",
    "prominence",
]


def coherence(inner: Array, identified: Array, expected: Array) -> RealArray:
    """Return |<q, e>| / (|q| |e|) of each mode from the inner product and the squared norms, 0 to 1; 0 without amplitude."""
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.abs(inner) / (np.sqrt(identified) * np.sqrt(expected))
    return np.where(np.isfinite(value), np.minimum(value, 1.0), 0.0)


def agreement(real: RealArray, imaginary: RealArray, identified: RealArray, expected: RealArray) -> RealArray:
    """Return `emac_channels` from Re and Im of a conj(e), whose angle is the phase between both, |a|^2 and |e|^2."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore", under="ignore"):
        ratio = np.sqrt(np.minimum(identified, expected) / np.maximum(identified, expected))
    phase = np.arctan2(np.abs(imaginary), real)
    # where both are zero, or beyond numbers, there is no ratio, and nothing agrees
    return np.fmax(ratio * (1 - 4 / np.pi * phase), 0.0)


def repeated(poles: ArrayLike, width: float = 2e-3) -> list[Array]:
    """Return the groups of poles, two and more, of which each lies within `width` (relative) of a neighbour.

    `poles` (n,): rad/s. `width`: largest distance of neighbours over the larger of their moduli.
    """
    s = np.asarray(poles, dtype=np.complex128)
    some = _alike_in_size(s, width)
    near = np.abs(s[some, None] - s[some]) <= width * np.maximum(np.abs(s[some, None]), np.abs(s[some]))
    first, before = np.arange(some.size), None  # the first member of each pole's group, as far as chains are followed
    while before is None or np.any(first != before):
        before = first
        first = np.where(near, before, some.size).min(axis=1, initial=some.size)
        first = first[first]
    return [group for k in np.unique(first) if (group := some[first == k]).size > 1]


def _alike_in_size(s: ComplexArray, width: float) -> Array:
    """Return the indices, in order, of numbers whose moduli are nearer to another's than `width`: no others can be neighbours."""
    size = np.abs(s)
    by_size = np.argsort(size, kind="stable")
    apart = np.diff(size[by_size]) > width * size[by_size[1:]] * (1 + 1e-12)  # a difference of moduli is rounded
    alone = np.append(True, apart)[: s.size] & np.append(apart, True)[: s.size]
    return np.sort(by_size[~alone])


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
    quantity = known_quantity(response.quantity, "a mode indicator function:", lost=lost)
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
        raise DataError(f"curves need one row per frequency, {len(f)}", f"they have {len(c)}", "Correct one of them.")
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
            higher = [np.flatnonzero(side > curve[k]) for side in sides]
            lowest = [side[: at[0] + 1 if at.size else None].min() for side, at in zip(sides, higher, strict=True)]
            saddle = max(lowest)
            best = max(best, float(curve[k] / saddle)) if saddle > 0 else np.inf
    return best


#: Values of shapes that are turned at a time.
_NUMBERS_AT_A_TIME = 100_000


@named()
def mac(shapes_a: ArrayLike | ModalModel, shapes_b: ArrayLike | ModalModel | None = None) -> RealArray:
    """Modal assurance criterion |a* b|^2 / (a* a)(b* b) between the columns of two sets of shapes.

    Parameters
    ----------
    shapes_a : array, (l, na), or ModalModel
    shapes_b : array, (l, nb), or ModalModel, optional
        `shapes_a` itself by default. Of two sets of modes the outputs must be the same, in the same order.

    Returns
    -------
    array, (na, nb)
        1 for shapes equal but for a complex factor, 0 for orthogonal ones (and for a shape of zeros).

    Raises
    ------
    DataError
        A different number of channels, or modes of other outputs.

    Examples
    --------
    >>> mac([[1, 1], [1, -1]]).round(3)
    array([[1., 0.],
           [0., 1.]])
    """
    if isinstance(shapes_a, ModalModel) and isinstance(shapes_b, ModalModel):
        _same_outputs(shapes_a, shapes_b)
    first = shapes_a.shapes if isinstance(shapes_a, ModalModel) else shapes_a
    second = shapes_b.shapes if isinstance(shapes_b, ModalModel) else shapes_b
    a = complex_array("shapes_a", first, "(channels,) or (channels, modes)", (1, 2))
    b = a if second is None else complex_array("shapes_b", second, "(channels,) or (channels, modes)", (1, 2))
    a, b = (x[:, None] if x.ndim == 1 else x for x in (a, b))
    if a.shape[0] != b.shape[0]:
        raise DataError(
            "MAC needs the same channels", f"there are {a.shape[0]} and {b.shape[0]}", "Select the same in both."
        )
    cross = np.abs(a.conj().T @ b) ** 2
    norms = np.sum(np.abs(a) ** 2, axis=0)[:, None] * np.sum(np.abs(b) ** 2, axis=0)
    return np.asarray(np.divide(cross, norms, out=np.zeros_like(cross, dtype=float), where=norms > 0))


@named()
def mac_std(modes_a: ModalModel, modes_b: ModalModel | None = None) -> RealArray:
    """Standard deviation of the MAC between modes, from those of the components of their shapes.

    With unit vectors a, b and c = a* b an error d of a changes the MAC m = |c|^2 by 2 Re d* (c* b - m a) to first order, which is nothing
    for shapes that are equal or orthogonal: there m = 1 - |d|^2 across the shape, or |d* b|^2. For errors of components that are
    independent and circular, with E |d_o|^2 = s_o of a and t_o of b, both have together the variance

        2 sum_o |c* b - m a|_o^2 s_o + 2 sum_o |c a - m b|_o^2 t_o + (sum_o |b_o|^2 s_o + |a_o|^2 t_o)^2
        + sum_o (m^2 - 2 m |a_o b_o|) (s_o + t_o)^2

    What errors of components have in common, from the error of their pole, is left out.

    Parameters
    ----------
    modes_a : ModalModel
        With `shapes_std`.
    modes_b : ModalModel, optional
        Of the same outputs; `modes_a` itself by default: between a mode and itself the deviation is zero.

    Returns
    -------
    array, (na, nb)
        NaN where the deviations of a shape are not known.

    Raises
    ------
    DataError
        Modes without deviations of shapes, or of other outputs.

    Examples
    --------
    >>> import modalscope as ms
    >>> modes = ms.ModalModel(
    ...     poles=[-1 + 100j, -1 + 200j], shapes=[[1, 1], [1, -1]], shapes_std=[[0.01, 0.02], [0.01, 0.02]]
    ... )
    >>> mac_std(modes).round(5)  # of orthogonal shapes: errors squared
    array([[0.     , 0.00025],
           [0.00025, 0.     ]])
    """
    other = modes_a if modes_b is None else modes_b
    _same_outputs(modes_a, other)
    for name, modes in (("modes_a", modes_a), ("modes_b", other)):
        if modes.shapes_std is None:
            raise DataError(
                "the standard deviation of a MAC:",
                f"{name} has no standard deviations of its shapes",
                "Refine the modes: ms.refine(data, modes).",
            )
    (x, y), (s, t) = zip(*(_unit_shapes(modes) for modes in (modes_a, other)), strict=True)
    a, b, s, t = x[:, :, None], y[:, None], s[:, :, None], t[:, None]  # (l, n, m)
    c = np.sum(a.conj() * b, axis=0)
    m = np.abs(c) ** 2
    linear = 2 * np.abs(c.conj() * b - m * a) ** 2 * s + 2 * np.abs(c * a - m * b) ** 2 * t
    across = np.sum(np.abs(b) ** 2 * s + np.abs(a) ** 2 * t, axis=0) ** 2
    variance = np.sum(linear + (m**2 - 2 * m * np.abs(a * b)) * (s + t) ** 2, axis=0) + across
    if modes_b is None:
        np.fill_diagonal(variance, 0)
    return np.asarray(np.sqrt(np.maximum(variance, 0)))


def _unit_shapes(modes: ModalModel) -> tuple[ComplexArray, RealArray]:
    """Return shapes of length one and the variances of their components, (l, n) each."""
    size = np.maximum(np.linalg.norm(modes.shapes, axis=0), 1e-300)
    return modes.shapes / size, (np.asarray(modes.shapes_std) / size) ** 2


def _same_outputs(a: ModalModel, b: ModalModel) -> None:
    if a.output_dofs != b.output_dofs:
        odd = sorted(set(a.output_dofs) ^ set(b.output_dofs)) or ["their order"]
        raise DataError(
            "the MAC of two sets of modes:",
            f"their outputs differ: {', '.join(odd[:6])}{' ...' if len(odd) > 6 else ''}",
            "Select the same outputs in the same order: modes.select(outputs=...).",
        )


def with_indicators_of_shapes(modes: ModalModel) -> ModalModel:
    """Return modes whose indicators of shapes, and CMI, are those of the shapes that they report, where they have these indicators."""
    own = {name: of(modes.shapes) for name, of in OF_SHAPES.items() if name in modes.indicators}
    if "cmi" in modes.indicators and {"mpc", "emac"} <= set(modes.indicators):
        own["cmi"] = modes.indicators["emac"] * own["mpc"]
    return replace(modes, indicators={**modes.indicators, **own})


@plainly
def mpc(shapes: ArrayLike) -> RealArray:
    """Modal phase collinearity ((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2 of each column, x and y its real and imaginary parts.

    1 for a shape whose components are in phase or in opposition, 0 for a travelling wave. The mean is not removed: that
    would destroy nearly uniform shapes. For repeated modes use `cluster_mpc`.

    Parameters
    ----------
    shapes : array, (l,) or (l, n)
    """
    phi = _columns(shapes)
    xx, yy = np.sum(phi.real**2, axis=0), np.sum(phi.imag**2, axis=0)
    xy = np.sum(phi.real * phi.imag, axis=0)
    total = (xx + yy) ** 2
    return np.asarray(np.divide((xx - yy) ** 2 + 4 * xy**2, total, out=np.zeros_like(total), where=total > 0))


def _columns(shapes: ArrayLike) -> ComplexArray:
    """Return shapes (l, n) as they are, one shape (l,) as a column; NaN may stand for what is not known."""
    phi = np.asarray(shapes, dtype=np.complex128)
    if phi.ndim not in (1, 2):
        raise DataError(
            "shapes needs axes (channels,) or (channels, modes)", f"it has {phi.ndim} axes", "Give one or two."
        )
    return phi[:, None] if phi.ndim == 1 else phi


@plainly
def mpd(shapes: ArrayLike) -> RealArray:
    """Mean phase deviation of each column, degrees: amplitude-weighted mean angle between components and the best straight line.

    The line is the leading singular direction of [Re phi, Im phi]. 0 for a shape of one phase.

    Parameters
    ----------
    shapes : array, (l,) or (l, n)
    """
    phi = _columns(shapes)
    step = max(_NUMBERS_AT_A_TIME // max(phi.shape[1], 1), 1)
    parts = [phi[start : start + step] for start in range(0, len(phi), step)]
    # the best line's direction theta: phi^2 summed has twice its angle
    turn = np.exp(-0.5j * np.angle(sum(np.sum(part**2, axis=0) for part in parts)))
    weighted, total = np.sum([_off_the_line(part, turn) for part in parts], axis=0)
    return np.asarray(np.degrees(np.divide(weighted, total, out=np.zeros_like(total), where=total > 0)))


#: Indicators that follow from shapes alone: of every pole, and again of the shapes that modes report.
OF_SHAPES: dict[str, Callable[[ComplexArray], RealArray]] = {"mpc": mpc, "mpd": mpd}


def _off_the_line(phi: ComplexArray, turn: ComplexArray) -> tuple[RealArray, RealArray]:
    """Return the angles off the line weighted by amplitude, summed, and the amplitudes summed."""
    weight, rotated = np.abs(phi), phi * turn
    off = np.arctan2(np.abs(rotated.imag), np.abs(rotated.real))
    return (weight * off).sum(axis=0), weight.sum(axis=0)


@plainly
def cluster_mpc(shapes: ArrayLike) -> float:
    """Phase collinearity of k repeated modes together: 1 - (s_{k+1} / s_k)^2 of [Re F, Im F], F an orthonormal basis of their span.

    The shapes of repeated modes are any basis of their space, so that single ones may look complex where the space is
    real; this value does not depend on the basis. For k = 1 it is 1 - (s_2 / s_1)^2.

    Parameters
    ----------
    shapes : array, (l, k)
    """
    phi = complex_array("shapes", shapes, "(channels, modes)", 2)
    k = phi.shape[1]
    basis = np.linalg.qr(phi)[0]
    s = np.linalg.svd(np.hstack([basis.real, basis.imag]), compute_uv=False)
    return float(1 - (s[k] / s[k - 1]) ** 2) if s.size > k and s[k - 1] > 0 else 1.0


@plainly
def clusters(poles: ArrayLike, width: float = 2e-3) -> list[Array]:
    """Group poles that lie within `width` (relative) of a neighbour: modes that may be repeated.

    Parameters
    ----------
    poles : array of complex, (n,)
        rad/s.
    width : float
        Largest distance of neighbours over the larger of their moduli.

    Returns
    -------
    list of arrays
        Indices into `poles`; every pole stands in one group.
    """
    several = repeated(poles, width)
    alone = np.setdiff1d(np.arange(np.size(poles)), np.concatenate(several)) if several else np.arange(np.size(poles))
    return sorted([*several, *alone[:, None]], key=lambda group: int(group[0]))


@plainly
def decay_step(evolution: Array, least: float = 0.1) -> Array:
    """Return for each mode the last block whose evolution (K, n) is at least `least` of the first block's.

    At the very last block a heavily damped mode has decayed below rounding and its EMAC would be zero even without
    noise. The comparison is therefore made where a tenth of the amplitude is left.

    Parameters
    ----------
    evolution : array, (K, n)
        The factor by which a mode's block k follows from the first.
    least : float
        Share of the first block's amplitude that must be left.
    """
    check_axes(evolution=(evolution, 2))
    size = np.abs(evolution)
    alive = size >= least * size[0]
    # the last block of the unbroken run from the start, so that a growing tail of polynomials does not count
    return np.asarray(np.maximum(np.argmin(np.vstack([alive, np.zeros((1, alive.shape[1]), bool)]), axis=0) - 1, 0))


@plainly
def modal_singular_values(shapes: Array, participation: Array, z: ComplexArray, samples: int) -> RealArray:
    """Return MSV = sqrt(|c| |b| (1 + |z| + ... + |z|^(samples-2))), the share of a mode in the pulse response, unscaled (OKID).

    Parameters
    ----------
    shapes : array, (l, n)
        c, as columns.
    participation : array, (n, m)
        b, as rows.
    z : array of complex, (n,)
        Poles on the z-plane.
    samples : int
        Of the response.
    """
    check_axes(shapes=(shapes, 2), participation=(participation, 2), z=(z, 1))
    size = np.linalg.norm(shapes, axis=0) * np.linalg.norm(participation, axis=1)
    # an unstable pole counts as an undamped one: its sum would grow without bound
    modulus = np.minimum(np.abs(z), 1)
    gap, terms = 1 - modulus, samples - 1
    total = np.divide(1 - modulus**terms, gap, out=np.full(modulus.shape, float(terms)), where=gap > 1e-12)
    return np.asarray(np.sqrt(size * total))
