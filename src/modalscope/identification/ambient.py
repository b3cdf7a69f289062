"""Prepare ambient records and setups: detrend, decimate and filter to the bands where modes are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.setups import Setups
from modalscope.data.sizes import check_size
from modalscope.data.stored import StoredSignals
from modalscope.identification.routes import one_record
from modalscope.identification.sizes import SETUP_ROWS
from modalscope.preprocess.bands import OwnBands, levels_of, own_bands, taken_down

if TYPE_CHECKING:
    from modalscope.preprocess.bands import Levels
    from modalscope.preprocess.harmonics import Line

__all__ = [
    "Conditioned",
    "SeenRecord",
    "bands_of_record",
    "bands_of_setups",
    "conditioned",
    "conditioned_setups",
    "looked_through",
    "seen_record",
]


# --------------------------------------------------------------------------------------------------------- conditioned
# What is made of a record without inputs before anything is identified: its band, its rate, and what in it is no structure.
#
# This is the only place where a record is filtered and decimated without being asked. The band that was chosen is the `band` of the
# settings:
# the same band, asked for, gives the same numbers to the last bit. Hits have their band by `modalscope.preprocess.excited_band`, other
# records with inputs by `modalscope.preprocess.excited_band`; nothing of them is filtered.


class Conditioned(NamedTuple):
    """A record as correlations are made of it.

    Attributes
    ----------
    records : Signals or StoredSignals
        Filtered to the band and decimated.
    band : (float, float) or None
        Hz, as asked or as chosen; None where the record is taken as it is.
    notes : tuple of Note
        What was chosen, lines of machines, and whether there is anything but noise.
    """

    records: Signals | StoredSignals
    band: Band | None
    notes: tuple[Note, ...]


@dataclass(frozen=True, eq=False, slots=True)
class SeenRecord:
    """A record without inputs with what is seen in it before any band: looked for once, and the same for all bands and ladders of orders.

    Wherever data are identified it stands for its record.

    `excerpt`: what was looked at: all of a record in memory. `lines`: of machines.
    """

    record: Signals | StoredSignals
    excerpt: Signals
    levels: Levels
    own: OwnBands
    lines: tuple[Line, ...]


def seen_record(record: Signals | StoredSignals) -> SeenRecord:
    """Look through a record without inputs.

    `record`: of a stored record an excerpt is looked at.
    """
    from modalscope.preprocess.bands import levels_in, own_bands
    from modalscope.preprocess.harmonics import Spectrum, lines_in

    excerpt = record.excerpt()
    spectrum = Spectrum.of(excerpt)
    levels = levels_in(spectrum)
    return SeenRecord(record, excerpt, levels, own_bands(levels, record.sampling_rate), lines_in(spectrum))


def looked_through(data: Any, exclude: Any = None) -> Any:
    """Return a record without inputs looked through, without the channels left out; all other data as they are."""
    if not isinstance(data, Signals | StoredSignals | Records) or data.input_dofs:
        return data
    thing = data if exclude is None else data.select(exclude=exclude)
    if isinstance(thing, StoredSignals):
        return seen_record(thing)
    records = as_records(thing)
    check_size(records)
    return seen_record(one_record(records, "correlations"))


def conditioned(seen: SeenRecord, band: Band | None) -> Conditioned:
    """Return a record without inputs in a band, or in its own.

    `band`: as asked, Hz.
    """
    from modalscope.preprocess.bands import noise_notes, taken_down
    from modalscope.preprocess.harmonics import harmonic_notes

    record: Any = seen.record
    own, lines = seen.own, seen.lines
    told = (own.note((own.whole,)),) if band is None and own.whole is not None else ()
    chosen = own.whole if band is None else band
    inside = record if chosen is None else taken_down(record, chosen[1], own.drift)
    taken, removed = _without_lines(inside, lines)
    return Conditioned(taken, chosen, (*told, *noise_notes(seen.levels, chosen), *harmonic_notes(lines), *removed))


def _without_lines(record: Signals | StoredSignals, lines: Sequence[Line]) -> tuple[Any, tuple[Note, ...]]:
    """Return a record without lines of machines, beside which modes would be lost, and what is said of it; a stored one keeps them."""
    from modalscope.preprocess.harmonics_removed import without_lines

    if not lines:
        return record, ()
    if isinstance(record, StoredSignals):
        text = "lines of machines stay in a stored record, where modes beside them may be lost; read into memory it is taken without"
        return record, (Note("lines kept", {"lines": float(len(lines))}, text),)
    text = "lines of machines were taken off before modes were looked for; estimate_correlation(record) keeps them"
    clean = without_lines(record, ((line.frequency, line.spread) for line in lines))
    return clean, () if clean is record else (Note("lines removed", {"lines": float(len(lines))}, text),)


def bands_of_record(data: Any) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that a record without inputs falls into, and what is said about them; none of all other data.

    `data`: as `looked_through` gives it.
    """
    if not isinstance(data, SeenRecord):
        return (), ()
    own = data.own
    return (own.parts, (own.note(own.parts),)) if len(own.parts) > 1 else ((), ())


# -------------------------------------------------------------------------------------------------- conditioned setups

Band = tuple[float, float]


def bands_of_setups(setups: Setups) -> tuple[tuple[Band, ...], tuple[Note, ...]]:
    """Return the bands that setups fall into, and what is said about them; none where one will do.

    One does where the block rows of the joined setups span half a period of the lowest frequency: modes of one band are fitted without
    those of the others, and their shapes suffer.
    """
    own = _own(setups)
    rows = max(SETUP_ROWS // len(setups.output_dofs), 10)
    if len(own.parts) < 2 or rows / setups.sampling_rate >= 0.5 / own.parts[0][0]:
        return (), ()
    return own.parts, (own.note(own.parts),)


class InBand(NamedTuple):
    """Setups as they are joined.

    Attributes
    ----------
    setups : Setups
    band : (float, float) or None
        Hz, as asked or as chosen; None where they are taken as they are.
    lowest : float or None
        Hz: the lowest frequency in the band at which something stands out; None where nothing does.
    notes : tuple of Note
    """

    setups: Setups
    band: Band | None
    lowest: float | None
    notes: tuple[Note, ...]


def conditioned_setups(setups: Setups, band: Band | None) -> InBand:
    """Return setups at the rate of a band and without drift, the band, and what was chosen.

    `band`: as asked, Hz; by default one in which something stands out of any of them, where they are sampled for more.
    """
    own = _own(setups)
    chosen = own.whole if band is None else band
    lowest = None if own.span is None else max(own.span[0], 0.0 if band is None else band[0])
    if chosen is None:
        return InBand(setups, None, lowest, ())
    parts = tuple(taken_down(part, chosen[1], own.drift) for part in setups.parts)
    return InBand(replace(setups, parts=parts), chosen, lowest, (own.note((chosen,)),) if band is None else ())


def _own(setups: Setups) -> OwnBands:
    """Return the bands of the outputs of all setups side by side, over the samples that all have."""
    count = min(setups.samples)
    each = [levels_of(replace(part, outputs=part.outputs[..., :count, :])) for part in setups.parts]
    together = replace(each[0], levels=np.hstack([levels.levels for levels in each]))
    return own_bands(together, setups.sampling_rate)
