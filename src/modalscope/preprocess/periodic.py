"""Periodic excitation: synchronous averages, whose noise is seen in the scatter from period to period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.model.checks import ComplexArray, DataError, RealArray
from modalscope.preprocess.estimators import Estimate, check_inputs, solve_h1
from modalscope.preprocess.spectra import CrossSpectra, silent_lines

__all__ = ["Synchronous", "synchronous"]


class Synchronous(NamedTuple):
    """What the average over periods gives: lines (Hz), responses with variance, coherence, periods a run, lines without force."""

    frequencies: RealArray
    estimate: Estimate
    coherence: RealArray | None
    periods: int
    silent: int


def synchronous(
    outputs: RealArray, inputs: RealArray, sampling_rate: float, period: int, settle: int, labels: tuple[str, ...]
) -> Synchronous:
    """Average records (R, N, l) and (R, N, m) over their periods and solve Y = H U over the runs.

    With the periods' mean transforms Y_r, U_r of every run, H = sum_r Y_r U_r* (sum_r U_r U_r*)^-1: noise on both sides is
    averaged out, and no window is needed. The residuals e_p = Y_p - H U_p of single periods scatter with power s^2, their
    mean over P periods with s^2 / P: the variance of H is s^2 / P times the diagonal of (sum_r U_r U_r*)^-1.

    Raises
    ------
    DataError
        No period left after `settle`, fewer runs than inputs, or inputs that are multiples of each other.

    References
    ----------
    Pintelon and Schoukens, "System Identification: A Frequency Domain Approach", section 2.5.
    """
    runs, samples = outputs.shape[:2]
    periods = samples // period - settle
    if periods < 1:
        raise DataError(
            f"an average over periods of {period} samples after {settle} of settling was asked",
            f"a run has {samples // period}",
            "Lower settle, or measure more periods.",
        )
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
    # between the lines of a multisine the forces hold noise only, far above rounding: a line is driven when it stands out
    silent = silent_lines(spectra) | _only_noise(U, Um)
    if np.all(silent):
        raise DataError(
            f"an average over periods of {period} samples was asked",
            "no line of the forces stands out of their scatter from period to period",
            'Correct the period, or give excitation="random".',
        )
    spectra = spectra.at_lines(~silent)
    check_inputs(spectra, labels)
    H = solve_h1(spectra)
    variance, coherence = None, None
    if periods > 1:
        variance, coherence = _scatter(Y[:, :, ~silent], U[:, :, ~silent], H, spectra.inputs)
    return Synchronous(spectra.frequencies, Estimate(H, variance), coherence, periods, int(np.sum(silent)))


def _scatter(Y: ComplexArray, U: ComplexArray, H: ComplexArray, inputs: ComplexArray) -> tuple[RealArray, RealArray]:
    """Return the variance of H (F, l, m) and the coherence (F, l) from what single periods (R, P, F, ...) leave."""
    runs, periods = Y.shape[:2]
    e = Y - np.einsum("fij,rpfj->rpfi", H, U, optimize=True)
    scatter = np.sum(np.abs(e - e.mean(axis=1, keepdims=True)) ** 2, axis=(0, 1)) / (runs * (periods - 1))
    inverse = np.einsum("fii->fi", np.linalg.inv(inputs)).real
    power = np.mean(np.abs(Y) ** 2, axis=(0, 1))
    coherence = np.clip(1 - np.divide(scatter, power, out=np.ones_like(power), where=power > 0), 0, 1)
    return np.asarray(scatter[:, :, None] / periods * inverse[:, None, :]), coherence


def _only_noise(U: np.ndarray, Um: np.ndarray) -> np.ndarray:
    """Return (F,) whether the mean over periods of some input is no larger than three times its own deviation."""
    runs, periods = U.shape[:2]
    power = np.mean(np.abs(Um) ** 2, axis=0)  # (F, m)
    if periods == 1:
        return np.zeros(power.shape[0], dtype=bool)
    scatter = np.sum(np.abs(U - Um[:, None]) ** 2, axis=(0, 1)) / (runs * (periods - 1) * periods)
    return np.asarray(np.any(power <= 9 * scatter, axis=1))
