"""Draw what a model simulates against what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modalscope.data.records import Records, Signals, as_records
from modalscope.data.statespace import StateSpace
from modalscope.plot.web.svg import Panel, Scale, chart, key, scale_of, shortened
from modalscope.reporting.figures import alone
from modalscope.workflow.simulation import explained, rebuilt, sampled

#: Outputs that are drawn: of least, middle and greatest variance explained.
_DRAWN = 3

#: Height of the axes of one output, and of what is between two, pixels.
_HEIGHT, _GAP = 110, 12


def simulation_svg(model: StateSpace, record: Signals | Records) -> str:
    """Return an SVG file of the outputs of a record that a model explains least, middling and best, measured and simulated.

    Runs follow one another; each without its mean, from the first state that fits best.
    """
    records = as_records(record) if isinstance(record, Signals) else record
    y, free, _ = rebuilt(replace(sampled(model, records), gain=None, innovation_covariance=None), records)
    share = explained(y, free)
    ranked = np.argsort(share, kind="stable")
    chosen = dict.fromkeys(int(ranked[k]) for k in np.linspace(0, len(ranked) - 1, _DRAWN).round().astype(int))
    time = np.arange(len(y)) / records.sampling_rate
    parts: list[str] = []
    x = Scale(float(time[0]), float(time[-1]))
    for row, k in enumerate(chosen):
        panel = Panel(58, 28 + row * (_HEIGHT + _GAP), 620, _HEIGHT, x, scale_of([y[:, k], free[:, k]]), parts)
        label = f"{shortened(str(records.output_dofs[k]))}, {share[k]:.1f} %"
        panel.axes("time [s]" if row == len(chosen) - 1 else "", label)
        panel.curve(time, y[:, k], "line measured")
        panel.curve(time, free[:, k], "line mode dashed")
    key(
        parts,
        [("line", "line measured", "measured"), ("line", "line mode dashed", "simulated from the inputs")],
        58,
        14,
    )
    height = 28 + len(chosen) * (_HEIGHT + _GAP) + 36
    return alone(
        chart(690, height, parts, f"Measured and simulated outputs; {np.mean(share):.1f} % of the variance explained")
    )
