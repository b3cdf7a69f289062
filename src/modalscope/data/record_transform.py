"""Transform whole runs to frequency lines, long ones in the place of the result."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import fft

from modalscope.data.record_spectra import RecordSpectra
from modalscope.data.records import Records
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import scratch

#: Samples from which a record is split in two.
_MIN_SPLIT_SAMPLES = 1 << 19

#: Lines that are joined at a time.
_LINES_AT_A_TIME = 1 << 15


def half_transform(samples: Array, place: ComplexArray) -> None:
    """Write the transform of N real samples on the lines 0 ... N / 2 to a place, (N // 2 + 1,).

    With E and O the transforms of even and of odd samples and w = exp(-2 pi j / N), Y_k = E_k + w^k O_k and Y_(N/2 - k) = (E_k - w^k O_k)*
    for k up to N / 4: E is laid down from the front, O from the back, and each pair takes the place of the two that it is made of.

    `samples` (N,). `place` (N // 2 + 1,).

    Examples
    --------
    >>> x, place = np.random.default_rng(0).standard_normal(1 << 20), np.empty((1 << 19) + 1, complex)
    >>> half_transform(x, place)
    >>> bool(np.allclose(place, np.fft.rfft(x)))
    True
    """
    N = len(samples)
    if N < _MIN_SPLIT_SAMPLES or N % 4:
        place[:] = fft.rfft(samples)
        return
    quarter, back = N // 4, place[::-1]
    half_transform(samples[1::2], back[: quarter + 1])
    middle = back[quarter]
    half_transform(samples[::2], place[: quarter + 1])
    place[quarter] -= 1j * middle  # E and O meet here, where w^k = -j and both are real
    for start in range(0, quarter, _LINES_AT_A_TIME):
        k = slice(start, min(start + _LINES_AT_A_TIME, quarter))
        even = place[k].copy()
        odd = back[k] * np.exp(np.arange(k.start, k.stop) * (-2j * np.pi / N))
        place[k], back[k] = even + odd, (even - odd).conj()


def record_spectra(records: Records, band: tuple[float, float] | None = None) -> RecordSpectra:
    """Return the plain transforms of whole runs, cut to a band: no window, no padding, no detrend; 0 Hz and half the rate are left out.

    `records`: with inputs. `band`: hz.

    Raises `DataError`: records without inputs, or a band that holds no line.

    Notes
    -----
    On the lines of a whole run x X = A X + B U + x w with w = (x(0) - x(N)) / sqrt(N), exactly, whatever the run does before and after.
    """
    fs, m = records.sampling_rate, len(records.input_dofs)
    if not m:
        raise DataError("records on lines need inputs", "these have none", "Give the inputs, or use correlations.")
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
        raise DataError(f"{asked} of records:", "no line lies there", "Choose a wider band, or measure longer.")
    return parts


def _lines(samples: RealArray, place: ComplexArray) -> ComplexArray:
    """Return the transform of a channel without 0 Hz and half the rate, over the root of the number of samples, in a place for all."""
    N = len(samples)
    half_transform(samples, place)
    place /= np.sqrt(N)
    return place[1 : (N + 1) // 2]
