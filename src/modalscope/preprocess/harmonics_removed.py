"""Lines of turning machines taken off a record, also when the speed wanders."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy
from scipy import fft

from modalscope.model.checks import ComplexArray, DataError, RealArray, check_each, check_kind, check_positive
from modalscope.model.keywords import named
from modalscope.model.signals import Signals
from modalscope.preprocess.harmonics import find_lines

__all__ = ["remove_harmonics"]

#: A line's phase is read in a band of so many of its spreads on either side, of this many lines of a run at least.
_SPREADS, _LINES = 6.0, 24

#: Values of the shifted band for each of its lines; the shortest window of the phase; and what a longer one may leave beside it.
_FINER, _SHORTEST, _LEAVES = 4, 9, 3.0

#: Powers of the frequency's deviation by which a line changes its size.
_POWERS = 3

#: How far a line wanders (standard deviation, a part of its frequency) where only its frequency is given.
_WANDERS = 0.001


@named()
def remove_harmonics(signals: Signals, frequencies: Iterable[float] | None = None) -> Signals:
    """Return the record without the lines of turning machines.

    The phase of a line is followed in a narrow band, in the combination of outputs that shows it best; of every channel
    Re((a + b d(t) + c d(t)^2) exp(j phase(t))) is taken off, with d the deviation of the frequency from its mean and complex a, b, c by
    least squares: a line that passes over a resonance changes its size with its frequency. A resonance at the same place loses what is
    in phase with the line. At constant speed nothing of a line stays; where the speed wanders about a tenth of it may, and is identified
    as a lightly damped mode: leave such lines in, `analyze` names them among the harmonics.

    Parameters
    ----------
    signals : Signals
        Its outputs are changed; inputs stay.
    frequencies : sequence of float, optional
        Hz, to 0.5 %: by default all lines that are found.

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
    check_kind("remove_harmonics", signals, Signals)
    if frequencies is None:
        lines = [(line.frequency, line.spread) for line in find_lines(signals)]
    else:
        given = [
            check_positive("each of frequencies", f) for f in check_each("frequencies", frequencies, "numbers in Hz")
        ]
        lines = [(f, _WANDERS * f) for f in given]
    outputs, _ = signals.by_run()
    y = np.array(outputs)
    for frequency, spread in lines:
        for run in y:
            run -= _line(run, frequency, spread, signals.sampling_rate)
    if not lines:
        return signals
    note = f"harmonics at {', '.join(f'{f:.5g}' for f, _ in lines)} Hz removed"
    return replace(signals, outputs=y.reshape(signals.outputs.shape)).processed(note)


def _line(y: RealArray, frequency: float, spread: float, rate: float) -> RealArray:
    """Return what a line adds to one run, (N, l)."""
    count = len(y)
    step = rate / count
    reach = max(_SPREADS * spread, _LINES * step)
    first, last = int(np.ceil((frequency - reach) / step)), int((frequency + reach) / step)
    if first < 1 or last >= count // 2:
        raise DataError(
            f"a harmonic at {frequency:g} Hz was to be removed",
            f"a run holds {step:.3g} to {rate / 2:g} Hz, and a band of {2 * reach:.3g} Hz is needed",
            "Leave it out.",
        )
    spectrum = fft.rfft(y - y.mean(axis=0), axis=0)[first : last + 1]
    strongest = np.linalg.eigh(spectrum.conj().T @ spectrum)[1][:, -1]
    z = np.asarray(fft.ifft(spectrum @ strongest, n=_FINER * len(spectrum)))  # shifted down by the first line
    phase, drift = _followed(z)
    coarse, fine = np.arange(z.size) / z.size, np.arange(count) / count
    turning = 2 * np.pi * first * np.arange(count) / count + np.interp(fine, coarse, phase)
    return _fitted(y, turning, np.interp(fine, coarse, drift))


def _followed(z: ComplexArray) -> tuple[RealArray, RealArray]:
    """Return the phase of a line and how far its frequency is from the mean, as smooth as its wandering allows.

    Of all windows the longest that leaves at most three times what the shortest does: that follows the noise, too.
    """
    raw = np.unwrap(np.angle(z))
    found = []
    window = z.size // 2
    while window >= _SHORTEST:
        phase = scipy.signal.savgol_filter(raw, window | 1, 2)
        drift = np.gradient(phase)
        drift = (drift - drift.mean()) / max(float(drift.std()), np.finfo(float).tiny)
        sizes = drift[:, None] ** np.arange(_POWERS) * np.exp(1j * phase)[:, None]
        left = z - sizes @ np.linalg.lstsq(sizes, z, rcond=None)[0]
        found.append((float(np.sum(np.abs(left) ** 2)), phase, drift))
        window //= 2
    bar = _LEAVES * min(power for power, _, _ in found)
    return next((phase, drift) for power, phase, drift in found if power <= bar)


def _fitted(y: RealArray, phase: RealArray, drift: RealArray) -> RealArray:
    """Return the part of every channel that has a phase, with sizes that vary as the frequency does."""
    sizes = drift[:, None] ** np.arange(_POWERS) * np.exp(1j * phase)[:, None]
    columns = np.concatenate([sizes.real, sizes.imag], axis=1)
    return np.asarray(columns @ np.linalg.lstsq(columns, y, rcond=None)[0])
