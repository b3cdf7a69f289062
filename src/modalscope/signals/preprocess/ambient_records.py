"""Filter and decimate ambient records and setups to a band, by default that of their spectra.

Only here are records filtered and decimated without being asked. The chosen band is the `band` of the settings: the same band, asked
for, gives the same numbers to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_moving, check_size, check_upright
from modalscope.data.stored import StoredSignals
from modalscope.numerics.errors import DataError
from modalscope.signals.preprocess.bands import AutomaticBands, at_lower_rate, automatic_bands
from modalscope.signals.preprocess.conditioning import straightened
from modalscope.signals.preprocess.harmonics import Line, harmonic_notes, lines_in
from modalscope.signals.preprocess.harmonics_removed import without_lines
from modalscope.signals.preprocess.modeless import modeless_notes
from modalscope.signals.preprocess.spectra import Spectrum
from modalscope.signals.preprocess.spectral_peaks import (
    Levels,
    clear_peaks,
    component_levels,
    levels_in,
    levels_of,
    noise_notes,
)
from modalscope.signals.preprocess.steady import steadied

Band = tuple[float, float]

#: Maximum number of rows of a matrix of joined setups.
SETUP_ROWS = 1300

#: Minimum share of a straight line in the power of a channel of a setup, to be drift: less is chance.
_MIN_DRIFT_SHARE = 1e-3


class Conditioned(NamedTuple):
    """A record filtered to a band (Hz, None for the whole record) and decimated, for correlations."""

    records: Signals | StoredSignals
    band: Band | None
    notes: tuple[Note, ...]


#: The kind of the note.
DELAYS = "delays taken out"


def one_record(records: Records, what: str) -> Signals:
    """Return runs of one length and the same inputs as one record, or raise `DataError` about `what` was asked."""
    stacks = records.stacked()
    if len(stacks) > 1:
        raise DataError(
            f"{what} of {len(records.runs)} runs:",
            "they differ in length or inputs",
            "Use route='records', which accepts any runs, or cut them to one length.",
        )
    return stacks[0]


def aligned(records: Records, delays: Mapping[str, int]) -> tuple[Records, tuple[Note, ...]]:
    """Return records with outputs shifted back against the forces by whole samples, and a note; unchanged where no delay is above zero.

    Raises DataError for an output that is not there, or a run that is no longer than its delay.
    """
    longest, shortest = max(delays.values(), default=0), min(records.samples)
    unknown = [dof for dof in delays if dof not in records.output_dofs]
    if unknown or longest > shortest - 2:
        have = f"the outputs are {', '.join(records.output_dofs)}, the shortest run has {shortest} samples"
        raise DataError(f"delays of {dict(delays)}:", have, "Name outputs of these, and fewer samples.")
    if not longest:
        return records, ()
    lags = [delays.get(dof, 0) for dof in records.output_dofs]

    def shifted(run: Signals) -> Signals:  # cut to the samples that all channels have
        count = run.samples - longest
        outputs = np.column_stack([y[lag : lag + count] for y, lag in zip(run.outputs.T, lags, strict=True)])
        return replace(run, outputs=outputs, inputs=None if run.inputs is None else run.inputs[:count])

    moved = replace(records, runs=tuple(map(shifted, records.runs)), groups=records.groups)
    listed = ", ".join(f"{dof} by {lag} samples" for dof, lag in delays.items() if lag)
    which = f"All outputs were shifted back by {longest} samples" if len(set(lags)) == 1 else f"Shifted back: {listed}"
    against = "after the forces" if records.input_dofs else "after the others"
    text = f"{which}, their delay {against}; poles and shapes stay. To keep the delay: --delays none"
    return moved, (Note(DELAYS, {"samples": float(longest)}, text),)


@dataclass(frozen=True, eq=False, slots=True)
class SeenRecord:
    """A record without inputs at one level, with its spectrum levels, bands and harmonics, found once for all bands and orders.

    Verbs take it in place of its record. `excerpt`: what was examined, all of a record in memory. `lines`: harmonics. `modeless`: why it
    holds no modes, if so. `level`: what was done to its level.
    """

    record: Signals | StoredSignals
    excerpt: Signals
    levels: Levels
    own: AutomaticBands
    lines: tuple[Line, ...]
    modeless: tuple[Note, ...]
    level: tuple[Note, ...] = ()


def seen_record(record: Signals | StoredSignals) -> SeenRecord:
    """Examine the spectrum of a record without inputs, of a stored record that of an excerpt.

    Straight lines are taken out first, and stretches brought to one level where every clear peak stays clear: an earthquake may be the one
    stretch that has them.
    """
    if isinstance(record, Signals):
        check_moving(record)
    straight = straightened(record)
    whole = _examined(straight)
    straight, (excerpt, spectrum, levels), told = _at_one_level(straight, whole)
    # machines go on through gusts
    bands, lines = automatic_bands(levels, record.sampling_rate), lines_in(whole.spectrum)
    return SeenRecord(straight, excerpt, levels, bands, lines, modeless_notes(spectrum, levels, lines), told)


class _Examined(NamedTuple):
    excerpt: Signals
    spectrum: Spectrum
    levels: Levels


def _examined(record: Signals | StoredSignals) -> _Examined:
    excerpt = record.excerpt()
    spectrum = Spectrum.of(excerpt)
    return _Examined(excerpt, spectrum, levels_in(spectrum).with_combinations(component_levels(spectrum)))


def _at_one_level(record: Any, seen: _Examined) -> tuple[Any, _Examined, tuple[Note, ...]]:
    """Return a record at one level, its spectrum, and what was done; as it is where it is steady, or its loudest part shows the most.

    An earthquake in a record that is quiet otherwise has more than twice the clear peaks of all stretches at one level.
    """
    steady = steadied(record, seen.spectrum)
    if steady is None:
        return record, seen, ()
    then = _examined(steady.record)
    if steady.loudest is not None and len(clear_peaks(levels_of(steady.loudest))) > 2 * len(clear_peaks(then.levels)):
        return record, seen, ()
    return steady.record, then, (steady.note,)


def looked_through(data: Any, exclude: Any = None, delays: Mapping[str, int] | None = None) -> Any:
    """Return a record without inputs as a `SeenRecord` without the excluded channels, in time; all other data as they are.

    `delays`: samples by which outputs are late, see `aligned`.
    """
    if not isinstance(data, Signals | StoredSignals | Records) or data.input_dofs:
        return data
    kept = data if exclude is None else data.select(exclude=exclude)
    if isinstance(kept, StoredSignals):
        return seen_record(kept)
    records, notes = aligned(as_records(kept), delays or {})
    check_size(records)
    check_upright(records)
    seen = seen_record(one_record(records, "correlations"))
    return replace(seen, level=(*notes, *seen.level))


def conditioned(seen: SeenRecord, band: Band | None) -> Conditioned:
    """Return a record without inputs in a band (Hz), by default the automatic one."""
    record: Any = seen.record
    bands, lines = seen.own, seen.lines
    choice = (bands.note((bands.whole,)),) if band is None and bands.whole is not None else ()
    chosen = bands.whole if band is None else band
    inside = record if chosen is None else at_lower_rate(record, chosen[1], bands.drift)
    clean, removal = _without_lines(inside, lines)
    modeless = seen.modeless or noise_notes(seen.levels, chosen)
    return Conditioned(clean, chosen, (*choice, *seen.level, *modeless, *harmonic_notes(lines), *removal))


def _without_lines(record: Signals | StoredSignals, lines: Sequence[Line]) -> tuple[Any, tuple[Note, ...]]:
    """Return a record without harmonics, which mask modes next to them, and a note; a stored record keeps them."""
    if not lines:
        return record, ()
    if isinstance(record, StoredSignals):
        text = "Harmonics stay in a stored record: modes next to them may be missed. Load the record to remove them"
        return record, (Note("lines kept", {"lines": float(len(lines))}, text),)
    text = "Harmonics were removed before identification; estimate_correlation(record) keeps them"
    clean = without_lines(record, ((line.frequency, line.spread) for line in lines))
    return clean, () if clean is record else (Note("lines removed", {"lines": float(len(lines))}, text),)


def bands_of_record(data: Any) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that the spectrum of a `SeenRecord` falls into and a note; none of other data."""
    if not isinstance(data, SeenRecord) or len(data.own.parts) < 2:
        return (), ()
    return data.own.parts, (data.own.note(data.own.parts),)


