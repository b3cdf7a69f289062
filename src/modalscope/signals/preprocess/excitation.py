"""Detect the kind of excitation from the recorded forces, and the period of periodic ones."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import fft

from modalscope.data.channels import names_base
from modalscope.data.kind_of_test import commonest, is_impact
from modalscope.data.notes import Note
from modalscope.data.record_transform import half_transform
from modalscope.data.records import Records, Signals
from modalscope.data.sizes import check_size, constant_channels
from modalscope.numerics.checks import Array, RealArray, check_count
from modalscope.numerics.errors import DataError, check_choice
from modalscope.numerics.resources import scratch

#: Kinds of excitation; `estimate_frf` says how each is averaged.
EXCITATIONS = ("random", "burst", "sweep", "periodic", "impact")

#: The last part of a run, and the maximum RMS of a force there that is off, relative to the run's.
_LAST_PART, _MAX_OFF = 0.05, 0.02

#: A swept sine has this part of the energy of a short stretch in this part of the lines.
_SWEPT_ENERGY, _SWEPT_LINES = 0.9, 0.1

#: Minimum of pairs of stretches in order less those that are not, over all: 0 for random forces, 1 for a clean sweep.
_MIN_ORDERED_PAIRS = 0.7

#: Stretches of a run that are compared for a sweep.
_STRETCHES = 16

#: Lags computed at a time.
_MAX_LAGS = 1 << 16

#: Minimum correlation coefficient of a periodic force with itself a period later.
_MIN_PERIODIC = 0.99

#: Stretches of a record without inputs, and the squared coefficient of variation of their power above which it holds an event. Were every
#: stretch's power exponential, as that of a mode which outlasts it, 25 of a million records would have so much by chance.
_PARTS, EVENT = 40, 4.0

#: Forces are few tones where all but this part of their power lies within so many lines of at most so many frequencies (the side lobes of
#: a Hann window hold less), and the lines that a spectrum needs for that.
_BESIDE_TONES, _TONE_LINES, _MAX_TONES, _MIN_LINES = 1e-4, 4, 10, 400

#: The kind of the note on forces that never change; its numbers are their values.
_DEAD_FORCE = "dead force"


def powers_of_stretches(y: RealArray) -> RealArray:
    """Return the power of equal stretches of a record (N, l), mean 1: the median over channels, each divided by its mean.

    Averages over the record scatter as if it lasted T (sum p)^2 / (n sum p^2) = T / (1 + c^2), c^2 the variance of these.
    """
    size = len(y) // _PARTS
    if size < 2:
        return np.ones(_PARTS)
    mean, stretches = y.mean(axis=0), y[: size * _PARTS].reshape(_PARTS, size, -1)
    power = np.array([np.mean((part - mean) ** 2, axis=0) for part in stretches])
    tiny = np.finfo(float).tiny
    medians = np.median(power / np.maximum(power.mean(axis=0), tiny), axis=1)
    return np.asarray(medians / max(float(medians.mean()), tiny))


def moved_by_base(signals: Signals) -> tuple[Signals, tuple[Note, ...]]:
    """Return an event of accelerations with the channels named for the base as inputs, and a note.

    A base moves the structure in an earthquake; under wind and traffic it is moved as the rest is, and stays an output.
    """
    base = np.array([names_base(dof) for dof in signals.output_dofs])
    accelerations = set(signals.quantities) == {"acceleration"}
    if signals.inputs is not None or signals.runs > 1 or not base.any() or base.all() or not accelerations:
        return signals, ()
    if np.var(powers_of_stretches(signals.by_run()[0][0])) <= EVENT:
        return signals, ()
    names = tuple(itertools.compress(signals.output_dofs, base))
    listed = f"{', '.join(names[:6])}{' ...' if len(names) > 6 else ''}"
    text = (
        f"Channels named for the base are inputs of this event: {listed}; poles are those of the structure held there. If they are "
        "outputs, rename them: --output-dofs"
    )
    return as_inputs(signals, names), (Note("base", {"inputs": float(len(names))}, text),)


def as_inputs(signals: Signals, names: Sequence[str]) -> Signals:
    """Return a record of outputs alone with those of these labels as its inputs."""
    inputs = np.isin(signals.output_dofs, names)
    units = tuple(tuple(itertools.compress(signals.units[0], which)) for which in (~inputs, inputs))
    rest = signals.select(exclude=names)
    return replace(rest, inputs=signals.outputs[..., inputs], input_dofs=tuple(names), units=units)  # type: ignore[arg-type]


def dead_forces(data: Signals | Records) -> dict[str, float]:
    """Return the inputs that are constant in every run, with their values; one that rests in some runs alone is none: these are decays."""
    moving: set[str] = set()
    levels: dict[str, float] = {}
    for record in data.recordings:
        for forces in record.by_run()[1] if record.inputs is not None else ():  # type: ignore[union-attr]
            levels |= dict(zip(record.input_dofs, forces[0].tolist(), strict=True))
            moving |= set(record.input_dofs) - {record.input_dofs[i] for i in constant_channels(forces)}
    return {dof: level for dof, level in levels.items() if dof not in moving}


def without_dead_forces(data: Signals | Records) -> tuple[Any, tuple[Note, ...]]:
    """Return records none of whose inputs ever changes without them, and a note: no force was measured.

    Beside others such an input stays: it has no participation.

    Examples
    --------
    >>> rest = Signals(outputs=np.arange(6.0).reshape(3, 2), inputs=np.full((3, 1), -3.0), sampling_rate=8.0)
    >>> alone, (note,) = without_dead_forces(rest)
    >>> print(alone.inputs, note)
    None Taken as no force, for it never changes: input u1. Check cable and sensor if it was to be one
    """
    dead = dead_forces(data)
    if not dead or len(dead) < len(data.input_dofs):
        return data, ()
    text = (
        f"Taken as no force, for it never changes: input {', '.join(dead)}. Check cable and sensor if it was to be one"
    )
    alone = data.select(inputs=[]) if isinstance(data, Signals) else data._mapped(lambda run: run.select(inputs=[]))
    return alone, (Note(_DEAD_FORCE, dead, text),)


def still_there(labels: Iterable[str], notes: Iterable[Note]) -> tuple[str, ...]:
    """Return the labels to exclude without those of forces that were left out already, as the notes say."""
    gone = {dof for note in notes if note.kind == _DEAD_FORCE for dof in note.numbers}
    return tuple(label for label in labels if label not in gone)


def driven_records(signals: Signals, asked: str) -> tuple[RealArray, RealArray]:
    """Return outputs (R, N, l) and inputs (R, N, m) of records; raise DataError without inputs, with what was `asked`."""
    check_size(signals)
    outputs, inputs = signals.by_run()
    if inputs is None:
        change = "Give the forces as inputs, or use estimate_correlation for outputs alone."
        raise DataError(f"{asked}:", "the record has no inputs", change)
    return outputs, inputs


def find_excitation(signals: Signals, asked: str = "auto") -> str:
    """Return the kind of excitation: as asked, or that of most runs, detected from all their forces.

    Impacts have nearly all energy in a few samples; the force of a burst is off at the end of a run; a sweep has few lines
    at a time, which move in one direction; everything else, periodic forces included, is treated as random.
    """
    check_choice("excitation", asked, ("auto", *EXCITATIONS))
    if asked != "auto":
        return asked
    inputs = signals.by_run()[1]
    assert inputs is not None
    moving = (np.delete(run, constant_channels(run), axis=1) for run in inputs)
    return commonest([_kind_of_run(run) for run in moving if run.size], "random")


def excitation_of(parts: Sequence[Signals], otherwise: str = "random") -> str:
    """Return the kind of excitation that most parts of one test show; where none is the most frequent, the one given."""
    return commonest([find_excitation(part) for part in parts], otherwise)


def _kind_of_run(forces: RealArray) -> str:
    """Return the kind of excitation of the forces of a run (N, m), all alike."""
    centred = [force - np.median(force) for force in forces.T]
    for kind, is_kind in (("impact", is_impact), ("burst", _is_burst), ("sweep", is_sweep)):
        if all(map(is_kind, centred)):
            return kind
    return "random"


def _is_burst(force: Array) -> bool:
    """Return whether the force is off at the end of the run."""
    last = force[-max(2, int(_LAST_PART * force.size)) :]
    return bool(np.sqrt(np.mean(last**2)) < _MAX_OFF * np.sqrt(np.mean(force**2)))


def is_sweep(force: Array) -> bool:
    """Return whether every stretch has few lines, and the strongest moves in one direction over the run."""
    length = force.size // _STRETCHES
    if length < 32:
        return False
    stretches = force[: length * _STRETCHES].reshape(_STRETCHES, length) * np.hanning(length)
    power = np.abs(fft.rfft(stretches, axis=1)) ** 2
    strongest = np.argmax(power, axis=1)
    count = max(3, int(_SWEPT_LINES * power.shape[1]))
    share = np.sort(power, axis=1)[:, -count:].sum(axis=1) / np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    # where the force drops out at a resonance, a harmonic may be stronger: most pairs of stretches, not all, are in order
    order = np.sign(np.subtract.outer(strongest, strongest))[np.tril_indices(_STRETCHES, -1)]
    return bool(abs(np.mean(order)) > _MIN_ORDERED_PAIRS and np.median(share) > _SWEPT_ENERGY)


def few_tones(data: Signals | Records) -> tuple[float, ...]:
    """Return the frequencies (Hz) of forces that are nothing but ten sinusoids at most, () for others.

    k sinusoids measure a response on k lines: 2 k l numbers of l outputs, where n states have n (1 + l).

    Examples
    --------
    >>> t = np.arange(2000) / 50.0
    >>> rest = {"outputs": np.zeros((2000, 1)), "sampling_rate": 50.0}
    >>> [round(f, 2) for f in few_tones(Signals(inputs=np.sin(2 * np.pi * 3 * t)[:, None], **rest))]
    [3.0]
    >>> few_tones(Signals(inputs=np.random.default_rng(0).standard_normal((2000, 1)), **rest))
    ()
    """
    found: set[float] = set()
    for record in data.recordings:
        for forces in record.by_run()[1] if record.inputs is not None else ():  # type: ignore[union-attr]
            lines = np.abs(fft.rfft((forces - forces.mean(axis=0)).T * np.hanning(len(forces)))) ** 2
            power = np.sum(lines / np.maximum(lines.sum(axis=1, keepdims=True), np.finfo(float).tiny), axis=0)
            least, at = _BESIDE_TONES * power.sum(), [power.size]
            while power.sum() > least:
                k = int(np.argmax(power))
                at.append(k)
                beside = np.min(np.abs(np.array(at[:-1]) - k)) <= 2 * _TONE_LINES + 1  # a band, no tones
                if beside or len(at) > _MAX_TONES + 1 or power.size < _MIN_LINES:
                    return ()
                power[max(k - _TONE_LINES, 0) : k + _TONE_LINES + 1] = 0
            found |= {k * record.sampling_rate / len(forces) for k in at[1:]}
    return tuple(sorted(found))


def find_period(forces: RealArray, period: int | None) -> int:
    """Return the period of forces (R, N, m) in samples: as given, or the shortest lag at which all repeat.

    Raises DataError for forces that do not repeat, and for fewer than two periods in a run.
    """
    samples = forces.shape[1]
    if period is None:
        period = _repeat(forces)
        if period is None:
            change = 'Give period in samples, or excitation="random".'
            raise DataError("a synchronous average:", "the forces do not repeat within half a run", change)
    check_count("period", period, least=2)
    if samples < 2 * period:
        asked, have = f"period={period}:", f"a run has {samples} samples, fewer than two periods"
        raise DataError(asked, have, 'Measure more periods, or give excitation="random".')
    return period


def _repeat(forces: RealArray) -> int | None:
    correlation = _autocorrelation(forces)
    peaks = 1 + np.flatnonzero((correlation[1:-1] >= correlation[:-2]) & (correlation[1:-1] >= correlation[2:]))
    peaks = peaks[peaks >= 2]
    if peaks.size == 0 or (best := correlation[peaks].max()) < _MIN_PERIODIC:
        return None
    # of lags nearly as good as the best, the shortest: the others are its multiples
    return int(peaks[np.flatnonzero(correlation[peaks] > best - 0.1 * (1 - _MIN_PERIODIC))[0]])


def _autocorrelation(forces: RealArray) -> RealArray:
    """Return the correlation coefficient of all forces (R, N, m) with themselves at lags 0 ... N / 2: 1 where they repeat."""
    samples = forces.shape[1]
    half = 2 * fft.next_fast_len(-(-samples // 2), real=True)  # at least 2 N in all, and it splits in four
    power, place, energy, x = scratch(half + 1), scratch(half + 1, complex), scratch(samples), scratch(2 * half)
    for force in (force for run in forces for force in run.T):
        np.subtract(force, force.mean(), out=x[:samples])
        half_transform(x, place)
        power += np.square(place.real, out=place.real)
        power += np.square(place.imag, out=place.imag)
        energy += np.square(x[:samples], out=x[:samples])
        x[:samples] = 0
    x[: half + 1], x[half + 1 :] = power, power[half - 1 : 0 : -1]  # power is even: its transform is the correlation
    half_transform(x, place)
    coefficients: RealArray = place.real[: samples // 2 + 1] / (2 * half)
    # energy of the parts that overlap at each lag: first N - k samples, and last N - k
    np.cumsum(energy, out=energy)
    for start in range(0, coefficients.size, _MAX_LAGS):
        lags = np.arange(start, min(start + _MAX_LAGS, coefficients.size))
        before = np.where(lags > 0, energy[lags - 1], 0.0)
        size = np.sqrt(energy[samples - 1 - lags] * (energy[-1] - before))
        coefficients[lags] /= np.maximum(size, np.finfo(float).tiny)
    return coefficients
