"""From records to their lines: the plain transform of whole runs, and nothing else."""

from __future__ import annotations

import numpy as np
from scipy import fft

from modalscope.model.checks import ComplexArray, DataError, RealArray
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
    parts = []
    for r, run in enumerate(records.runs):
        N = run.samples
        assert run.inputs is not None
        f = np.arange(1, (N + 1) // 2) * fs / N
        inside = slice(None) if band is None else (f >= band[0]) & (f <= band[1])
        U = np.zeros((f.size, m), dtype=complex)
        U[:, list(records.inputs_of(r))] = _lines(run.inputs)
        parts.append((f[inside], _lines(run.outputs)[inside], U[inside]))
    count = [f.size for f, _, _ in parts]
    if not sum(count):
        asked = "all lines" if band is None else f"the band {band[0]:g} to {band[1]:g} Hz"
        raise DataError(
            f"{asked} of records were asked",
            f"runs of {', '.join(map(str, records.samples))} samples at {fs:g} Hz have no line there",
            "Choose a wider band, or measure longer.",
        )
    return RecordSpectra(
        values=np.concatenate([Y for _, Y, _ in parts])[:, :, None],
        frequencies=np.concatenate([f for f, _, _ in parts]),
        drive=np.concatenate([U for _, _, U in parts]),
        run=np.repeat(np.arange(len(parts)), count),
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


def _lines(samples: RealArray) -> ComplexArray:
    """Return the transform without 0 Hz and half the rate, over the root of the number of samples."""
    N = len(samples)
    return np.asarray(fft.rfft(samples, axis=0)[1 : (N + 1) // 2] / np.sqrt(N))
