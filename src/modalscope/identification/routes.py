"""Ways from records with inputs into the table, and the rule that chooses one.

    impacts                                        -> frf (hits average, each input by itself)
    periodic, settled, two or more periods         -> frf by synchronous averages, on the driven lines only
    all else                                       -> records on lines, in z

Only records on lines are free of leakage whatever the run does before and after. What they cannot take is noise on the inputs, and
forces that were not measured: see `modalscope.data.record_residual`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from modalscope.blocks.records import record_cost, refuse_beyond_memory
from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records, Signals
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.identification.lookup import find_method
from modalscope.identification.table import methods
from modalscope.numerics.errors import DataError

__all__ = ["USUAL", "Way", "by_route", "chosen_route", "one_record", "usual_route", "without_delays"]

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
    """Return the way that suits records with inputs by the rule of this module; runs that do not stack are taken as they are."""
    from modalscope.preprocess.excitation import find_excitation

    if max(records.samples) <= _LENGTHS * min(records.samples) and all(
        len(run.input_dofs) == 1 and find_excitation(run) == "impact" for run in records.runs
    ):
        return "frf"
    return "records" if _periodic(records) is None else "frf"


def chosen_route(records: Records, method: str | None, domain: str | None, asked: str) -> str:
    """Return the way for a method and a domain: as asked, or the first by the rule that serves them.

    `records`: with inputs. `method`, `domain`: as asked. `asked`: "auto", or a way.
    """
    if asked != "auto":
        return asked
    usual = usual_route(records)
    if method is None and domain is None:
        return usual
    name = find_method("alternate" if method is None else method, None, "time").name
    own = {m.route for m in methods() if m.name == name and (domain is None or m.domain == domain)}
    return next((way for way in (usual, *USUAL) if way in own), usual)


def by_route(records: Records, route: str, band: tuple[float, float] | None) -> Way:
    """Return what a way makes of records with inputs.

    `band`: hz.
    """
    if route == "frf":
        return _averaged(records, band)
    if route == "markov":
        from modalscope.preprocess import estimate_markov

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
    """Return records with outputs that come late shifted back, by how much, and what is said; periods are left whole unless it is asked.

    `records`: with inputs. `delays`: as in `modalscope.doctor.delays`.
    """
    from modalscope.doctor.delays import aligned, seen_delays

    chosen = seen_delays(records) if delays is None else delays
    if delays is None and (not chosen or _periodic(records) is not None):
        return records, None, ()
    moved, told = aligned(records, chosen)
    return moved, chosen, told


def _averaged(records: Records, band: tuple[float, float] | None) -> Way:
    """Return frequency responses in a band; of hits, where none is asked, in that into which they put force."""
    from modalscope.preprocess.excited_band import struck_band
    from modalscope.preprocess.merging import joined_frf

    stacked, period = records.stacked(), _periodic(records)
    own, told = struck_band(stacked, band) or (band, None)
    kind = "auto" if period is None else "periodic"
    note = Note("estimated", {}, "frequency responses were estimated from the records (H1)")
    response = joined_frf(stacked, excitation=kind, period=period).in_band(own)
    return Way(response, own, (note,) if told is None else (told, note))


def _level(spectra: RecordSpectra, band: tuple[float, float] | None, note: Note) -> Way:
    """Return records in the band that holds their resonances where none was asked, their noise the same on all lines, and what is said."""
    from modalscope.preprocess.excited_band import resonant_band
    from modalscope.preprocess.line_noise import level_lines

    found = resonant_band(spectra) if band is None else None
    own, told = (band, ()) if found is None else (found[0], (found[1],))
    taken, drift = level_lines(spectra if found is None else spectra.in_band(own))
    return Way(taken, own, (*told, *drift, note))


def one_record(records: Records, what: str) -> Signals:
    """Return runs of one length and the same inputs as one record, or raise.

    `what`: what is to be made of it.
    """
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
    from modalscope.preprocess.excitation import find_period

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
