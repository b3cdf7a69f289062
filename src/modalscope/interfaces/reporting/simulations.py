"""Draw what a model simulates against what was measured, and its frequency response with what the record leaves uncertain of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from modalscope.analysis.checking.validation import validate
from modalscope.analysis.workflow.realize import RealizedModel
from modalscope.analysis.workflow.simulation import explained, rebuilt, sampled
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.shown import cells_of, counted, summary_of
from modalscope.data.statespace import StateSpace
from modalscope.interfaces.plot.web.svg import Panel, Scale, chart, key, scale_of, shortened
from modalscope.interfaces.reporting.figures import alone
from modalscope.interfaces.reporting.html import Section, figure, folded, listing, paragraph, table

#: Outputs that are drawn: of least, middle and greatest variance explained.
_DRAWN = 3

#: Height of the axes of one output, and of what is between two, pixels; samples around the largest one that are drawn by themselves.
_HEIGHT, _GAP, _NEAR = 110, 12, 300

#: Lines of a frequency response, and the radius of a disc that holds 95 % of a round Gaussian, in standard deviations.
_LINES, _DISC = 800, float(np.sqrt(-np.log(0.05)))


def model_sections(model: StateSpace, record: Signals | Records, command: str | None = None) -> Iterator[Section]:
    """Yield the sections on a model of records: what it is, measured against simulated outputs, its response, and what was tried."""
    records = as_records(record) if isinstance(record, Signals) else record
    found = validate(model, records)
    rate = "continuous" if model.dt is None else f"{1 / model.dt:g} Hz"
    sizes = ", ".join(
        counted(n, word) for n, word in ((model.order, "state"), (model.B.shape[1], "input"), (len(model.C), "output"))
    )
    held = getattr(model, "validation", None)
    rows = {"model": sizes, "sampling rate": rate, "on this record": summary_of(found)}
    rows |= {} if held is None else {"on what was held out": summary_of(held)}
    rows |= {"command": command} if command else {}
    notes = "".join(paragraph(str(note)) for note in getattr(model, "notes", ()))
    yield Section("model", "Model", listing(rows.items()) + notes)
    body = figure(simulation_figure(model, records)) + table(
        ("output", "free run %", "one step %"),
        [(name, *cells) for name, cells in zip(records.output_dofs, cells_of(found), strict=True)],
        words=(0,),
    )
    yield Section("simulation", "Measured and simulated", body)
    yield Section("response", "Frequency response", figure(response_figure(model)))
    if held is not None:
        head, *tried = held.rows()
        body = folded(counted(len(tried), "model"), table(head, tried, words=(0, 4)))
        yield Section("tried", "What was tried", body)


def response_figure(model: StateSpace) -> str:
    """Draw the largest frequency response of a model, and the discs that hold it with 95 % where the model has `directions`."""
    top = 0.5 / model.dt if model.dt else 1.5 * float(np.abs(model.poles).max(initial=1.0)) / (2 * np.pi)
    f = np.unique(np.concatenate([np.linspace(top / _LINES, top, _LINES), _peaks(model, top)]))
    H = model.frequency_response(f).values
    k, j = np.unravel_index(np.argmax(np.linalg.norm(H, axis=0)), H.shape[1:])
    size = np.abs(H[:, k, j])
    curves, entries = [size], [("line", "line measured", "frequency response")]
    if isinstance(model, RealizedModel) and model.directions is not None:
        radius = _DISC * model.frequency_response_std(f)[:, k, j]
        curves += [size + radius, np.maximum(size - radius, size.min() / 10)]
        entries.append(("line", "line mode dashed", "95 % of it, by the noise of the record"))
    parts: list[str] = []
    decibels = [20 * np.log10(np.maximum(curve, np.finfo(float).tiny)) for curve in curves]
    panel = Panel(58, 28, 620, 220, Scale(0, top), scale_of(decibels[:2]), parts)
    names = [names[at] if names else str(at + 1) for names, at in ((model.output_dofs, k), (model.input_dofs, j))]
    panel.axes("frequency [Hz]", f"{' / '.join(map(shortened, names))} [dB]")
    for curve, kind in zip(decibels, ("line measured", *2 * ("line mode dashed",)), strict=False):
        panel.curve(f, curve, kind)
    key(parts, entries, 58, 14)
    return chart(690, 300, parts, "The largest frequency response of the model")


def _peaks(model: StateSpace, top: float) -> np.ndarray:
    """Return lines within three half bandwidths of the poles, where a resonance is narrower than those of all."""
    s = model.continuous_poles
    f = np.abs(s.imag)[:, None] / (2 * np.pi) + np.linspace(-3, 3, 25) * np.abs(s.real)[:, None] / (2 * np.pi)
    return f[(f > top / _LINES) & (f < top)]


def simulation_svg(model: StateSpace, record: Signals | Records) -> str:
    """Return an SVG file of `simulation_figure`."""
    return alone(simulation_figure(model, as_records(record) if isinstance(record, Signals) else record))


def simulation_figure(model: StateSpace, records: Records) -> str:
    """Draw the outputs of records that a model explains least, middling and best, measured and simulated.

    Runs follow one another; each without its mean, from the first state that fits best. Below, near its largest sample, the output that
    is explained least.
    """
    y, free, _ = rebuilt(replace(sampled(model, records), gain=None, innovation_covariance=None), records)
    share = explained(y, free)
    ranked = np.argsort(share, kind="stable")
    chosen = dict.fromkeys(int(ranked[k]) for k in np.linspace(0, len(ranked) - 1, _DRAWN).round().astype(int))
    time = np.arange(len(y)) / records.sampling_rate
    parts: list[str] = []
    names = [f"{shortened(str(records.output_dofs[k]))}, {share[k]:.1f} %" for k in chosen]
    rows = [(name, k, slice(None)) for name, k in zip(names, chosen, strict=True)]
    worst = int(ranked[0])
    middle = min(max(int(np.abs(y[:, worst]).argmax()), _NEAR // 2), len(y) - _NEAR // 2)
    if len(y) > 2 * _NEAR:
        rows.append((names[0], worst, slice(middle - _NEAR // 2, middle + _NEAR // 2)))
    for row, (name, k, part) in enumerate(rows):
        near, top = part.start is not None, 28 + row * (_HEIGHT + _GAP) + (2.5 * _GAP if part.start else 0)
        t, measured, simulated = time[part], y[part, k], free[part, k]
        panel = Panel(58, top, 620, _HEIGHT, Scale(float(t[0]), float(t[-1])), scale_of([measured, simulated]), parts)
        panel.axes("time [s]" if near or row == len(chosen) - 1 else "", name)
        panel.curve(t, measured, "line measured")
        panel.curve(t, simulated, "line mode dashed")
    key(
        parts,
        [("line", "line measured", "measured"), ("line", "line mode dashed", "simulated from the inputs")],
        58,
        14,
    )
    height = 28 + len(rows) * (_HEIGHT + _GAP) + 36 + (2.5 * _GAP if len(rows) > len(chosen) else 0)
    words = f"Measured and simulated outputs; {np.mean(share):.1f} % of the variance explained"
    return chart(690, height, parts, words)
