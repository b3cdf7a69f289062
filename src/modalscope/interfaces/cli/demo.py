"""The command `demo`: a measured beam, and its modes beside the published ones."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from modalscope.interfaces.cli.parser import Parser, add_page
from modalscope.interfaces.cli.process import progress, remark, say

if TYPE_CHECKING:
    from modalscope.data import ModalModel

#: The data set, and the band in which its modes were published.
_SET, _BAND = "beam_hammer", (100.0, 4500.0)


def add_demo(parser: Parser) -> None:
    """Add the arguments of `demo`."""
    add_page(parser, "demo-report.html", "report to write: .html, .docx or .pptx")


def demo(options: argparse.Namespace) -> None:
    """Identify a measured beam, compare with the published modes, and write a report.

    The data come with the program: seven accelerometers and six hammer points, measured by the authors of sdypy-EMA (MIT). Only the
    band is set.
    """
    from modalscope.analysis.workflow.analyze import analyze
    from modalscope.datasets import load, reference
    from modalscope.interfaces.cli.output import check_output
    from modalscope.interfaces.reporting import report

    check_output(options.output, (), options.force)
    data, published = load(_SET), reference(_SET)
    outputs, inputs = len(data.output_dofs), len(data.input_dofs)
    sizes = f"{outputs} accelerometers, {inputs} hammer points, {data.lines} lines"
    remark(f"{_SET}: {sizes}; band {_BAND[0]:g} to {_BAND[1]:g} Hz", "")
    with progress("identifying") as show:
        result = analyze(data, band=_BAND, progress=show)
    say(_table(result.modes, published), "", _inside(result.modes, published))
    with progress(f"writing {options.output.name}"):
        report(result, options.output, title="Modes of a measured beam")
    say(f"Pictures, reasons and settings: {options.output.resolve()}. Your own file: modalscope app test.uff")


def _beside(modes: ModalModel, published: ModalModel) -> dict[int, int]:
    """Return which published mode stands nearest to a mode, by the number of the mode."""
    return {int(abs(modes.frequencies - f).argmin()): k for k, f in enumerate(published.frequencies)}


def _table(modes: ModalModel, published: ModalModel) -> str:
    """Return the modes with their 95 % intervals and grades, and the published values beside them."""
    from modalscope.data.shown import text_table
    from modalscope.selection.judging.description import table_of

    head, *rows = table_of(modes)
    width, nearest = head.index("grade") + 1, _beside(modes, published)
    lines = [[*head[:width], "published: f [Hz]", "damping [%]"]]
    for k, row in enumerate(rows):
        mode = published[nearest[k]] if k in nearest else None
        texts = ("-", "-") if mode is None else (f"{mode.frequency:.1f}", f"{100 * mode.damping_ratio:.2f}")
        lines.append([*row[:width], *texts])
    return text_table(lines, left=[width - 1])


def _inside(modes: ModalModel, published: ModalModel) -> str:
    """Return how many published values, which are rounded to .1 Hz and .01 %, their modes' intervals reach."""
    ends, pairs = modes.interval(0.95), _beside(modes, published)
    counts = []
    known = {"frequency": (published.frequencies, 0.05), "damping_ratio": (published.damping_ratios, 0.5e-4)}
    for name, (values, rounding) in known.items():
        low, high = ends[name].T
        counts.append(sum(bool(low[i] - rounding <= values[k] <= high[i] + rounding) for i, k in pairs.items()))
    n = len(published)
    return f"Within the 95 % intervals: {counts[0]} of {n} published frequencies, {counts[1]} of {n} damping ratios."
