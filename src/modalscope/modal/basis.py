"""Residues by least squares: B and D of a model, or shapes and residuals of modes, from all lines or samples.

A conjugate pair of poles with residue R = a + j b contributes a g1 + b g2, two functions of the line (or sample) that are the
same for every output and input. One orthogonal decomposition of these functions therefore serves all channels: the data
enter only through their few coefficients. The constant (and residual) terms come first in it, so that they take one
coefficient each and leave the rest to the modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from modalscope.model.channels import QUANTITIES
from modalscope.model.checks import Array, ComplexArray, DataError, RealArray
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import powers_of, to_discrete

__all__ = [
    "ModalBasis",
    "basis_of_lines",
    "basis_of_samples",
    "basis_of_window",
    "check_residuals",
    "fit_error",
    "fit_participation",
    "fit_shapes",
    "rebuilt_rows",
    "residual_powers",
    "scaled_terms",
]


@dataclass(frozen=True, eq=False)
class ModalBasis:
    """What poles (and constant terms) can contribute, as real columns.

    Parameters
    ----------
    terms : array, (K, t)
        Constant and residual terms, which every channel has for itself.
    functions : array, (K, 2 n)
        g1 and g2 of every pole; for a real pole g2 is zero.
    data : array, (K, l, m)
        The response on the same rows.
    """

    terms: RealArray
    functions: RealArray
    data: RealArray


def residual_powers(quantity: str | None, residuals: bool) -> tuple[int, ...]:
    """Return the powers of j w that stand beside the modes: of the direct term or, with residuals, of lower and upper modes.

    Modes below the band look like a mass line, (j w)^(p - 2), and modes above it like a stiffness line, (j w)^p, with p = 0, 1, 2 for
    displacement, velocity and acceleration. Without a known quantity there is the constant alone.
    """
    if quantity is None or not residuals:
        return (0,)
    p = QUANTITIES[quantity]
    return (p - 2, p)


def basis_of_lines(
    response: FrequencyResponse, poles: Array, powers: tuple[int, ...] = (0,), weights: Array | None = None
) -> ModalBasis:
    """Return the functions 1 / (x - pole) and conjugates on the lines, real and imaginary parts stacked.

    x is j w with poles in rad/s; for the response of a sampled system x = exp(j w dt) and the poles go along.

    Raises
    ------
    DataError
        A line at 0 Hz with a residual that divides by its frequency.
    """
    f, rate = response.frequencies, response.sampling_rate
    x, p = (2j * np.pi * f, np.asarray(poles, dtype=complex))
    if rate is not None:
        x, p = np.exp(x / rate), to_discrete(p, 1 / rate)
    check_residuals(response, powers)
    # powers of the relative frequency: only their span matters, and it is better conditioned
    terms = np.stack([(1j * f / _top(f)) ** power for power in powers], axis=1) if powers else np.zeros((f.size, 0))
    return _stacked(1 / (x[:, None] - p), 1 / (x[:, None] - p.conj()), p.imag == 0, terms, response.values, weights)


def check_residuals(response: FrequencyResponse, powers: tuple[int, ...]) -> None:
    """Raise when a residual divides by the frequency of a line at 0 Hz."""
    if powers and min(powers) < 0 and response.frequencies[0] == 0:
        raise DataError(
            "residuals of modes below the band were asked",
            f"the {response.quantity or 'response'} has a line at 0 Hz, where they are infinite",
            "Leave that line out with band(), or ask for residuals=False.",
        )


def _top(frequencies: RealArray) -> float:
    return float(frequencies[-1]) or 1.0


def scaled_terms(terms: Array, powers: tuple[int, ...], frequencies: RealArray) -> RealArray:
    """Return coefficients of powers of j w from those of the basis, which are of the relative frequency."""
    factor = (2 * np.pi * _top(frequencies)) ** -np.asarray(powers, dtype=float)
    return np.asarray(terms * factor[:, None, None])


def basis_of_window(
    own: ComplexArray, pair: ComplexArray, poles: Array, data: ComplexArray, weights: Array | None
) -> ModalBasis:
    """Return the same for functions that are known on the lines: those of the poles (F, n) and of their conjugates."""
    return _stacked(own, pair, np.asarray(poles).imag == 0, np.zeros((len(own), 0)), data, weights)


def _stacked(
    own: ComplexArray, pair: ComplexArray, alone: Array, terms: Array, data: ComplexArray, weights: Array | None
) -> ModalBasis:
    """Return g1 = own + pair and g2 = j (own - pair) for pairs, own for real poles, with real and imaginary parts stacked."""
    lines, outputs, inputs = data.shape
    g1 = np.where(alone, own, own + pair)
    g2 = np.where(alone, 0, 1j * (own - pair))
    functions = np.stack([g1, g2], axis=2).reshape(lines, -1)
    w = (np.ones(lines) if weights is None else np.asarray(weights))[:, None]

    def real(array: Array) -> RealArray:
        return np.vstack([(w * array).real, (w * array).imag])

    return ModalBasis(real(terms), real(functions), real(data.reshape(lines, -1)).reshape(2 * lines, outputs, inputs))


def basis_of_samples(response: ImpulseResponse, poles: Array) -> ModalBasis:
    """Return the functions Re and Im of exp(s t_k) at the samples, counted from the impulse."""
    z = to_discrete(np.asarray(poles, dtype=complex), 1 / response.sampling_rate)
    decay = powers_of(z, response.samples, response.first_sample)
    alone = (np.asarray(poles).imag == 0) | (z.imag == 0)
    g1 = np.where(alone, decay.real, 2 * decay.real)
    g2 = np.where(alone, 0.0, -2 * decay.imag)
    functions = np.stack([g1, g2], axis=2).reshape(response.samples, -1)
    return ModalBasis(np.zeros((response.samples, 0)), functions, response.values)


def fit_participation(basis: ModalBasis, shapes: Array) -> tuple[ComplexArray, RealArray]:
    """Fit participation rows l_j to known shapes c_j, with the terms of every channel, by least squares over all rows.

    Parameters
    ----------
    basis : ModalBasis
    shapes : array of complex, (l, n)
        Given the other way round (participation as columns, with transposed data) the result is the shapes.

    Returns
    -------
    participation : array of complex, (n, m)
    terms : array, (t, l, m)
        Coefficients of the constant and residual terms.
    """
    rows, outputs, inputs = basis.data.shape
    t, n = basis.terms.shape[1], shapes.shape[1]
    columns = np.hstack([basis.terms, basis.functions])
    scale = np.linalg.norm(columns, axis=0)
    used = np.flatnonzero(scale > 0)
    Q, R = sla.qr(columns[:, used] / scale[used], mode="economic", check_finite=False)
    coefficients = (Q.T @ basis.data.reshape(rows, -1)).reshape(-1, outputs, inputs)
    R = R * scale[used]
    # theta = (Re l_1, Im l_1, ...) -> (a, b) of every output: a = cr lr - ci li, b = ci lr + cr li
    spread = np.zeros((outputs, 2 * n, 2 * n))
    j = 2 * np.arange(n)
    spread[:, j, j] = spread[:, j + 1, j + 1] = shapes.real
    spread[:, j, j + 1], spread[:, j + 1, j] = -shapes.imag, shapes.imag
    kept = used[t:] - t
    known = np.einsum("kj,ojp->okp", R[t:, t:], spread[:, kept])[:, :, kept]
    theta = np.zeros((2 * n, inputs))
    target = coefficients[t:].transpose(1, 0, 2)
    theta[kept] = _solve(known.reshape(outputs * (len(R) - t), kept.size), target.reshape(-1, inputs))
    rest = (spread[:, kept] @ theta).transpose(1, 0, 2)
    left = coefficients[:t] - np.tensordot(R[:t, t:], rest, axes=1)
    terms = sla.solve_triangular(R[:t, :t], left.reshape(t, outputs * inputs)) if t else left
    terms = terms.reshape(t, outputs, inputs)
    return theta[::2] + 1j * theta[1::2], terms


def fit_shapes(basis: ModalBasis, participation: Array) -> tuple[ComplexArray, RealArray]:
    """Fit shapes to known participation rows, the other way round: shapes (l, n) and terms (t, l, m)."""
    turned = ModalBasis(basis.terms, basis.functions, basis.data.transpose(0, 2, 1))
    shapes, terms = fit_participation(turned, np.asarray(participation).T)
    return shapes.T, terms.transpose(0, 2, 1)


def _solve(known: RealArray, target: RealArray) -> RealArray:
    """Least squares with columns scaled to length one: poles far apart would otherwise decide the rank by their units."""
    scale = np.linalg.norm(known, axis=0)
    scale = np.where(scale > 0, scale, 1)
    return np.asarray(np.linalg.lstsq(known / scale, target, rcond=None)[0] / scale[:, None])


def rebuilt_rows(basis: ModalBasis, shapes: Array, participation: Array, terms: Array) -> RealArray:
    """Return what modes and terms give on the rows of a basis, (K, l, m): the counterpart of `fit_participation`."""
    residues = shapes.T[:, :, None] * participation[:, None, :]
    coefficients = np.stack([residues.real, residues.imag], axis=1).reshape(2 * len(residues), basis.data[0].size)
    flat = basis.functions @ coefficients + basis.terms @ terms.reshape(len(terms), coefficients.shape[1])
    return np.asarray(flat.reshape(basis.data.shape))


def fit_error(measured: Array, rebuilt: Array) -> tuple[float, RealArray]:
    """Return norm(measured - rebuilt) / norm(measured), in all and per channel (l, m)."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        difference = np.asarray(measured) - rebuilt
        channel = np.linalg.norm(difference, axis=0) / np.linalg.norm(measured, axis=0)
        whole = np.linalg.norm(difference) / np.linalg.norm(measured)
    return float(whole), np.asarray(channel)
