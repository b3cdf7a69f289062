"""Bring the stretches of an ambient record to one level: gusts, passages and disturbances count for what they tell.

Under forces whose level g(t) changes slowly the spectral matrix of a stretch is g^2 S. The likelihood of all stretches weighs each by
1 / g^2, as does one sum of the stretches y / g; a plain sum is that of the loudest stretches alone, and scatters as these few do.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy
from scipy import fft
from scipy.special import chdtri

from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.shown import figures
from modalscope.data.stored import StoredSignals
from modalscope.numerics.checks import Array, RealArray
from modalscope.signals.preprocess.conditioning import ChangedRows
from modalscope.signals.preprocess.spectra import Spectrum

#: Stretches of a record, and parts of their spectra.
_STRETCHES, _PARTS = 40, 64

#: Minimum length of a stretch whose level is that of the forces, in correlation times: a mode that rings longer would lose its decay.
_CORRELATION_TIMES = 10.0

#: Standard deviation of an estimated correlation time, times the root of how often the record holds it: 1.8 to 3.1 of resonances of .3 to
#: 2 % over 20 to 300 times.
_TIME_SPREAD = 3.0

#: Minimum number of such stretches, and how often a steady record is taken for one whose level changes.
_MIN_STRETCHES, _FALSE_ALARM = 4, 1e-3

#: A stretch is unlike the rest where its power, in the mean over parts of the spectrum, exceeds the usual one by this factor more than its
#: whole power does. Parts of a steady record scatter by a tenth.
_UNLIKE = 4.0

#: Part of a stretch at both ends over which its level changes to the next one's.
_CROSSED = 0.25

#: A stretch with this times the usual power is another test: a blow or an earthquake in a record that is quiet otherwise.
_OTHER_TEST = 1e3

#: Stretches below this part of the usual level are gaps, which are not raised.
_MIN_LEVEL = 0.03

#: Stretches whose level exceeds the usual one by this factor are loud; so many groups of them are named.
_LOUD, _NAMED = 2.0, 3

#: The kind of the note.
LEVEL = "level changes"


class Steady(NamedTuple):
    """A record brought to one level, a note that says so, and what was loudest as it was, where it was twice the usual level."""

    record: Any
    note: Note
    loudest: Signals | None


def steadied(record: Signals | StoredSignals, spectrum: Spectrum) -> Steady | None:
    """Return a record without inputs, its stretches brought to one level; None for a steady one.

    None as well where one stretch is another test: its power is a thousand times the usual one.

    `spectrum`: of the record, or of an excerpt.

    Forty stretches have a level for two reasons. Forces: the power p of a stretch over the usual one (lower median of the channels), whose
    logarithm scatters by tau / T_s in a steady record, tau = int S^2 df / (int S df)^2 and T_s the length of a stretch; ten tau at least,
    and where the scatter is more than chance, levels are drawn to the usual one by the part of it that chance makes. Disturbances: in a
    channel the power over the usual one in the mean over parts of the spectrum, w: where w > 4 and w > 4 p a stretch counts as if it had
    that power, and so do its neighbours, into which it may reach.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> y = rng.standard_normal((4000, 2))
    >>> y[1000:1200] *= 20
    >>> record = Signals(outputs=y, sampling_rate=10.0)
    >>> found = steadied(record, Spectrum.of(record))
    >>> print(found.note)
    Level of the record changes: stretches were scaled to one level. Relative to the usual level: 20 from 100 to 120 s
    >>> bool(np.std(found.record.outputs[1050:1150]) < 1.2)
    True
    """
    powers = _powers(record)
    if powers is None:
        return None
    usual = _over(powers.whole, np.median(powers.whole, axis=0))
    parts = _over(powers.parts, np.median(powers.parts, axis=0)).mean(axis=1)
    force = np.quantile(usual, 0.5, axis=1, method="lower")
    if force.max() > _OTHER_TEST:
        return None
    unlike = np.max(_over(parts, np.median(parts, axis=0)), axis=1) / np.maximum(force, 1.0)
    unlike = np.where(unlike > _UNLIKE, unlike, 1.0)
    time = _correlation_time(spectrum)
    if time == 0:  # nothing moves
        return None
    forces = _of_forces(force, powers.runs, powers.seconds / time)
    near = scipy.ndimage.maximum_filter1d(unlike.reshape(powers.runs, -1), 3, axis=1, mode="nearest").ravel()
    level = np.asarray(forces * np.sqrt(np.maximum(near, 1.0)))
    if np.all(level == 1.0):
        return None
    loud = _loud(level, powers.runs)
    loudest = _part_of(record, loud[0], powers) if loud else None
    return Steady(_divided(record, level.reshape(powers.runs, -1)), _note(level, loud, powers), loudest)


class _Powers(NamedTuple):
    """Powers of the stretches of all runs one after another: of each channel (s, l), and in parts of its spectrum (s, parts, l)."""

    whole: RealArray
    parts: RealArray
    runs: int
    seconds: float


def _powers(record: Signals | StoredSignals) -> _Powers | None:
    """Return the powers of the stretches of a record; None where it is too short."""
    runs = 1 if isinstance(record, StoredSignals) else record.runs
    each = max(_STRETCHES // runs, 1)
    size = record.samples // each
    count = min(_PARTS, size // 8)
    if count < 1:
        return None
    window, edges = np.hanning(size)[:, None], np.linspace(2, size // 2 + 1, count + 1).astype(int)
    whole, parts = [], []
    outputs = None if isinstance(record, StoredSignals) else record.by_run()[0]
    for r in range(runs):
        for start in range(0, each * size, size):
            y = record.chunk(start, start + size) if outputs is None else outputs[r, start : start + size]  # type: ignore[union-attr]
            whole.append(np.mean(np.square(y, dtype=float), axis=0))
            lines = np.abs(fft.rfft((y - y.mean(axis=0)) * window, axis=0)) ** 2
            parts.append(np.add.reduceat(lines, edges[:-1], axis=0))
    return _Powers(np.array(whole), np.array(parts), runs, size / record.sampling_rate)


def _over(powers: RealArray, usual: RealArray) -> RealArray:
    """Return powers over the usual ones; 1 where these are zero."""
    return np.asarray(np.divide(powers, usual, out=np.ones_like(powers), where=usual > 0))


def _correlation_time(spectrum: Spectrum) -> float:
    """Return int S^2 df / (int S df)^2, s: the mean square over T s has a squared coefficient of variation of that over T.

    Of a record of n such times it is known to 3 / sqrt(n); two deviations are added.
    """
    power = np.mean(spectrum.lines.real**2 + spectrum.lines.imag**2, axis=0)[2:]
    # the square of a line of one run is twice that of its mean
    twice = 1 + 1 / len(spectrum.lines)
    total = np.maximum(power.sum(axis=0) ** 2, np.finfo(float).tiny)
    time = float(np.median(np.sum(power**2, axis=0) / (twice * spectrum.step * total)))
    return time * (1 + 2 * _TIME_SPREAD * float(np.sqrt(time * spectrum.step / len(spectrum.lines))))


def _of_forces(power: RealArray, runs: int, times: float) -> RealArray:
    """Return the level of every stretch by the power of its forces, (s,), 1 where it is steady; `times`: stretches in correlation times."""
    steady, each = np.ones(len(power)), len(power) // runs
    together = int(np.ceil(_CORRELATION_TIMES / max(times, np.finfo(float).tiny)))
    if together > each:
        return steady
    starts = np.concatenate([r * each + np.arange(each // together) * together for r in range(runs)])
    of = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(power))))
    mean = np.bincount(of, power) / np.bincount(of)
    logs = np.log(np.where(mean > _MIN_LEVEL**2, mean, np.median(mean)))
    scatter, chance = float(np.var(logs)), 1 / (times * together)
    if len(starts) < _MIN_STRETCHES or scatter < chance * chdtri(len(starts) - 1, _FALSE_ALARM) / len(starts):
        return steady
    return np.asarray(np.exp((1 - chance / scatter) / 2 * (logs - np.median(logs)))[of])


def _divided(record: Signals | StoredSignals, level: RealArray) -> Any:
    """Return a record over the level of its stretches (runs, s)."""
    if isinstance(record, StoredSignals):
        change, words = partial(_over_level, level[0], record.samples), f"over levels {tuple(level[0].tolist())}"
        return replace(record, rows=ChangedRows(record.rows, change, words))
    outputs, _ = record.by_run()
    divided = np.stack(
        [y / _at(np.arange(len(y)), len(y), own)[:, None] for y, own in zip(outputs, level, strict=True)]
    )
    return replace(record, outputs=divided.reshape(record.outputs.shape))


def _at(samples: Array, count: int, level: RealArray) -> RealArray:
    """Return the level at samples of a record of so many: that of their stretch, and geometric means where two meet."""
    size = count // len(level)
    ends = (np.arange(len(level))[:, None] + [_CROSSED, 1 - _CROSSED]) * size
    return np.asarray(np.exp(np.interp(samples, ends.ravel(), np.repeat(np.log(level), 2))))


def _over_level(level: RealArray, samples: int, start: int, rows: RealArray) -> RealArray:
    """Return rows over the level of their stretch, of a record of so many samples."""
    return np.asarray(rows / _at(np.arange(start, start + len(rows)), samples, level)[:, None])


def _loud(level: RealArray, runs: int) -> list[Array]:
    """Return the neighbouring stretches of a run that are loud, the loudest first."""
    loud = np.flatnonzero(level > _LOUD)
    if not loud.size:
        return []
    of_run = loud // (len(level) // runs)
    groups = np.split(loud, np.flatnonzero((np.diff(loud) > 1) | (np.diff(of_run) > 0)) + 1)
    return sorted(groups, key=lambda group: -float(level[group].max()))


def _part_of(record: Signals | StoredSignals, stretches: Array, powers: _Powers) -> Signals:
    """Return neighbouring stretches of a record by themselves."""
    run, first = divmod(int(stretches[0]), len(powers.whole) // powers.runs)
    size = round(powers.seconds * record.sampling_rate)
    start, stop = first * size, (first + len(stretches)) * size
    y = record.chunk(start, stop) if isinstance(record, StoredSignals) else record.by_run()[0][run, start:stop]
    return Signals(outputs=y, sampling_rate=record.sampling_rate)


def _note(level: RealArray, loud: list[Array], powers: _Powers) -> Note:
    """Return the note on the levels of all stretches, (s,): the loudest ones by name."""
    each, named = len(level) // powers.runs, []
    for group in loud[:_NAMED]:
        run = f" of run {group[0] // each + 1}" if powers.runs > 1 else ""
        start, stop = (group[0] % each) * powers.seconds, (group[-1] % each + 1) * powers.seconds
        named.append(f"{figures(level[group].max())} from {start:.4g} to {stop:.4g} s{run}")
    further = ", ..." if len(loud) > _NAMED else ""
    which = "; ".join(named) + further if named else f"{figures(level.min(), 2)} to {figures(level.max(), 2)}"
    text = f"Level of the record changes: stretches were scaled to one level. Relative to the usual level: {which}"
    return Note(LEVEL, {"least": float(level.min()), "largest": float(level.max())}, text)
