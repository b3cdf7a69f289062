"""Compute frequency responses from cross spectra: H1, H2 and Hv as one errors-in-variables problem; synchronous averages.

Every output is y = h u + noise, with noise on u, too. For x = [y; u] with spectral matrix S and noise of known
relative powers Lambda = diag(lambda_y, lambda_u), the row g = [1, -h] minimises (g S g*) / (g Lambda g*):

    H1    lambda_u = 0     h = S_yu S_uu^-1, all noise on the output
    H2    lambda_y = 0     all noise on the inputs; with one input h = S_yy / S_uy
    Hv    both             total least squares: the smallest eigenvector of the scaled S

To first order the error is dh = g dS P S_uu^-1 with P = [0; I] - g* (g Lambda)_u / (g Lambda g*), which gives its variance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from modalscope.numerics.checks import Array, BoolArray, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.spectra import CrossSpectra, silent_lines

ESTIMATORS = ("h1", "h2", "hv")

#: Minimum reciprocal condition of the scaled spectral matrix of the inputs: below, they are dependent.
_MIN_CONDITION = 1e-10


class Estimate(NamedTuple):
    """Frequency responses (F, l, m) and the variances E|h - E h|^2 of their elements; None without degrees of freedom."""

    values: ComplexArray
    variance: RealArray | None


class NoisePowers(NamedTuple):
    """Relative noise powers of every output (l,) and input (m,); only ratios matter."""

    outputs: RealArray
    inputs: RealArray


def noise_powers(spectra: CrossSpectra, estimator: str, noise: tuple[ArrayLike, ArrayLike] | None) -> NoisePowers:
    """Return the noise powers of an estimator: given ones, or the same fraction of the power of every channel."""
    l, m = spectra.cross.shape[1:]
    if noise is None:
        outputs = spectra.output_powers.mean(axis=0)
        inputs = np.einsum("fii->i", spectra.inputs).real / spectra.frequencies.size
        outputs = np.where(outputs > 0, outputs, 1.0)  # a dead channel has no power, and no response either
    else:
        try:
            outputs = np.broadcast_to(np.asarray(noise[0], dtype=float), (l,))
            inputs = np.broadcast_to(np.asarray(noise[1], dtype=float), (m,))
        except (ValueError, TypeError, IndexError):
            asked = f"noise needs the powers of {l} outputs and {m} inputs"
            change = "Give a pair (outputs, inputs), each one number, or one per channel."
            raise DataError(asked, f"it is {noise!r}", change) from None
        if estimator == "h1" or not (np.all(outputs > 0) and np.all(inputs > 0)):
            asked = f"estimator={estimator!r} with noise={noise!r}:"
            change = 'Give positive powers with estimator="hv", or leave noise out.'
            raise DataError(asked, "H1 assumes all noise on the outputs, and powers are above zero", change)
    if estimator == "h2":
        outputs = np.zeros(l)
    return NoisePowers(np.asarray(outputs, dtype=float), np.asarray(inputs, dtype=float))


def check_inputs(spectra: CrossSpectra, labels: tuple[str, ...]) -> None:
    """Raise DataError for dependent inputs: fewer averages than inputs, or one that is a multiple of the others."""
    m = len(labels)
    if spectra.averages < m:
        change = f"Give at least {m} runs with different forces, or shorter segments."
        raise DataError(f"responses to {m} inputs:", f"the number of averages is {spectra.averages}", change)
    if m == 1:
        return
    root = np.sqrt(np.einsum("fii->fi", spectra.inputs).real)
    scaled = spectra.inputs / (root[:, :, None] * root[:, None, :])
    least = np.linalg.eigvalsh(scaled)[:, 0]
    dependent = least < _MIN_CONDITION
    if dependent.any():
        first = spectra.frequencies[np.argmax(dependent)]
        raise DataError(
            f"separate responses to {', '.join(labels)}:",
            f"the forces are dependent at {int(np.sum(dependent))} of {least.size} lines, the first at {first:g} Hz",
            f"Measure at least {m} runs with independent forces, or leave an input out with select().",
        )


def solve(spectra: CrossSpectra, estimator: str, noise: NoisePowers) -> Estimate:
    """Return the estimate and its variance on all lines (see the module's head for the formulas)."""
    l, m = spectra.cross.shape[1:]
    free = spectra.effective - m
    if estimator == "h1":
        values = solve_h1(spectra)
        return Estimate(values, _variance_h1(spectra, values, free) if free > 0 else None)
    row = _all_on_inputs if estimator == "h2" else _on_both
    values = np.stack([row(spectra, i, noise) for i in range(l)], axis=1)
    if free <= 0:
        return Estimate(values, None)
    return Estimate(values, np.stack([_variance(spectra, values, i, noise, free) for i in range(l)], axis=1))


def solve_h1(spectra: CrossSpectra) -> ComplexArray:
    """Return S_yu S_uu^-1 on all lines."""
    return _right_divide(spectra.cross, spectra.inputs)


def _right_divide(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Return a b^-1, line by line."""
    return np.asarray(np.linalg.solve(b.transpose(0, 2, 1), a.transpose(0, 2, 1)).transpose(0, 2, 1))


def _all_on_inputs(spectra: CrossSpectra, i: int, noise: NoisePowers) -> ComplexArray:
    """H2: eliminate the exact output, then take the smallest eigenvector of the remaining S_uu."""
    power, Syu = spectra.output_powers[:, i], spectra.cross[:, i, :]
    Syy = np.where(power > 0, power, 1.0)  # a dead output has zero cross spectra, and so a zero response
    scale = np.sqrt(noise.inputs)
    conditional = spectra.inputs - np.conj(Syu)[:, :, None] * Syu[:, None, :] / Syy[:, None, None]
    vectors = np.linalg.eigh(conditional / np.outer(scale, scale))[1]
    g = np.conj(vectors[:, :, 0]) / scale
    return _row(g, -np.sum(g * np.conj(Syu), axis=1) / Syy)


def _on_both(spectra: CrossSpectra, i: int, noise: NoisePowers) -> ComplexArray:
    """Hv: the smallest eigenvector of Lambda^-1/2 S Lambda^-1/2."""
    S = _joint(spectra, i)
    scale = np.sqrt(np.concatenate([noise.outputs[i : i + 1], noise.inputs]))
    vectors = np.linalg.eigh(S / np.outer(scale, scale))[1]
    g = np.conj(vectors[:, :, 0]) / scale
    return _row(g[:, 1:], g[:, 0])


def _row(on_inputs: ComplexArray, on_output: ComplexArray) -> ComplexArray:
    """Return h = -g_u / g_y; 0 for an output without part in it (a dead channel)."""
    zero = np.abs(on_output) < np.finfo(float).tiny
    return np.asarray(np.where(zero[:, None], 0, -on_inputs / np.where(zero, 1, on_output)[:, None]))


def _joint(spectra: CrossSpectra, i: int) -> ComplexArray:
    """Return S of x = [y_i; u], (F, 1 + m, 1 + m)."""
    lines, m = spectra.inputs.shape[:2]
    S = np.empty((lines, 1 + m, 1 + m), dtype=complex)
    S[:, 0, 0] = spectra.output_powers[:, i]
    S[:, 0, 1:], S[:, 1:, 0] = spectra.cross[:, i, :], np.conj(spectra.cross[:, i, :])
    S[:, 1:, 1:] = spectra.inputs
    return S


def _variance_h1(spectra: CrossSpectra, values: ComplexArray, free: float) -> RealArray:
    """Return the power of y - h u, g S g*, over n - m times the diagonal of S_uu^-1."""
    explained = 2 * np.sum(np.conj(values) * spectra.cross, axis=2).real
    model = np.einsum("fli,fij,flj->fl", values, spectra.inputs, np.conj(values), optimize=True).real
    residual = np.clip(spectra.output_powers - explained + model, 0, None)
    inverse = np.einsum("fii->fi", np.linalg.inv(spectra.inputs)).real
    return np.asarray(residual[:, :, None] / free * inverse[:, None, :])


def _variance(spectra: CrossSpectra, values: ComplexArray, i: int, noise: NoisePowers, free: float) -> RealArray:
    """Return (g S g*) / (n - m) times the diagonal of (P S_uu^-1)* S (P S_uu^-1), S_uu without its noise."""
    S, h = _joint(spectra, i), values[:, i, :]
    weights = np.concatenate([noise.outputs[i : i + 1], noise.inputs])
    g = np.concatenate([np.ones((h.shape[0], 1)), -h], axis=1)
    residual = np.einsum("fi,fij,fj->f", g, S, np.conj(g), optimize=True).real.clip(0)
    size = np.sum(np.abs(g) ** 2 * weights, axis=1)
    size = np.where(size > 0, size, 1.0)
    P = np.zeros((*S.shape[:2], h.shape[1]), dtype=complex)
    P[:, 1:] = np.eye(h.shape[1])
    P -= np.conj(g)[:, :, None] * (g * weights)[:, None, 1:] / size[:, None, None]
    clean = spectra.inputs - (residual / size)[:, None, None] * np.diag(noise.inputs)
    M = _right_divide(P, clean)
    spread = np.einsum("fia,fij,fja->fa", np.conj(M), S, M, optimize=True).real
    return np.asarray((residual / free)[:, None] * spread.clip(0))


def coherence_of(spectra: CrossSpectra) -> RealArray | None:
    """Return S_yu S_uu^-1 S_uy / S_yy, (F, l): ordinary coherence of one input, multiple coherence of several.

    None when there are no more averages than inputs: it would be 1 whatever the data.
    """
    if spectra.effective <= spectra.cross.shape[2]:
        return None
    explained = np.sum(_right_divide(spectra.cross, spectra.inputs) * np.conj(spectra.cross), axis=2).real
    power = spectra.output_powers
    ratio: Array = np.divide(explained, power, out=np.zeros_like(power), where=power > 0)
    return np.clip(ratio, 0, 1)


class Synchronous(NamedTuple):
    """Synchronous average: lines (Hz), responses with variance, coherence, periods a run, number of lines without force."""

    frequencies: RealArray
    estimate: Estimate
    coherence: RealArray | None
    periods: int
    silent: int


def synchronous(
    outputs: RealArray, inputs: RealArray, sampling_rate: float, period: int, settle: int, labels: tuple[str, ...]
) -> Synchronous:
    """Average records (R, N, l) and (R, N, m) over their periods and solve Y = H U over the runs.

    With the mean transforms Y_r, U_r of every run, H = sum_r Y_r U_r* (sum_r U_r U_r*)^-1, without a window. The residuals
    e_p = Y_p - H U_p of single periods scatter with power s^2, their mean over P periods with s^2 / P: the variance of H is s^2 / P times
    the diagonal of (sum_r U_r U_r*)^-1.

    Raises DataError when no period remains after `settle`, and for dependent inputs.

    References
    ----------
    Pintelon and Schoukens, "System Identification: A Frequency Domain Approach", section 2.5.
    """
    runs, samples = outputs.shape[:2]
    periods = samples // period - settle
    if periods < 1:
        asked = f"an average over periods of {period} samples after {settle} of settling:"
        raise DataError(asked, f"a run has {samples // period}", "Lower settle, or measure more periods.")
    kept = slice(settle * period, (settle + periods) * period)
    Y = fft.rfft(outputs[:, kept].reshape(runs, periods, period, -1), axis=2)  # (R, P, F, l)
    U = fft.rfft(inputs[:, kept].reshape(runs, periods, period, -1), axis=2)
    lines = np.asarray(fft.rfftfreq(period, 1 / sampling_rate))
    Ym, Um = Y.mean(axis=1), U.mean(axis=1)
    spectra = CrossSpectra(
        frequencies=lines,
        outputs=np.sum(np.abs(Ym) ** 2, axis=0),
        cross=np.einsum("rfi,rfj->fij", Ym, np.conj(Um)),
        inputs=np.einsum("rfi,rfj->fij", Um, np.conj(Um)),
        averages=runs,
        effective=float(runs),
    )
    # between the lines of a multisine the forces are noise, far above rounding: a driven line exceeds it
    silent = silent_lines(spectra) | _only_noise(U, Um)
    if np.all(silent):
        asked = f"an average over periods of {period} samples:"
        change = 'Correct the period, or give excitation="random".'
        raise DataError(asked, "the forces do not repeat with this period", change)
    spectra = spectra.at_lines(~silent)
    check_inputs(spectra, labels)
    H = solve_h1(spectra)
    Y, U = Y[:, :, ~silent], U[:, :, ~silent]
    variance, coherence = _scatter(Y, U, H, spectra.inputs) if periods > 1 else (None, None)
    return Synchronous(spectra.frequencies, Estimate(H, variance), coherence, periods, int(np.sum(silent)))


def _scatter(Y: ComplexArray, U: ComplexArray, H: ComplexArray, inputs: ComplexArray) -> tuple[RealArray, RealArray]:
    """Return the variance of H (F, l, m) and the coherence (F, l) from the residuals of single periods (R, P, F, ...)."""
    runs, periods = Y.shape[:2]
    e = Y - np.einsum("fij,rpfj->rpfi", H, U, optimize=True)
    scatter = np.sum(np.abs(e - e.mean(axis=1, keepdims=True)) ** 2, axis=(0, 1)) / (runs * (periods - 1))
    inverse = np.einsum("fii->fi", np.linalg.inv(inputs)).real
    power = np.mean(np.abs(Y) ** 2, axis=(0, 1))
    coherence = np.clip(1 - np.divide(scatter, power, out=np.ones_like(power), where=power > 0), 0, 1)
    return np.asarray(scatter[:, :, None] / periods * inverse[:, None, :]), coherence


def _only_noise(U: ComplexArray, Um: ComplexArray) -> BoolArray:
    """Return (F,) whether the mean over periods of some input is below three times its standard deviation."""
    runs, periods = U.shape[:2]
    power = np.mean(np.abs(Um) ** 2, axis=0)  # (F, m)
    if periods == 1:
        return np.zeros(power.shape[0], dtype=bool)
    scatter = np.sum(np.abs(U - Um[:, None]) ** 2, axis=(0, 1)) / (runs * (periods - 1) * periods)
    return np.asarray(np.any(power <= 9 * scatter, axis=1))
