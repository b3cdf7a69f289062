"""Accuracy of modes: correlation of shapes, complexity, and coherence of what was identified with how a mode must evolve.

A modal coordinate's rows of the observability factor are c_j g_0, c_j g_1, ... and its columns of the controllability factor
b_j h_0, b_j h_1, ...: in the time domain g_k = h_k = z_j^k, in the frequency domain the basis polynomials and 1 / (x_i - s_j).
How well the identified factors obey that is the amplitude coherence and the extended modal amplitude coherence (EMAC).
All are invariant under a change of coordinates of the model and lie between 0 and 1 (MSV up to its scale).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from modalscope.modal.amplitudes import agreement, coherence
from modalscope.modal.indicator_functions import cmif, mmif, prominence
from modalscope.modal.neighbours import repeated
from modalscope.model.checks import Array, ComplexArray, DataError, RealArray, check_axes, complex_array
from modalscope.model.entries import plainly
from modalscope.model.keywords import named
from modalscope.model.modes import ModalModel

__all__ = [
    "amplitude_coherence",
    "cluster_mpc",
    "clusters",
    "cmif",
    "decay_step",
    "emac_channels",
    "mac",
    "mmif",
    "modal_singular_values",
    "mpc",
    "mpd",
    "prominence",
    "weighted_mean",
]


#: Numbers of shapes that are turned together.
_AT_A_TIME = 100_000


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
            "the MAC of two sets of shapes was asked",
            f"they have {a.shape[0]} and {b.shape[0]} channels",
            "Select the same channels in both.",
        )
    cross = np.abs(a.conj().T @ b) ** 2
    norms = np.sum(np.abs(a) ** 2, axis=0)[:, None] * np.sum(np.abs(b) ** 2, axis=0)
    return np.asarray(np.divide(cross, norms, out=np.zeros_like(cross, dtype=float), where=norms > 0))


def _same_outputs(a: ModalModel, b: ModalModel) -> None:
    if a.output_dofs != b.output_dofs:
        odd = sorted(set(a.output_dofs) ^ set(b.output_dofs)) or ["their order"]
        raise DataError(
            "the MAC of two sets of modes was asked",
            f"their outputs differ: {', '.join(odd[:6])}{' ...' if len(odd) > 6 else ''}",
            "Select the same outputs in the same order: modes.select(outputs=...).",
        )


@plainly
def mpc(shapes: ArrayLike) -> RealArray:
    """Modal phase collinearity ((Sxx - Syy)^2 + 4 Sxy^2) / (Sxx + Syy)^2 of each column, x and y its real and imaginary parts.

    1 for a shape whose components are in phase or in opposition, 0 for a travelling wave. The mean is not removed: that
    would destroy nearly uniform shapes. For repeated modes use `cluster_mpc`.

    Parameters
    ----------
    shapes : array, (l, n)
    """
    phi = np.asarray(shapes, dtype=np.complex128)
    xx, yy = np.sum(phi.real**2, axis=0), np.sum(phi.imag**2, axis=0)
    xy = np.sum(phi.real * phi.imag, axis=0)
    total = (xx + yy) ** 2
    return np.asarray(np.divide((xx - yy) ** 2 + 4 * xy**2, total, out=np.zeros_like(total), where=total > 0))


@plainly
def mpd(shapes: ArrayLike) -> RealArray:
    """Mean phase deviation of each column, degrees: amplitude-weighted mean angle between components and the best straight line.

    The line is the leading singular direction of [Re phi, Im phi]. 0 for a shape of one phase.

    Parameters
    ----------
    shapes : array, (l, n)
    """
    phi = np.asarray(shapes, dtype=np.complex128)
    step = max(_AT_A_TIME // max(phi.shape[1], 1), 1)
    parts = [phi[start : start + step] for start in range(0, len(phi), step)]
    # the best line's direction theta: phi^2 summed has twice its angle
    turn = np.exp(-0.5j * np.angle(sum(np.sum(part**2, axis=0) for part in parts)))
    weighted, total = np.sum([_off_the_line(part, turn) for part in parts], axis=0)
    return np.asarray(np.degrees(np.divide(weighted, total, out=np.zeros_like(total), where=total > 0)))


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
def amplitude_coherence(identified: Array, first: Array, evolution: Array) -> RealArray:
    """Modal amplitude coherence |q* qbar| / (|q| |qbar|) of each mode (Juang and Pappa 1985).

    Parameters
    ----------
    identified : array, (K, c, n)
        What was identified: K blocks of c channels for n modes.
    first : array, (c, n)
        The block that starts the evolution.
    evolution : array, (K, n)
        The factor by which a mode's block k must follow from the first.
    """
    check_axes(identified=(identified, 3), first=(first, 2), evolution=(evolution, 2))
    inner = np.einsum("kcn,cn,kn->n", identified.conj(), first, evolution, optimize=True)
    ideal = np.sum(np.abs(first) ** 2, axis=0) * np.sum(np.abs(evolution) ** 2, axis=0)
    return coherence(inner, np.sum(np.abs(identified) ** 2, axis=(0, 1)), ideal)


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
def emac_channels(identified: Array, expected: Array) -> RealArray:
    """Agreement of identified and expected amplitude in each channel and mode (Pappa, Elliott and Schenk 1993).

    min(|a| / |e|, |e| / |a|) times the phase weight 1 - 4 |arg(a / e)| / pi, not below 0.

    Parameters
    ----------
    identified, expected : array of complex, (c, n)
        Amplitudes a of c channels in n modes, and what the modes' evolution predicts for them, e.
    """
    check_axes(identified=(identified, 2), expected=(expected, 2))
    product = identified * np.conj(expected)
    return agreement(product.real, product.imag, _squared(identified), _squared(expected))


def _squared(values: Array) -> RealArray:
    return np.asarray(values.real**2 + values.imag**2)


@plainly
def weighted_mean(values: Array, amplitude: Array) -> RealArray:
    """Mean over channels, weighted by the squared amplitude: sum_c |a|^2 v / sum_c |a|^2 of each mode, (n,).

    Parameters
    ----------
    values : array, (c, n)
        v, of every channel and mode.
    amplitude : array, (c, n)
        a; a mode without any has the mean 0.
    """
    check_axes(values=(values, 2), amplitude=(amplitude, 2))
    weight = np.asarray(np.abs(amplitude), dtype=float) ** 2
    total = weight.sum(axis=0)
    return np.asarray(np.divide((values * weight).sum(axis=0), total, out=np.zeros_like(total), where=total > 0))


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
