"""What the lines of an ambient record say of its modes: their shapes, and peaks that no mode explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modalscope.data.indicators import mac, with_indicators_of_shapes
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.results import StabilizationDiagram
from modalscope.data.stored import StoredSignals
from modalscope.selection.likelihood.line_shapes import line_shapes
from modalscope.signals.preprocess.ambient_records import SeenRecord
from modalscope.signals.preprocess.spectral_peaks import Levels, clear_peaks

#: Half width of a machine's line: in its spreads, plus this part of its frequency.
_HALF_WIDTH_SPREADS, _HALF_WIDTH = 3.0, 0.002

#: Minimum change of a shape, 1 - MAC, that is noted.
_MIN_CHANGE = 0.01

#: A peak is a mode's within this part of its frequency, two bins, or its half bandwidth.
_PEAK_OF_MODE = 0.02


def with_lines_of_record(
    seen: SeenRecord | None, modes: ModalModel, diagrams: Sequence[StabilizationDiagram], *, chosen: bool = True
) -> ModalModel:
    """Return modes of a record without inputs with the shapes of its lines and what peaks lack a mode; modes of other data as they are.

    A stored record is used where it fits into memory. `diagrams`: of all bands. `chosen`: whether the list is automatic: what was chosen
    by hand lacks nothing.
    """
    if seen is None:
        return modes
    machines = machines_in(seen)
    record = seen.record.settled() if isinstance(seen.record, StoredSignals) else seen.record
    found = _with_line_shapes(record, modes, machines) if isinstance(record, Signals) else modes
    bands = [diagram.response.reported_band(diagram.settings.band) for diagram in diagrams]
    return with_note_on_peaks(found, peaks_in(seen.levels, bands, machines)) if chosen else found


def machines_in(seen: SeenRecord) -> list[tuple[float, float]]:
    """Return the frequencies and half widths of the lines of machines, Hz."""
    return [(line.frequency, _HALF_WIDTH_SPREADS * line.spread + _HALF_WIDTH * line.frequency) for line in seen.lines]


def peaks_in(
    levels: Levels, bands: Sequence[tuple[float, float]], machines: Sequence[tuple[float, float]]
) -> list[float]:
    """Return the clear peaks (Hz) in bands that are no line of a machine."""
    return [
        f
        for f in clear_peaks(levels)
        if any(low <= f <= high for low, high in bands)
        and not any(abs(f - line) < half + _PEAK_OF_MODE * f for line, half in machines)
    ]


def without_mode(peaks: Sequence[float], modes: ModalModel) -> list[float]:
    """Return the peaks (Hz) at which there is no mode."""
    width = np.maximum(_PEAK_OF_MODE * modes.frequencies, modes.frequencies * modes.damping_ratios)
    return [f for f in peaks if not np.any(np.abs(modes.frequencies - f) <= width)]


def with_note_on_peaks(modes: ModalModel, peaks: Sequence[float]) -> ModalModel:
    """Return modes with a note on the clear peaks (Hz) that none of them explains, and why."""
    open_there = without_mode(peaks, modes)
    if not open_there:
        return modes
    why = []
    for f in open_there:
        near = [c.reason for c in modes.left_out if abs(c.frequency - f) <= _PEAK_OF_MODE * f]
        why.append(f"{f:.4g} Hz ({near[0] if near else 'no poles agree there'})")
    text = f"Clear peaks without a mode: {'; '.join(why)}. Narrower bands may show more"
    return modes.noted(Note("peaks without a mode", {"peaks": float(len(open_there))}, text))


def _with_line_shapes(record: Signals, modes: ModalModel, avoided: Sequence[tuple[float, float]]) -> ModalModel:
    """Return modes with the shapes of `likelihood.line_shapes`, to which participation is still to be fitted.

    `avoided`: frequencies and half widths of machines' lines (Hz).
    """
    if not len(modes) or len(record.output_dofs) < 2:
        return modes
    shapes, deviations = line_shapes(record, modes, avoided)
    refitted = with_indicators_of_shapes(replace(modes, shapes=shapes, shapes_std=deviations).normalized("unit"))
    real = np.all(shapes.imag == 0, axis=0)
    if real.any():
        which = ", ".join(f"{f:.5g} Hz" for f in modes.frequencies[real])
        text = f"Shapes assumed real, so that their MPC is 1 by assumption, because other modes overlap with {which}"
        refitted = refitted.noted(Note("real shapes", {"modes": float(real.sum())}, text))
    alike = np.diag(mac(refitted.shapes, modes.shapes))
    names = ", ".join(f"{f:.5g} Hz" for f in modes.frequencies[alike < 1 - _MIN_CHANGE])
    if not names:
        return refitted
    text = f"Shapes estimated on the lines of the record, where those of the correlations are others: {names}"
    return refitted.noted(Note("shapes of lines", {"modes": float(np.sum(alike < 1 - _MIN_CHANGE))}, text))
