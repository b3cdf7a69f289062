"""Noise of records that rises towards 0 Hz: sensors and integrated records that drift.

A random walk has the spectrum s^2 / |x - 1|^2 on the lines x = exp(j w dt), flicker its root, an integrated walk its square. The equations
of records hold line by line, so that outputs, inputs and ends of a line may all be divided by one number: by the deviation of its noise
the noise is the same on all lines, which is what least squares and everything that judges takes it for.

The noise is what rational functions leave on a few lines side by side: with polynomials q_d of low degree

    (1 + d_1 x + d_2 x^2) Y(x) = sum_d q_d(x) (G_d U(x) + t_d) + (1 + d_1 x + d_2 x^2) noise,

the first factor common to all outputs, so that a resonance between the lines is none of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import scipy.linalg as sla
from scipy import optimize

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.numerics.checks import RealArray

__all__ = ["DRIFT", "level_lines", "line_noise"]

#: The kind of the note.
DRIFT = "noise rises"

#: Degrees of the numerators and of the denominator, lines for every unknown of an output, and how far groups of lines lie apart, as a part
#: of the frequency.
_NUMERATOR, _DENOMINATOR, _LINES, _APART = 2, 2, 4, 0.05

#: Powers of 1 / |x - 1|^2 that noise is a sum of: white noise, flicker, a random walk, a walk that was integrated.
_POWERS = (0.0, 0.5, 1.0, 2.0)

#: Lines are divided by their noise where equal weights would give so many times the variance that the right ones do.
_LOSS = 2.0

#: A group beyond so many times the noise holds something else and counts by that less; nine of ten must be within it, either way:
#: what approximation leaves where there is hardly any noise scatters over decades.
_OUTLIER, _DESCRIBED = 3.0, 0.9

#: Rounds of the fit.
_ROUNDS = 30

#: Singular values of the numerators' columns below this part of the largest are none.
_ALIKE = 1e-8


def level_lines(spectra: RecordSpectra) -> tuple[RecordSpectra, tuple[Note, ...]]:
    """Return the records with all that stands on a line divided by the deviation of its noise, where it rises towards 0 Hz, and a note.

    Parameters
    ----------
    spectra : RecordSpectra
        In z.

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
    if variance is None or np.mean(variance) * np.mean(1 / variance) < _LOSS:
        return spectra, ()
    decibels = 10 * np.log10(variance.max() / variance.min())
    scale = np.sqrt(variance / np.exp(np.mean(np.log(variance))))
    text = (
        f"the noise of the outputs rises by {decibels:.0f} dB towards 0 Hz, as drift does: every line of outputs and inputs was divided by "
        "the deviation of its noise"
    )
    values, drive = spectra.values / scale[:, None, None], spectra.drive / scale[:, None]
    for array in (values, drive, scale):
        array.setflags(write=False)  # nobody else has it: it need not be copied again
    told = Note(DRIFT, {"decibels": float(decibels)}, text)
    return replace(spectra, values=values, drive=drive, line_scale=scale), (told,)


def line_noise(spectra: RecordSpectra) -> RealArray | None:
    """Return the variance of noise on every line up to a factor, (F,), a sum of powers of 1 / |x - 1|^2; None where none describes it.

    Outputs together tell of a line the sum of what each does, 1 / variance, each in parts of its median over the lines.

    Parameters
    ----------
    spectra : RecordSpectra
        In z.
    """
    groups = [group for own in spectra.spans_of_runs for group in _groups(own, spectra)]
    if not groups:
        return None
    rise = np.abs(spectra.points - 1) ** -2.0
    columns = (rise / rise.max())[:, None] ** np.array(_POWERS)
    powers = np.maximum([_left(spectra, group) for group in groups], np.finfo(float).tiny)
    power = 1 / np.mean(np.median(powers, axis=0) / powers, axis=1)
    known = np.array([columns[group].mean(axis=0) for group in groups])
    found = _sum_of(known, power)
    described = np.abs(np.log(power / np.maximum(known @ found, np.finfo(float).tiny))) < np.log(_OUTLIER)
    return np.asarray(columns @ found) if np.mean(described) > _DESCRIBED else None


def _groups(own: slice, spectra: RecordSpectra) -> Iterator[slice]:
    """Yield lines side by side of a run, as many as the unknowns ask."""
    least = _LINES * (_NUMERATOR + 1) * (1 + spectra.drive.shape[1])
    start, count = 0, own.stop - own.start
    while start + least <= count:
        yield slice(own.start + start, own.start + start + least)
        start += max(least, round(_APART * start))


def _left(spectra: RecordSpectra, lines: slice) -> RealArray:
    """Return the mean square that rational functions leave of every output on some lines, (l,); of white noise its power.

    The coefficients d of the denominator make |sum_k d_k (what numerators leave of x^k Y)|^2 over what white noise would give the least.
    """
    drive, Y = spectra.drive[lines], spectra.values[lines, :, 0]
    x = np.linspace(-1, 1, len(Y))
    channels = np.hstack([np.ones((len(x), 1)), drive / np.maximum(np.linalg.norm(drive, axis=0), 1e-300)])
    powers = np.polynomial.legendre.legvander(x, max(_NUMERATOR, _DENOMINATOR))
    columns = (powers[:, : _NUMERATOR + 1, None] * channels[:, None, :]).reshape(len(x), -1)
    U, d, _ = np.linalg.svd(columns, full_matrices=False)
    U = U[:, d > _ALIKE * d[0]]
    beyond = np.eye(len(x)) - U @ U.conj().T
    left = np.stack([beyond @ (powers[:, k, None] * Y) for k in range(_DENOMINATOR + 1)])
    size = np.maximum(np.linalg.norm(left[0], axis=0), 1e-300)
    noise = np.stack([beyond * powers[:, k] for k in range(_DENOMINATOR + 1)]).reshape(_DENOMINATOR + 1, -1)
    flat = (left / size).reshape(_DENOMINATOR + 1, -1)
    W = (noise.conj() @ noise.T).real
    _, vectors = sla.eigh(flat.conj() @ flat.T, W)
    own = vectors[:, 0]
    power = np.sum(np.abs(np.einsum("k,kfo->fo", own, left)) ** 2, axis=0) / (own.conj() @ W @ own).real
    return np.asarray(power)


def _sum_of(known: RealArray, power: RealArray) -> RealArray:
    """Return the parts of each power that give the noise of the groups best, by least squares in parts of the fit itself."""
    fit = np.minimum.accumulate(power)
    for _ in range(_ROUNDS):
        weights = np.sqrt(np.minimum(_OUTLIER * fit / power, 1)) / fit
        weighted = known * weights[:, None]
        size = np.linalg.norm(weighted, axis=0)
        found = optimize.nnls(weighted / size, power * weights)[0] / size
        before, fit = fit, np.maximum(known @ found, np.finfo(float).tiny)
        if np.allclose(fit, before, rtol=1e-4):
            break
    return np.asarray(found)
