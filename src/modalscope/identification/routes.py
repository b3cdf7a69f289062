"""Turn records into responses: records with inputs by one of several routes, ambient records in a band of their spectra.

    impacts                                        -> frf (hits average, each input by itself)
    periodic, settled, two or more periods         -> frf by synchronous averages, on the driven lines only
    all else                                       -> records on lines, in z

Only records on lines are free of leakage, whatever the run does before and after. They are biased by noise on the inputs and by
unmeasured forces: see `modalscope.data.record_residual`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from modalscope.blocks.records import record_cost, refuse_beyond_memory
from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredSignals
from modalscope.doctor.delays import aligned, seen_delays
from modalscope.identification.sizes import SETUP_ROWS
from modalscope.identification.table import find_method, methods
from modalscope.numerics.errors import DataError
from modalscope.preprocess import estimate_markov
from modalscope.preprocess.bands import AutomaticBands, at_lower_rate, automatic_bands, struck_band
from modalscope.preprocess.conditioning import straightened
from modalscope.preprocess.excitation import find_excitation, find_period
from modalscope.preprocess.harmonics import Line, harmonic_notes, lines_in
from modalscope.preprocess.harmonics_removed import without_lines
from modalscope.preprocess.line_noise import level_lines
from modalscope.preprocess.merging import joined_frf
from modalscope.preprocess.resonant_band import resonant_band
from modalscope.preprocess.spectra import Spectrum
from modalscope.preprocess.spectral_peaks import Levels, levels_in, noise_notes, uncorrelated

# -------------------------------------------------------------------------------------------------- records with inputs

#: The row and the domain of each way where none is asked.
USUAL = {
    "records": ("alternate", "z"),
    "frf": ("alternate", "s"),
    "markov": ("era", "time"),
    "subspace": ("n4sid", "time"),
}

#: Hits are cut to the length of the shortest run: others last this much longer at most.
_LENGTHS = 2.0

#: Periods after the first that a synchronous average needs, and how alike two periods of the outputs are when all has settled.
_PERIODS, _SETTLED = 2, 0.99


class Way(NamedTuple):
    """A response made of records, its band (Hz, as asked or as chosen; None stands for all there is), and what was done."""

    response: RecordSpectra | FrequencyResponse | ImpulseResponse
    band: tuple[float, float] | None
    notes: tuple[Note, ...]


def usual_route(records: Records) -> str:
    """Return the route that suits records with inputs by the rule of this module."""
    if max(records.samples) <= _LENGTHS * min(records.samples) and all(
        len(run.input_dofs) == 1 and find_excitation(run) == "impact" for run in records.runs
    ):
        return "frf"
    return "records" if _periodic(records) is None else "frf"


def chosen_route(records: Records, method: str | None, domain: str | None, asked: str) -> str:
    """Return the route as `asked`, or for "auto" the usual one where it serves the method and domain, else the first that does."""
    if asked != "auto":
        return asked
    usual = usual_route(records)
    if method is None and domain is None:
        return usual
    name = find_method("alternate" if method is None else method, None, "time").name
    own = {m.route for m in methods() if m.name == name and (domain is None or m.domain == domain)}
    return next((way for way in (usual, *USUAL) if way in own), usual)


def by_route(records: Records, route: str, band: tuple[float, float] | None) -> Way:
    """Return the response of records with inputs by a route, in a band (Hz)."""
    if route == "frf":
        return _averaged(records, band)
    if route == "markov":
        note = Note("estimated", {}, "Markov parameters were estimated from the records by an observer (OKID)")
        return Way(estimate_markov(one_record(records, "Markov parameters")), band, (note,))
    low, high = (0.0, np.inf) if band is None else band
    rate, samples = records.sampling_rate, sum(records.samples)
    lines = int(samples * (min(high, rate / 2) - low) / rate) if low < rate / 2 else 0
    refuse_beyond_memory(record_cost(lines, len(records.output_dofs), len(records.input_dofs), 0))
    runs = len(records.runs)
    of = "the record" if runs == 1 else f"{runs} runs"
    note = Note("records on lines", {"runs": runs}, f"{of} on lines, nothing estimated: inputs and ends are eliminated")
    spectra = record_spectra(records, band)
    return Way(spectra, band, (note,)) if route != "records" else _level(spectra, band, note)


def without_delays(
    records: Records, delays: Mapping[str, int] | None
) -> tuple[Records, Mapping[str, int] | None, tuple[Note, ...]]:
    """Return records with delayed outputs shifted back, the delays and notes; periodic records only where delays are given."""
    chosen = seen_delays(records) if delays is None else delays
    if delays is None and (not chosen or _periodic(records) is not None):
        return records, None, ()
    moved, told = aligned(records, chosen)
    return moved, chosen, told


def _averaged(records: Records, band: tuple[float, float] | None) -> Way:
    """Return frequency responses in a band; of hits, where none is asked, in that into which they put force."""
    stacked, period = records.stacked(), _periodic(records)
    own, told = struck_band(stacked, band) or (band, None)
    kind = "auto" if period is None else "periodic"
    note = Note("estimated", {}, "frequency responses were estimated from the records (H1)")
    response = joined_frf(stacked, excitation=kind, period=period).in_band(own)
    return Way(response, own, (note,) if told is None else (told, note))


def _level(spectra: RecordSpectra, band: tuple[float, float] | None, note: Note) -> Way:
    """Return records in a band, by default that of their resonances, with noise of the same level on all lines."""
    found = resonant_band(spectra) if band is None else None
    own, told = (band, ()) if found is None else (found[0], (found[1],))
    taken, drift = level_lines(spectra if found is None else spectra.in_band(own))
    return Way(taken, own, (*told, *drift, note))


def one_record(records: Records, what: str) -> Signals:
    """Return runs of one length and the same inputs as one record, or raise `DataError` about `what` was asked."""
    stacks = records.stacked()
    if len(stacks) > 1:
        raise DataError(
            f"{what} of {len(records.runs)} runs were asked",
            "they differ in length or in their inputs",
            "Use route='records', which takes runs as they are, or cut them alike.",
        )
    return stacks[0]


def _periodic(records: Records) -> int | None:
    """Return the period in samples where forces repeat at least twice after settling, and the responses with them; None else."""
    try:
        record = one_record(records, "a period")
        outputs, inputs = record.by_run()
        assert inputs is not None
        period = find_period(inputs, None)
    except DataError:
        return None
    if outputs.shape[1] < (_PERIODS + 1) * period:
        return None
    start = outputs.shape[1] - _PERIODS * period
    first, second = outputs[:, start : start + period], outputs[:, start + period :]
    apart = np.linalg.norm(second - first) / max(float(np.linalg.norm(second)), 1e-300)
    return period if apart < 1 - _SETTLED else None


# --------------------------------------------------------------------------------------------------------- conditioned
# Only here are records filtered and decimated without being asked. The chosen band is the `band` of the settings: the same band, asked
# for, gives the same numbers to the last bit.


class Conditioned(NamedTuple):
    """A record filtered to a band (Hz, None for the whole record) and decimated, for correlations."""

    records: Signals | StoredSignals
    band: Band | None
    notes: tuple[Note, ...]


@dataclass(frozen=True, eq=False, slots=True)
class SeenRecord:
    """A record without inputs with its spectrum levels, bands and harmonics, found once for all bands and orders.

    Verbs take it in place of its record. `excerpt`: what was examined, all of a record in memory. `lines`: harmonics.
    """

    record: Signals | StoredSignals
    excerpt: Signals
    levels: Levels
    own: AutomaticBands
    lines: tuple[Line, ...]


def seen_record(record: Signals | StoredSignals) -> SeenRecord:
    """Examine the spectrum of a record without inputs, of a stored record that of an excerpt; straight lines are taken out first."""
    straight = straightened(record)
    excerpt = straight.excerpt()
    spectrum = Spectrum.of(excerpt)
    levels = levels_in(spectrum).with_combinations(levels_in(uncorrelated(spectrum)))
    return SeenRecord(straight, excerpt, levels, automatic_bands(levels, record.sampling_rate), lines_in(spectrum))


def looked_through(data: Any, exclude: Any = None) -> Any:
    """Return a record without inputs as a `SeenRecord` without the excluded channels; all other data as they are."""
    if not isinstance(data, Signals | StoredSignals | Records) or data.input_dofs:
        return data
    kept = data if exclude is None else data.select(exclude=exclude)
    if isinstance(kept, StoredSignals):
        return seen_record(kept)
    records = as_records(kept)
    check_size(records)
    return seen_record(one_record(records, "correlations"))


def conditioned(seen: SeenRecord, band: Band | None) -> Conditioned:
    """Return a record without inputs in a band (Hz), by default the automatic one."""
    record: Any = seen.record
    own, lines = seen.own, seen.lines
    chosen_note = (own.note((own.whole,)),) if band is None and own.whole is not None else ()
    chosen = own.whole if band is None else band
    inside = record if chosen is None else at_lower_rate(record, chosen[1], own.drift)
    taken, removed = _without_lines(inside, lines)
    return Conditioned(
        taken, chosen, (*chosen_note, *noise_notes(seen.levels, chosen), *harmonic_notes(lines), *removed)
    )


def _without_lines(record: Signals | StoredSignals, lines: Sequence[Line]) -> tuple[Any, tuple[Note, ...]]:
    """Return a record without harmonics, next to which modes would be lost, and a note; a stored record keeps them."""
    if not lines:
        return record, ()
    if isinstance(record, StoredSignals):
        text = "harmonics stay in a stored record, where modes next to them may be missed; they are removed from a record in memory"
        return record, (Note("lines kept", {"lines": float(len(lines))}, text),)
    text = "harmonics were removed before identification; estimate_correlation(record) keeps them"
    clean = without_lines(record, ((line.frequency, line.spread) for line in lines))
    return clean, () if clean is record else (Note("lines removed", {"lines": float(len(lines))}, text),)


def bands_of_record(data: Any) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that the spectrum of a `SeenRecord` falls into and a note; none of other data."""
    if not isinstance(data, SeenRecord):
        return (), ()
    own = data.own
    return (own.parts, (own.note(own.parts),)) if len(own.parts) > 1 else ((), ())


