"""Remove harmonics of rotating machines from a record, also when the speed wanders."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy import fft

from modalscope.data.records import Signals
from modalscope.data.shown import figures
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import ComplexArray, RealArray, check_each, check_positive
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.harmonics import find_lines

#: Half width of the band in which the phase is measured: standard deviations of the frequency, and lines of a run at least.
_HALF_BAND_SPREADS, _MIN_HALF_BAND_LINES = 6.0, 24

#: Values of the shifted band for each of its lines; corrections of the phase by its residual, and the last correction, rad.
_OVERSAMPLING, _MAX_ROUNDS, _MAX_LAST_CORRECTION = 4, 3, 0.003

#: Maximum number of times in a run that noise is expected to reach the amplitude of the harmonic: in a wider band its phase is lost.
_MAX_SLIPS = 0.01

#: Maximum width of a band as a part of its lowest frequency: a wider one may contain other orders of the shaft.
_MAX_BAND_WIDTH = 0.5

#: Number of powers of the frequency's deviation in the amplitude of a harmonic.
_AMPLITUDE_POWERS = 3

#: Relative standard deviation of the frequency where only its mean is given.
_DEFAULT_SPREAD = 0.001


@named(signals=Signals)
def remove_harmonics(signals: Signals, frequencies: Iterable[float] | None = None) -> Signals:
    """Return the record without the harmonics of rotating machines.

    The phase of a harmonic is tracked in a narrow band, in the combination of outputs with the best signal-to-noise ratio. From every
    channel Re((a + b d(t) + c d(t)^2) exp(j phase(t))) is subtracted, with d the deviation of the frequency from its mean and complex
    a, b, c by least squares: a harmonic that passes a resonance changes its amplitude with its frequency. Random vibration loses what turns
    the phase no faster than the machine does: half of one combination of outputs, in a band as wide as the harmonic; nothing at constant
    speed.

    Parameters
    ----------
    signals : Signals
        Its outputs are changed; inputs stay.
    frequencies : sequence of float, optional
        Hz, to 0.5 %; by default all harmonics that are found.

    Raises
    ------
    DataError
        A frequency of half the sampling rate or more, or so low that a run has no band around it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> hum = 3 * np.sin(2 * np.pi * 12.0 * np.arange(30000) / 50)
    >>> noise = rng.standard_normal((30000, 2))
    >>> clean = remove_harmonics(Signals(outputs=noise + hum[:, None], sampling_rate=50.0))
    >>> round(float(np.std(clean.outputs)), 1)
    1.0
    """
    if frequencies is None:
        return without_lines(signals, ((line.frequency, line.spread) for line in find_lines(signals)))
    given = [check_positive("each of frequencies", f) for f in check_each("frequencies", frequencies, "numbers in Hz")]
    for f in given:
        if _edges(signals, f, _DEFAULT_SPREAD * f) is None:
            have = f"a run has no band around it within {figures(1 / signals.duration)} to {signals.sampling_rate / 2:g} Hz"
            raise DataError(f"a harmonic at {f:g} Hz was to be removed", have, "Leave it out.")
    return without_lines(signals, ((f, _DEFAULT_SPREAD * f) for f in given))


def without_lines(signals: Signals, lines: Iterable[tuple[float, float]]) -> Signals:
    """Return the record without harmonics of given frequencies and standard deviations (Hz); those close to 0 or Nyquist stay."""
    outputs, _ = signals.by_run()
    y, removed = np.array(outputs), []
    for frequency, spread in lines:
        edges = _edges(signals, frequency, spread)
        if edges is not None:
            removed.append(f"{frequency:.5g}")
            for run in y:
                run -= _line(run, *edges)
    if not removed:
        return signals
    cleaned = replace(signals, outputs=y.reshape(signals.outputs.shape))
    return cleaned.processed(f"harmonics at {', '.join(removed)} Hz removed")


def _edges(signals: Signals, frequency: float, spread: float) -> tuple[int, int] | None:
    """Return the first and the last line of the band of a harmonic; None where it leaves 0 to half the sampling rate."""
    seconds = signals.duration
    reach = max(_HALF_BAND_SPREADS * spread, _MIN_HALF_BAND_LINES / seconds)
    first, last = int(np.ceil((frequency - reach) * seconds)), int((frequency + reach) * seconds)
    return (first, last) if first >= 1 and last < signals.samples // 2 else None


class _Track(NamedTuple):
    """A harmonic over a run, t from 0 to 1: its phase a + b t (`straight`) plus `wander` at even times, and the noise in phase with it.

    The noise is that of the logarithm of its envelope, as slow as the wandering: both have `terms` terms of a cosine series. `slips` is the
    expected number of times that noise reaches its amplitude, where the phase is lost.
    """

    straight: RealArray
    wander: RealArray
    noise: RealArray
    terms: int = 0
    slips: float = 0.0

    def sizes(self, times: RealArray) -> ComplexArray:
        """Return exp(j phase) times the powers of the frequency's deviation, (n, powers)."""
        turned = self.straight[0] + self.straight[1] * times + self._at(times, self.wander)
        powers = self._at(times, self.drift)[:, None] ** np.arange(self.powers)
        return np.asarray(powers * np.exp(1j * turned)[:, None])

    def share(self, times: RealArray) -> RealArray:
        """Return the part of the harmonic that is subtracted, (n,): the rest restores the power of the noise.

        With e the noise in phase, 1 + e of the harmonic are measured, and sqrt(2) e should remain: 1 - (sqrt(2) - 1) e are subtracted. It
        is clipped, as an envelope has e >= -1, and nothing is added.
        """
        return np.asarray(np.clip(1 - (np.sqrt(2) - 1) * self._at(times, self.noise), 0.0, np.sqrt(2)))

    @property
    def drift(self) -> RealArray:
        """The frequency's deviation from its mean, over its standard deviation; zeros at constant speed."""
        drift = np.gradient(self.wander)
        return np.asarray((drift - drift.mean()) / drift.std()) if self.wander.any() else drift

    @property
    def powers(self) -> int:
        return _AMPLITUDE_POWERS if self.wander.any() else 1

    def _at(self, times: RealArray, values: RealArray) -> RealArray:
        return np.asarray(np.interp(times, np.arange(values.size) / values.size, values))