def bands_of_setups(setups: Setups) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that the spectra of setups fall into and a note; none where one band is enough.

    One band is enough where the block rows of the joined setups span half a period of the lowest frequency: several bands fit the modes
    of one without those of the others, which biases shapes.
    """
    own = _own(setups)
    rows = max(SETUP_ROWS // len(setups.output_dofs), 10)
    if len(own.parts) < 2 or rows / setups.sampling_rate >= 0.5 / own.parts[0][0]:
        return (), ()
    return own.parts, (own.note(own.parts),)


class ConditionedSetups(NamedTuple):
    """Setups in a band (Hz, None for all); `lowest`: Hz, the lowest frequency with a peak above the noise, if any."""

    setups: Setups
    band: Band | None
    lowest: float | None
    notes: tuple[Note, ...]


def conditioned_setups(setups: Setups, band: Band | None) -> ConditionedSetups:
    """Return setups decimated to a band and without drift; by default the band in which any of them has peaks."""
    straight = map(_without_drift, setups.parts)
    level = [_at_one_level(part, _examined(part)) for part in straight]
    setups = replace(setups, parts=tuple(part for part, _, _ in level))
    told = tuple(
        replace(note, text=f"Setup {k + 1}: {note.text[0].lower()}{note.text[1:]}")
        for k, (_, _, notes) in enumerate(level)
        for note in notes
    )
    own = _own(setups)
    chosen = own.whole if band is None else band
    lowest = None if own.span is None else max(own.span[0], 0.0 if band is None else band[0])
    if chosen is None:
        return ConditionedSetups(setups, None, lowest, told)
    parts = tuple(at_lower_rate(part, chosen[1], own.drift) for part in setups.parts)
    return ConditionedSetups(
        replace(setups, parts=parts), chosen, lowest, (*((own.note((chosen,)),) if band is None else ()), *told)
    )


def _without_drift(part: Signals) -> Signals:
    """Return a setup without straight lines where one has a thousandth of the power of its channel."""
    straight: Signals = straightened(part)
    whole, remainder = (np.var(record.outputs, axis=-2) for record in (part, straight))
    return straight if np.any(whole - remainder > _MIN_DRIFT_SHARE * whole) else part


def _own(setups: Setups) -> AutomaticBands:
    """Return the bands of the outputs of all setups side by side, over the samples that all have."""
    count = min(setups.samples)
    spectra = [Spectrum.of(replace(part, outputs=part.outputs[..., :count, :])) for part in setups.parts]
    first, *others = map(levels_in, spectra)
    levels = first.with_channels(others).with_combinations(*(component_levels(spectrum) for spectrum in spectra))
    return automatic_bands(levels, setups.sampling_rate)
