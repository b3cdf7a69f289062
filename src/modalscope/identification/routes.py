"""Turn records with inputs into responses by one of several routes.

    impacts at one place, cut off                  -> free decays after the hits
    other impacts                                  -> frf (hits average, each input by itself)
    periodic, settled, two or more periods         -> frf by synchronous averages, on the driven lines only
    all else                                       -> records on lines, in z

Records on lines and decays do not leak, whatever came before and follows. The former are biased by noise on the inputs and by unmeasured
forces: see `modalscope.data.record_residual`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.record_transform import record_spectra
from modalscope.data.records import Records
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.identification.fast.record_cost import record_cost, refuse_beyond_memory
from modalscope.identification.method_names import find_method, rows_of
from modalscope.identification.suits import route_of
from modalscope.numerics.errors import DataError
from modalscope.signals.doctor.delays import common_delays
from modalscope.signals.preprocess import estimate_markov
from modalscope.signals.preprocess.after_hits import cut_off, decays_after_hits
from modalscope.signals.preprocess.ambient_records import aligned, one_record
from modalscope.signals.preprocess.bands import driven_band, struck_band
from modalscope.signals.preprocess.excitation import excitation_of, find_period
from modalscope.signals.preprocess.line_noise import level_lines
from modalscope.signals.preprocess.merging import joined_frf
from modalscope.signals.preprocess.resonant_band import resonant_band

#: Route -> default row and domain.
USUAL = {
    "records": ("alternate", "z"),
    "frf": ("alternate", "s"),
    "markov": ("era", "time"),
    "subspace": ("n4sid", "time"),
    "decays": ("era", "time"),
}

#: Maximum ratio of the longest to the shortest run of hits, which are all cut to the shortest.
_MAX_LENGTH_RATIO = 2.0

#: Minimum number of periods after the first for a synchronous average, and maximum relative difference of the outputs of two periods.
_MIN_PERIODS, _MAX_PERIOD_DIFFERENCE = 2, 1 - 0.99


class Way(NamedTuple):
    """A response made of records, its band (Hz, as asked or automatic; None for the whole range), and notes."""

    response: RecordSpectra | FrequencyResponse | ImpulseResponse
    band: tuple[float, float] | None
    notes: tuple[Note, ...]


def usual_route(records: Records) -> str:
    """Return the route that suits records with inputs by the rule of this module."""
    single = all(len(run.input_dofs) == 1 for run in records.runs)
    alike = max(records.samples) <= _MAX_LENGTH_RATIO * min(records.samples)
    if single and alike and excitation_of(records.runs) == "impact":
        return "decays" if len(records.input_dofs) == 1 and all(map(cut_off, records.stacked())) else "frf"
    return "records" if _periodic(records) is None else "frf"


def chosen_route(records: Records, method: str | None, domain: str | None, asked: str) -> str:
    """Return the route as `asked`; else the usual one where it serves the method and domain, or the first that does."""
    if asked in USUAL:
        return asked
    usual = usual_route(records)
    if method is None and domain is None:
        return usual
    name = find_method("alternate" if method is None else method, None, "time").name
    routes = {route_of(m) for m in rows_of(name) if domain is None or m.domain == domain}
    return next((route for route in (usual, *USUAL) if route in routes), usual)


#: Kinds of tests with forces, in words.
_TAKEN = {"hammer": "a hammer test", "shaker": "a test with measured forces", "earthquake": "an earthquake"}


def by_route(records: Records, route: str, band: tuple[float, float] | None) -> Way:
    """Return the response of records with inputs by a route, in a band (Hz)."""
    if route == "frf":
        return _averaged(records, band)
    if route == "markov":
        note = Note("estimated", {}, "Markov parameters were estimated from the records by an observer (OKID)")
        return Way(estimate_markov(one_record(records, "Markov parameters")), band, (note,))
    if route == "decays":
        return Way(*decays_after_hits(records, band))
    low, high = (0.0, np.inf) if band is None else band
    rate, samples = records.sampling_rate, sum(records.samples)
    lines = int(samples * (min(high, rate / 2) - low) / rate) if low < rate / 2 else 0
    refuse_beyond_memory(record_cost(lines, len(records.output_dofs), len(records.input_dofs), 0))
    runs = len(records.runs)
    what = "the record" if runs == 1 else f"{runs} runs"
    taken = f"Taken as {_TAKEN[records.kind_of_test]}"
    text = f"{taken}: lines of {what} fitted directly; inputs and end effects eliminated"
    note = Note("records on lines", {"runs": runs}, text)
    spectra = record_spectra(records, band)
    return Way(spectra, band, (note,)) if route != "records" else _level(spectra, band, note)


def without_delays(
    records: Records, delays: Mapping[str, int] | None
) -> tuple[Records, Mapping[str, int] | None, tuple[Note, ...]]:
    """Return records with delayed outputs shifted back, the delays and notes; periodic records only where delays are given."""
    chosen = common_delays(records) if delays is None else delays
    if delays is None and (not chosen or _periodic(records) is not None):
        return records, None, ()
    moved, notes = aligned(records, chosen)
    return moved, chosen, notes


def _averaged(records: Records, band: tuple[float, float] | None) -> Way:
    """Return frequency responses in a band, by default for hits, sweeps and bursts the one that they excite."""
    stacked, period = records.stacked(), _periodic(records)
    driven = driven_band(stacked) if band is None else struck_band(stacked, band)
    chosen, note_on_band = driven or (band, None)
    kind = excitation_of(records.runs, "auto") if period is None else "periodic"
    text = f"Taken as {_TAKEN[records.kind_of_test]}: frequency responses were estimated from the records (H1)"
    note = Note("estimated", {}, text)
    response = joined_frf(stacked, excitation=kind, period=period).in_band(chosen)
    return Way(response, chosen, (note,) if note_on_band is None else (note_on_band, note))


def _level(spectra: RecordSpectra, band: tuple[float, float] | None, note: Note) -> Way:
    """Return records in a band, by default that of their resonances, with noise of the same level on all lines."""
    automatic = resonant_band(spectra) if band is None else None
    chosen, notes = (band, ()) if automatic is None else (automatic[0], (automatic[1],))
    levelled, drift = level_lines(spectra if automatic is None else spectra.in_band(chosen))
    return Way(levelled, chosen, (*notes, *drift, note))


def _periodic(records: Records) -> int | None:
    """Return the period in samples of forces that repeat at least twice after settling, and of the responses; None for others."""
    try:
        outputs, inputs = one_record(records, "a period").by_run()
        assert inputs is not None
        period = find_period(inputs, None)
    except DataError:
        return None
    if outputs.shape[1] < (_MIN_PERIODS + 1) * period:
        return None
    start = outputs.shape[1] - _MIN_PERIODS * period
    first, second = outputs[:, start : start + period], outputs[:, start + period :]
    difference = np.linalg.norm(second - first) / max(float(np.linalg.norm(second)), 1e-300)
    return period if difference < _MAX_PERIOD_DIFFERENCE else None
