"""From records to their lines: the plain transform of whole runs, and nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np

from modalscope.model.checks import ComplexArray, DataError, RealArray
from modalscope.model.half_transform import half_transform
from modalscope.model.memory import scratch
from modalscope.model.record_spectra import RecordSpectra
from modalscope.model.records import Records

__all__ = ["record_spectra"]


def record_spectra(records: Records, band: tuple[float, float] | None = None) -> RecordSpectra:
    """Return the plain transforms of whole runs, cut to a band: no window, no padding, no detrend; 0 Hz and half the rate are left out.

    Parameters
    ----------
    records : Records
        With inputs.
    band : (float, float), optional
        Hz.

    Raises
    ------
    DataError
        Records without inputs, or a band that holds no line.

    Notes
    -----
    On the lines of a whole run x X = A X + B U + x w with w = (x(0) - x(N)) / sqrt(N), exactly, whatever the run does before and after.
    """
    fs, m = records.sampling_rate, len(records.input_dofs)
    if not m:
        raise DataError("records on lines were asked", "they have no inputs", "Give the inputs, or use correlations.")
    parts = _chosen(records, band)
    count = [f.size for f, _ in parts]
    values, drive = np.empty((sum(count), len(records.output_dofs)), complex), np.zeros((sum(count), m), complex)
    first = 0
    for r, (run, (f, inside)) in enumerate(zip(records.runs, parts, strict=True)):
        assert run.inputs is not None
        place = scratch(len(run.outputs) // 2 + 1, complex)
        for own, samples in enumerate(run.outputs.T):
            values[first : first + f.size, own] = _lines(samples, place)[inside]
        for own, samples in zip(records.inputs_of(r), run.inputs.T, strict=True):
            drive[first : first + f.size, own] = _lines(samples, place)[inside]
        first += f.size
    frequencies = parts[0][0] if len(parts) == 1 else np.concatenate([f for f, _ in parts])
    # of long records an array of all lines is large
    kind = np.int16 if len(parts) < np.iinfo(np.int16).max else np.int32
    which: Any = np.repeat(np.arange(len(parts), dtype=kind), count)
    for array in (values, drive, frequencies, which):
        array.setflags(write=False)  # nobody else has it: it need not be copied again
    return RecordSpectra(
        values=values[:, :, None],
        frequencies=frequencies,
        drive=drive,
        run=which,
        durations=tuple(N / fs for N in records.samples),
        sampling_rate=fs,
        quantity=records.quantity,
        output_dofs=records.output_dofs,
        input_dofs=records.input_dofs,
        units=records.units,
        geometry=records.geometry,
        processing=records.processing,
        source_path=records.source_path,
        groups=records.groups,
    )


def _chosen(records: Records, band: tuple[float, float] | None) -> list[tuple[RealArray, Any]]:
    """Return the lines of every run in a band, Hz, and which of all they are."""
    fs, parts = records.sampling_rate, []
    for N in records.samples:
        f = np.arange(1.0, (N + 1) // 2)
        f *= fs
        f /= N
        inside = None if band is None else (f >= band[0]) & (f <= band[1])
        parts.append((f, slice(None)) if inside is None else (f[inside], inside))
    if not sum(f.size for f, _ in parts):
        asked = "all lines" if band is None else f"the band {band[0]:g} to {band[1]:g} Hz"
        raise DataError(
            f"{asked} of records were asked",
            f"runs of {', '.join(map(str, records.samples))} samples at {fs:g} Hz have no line there",
            "Choose a wider band, or measure longer.",
        )
    return parts


def _lines(samples: RealArray, place: ComplexArray) -> ComplexArray:
    """Return the transform of a channel without 0 Hz and half the rate, over the root of the number of samples, in a place for all."""
    N = len(samples)
    half_transform(samples, place)
    place /= np.sqrt(N)
    return place[1 : (N + 1) // 2]