# -------------------------------------------------------------------------------------------------- conditioned setups

Band = tuple[float, float]


def bands_of_setups(setups: Setups) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that the spectra of setups fall into and a note; none where one band is enough.

    It is where the block rows of the joined setups span half a period of the lowest frequency: modes of one band are fitted without
    those of the others, and their shapes suffer.
    """
    own = _own(setups)
    rows = max(SETUP_ROWS // len(setups.output_dofs), 10)
    if len(own.parts) < 2 or rows / setups.sampling_rate >= 0.5 / own.parts[0][0]:
        return (), ()
    return own.parts, (own.note(own.parts),)


#: Part of a channel's power from which a straight line in a setup is drift.
_DRIFT = 1e-3


class InBand(NamedTuple):
    """Setups in a band (Hz, None for all); `lowest`: Hz, the lowest frequency with a peak above the noise, if any."""

    setups: Setups
    band: Band | None
    lowest: float | None
    notes: tuple[Note, ...]


def conditioned_setups(setups: Setups, band: Band | None) -> InBand:
    """Return setups decimated to a band and without drift; by default the band in which any of them has peaks."""
    setups = replace(setups, parts=tuple(map(_without_drift, setups.parts)))
    own = _own(setups)
    chosen = own.whole if band is None else band
    lowest = None if own.span is None else max(own.span[0], 0.0 if band is None else band[0])
    if chosen is None:
        return InBand(setups, None, lowest, ())
    parts = tuple(at_lower_rate(part, chosen[1], own.drift) for part in setups.parts)
    return InBand(replace(setups, parts=parts), chosen, lowest, (own.note((chosen,)),) if band is None else ())


def _without_drift(part: Signals) -> Signals:
    """Return a setup without straight lines where one holds a thousandth of its channel's power: less is chance."""
    straight: Signals = straightened(part)
    whole, left = (np.var(record.outputs, axis=-2) for record in (part, straight))
    return straight if np.any(whole - left > _DRIFT * whole) else part


def _own(setups: Setups) -> AutomaticBands:
    """Return the bands of the outputs of all setups side by side, over the samples that all have."""
    count = min(setups.samples)
    spectra = [Spectrum.of(replace(part, outputs=part.outputs[..., :count, :])) for part in setups.parts]
    channels = [*map(levels_in, spectra)]
    levels = (
        channels[0].with_channels(channels[1:]).with_combinations(*(levels_in(uncorrelated(each)) for each in spectra))
    )
    return automatic_bands(levels, setups.sampling_rate)