def _line(y: RealArray, first: int, last: int) -> RealArray:
    """Return a harmonic in one run, (N, l).

    Its band is widened while the speed changes with more terms than half of the band resolves, and noise stays below its amplitude.
    """
    transform = fft.rfft(y, axis=0)
    if not np.any(transform[first : last + 1]):  # a run of zeros
        return np.zeros_like(y)
    line, track = _in_band(y, transform[first : last + 1], first)
    while track.terms > (last + 1 - first) // 2:
        half = (last + 1 - first) // 2
        first, last = first - half, last + half
        if last - first > _MAX_BAND_WIDTH * first or last >= len(y) // 2:
            break
        wider, track = _in_band(y, transform[first : last + 1], first)
        if track.slips > _MAX_SLIPS:
            break
        line = wider
    return line


def _in_band(y: RealArray, band: ComplexArray, first: int) -> tuple[RealArray, _Track]:
    """Return a harmonic and its track from a band of the transform that begins at line `first`.

    It is tracked in the combination of outputs with most power, then in that with the best signal-to-noise ratio.
    """
    times = np.arange(len(y)) / len(y)
    down = np.exp(-2j * np.pi * first * times)
    strongest = np.linalg.eigh(band.conj().T @ band)[1][:, -1]
    x = (y @ strongest) * down
    z = _slow(x, len(band))
    nothing = np.zeros(z.size)
    start = _straightened(_Track(np.zeros(2), np.unwrap(np.angle(z)), nothing))
    track = _tracked(x, len(band), start._replace(wander=nothing))
    line, sizes = _fitted(y, track, times, down)
    residual = fft.rfft(y - line, axis=0)[first : first + len(band)]
    track = _tracked((y @ _best_combination(sizes, residual)) * down, len(band), track)
    return _fitted(y, track, times, down)[0], track


