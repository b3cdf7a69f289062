"""Estimate noise that rises towards 0 Hz (drift of sensors, integration) on the lines of records and of responses.

A random walk has the spectrum s^2 / |x - 1|^2 on the lines x = exp(j w dt), flicker its root, an integrated walk its square. The equations
of records are valid line by line. Outputs, inputs and transients of a line may therefore be divided by the standard deviation of its
noise, after which all lines have the same noise.

The noise is the residual of rational functions on a few adjacent lines: with polynomials q_d of low degree

    (1 + d_1 x + d_2 x^2) Y(x) = sum_d q_d(x) (G_d U(x) + t_d) + (1 + d_1 x + d_2 x^2) noise,

the first factor common to all outputs, which represents a resonance between the lines.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg as sla

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.numerics.checks import ComplexArray, RealArray

#: The kind of the note.
DRIFT = "noise rises"

#: Degrees of the numerators and of the denominator, lines for every unknown of an output, and the distance of groups of lines, as a part
#: of the frequency.
_NUMERATOR, _DENOMINATOR, _LINES_PER_UNKNOWN, _GROUP_DISTANCE = 2, 2, 4, 0.05

#: Powers of 1 / |x - 1|^2 whose sum the noise is: white noise, flicker, a random walk, an integrated walk.
_NOISE_POWERS = (0.0, 0.5, 1.0, 2.0)

#: Variance by equal weights over that by optimal ones from which on lines are whitened.
_MIN_LOSS = 2.0

#: A group beyond this ratio to the noise is downweighted by its excess; and the part of the groups that must be within it, either way:
#: where there is hardly any noise, the residuals of the approximation scatter over decades.
_OUTLIER_RATIO, _MIN_DESCRIBED = 3.0, 0.9

#: Maximum number of rounds of the fit.
_MAX_ROUNDS = 30

#: Of responses: least lines of a group, and the powers of 1 / f whose sum the noise is: white noise, flicker, signals that were integrated
#: once and twice.
_MIN_GROUP, _POWERS_OF_RESPONSES = 8, (0, 1, 2, 4)

#: What second differences leave is noise where neighbours have at most this correlation: -2/3 of white noise, -2/5 of noise under a Hann
#: window; what is smooth, as near resonances, has nearly one. At least this part of the groups must be noise.
_MOST_ALIKE, _MIN_NOISY = -1 / 3, 0.5

#: Singular values of the numerators' columns below this part of the largest are rounding.
_RANK = 1e-8


def level_lines(spectra: RecordSpectra) -> tuple[RecordSpectra, tuple[Note, ...]]:
    """Return the records (in z) with every line over the standard deviation of its noise, where it rises towards 0 Hz, and a note.

    Examples
    --------
    >>> from modalscope.data import Records, Signals
    >>> from modalscope.data.record_transform import record_spectra
    >>> from modalscope.systems import chain5
    >>> run = chain5().simulate(inputs="white", samples=4000, sampling_rate=12.0, noise=0.01, seed=0)
    >>> walk = np.cumsum(np.random.default_rng(0).standard_normal(run.outputs.shape), axis=0)
    >>> for outputs in (run.outputs, run.outputs + 0.02 * run.outputs.std() * walk):
    ...     signals = Signals(outputs=outputs, inputs=run.inputs, sampling_rate=12.0)
    ...     print([note.kind for note in level_lines(record_spectra(Records(runs=(signals,))))[1]])
    []
    ['noise rises']
    """
    variance = line_noise(spectra)
    if variance is None or _loss(variance) < _MIN_LOSS:
        return spectra, ()
    decibels = 10 * np.log10(variance.max() / variance.min())
    scale = np.sqrt(variance / np.exp(np.mean(np.log(variance))))
    text = f"Noise rises by {decibels:.0f} dB towards 0 Hz (drift): every line was divided by the standard deviation of its noise"
    values, drive = spectra.values / scale[:, None, None], spectra.drive / scale[:, None]
    for array in (values, drive, scale):
        array.setflags(write=False)  # so that it is not copied again
    note = Note(DRIFT, {"decibels": float(decibels)}, text)
    return replace(spectra, values=values, drive=drive, line_scale=scale), (note,)


def line_noise(spectra: RecordSpectra) -> RealArray | None:
    """Return the variance of noise on every line up to a factor, (F,), a sum of powers of 1 / |x - 1|^2; None where none fits."""
    groups = [group for run in spectra.spans_of_runs for group in _groups(run, spectra)]
    if not groups:
        return None
    rise = np.abs(spectra.points - 1) ** -2.0
    columns = (rise / rise.max())[:, None] ** np.array(_NOISE_POWERS)
    powers = np.maximum([_residual_power(spectra, group) for group in groups], np.finfo(float).tiny)
    return _described(columns, groups, powers)


def rising_noise(frequencies: RealArray, values: ComplexArray) -> RealArray | None:
    """Return the variance of the noise of responses (F, c) on every line up to a factor, (F,), where it rises towards 0 Hz, else None.

    Responses of integrated signals, receptances from accelerometers say, are full of it. Beside noise a response is smooth: of white noise
    x_k - (x_k-1 + x_k+1) / 2 has 3/2 of the variance. Its median over groups of lines passes over resonances.

    Examples
    --------
    >>> f, rng = np.arange(1.0, 401.0), np.random.default_rng(0)
    >>> noise = rng.standard_normal((400, 6)) + 1j * rng.standard_normal((400, 6))
    >>> rising_noise(f, noise) is None
    True
    >>> v = rising_noise(f, noise / f[:, None] ** 2)
    >>> bool(abs(np.log(v[0] / v[99]) / np.log(100) - 4) < 0.1)
    True
    """
    bend = values[1:-1] - (values[:-2] + values[2:]) / 2
    bend = bend / np.maximum(np.abs(bend).max(axis=0, initial=0.0), np.finfo(float).tiny)
    groups, start = list[slice](), 0
    while start + _MIN_GROUP <= len(bend):
        groups.append(slice(start, start + max(_MIN_GROUP, round(_GROUP_DISTANCE * start))))
        start = groups[-1].stop
    if not groups:
        return None
    powers = np.array([np.median(np.abs(bend[group]) ** 2, axis=0) for group in groups])
    # a channel of zeros, but for some lines, has no noise to tell
    told = np.all(powers > np.finfo(float).eps ** 2, axis=0)
    if not told.any():
        return None
    bend, powers = bend[:, told], powers[:, told]
    noisy = np.array([_alike(bend[group], powers.mean(axis=0)) < _MOST_ALIKE for group in groups])
    if noisy.mean() < _MIN_NOISY:
        return None
    f = np.maximum(frequencies, frequencies[1] - frequencies[0])
    columns = (f[0] / f[:, None]) ** np.array(_POWERS_OF_RESPONSES)
    seen = [slice(group.start + 1, group.stop + 1) for group, alone in zip(groups, noisy, strict=True) if alone]
    variance = _described(columns, seen, powers[noisy])
    return None if variance is None or _loss(variance) < _MIN_LOSS else variance


def _alike(bend: ComplexArray, power: RealArray) -> float:
    """Return the correlation of neighbours in a group of second differences."""
    both = np.sum((bend[1:] * bend[:-1].conj()).real / power)
    return float(both / np.sum(np.abs(bend) ** 2 / power))


def _loss(variance: RealArray) -> float:
    """Return the variance of a mean over lines by equal weights relative to that by optimal ones."""
    return float(np.mean(variance) * np.mean(1 / variance))


def _described(columns: RealArray, groups: Sequence[slice], powers: RealArray) -> RealArray | None:
    """Return a sum of columns (F, c) that describes the noise of groups of lines, (F,); None where none does.

    1 / variance of a line is the mean over the channels, each relative to its median over the groups.

    `powers` (groups, channels).
    """
    power = 1 / np.mean(np.median(powers, axis=0) / powers, axis=1)
    group_columns = np.array([columns[group].mean(axis=0) for group in groups])
    coefficients = _coefficients(group_columns, power)
    ratios = power / np.maximum(group_columns @ coefficients, np.finfo(float).tiny)
    described = np.mean(np.abs(np.log(ratios)) < np.log(_OUTLIER_RATIO))
    return np.asarray(columns @ coefficients) if described > _MIN_DESCRIBED else None


def _groups(run: slice, spectra: RecordSpectra) -> Iterator[slice]:
    """Yield groups of adjacent lines of a run, as many as the unknowns require."""
    least = _LINES_PER_UNKNOWN * (_NUMERATOR + 1) * (1 + spectra.drive.shape[1])
    start, count = 0, run.stop - run.start
    while start + least <= count:
        yield slice(run.start + start, run.start + start + least)
        start += max(least, round(_GROUP_DISTANCE * start))


def _residual_power(spectra: RecordSpectra, lines: slice) -> RealArray:
    """Return the mean square residual of rational functions on some lines for every output, (l,); of white noise its power.

    The coefficients c of the denominator minimize |sum_k c_k (residual of x^k Y from the numerators)|^2 over its value for white noise.
    """
    drive, Y = spectra.drive[lines], spectra.values[lines, :, 0]
    x = np.linspace(-1, 1, len(Y))
    channels = np.hstack([np.ones((len(x), 1)), drive / np.maximum(np.linalg.norm(drive, axis=0), 1e-300)])
    powers = np.polynomial.legendre.legvander(x, max(_NUMERATOR, _DENOMINATOR))
    columns = (powers[:, : _NUMERATOR + 1, None] * channels[:, None, :]).reshape(len(x), -1)
    U, d, _ = np.linalg.svd(columns, full_matrices=False)
    U = U[:, d > _RANK * d[0]]
    projector = np.eye(len(x)) - U @ U.conj().T
    residual = np.stack([projector @ (powers[:, k, None] * Y) for k in range(_DENOMINATOR + 1)])
    size = np.maximum(np.linalg.norm(residual[0], axis=0), 1e-300)
    noise = np.stack([projector * powers[:, k] for k in range(_DENOMINATOR + 1)]).reshape(_DENOMINATOR + 1, -1)
    flat = (residual / size).reshape(_DENOMINATOR + 1, -1)
    W = (noise.conj() @ noise.T).real
    _, vectors = sla.eigh(flat.conj() @ flat.T, W)
    c = vectors[:, 0]
    power = np.sum(np.abs(np.einsum("k,kfo->fo", c, residual)) ** 2, axis=0) / (c.conj() @ W @ c).real
    return np.asarray(power)


def _coefficients(columns: RealArray, power: RealArray) -> RealArray:
    """Return the coefficients of the columns that fit the noise of the groups, by non-negative least squares relative to the fit."""
    from scipy.optimize import nnls  # slow to load

    fit = np.minimum.accumulate(power)
    for _ in range(_MAX_ROUNDS):
        weights = np.sqrt(np.minimum(_OUTLIER_RATIO * fit / power, 1)) / fit
        weighted = columns * weights[:, None]
        size = np.linalg.norm(weighted, axis=0)
        coefficients = nnls(weighted / size, power * weights)[0] / size
        before, fit = fit, np.maximum(columns @ coefficients, np.finfo(float).tiny)
        if np.allclose(fit, before, rtol=1e-4):
            break
    return np.asarray(coefficients)
