"""Draw what a model simulates against what was measured, and its frequency response with its uncertainty."""

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
from modalscope.interfaces.plot.picture import Axis, Line, Panel, Picture, axis_of, plain
from modalscope.interfaces.plot.responses import both
from modalscope.interfaces.reporting.html import Section, figure, folded, listing, paragraph, table

#: Outputs that are drawn: of least, middle and greatest variance explained.
_DRAWN = 3

#: Pixels of the picture of outputs, and samples around the largest one that are drawn by themselves.
_SIZE, _NEAR = (690, 560), 300

#: Lines of a frequency response, and the radius of a disc that holds 95 % of a round Gaussian, in standard deviations.
_LINES, _DISC = 800, float(np.sqrt(-np.log(0.05)))


def model_sections(model: StateSpace, record: Signals | Records, command: str | None = None) -> Iterator[Section]:
    """Yield the sections on a model of records: what it is, measured against simulated outputs, its response, and what was tried."""
    records = as_records(record) if isinstance(record, Signals) else record
    found = validate(model, records)
    rate = "continuous" if model.dt is None else f"{1 / model.dt:g} Hz"
    counts = ((model.order, "state"), (model.B.shape[1], "input"), (len(model.C), "output"))
    sizes = ", ".join(counted(number, word) for number, word in counts)
    held = getattr(model, "validation", None)
    rows = {"model": sizes, "sampling rate": rate, "on this record": summary_of(found)}
    rows |= {} if held is None else {"on what was held out": summary_of(held)}
    rows |= {"command": command} if command else {}
    notes = "".join(paragraph(str(note)) for note in getattr(model, "notes", ()))
    yield Section("model", "Model", listing(rows.items()) + notes)
    shares = [(name, *cells) for name, cells in zip(records.output_dofs, cells_of(found), strict=True)]
    listed = table(("output", "free run %", "one step %"), shares, words=(0,))
    drawn = figure(simulation_picture(model, records), "", *_SIZE)
    yield Section("simulation", "Measured and simulated", drawn + listed)
    yield Section("response", "Frequency response", figure(response_picture(model), "", 690, 300))
    if held is not None:
        head, *tried = held.rows()
        body = folded(counted(len(tried), "model"), table(head, tried, words=(0, 4)))
        yield Section("tried", "What was tried", body)


def response_picture(model: StateSpace) -> Picture:
    """Return the largest frequency response of a model, and the discs that hold it with 95 % where the model has `directions`."""
    top = 0.5 / model.dt if model.dt else 1.5 * float(np.abs(model.poles).max(initial=1.0)) / (2 * np.pi)
    f = np.unique(np.concatenate([np.linspace(top / _LINES, top, _LINES), _peaks(model, top)]))
    H = model.frequency_response(f).values
    k, j = np.unravel_index(np.argmax(np.linalg.norm(H, axis=0)), H.shape[1:])
    size = np.abs(H[:, k, j])
    curves = [Line(f, size, "ink", "frequency response")]
    if isinstance(model, RealizedModel) and model.directions is not None:
        radius = _DISC * model.frequency_response_std(f)[:, k, j]
        words = "95 % of it, by the noise of the record"
        sides = size + radius, np.maximum(size - radius, size.min() / 10)
        curves += [Line(f, side, "vermillion", words, 1.3, dashed=True) for side in sides]
    names = [names[at] if names else str(at + 1) for names, at in ((model.output_dofs, k), (model.input_dofs, j))]
    label = f"magnitude of {' / '.join(plain(name, 14) for name in names)}"
    upward = axis_of(label, [curve.y for curve in curves[:2]], log=True)
    panel = Panel(Axis("frequency [Hz]", 0, top), upward, curves)
    return Picture([panel], "The largest frequency response of the model")


def _peaks(model: StateSpace, top: float) -> np.ndarray:
    """Return lines within three half bandwidths of the poles, where a resonance is narrower than those of all."""
    s = model.continuous_poles
    f = np.abs(s.imag)[:, None] / (2 * np.pi) + np.linspace(-3, 3, 25) * np.abs(s.real)[:, None] / (2 * np.pi)
    return f[(f > top / _LINES) & (f < top)]


def simulation_picture(model: StateSpace, record: Signals | Records) -> Picture:
    """Return the outputs of records that a model explains least, middling and best, measured and simulated.

    Runs follow one another; each without its mean, from the first state that fits best. Below, near its largest sample, the output that
    is explained least.
    """
    records = as_records(record) if isinstance(record, Signals) else record
    y, free, _ = rebuilt(replace(sampled(model, records), gain=None, innovation_covariance=None), records)
    share = explained(y, free)
    ranked = np.argsort(share, kind="stable")
    chosen = dict.fromkeys(int(ranked[k]) for k in np.linspace(0, len(ranked) - 1, _DRAWN).round().astype(int))
    time = np.arange(len(y)) / records.sampling_rate
    rows = [(k, slice(None)) for k in chosen]
    worst = int(ranked[0])
    middle = min(max(int(np.abs(y[:, worst]).argmax()), _NEAR // 2), len(y) - _NEAR // 2)
    if len(y) > 2 * _NEAR:
        rows.append((worst, slice(middle - _NEAR // 2, middle + _NEAR // 2)))
    panels = []
    for row, (k, part) in enumerate(rows):
        label = "time [s]" if row in (len(chosen) - 1, len(rows) - 1) else ""
        t, measured, simulated = time[part], y[part, k], free[part, k]
        curves = both([(t, measured), (t, simulated)], ("measured", "simulated from the inputs"))
        name = f"{plain(str(records.output_dofs[k]), 14)}, {share[k]:.1f} %"
        panels.append(Panel(Axis(label, float(t[0]), float(t[-1])), axis_of(name, [measured, simulated]), curves))
    return Picture(panels, f"Measured and simulated outputs; {np.mean(share):.1f} % of the variance explained", _SIZE)
