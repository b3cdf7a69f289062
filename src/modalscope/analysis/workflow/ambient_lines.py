"""What the lines of an ambient record say of its modes: their shapes, and peaks that no mode explains."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from modalscope.analysis.workflow.setups import glued
from modalscope.data.geometry import indices_of
from modalscope.data.indicators import mac, with_indicators_of_shapes
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals, runs_apart
from modalscope.data.results import StabilizationDiagram
from modalscope.data.setups import Setups
from modalscope.data.shown import list_some
from modalscope.data.stored import StoredSignals
from modalscope.selection.likelihood.line_shapes import LineShapes, line_shapes
from modalscope.selection.likelihood.refine_setups import refine_setups
from modalscope.signals.preprocess.ambient_records import SeenRecord
from modalscope.signals.preprocess.harmonics import Line, find_lines
from modalscope.signals.preprocess.spectral_peaks import Levels, clear_peaks

#: Half width of a machine's line: in its spreads, plus this part of its frequency.
_HALF_WIDTH_SPREADS, _HALF_WIDTH = 3.0, 0.002

#: Minimum change of a shape, 1 - MAC, that is noted.
_MIN_CHANGE = 0.01

#: A peak is a mode's within this part of its frequency, two bins, or its half bandwidth.
_PEAK_OF_MODE = 0.02

#: What is said of a record that is read in pieces.
_TOO_LARGE = Note("not refined", {}, "Not refined: the record is too large to hold all of its lines in memory")


def with_lines_of_record(
    seen: SeenRecord,
    modes: ModalModel,
    diagrams: Sequence[StabilizationDiagram],
    *,
    chosen: bool = True,
    refine: bool = False,
) -> ModalModel:
    """Return modes of a record without inputs with the shapes of its lines, refined if asked, and what peaks lack a mode.

    A stored record is used where it fits into memory. `diagrams`: of all bands. `chosen`: whether the list is automatic: what was chosen
    by hand lacks nothing.
    """
    machines = machines_in(seen.lines)
    record = seen.record.settled() if isinstance(seen.record, StoredSignals) else seen.record
    found = modes
    if isinstance(record, Signals):
        if refine:
            found = refine_setups(Setups(parts=tuple(runs_apart(record)), groups=None), found)
        if len(modes) and len(record.output_dofs) > 1:
            found = _with_shapes(found, line_shapes(record, found, machines))
    elif refine:
        found = found.noted(_TOO_LARGE)
    bands = [diagram.response.reported_band(diagram.settings.band) for diagram in diagrams]
    return with_note_on_peaks(found, peaks_in(seen.levels, bands, machines)) if chosen else found


def machines_in(lines: Iterable[Line]) -> list[tuple[float, float]]:
    """Return the frequencies and half widths of the lines of machines, Hz."""
    return [(line.frequency, _HALF_WIDTH_SPREADS * line.spread + _HALF_WIDTH * line.frequency) for line in lines]


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


def with_lines_of_setups(setups: Setups, modes: ModalModel) -> ModalModel:
    """Return modes of setups with the shapes of the lines of each, put together by the outputs that they share (`glued`).

    A mode keeps its shape, and has no deviations, where a setup has too few lines of it.
    """
    if not len(modes):
        return modes
    outputs, band = modes.output_dofs, (0.0, 1.1 * float(modes.frequencies.max()))
    places = [indices_of("output", part.output_dofs, outputs) for part in setups.parts]
    each = [
        line_shapes(part, modes.select(outputs=list(part.output_dofs)), machines_in(find_lines(part, band)))
        for part in setups.parts
    ]
    shapes, deviations = np.array(modes.shapes), np.full(modes.shapes.shape, np.nan)
    level = np.concatenate([own.level for own in each])[np.unique(np.concatenate(places), return_index=True)[1]]
    for k in range(len(modes)):
        x, s = [own.shapes[:, k] for own in each], [own.with_size[:, k] for own in each]
        if np.isfinite(np.concatenate(s)).all():
            shapes[:, k], deviations[:, k] = glued(x, s, places, len(outputs))
    return _with_shapes(modes, LineShapes(shapes, deviations, level))


def _with_shapes(modes: ModalModel, found: LineShapes) -> ModalModel:
    """Return modes with shapes of lines, to which participation is still to be fitted, and notes on what they change."""
    changed = replace(modes, shapes=found.shapes, shapes_std=found.deviations)
    refitted = with_indicators_of_shapes(changed.normalized("unit"))
    real = np.all(found.shapes.imag == 0, axis=0)
    if real.any():
        which = "all modes" if real.all() else list_some(f"{f:.5g} Hz" for f in modes.frequencies[real])
        text = f"Shapes set to real (MPC 1), as imaginary parts are within their errors: {which}"
        refitted = refitted.noted(Note("real shapes", {"modes": float(real.sum())}, text))
    alike = np.diag(mac(refitted.shapes / found.level[:, None], modes.shapes / found.level[:, None]))
    names = list_some(f"{f:.5g} Hz" for f in modes.frequencies[alike < 1 - _MIN_CHANGE])
    if not names:
        return refitted
    text = f"Shapes estimated from the spectra, as they differ from those of the correlations: {names}"
    return refitted.noted(Note("shapes of lines", {"modes": float(np.sum(alike < 1 - _MIN_CHANGE))}, text))
