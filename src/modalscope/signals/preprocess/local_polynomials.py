"""Estimate frequency responses without leakage by local polynomial or rational models on a few adjacent lines of whole runs.

The transform of a whole run obeys Y = G U + T + V exactly, T from the states at both ends. On the lines k + r, r = -n ... n, both are
polynomials of r, or ratios of polynomials with one denominator:

    local polynomial    Y(k + r) = (g_0 + g_1 r + ...) U(k + r) + t_0 + t_1 r + ... + V
    local rational      (1 + d_1 r + ...) Y(k + r) = (b_0 + b_1 r + ...) U(k + r) + i_0 + i_1 r + ... + V

by linear least squares line by line; G = g_0 or b_0. The residual is the noise, and gives the variance. There is no window, average or
leakage; the polynomial is biased where a resonance is narrower than its lines, the rational model is not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import fft

from modalscope.data.records import Signals
from modalscope.numerics.arguments import COUNT, named
from modalscope.numerics.checks import ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.excitation import driven_records

#: Local models by name.
LOCAL = ("lpm", "lrm")

#: Minimum degrees of freedom of a line by default: the relative standard deviation of its noise power is then a third.
_MIN_FREEDOM = 9

#: Minimum reciprocal condition of the regressors: below, forces are dependent.
_MIN_CONDITION = 1e-10

#: Complex numbers in the equations solved at a time.
_MAX_NUMBERS = 2_000_000


class LocalEstimate(NamedTuple):
    """Estimate by local models on the lines of a whole run.

    Attributes
    ----------
    frequencies : array, (F,)
        Hz, without 0 and half the sampling rate.
    values : array of complex, (F, l, m)
        Frequency responses.
    variance : array, (F, l, m)
        E|H - E H|^2 of their elements.
    noise : array, (F, l)
        Power spectral density of the noise on every output, one-sided.
    coherence : array, (F, l)
        The part of every output's power near the line that is not noise.
    half_width : int
        Lines on either side of an estimate.
    """

    frequencies: RealArray
    values: ComplexArray
    variance: RealArray
    noise: RealArray
    coherence: RealArray
    half_width: int


@named(kind=LOCAL, degree=COUNT, half_width=COUNT)
def local_models(signals: Signals, kind: str = "lrm", degree: int = 2, half_width: int | None = None) -> LocalEstimate:
    """Estimate frequency responses by a local polynomial or rational model on every line.

    Parameters
    ----------
    signals : Signals
        With inputs that differ from line to line: random forces, of any beginning and end. Several runs share the response, not the
        transient.
    kind : {"lpm", "lrm"}
        Local polynomial or rational model.
    degree : int
        Of all polynomials.
    half_width : int, optional
        Lines on either side; by default the fewest with nine equations more than unknowns.

    Raises
    ------
    DataError
        No inputs, too few lines, or forces that are multiples of each other, or so smooth over the lines that they look like transients.

    References
    ----------
    Pintelon and Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., 2012, chapter 7.

    Examples
    --------
    >>> from modalscope.data import StateSpace
    >>> model = StateSpace(A=[[0.9, 0.4], [-0.4, 0.9]], B=[[1], [0]], C=[[1, 1]], dt=1.0)
    >>> u = np.random.default_rng(0).standard_normal((1000, 1))
    >>> frf = local_models(Signals(outputs=model.simulate(u), inputs=u, sampling_rate=1.0))
    >>> bool(np.allclose(frf.values, model.frequency_response(frf.frequencies).values, rtol=1e-3))
    True
    """
    records = driven_records(signals, "frequency responses")
    inside = slice(1, (signals.samples + 1) // 2)  # without 0 Hz and half the sampling rate
    Y, U = (np.asarray(fft.rfft(x, axis=1)[:, inside]) for x in records)
    runs, lines, m = U.shape
    unknowns = (degree + 1) * (m + runs) + (degree if kind == "lrm" else 0)
    least = -(-(unknowns + 1 - runs) // (2 * runs))
    default = max(-(-(unknowns + _MIN_FREEDOM - runs) // (2 * runs)), 1)
    n = default if half_width is None else half_width
    if n < least or lines < 2 * n + 1:
        asked = f"a local model of degree {degree} on {2 * n + 1} lines of {runs} runs:"
        have = f"it has {unknowns} unknowns in {min(lines, 2 * n + 1) * runs} equations; the runs have {lines} lines"
        raise DataError(asked, have, f"Give half_width={max(least, 1)} or more, lower the degree, or measure longer.")
    solve = _rational if kind == "lrm" else _polynomial
    parts = []
    step = max(1, _MAX_NUMBERS // (runs * (2 * n + 1) * (unknowns + Y.shape[2])))
    for start in range(0, lines, step):
        k = np.arange(start, min(start + step, lines))
        first = np.clip(k - n, 0, lines - 2 * n - 1)  # at the ends of the band the lines lie to one side
        near = first[:, None] + np.arange(2 * n + 1)
        power = np.mean(np.abs(Y[:, near]) ** 2, axis=(0, 2))
        parts.append((*solve(Y[:, near], U[:, near], (near - k[:, None]) / n, degree), power))
    values, variance, noise, power = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    fs, N = signals.sampling_rate, signals.samples
    density = 2 / (fs * N)
    coherence = np.clip(1 - np.divide(noise, power, out=np.ones_like(power), where=power > 0), 0, 1)
    return LocalEstimate(np.arange(1, lines + 1) * fs / N, values, variance, noise * density, coherence, n)


def _regressors(U: ComplexArray, r: RealArray, degree: int) -> ComplexArray:
    """Return the regressors r^s U and, for each run, r^s: (F, R (2 n + 1), (degree + 1) (m + R)), those of g_0 first."""
    runs, lines, width, _ = U.shape
    powers = r[:, :, None] ** np.arange(degree + 1)  # (F, w, s)
    forced = U[:, :, :, None, :] * powers[:, :, :, None]  # (R, F, w, s, m)
    free = np.zeros((runs, lines, width, degree + 1, runs), dtype=complex)
    for run in range(runs):
        free[run, ..., run] = powers
    columns = np.concatenate([forced.reshape(*U.shape[:3], -1), free.reshape(*U.shape[:3], -1)], axis=3)
    return np.asarray(columns.transpose(1, 0, 2, 3).reshape(lines, runs * width, -1))


def _flat(Y: ComplexArray) -> ComplexArray:
    """Return (F, R w, l) from (R, F, w, l)."""
    runs, lines, width, l = Y.shape
    return np.asarray(Y.transpose(1, 0, 2, 3).reshape(lines, runs * width, l))


class _Regressors(NamedTuple):
    """Regressors decomposed once for all outputs: P (F, e, u) spans them, `inverse` (F, u, e) is their pseudo-inverse."""

    P: ComplexArray
    inverse: ComplexArray

    def residual(self, Y: ComplexArray) -> ComplexArray:
        """Return the residual of Y from the regressors, (F, e, k)."""
        return np.asarray(Y - self.P @ (self.P.conj().transpose(0, 2, 1) @ Y))


def _decomposed(K: ComplexArray) -> _Regressors:
    scale = np.linalg.norm(K, axis=1)
    scale = np.where(scale > 0, scale, 1.0)
    P, d, Qh = np.linalg.svd(K / scale[:, None, :], full_matrices=False)
    independent = d[:, -1] > _MIN_CONDITION * d[:, 0]
    if not np.all(independent):
        have = f"on {int(np.sum(~independent))} of {len(d)} lines the forces vanish, or are proportional to others"
        change = "Leave one out with select(), cut the band with filter_band(), or use estimator='h1'."
        raise DataError("a local model of the responses:", have, change)
    inverse = (Qh.conj().transpose(0, 2, 1) / d[:, None, :]) @ P.conj().transpose(0, 2, 1)
    return _Regressors(P, inverse / scale[:, :, None])


def _polynomial(
    Y: ComplexArray, U: ComplexArray, r: RealArray, degree: int
) -> tuple[ComplexArray, RealArray, RealArray]:
    """Return responses (F, l, m), variances and noise power (F, l) of the local polynomial model."""
    m, regressors, outputs = U.shape[3], _decomposed(_regressors(U, r, degree)), _flat(Y)
    response_rows = regressors.inverse[:, :m]
    freedom = outputs.shape[1] - regressors.P.shape[2]
    noise = np.sum(np.abs(regressors.residual(outputs)) ** 2, axis=1) / freedom
    spread = np.sum(np.abs(response_rows) ** 2, axis=2)
    return (response_rows @ outputs).transpose(0, 2, 1), noise[:, :, None] * spread[:, None, :], noise


def _rational(Y: ComplexArray, U: ComplexArray, r: RealArray, degree: int) -> tuple[ComplexArray, RealArray, RealArray]:
    """Return the same for the local rational model, with a denominator for every output.

    The denominator d is fitted to the residuals of the other regressors, b = K# (y - Z d), and the variances are blocks of the inverse
    of [K, Z]'[K, Z].
    """
    m, regressors, outputs = U.shape[3], _decomposed(_regressors(U, r, degree)), _flat(Y)
    powers = np.tile(r[:, :, None] ** np.arange(1, degree + 1), (1, Y.shape[0], 1))
    response_rows, freedom = regressors.inverse[:, :m], outputs.shape[1] - regressors.P.shape[2] - degree
    values, variance, noise = [], [], []
    for i in range(outputs.shape[2]):
        y = outputs[:, :, i : i + 1]
        Z = -powers * y
        free, residual = regressors.residual(Z), regressors.residual(y)
        adjoint = free.conj().transpose(0, 2, 1)
        inverse = np.linalg.pinv(adjoint @ free, hermitian=True)
        d = inverse @ (adjoint @ residual)
        power = np.sum(np.abs(residual - free @ d) ** 2, axis=(1, 2)) / freedom
        through = response_rows @ Z
        spread = np.sum(np.abs(response_rows) ** 2, axis=2)
        spread += np.einsum("fms,fst,fmt->fm", through, inverse, through.conj()).real
        values.append((response_rows @ (y - Z @ d))[:, :, 0])
        variance.append(power[:, None] * spread)
        # the residual of the equations is the noise times the denominator
        noise.append(power / np.mean(np.abs(1 + (powers @ d)[:, :, 0]) ** 2, axis=1))
    return np.stack(values, axis=1), np.stack(variance, axis=1), np.stack(noise, axis=1)