def _best_combination(sizes: ComplexArray, residual: ComplexArray) -> ComplexArray:
    """Return the weights s of outputs, (l,), that maximize |s a|^2 over the power of s n, n the residual on lines (k, l).

    s = conj(S^-1 a) with the covariance S of n, loaded by its mean times outputs over lines, as few lines determine it poorly.
    """
    lines, outputs = residual.shape
    S = residual.T @ residual.conj() / lines
    S = S + np.eye(outputs) * (np.trace(S).real / lines + np.finfo(float).tiny)
    return np.asarray(np.linalg.solve(S, sizes).conj())


def _fitted(y: RealArray, track: _Track, times: RealArray, down: ComplexArray) -> tuple[RealArray, ComplexArray]:
    """Return the harmonic in every channel, (N, l), and its complex amplitudes at the mean frequency, (l,)."""
    sizes = track.sizes(times) * down.conj()[:, None]
    columns = np.concatenate([sizes.real, sizes.imag], axis=1)
    coefficients = _least_squares(columns, y)
    line = (columns * track.share(times)[:, None]) @ coefficients
    return line, coefficients[0] - 1j * coefficients[track.powers]


def _tracked(x: ComplexArray, lines: int, track: _Track) -> _Track:
    """Return a track corrected repeatedly by the residual of its harmonic in a combination of outputs.

    ln(a exp(j phase) + n) = ln a + j phase + n / a exp(-j phase): noise is as strong in the logarithm of the envelope as in the phase.
    """
    times, even_times = np.arange(len(x)) / len(x), np.arange(track.wander.size) / track.wander.size
    for _ in range(_MAX_ROUNDS):
        fast, slow = track.sizes(times), track.sizes(even_times)
        size = _least_squares(fast, x)
        model = slow @ size
        ratio = 1 + _slow(x - fast @ size, lines) / model
        level = np.log(np.abs(ratio * model))
        powers = track.drift[:, None] ** np.arange(track.powers)
        noise = level - powers @ _least_squares(powers, level)
        moved = _straightened(track._replace(wander=track.wander + np.unwrap(np.angle(ratio))))
        before, track = track.wander, _as_slow(moved, noise)
        if np.std(track.wander - before) < _MAX_LAST_CORRECTION:
            break
    return track


def _as_slow(track: _Track, noise: RealArray) -> _Track:
    """Return a track with the wandering of the machine alone, and noise of as many terms.

    Of the cosine transforms w of the phase and r of the noise the first k terms are kept that reduce the expected error most: w^2 - r^2 is
    due to the machine, r^2 is noise (an unbiased estimate of the risk).
    """
    w, r = fft.dct(track.wander, norm="ortho"), fft.dct(noise, norm="ortho")
    reduction = np.cumsum((w**2 - 2 * r**2)[1:])
    terms = int(np.argmax(reduction)) + 2 if reduction.max() > 0 else 0
    w[terms:], r[terms:] = 0, 0
    # of complex noise |n / a|^2 is exponential, and half of it is in the logarithm of the envelope
    slips = noise.size / _OVERSAMPLING * float(np.exp(-0.5 / np.mean(noise**2)))
    return track._replace(wander=fft.idct(w, norm="ortho"), noise=fft.idct(r, norm="ortho"), terms=terms, slips=slips)


def _slow(x: ComplexArray, lines: int) -> ComplexArray:
    """Return a series limited to its lowest lines, at a rate for them."""
    n = _OVERSAMPLING * lines
    return np.asarray(fft.ifft(fft.fft(x)[:lines], n=n) * (n / len(x)))


def _least_squares(columns: Any, x: Any) -> Any:
    """Return the coefficients of few well-scaled columns, by the normal equations."""
    adjoint = columns.conj().T
    return np.linalg.lstsq(adjoint @ columns, adjoint @ x, rcond=None)[0]


def _straightened(track: _Track) -> _Track:
    """Return a track with the linear part of its wandering moved to `straight`; the ends of the run are excluded from the fit."""
    phase, margin = track.wander, track.wander.size // 50
    t, inside = np.arange(phase.size) / phase.size, slice(margin, phase.size - margin)
    more = np.polynomial.Polynomial.fit(t[inside], phase[inside], 1).convert()
    return track._replace(straight=track.straight + np.resize([*more.coef, 0.0], 2), wander=np.asarray(phase - more(t)))
