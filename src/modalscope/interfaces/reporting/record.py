"""Write the sections on data, settings and notes, and the scripts that repeat an analysis."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.analysis.comparing import Comparison
from modalscope.data import FrequencyResponse, ImpulseResponse, StabilizationDiagram
from modalscope.data.analysis import VERSION
from modalscope.data.notes import Note, notes_of
from modalscope.data.response import Response, root_mean_squares
from modalscope.data.results import Result, Settings
from modalscope.data.shown import list_some
from modalscope.identification.identify import Identification
from modalscope.identification.method_names import cell_label
from modalscope.interfaces.plot.web.verdict import grouped, notes_that_matter
from modalscope.interfaces.reporting.html import Section, folded, heading, listing, paragraph, script, table, value
from modalscope.io.arrays import plain
from modalscope.numerics.errors import as_read
from modalscope.signals.doctor import Finding, examine

#: Maximum number of listed channels.
_MAX_CHANNEL_ROWS = 60

#: How a script begins.
_IMPORT = "import modalscope as ms\n\n"

#: Coherence below which a line is counted.
_LOW_COHERENCE = 0.8


def stabilization_script(diagram: StabilizationDiagram, source: str | None) -> str:
    """Return the script that repeats a stabilization diagram and the selection from it."""
    orders = diagram.asked_orders or diagram.orders
    steps = {b - a for a, b in pairwise(orders)}
    even = len(steps) == 1
    listed = f"range({orders[0]}, {orders[-1] + 1}, {int(steps.pop())})" if even else repr(list(map(int, orders)))
    cell = {"method": diagram.method, "domain": diagram.domain}
    lines = [*_options(cell), f"    orders={listed},\n", *_options(diagram.settings)]
    if diagram.tolerances:
        lines += _options({"tolerances": {name: float(limit) for name, limit in diagram.tolerances.items()}})
    after = 'modes = ms.select(diagram)\nprint(modes.table())\nms.report((modes, diagram), "report.html")\n'
    return _call("diagram", "stabilize", source, lines) + after


def result_script(result: Result) -> str:
    """Return the script that repeats a whole analysis."""
    document = result.analysis
    paths = [file.path for file in document.files if file.path]
    reading = {"reading": document.reading} if document.reading else {}
    lines = _options(reading | document.choices())
    source = repr(paths if len(paths) > 1 else paths[0]) + "," if paths else "data,  # arrays, not from a file"
    call = f"result = ms.analyze(\n    {source}\n{''.join(lines)})\n"
    return f'{_IMPORT}{call}print(result.modes.table())\nms.report(result, "report.html")\n'


def identification_script(identified: Identification, source: str | None) -> str:
    """Return the script that repeats an identification at one order."""
    cell = {"method": identified.method, "domain": identified.domain, "order": int(identified.order)}
    lines = [*_options(cell), *_options(identified.settings)]
    after = 'print(found.modes.table())\nms.report(found, "report.html")\n'
    return _call("found", "identify", source, lines) + after


def comparison_script(c: Comparison, source: str | None) -> str:
    """Return the script that repeats a comparison."""
    lines = _options({name: value for name, value in c.settings.items() if value is not None})
    after = 'print(comparison.table())\nms.report(comparison, "report.html")\n'
    return _call("comparison", "compare", source, lines) + after


def _call(name: str, verb: str, source: str | None, lines: list[str]) -> str:
    data = f"data = ms.read({source or 'your file'!r})\n"
    return f"{_IMPORT}{data}{name} = ms.{verb}(\n    data,\n{''.join(lines)})\n"


def _options(settings: Settings | Mapping[str, Any]) -> list[str]:
    """Return options as arguments with all digits: the script gives the same result to the last bit."""
    return [f"    {name}={plain(value)!r},\n" for name, value in settings.items()]


def data_section(
    response: Response, source: str | None, findings: Sequence[Finding] | None = None, record: object = None
) -> Section:
    """Describe the data: channels, lines or samples, quantity and processing, findings, level and coherence of every output.

    `source`: the file. `findings`: of the data before their conversion to the response; by default the response is examined. `record`: the
    measurement; length, rate and processing of records are listed with those of the response.
    """
    facts = {"source": source or "not stated", **_recorded(record), **_extent(response)}
    facts["quantity"] = response.quantity or "not stated"
    facts["outputs"] = f"{len(response.output_dofs)}: {list_some(response.output_dofs, 12)}"
    facts[f"{response.column_word}s"] = f"{len(response.input_dofs)}: {list_some(response.input_dofs, 12)}"
    facts["geometry"] = "none" if response.geometry is None else f"{len(response.geometry.nodes)} nodes"
    facts["processing"] = "; ".join(response.processing) or "none"
    quality = _quality(examine(response) if findings is None else findings)
    return Section("data", "Data and their quality", listing(facts.items()) + quality + _channels(response))


def _recorded(record: Any) -> dict[str, str]:
    """Return length, rate and processing of records; nothing of responses."""
    recordings = getattr(record, "recordings", ())
    if not recordings:
        return {}
    runs, lengths = sum(run.runs for run in recordings), sorted({run.samples for run in recordings})
    rate = record.sampling_rate
    several = "" if runs == 1 else f"{runs} runs of "
    ends = tuple(dict.fromkeys((lengths[0], lengths[-1])))
    times = " to ".join(f"{s:.4g} s" if s < 600 else f"{s / 60:.4g} min" for s in (n / rate for n in ends))
    return {
        "record": f"{several}{' to '.join(map(str, ends))} samples at {rate:.6g} Hz: {times}",
        "processing of the record": "; ".join(record.processing) or "none",
    }


def _quality(findings: Sequence[Finding]) -> str:
    """List the findings about the data with their remedies."""
    if not findings:
        return paragraph("No data problem found.")
    rows = [[f.kind, list_some(f.channels, 12), as_read(f.reason), as_read(f.change)] for f in grouped(findings)]
    return table(["finding", "channels", "reason", "remedy"], rows, words=[0, 1, 2, 3])


def _extent(response: Response) -> dict[str, str]:
    if isinstance(response, ImpulseResponse):
        kind, axis = ("correlations", "lags") if response.ambient else (f"{response.kind} response", "samples")
        rate = response.sampling_rate
        return {"kind": kind, axis: f"{response.samples} at {rate:.6g} Hz, {response.samples / rate:.4g} s"}
    assert response.grid is not None
    f = response.grid
    steps = np.diff(f)
    even = steps.size and np.allclose(steps, steps[0], rtol=1e-6)
    step = f", every {steps[0]:.4g} Hz" if even else ", unevenly spaced" if steps.size else ""
    kind = "frequency responses" if isinstance(response, FrequencyResponse) else "records on their own lines"
    facts = {"kind": kind, "lines": f"{f.size} from {f[0]:.6g} to {f[-1]:.6g} Hz{step}"}
    if response.averages is not None:
        facts["averages"] = str(response.averages)
    if response.added_damping:
        facts["exponential window"] = f"added {response.added_damping:.4g} 1/s to every pole; corrected"
    return facts


def _channels(response: Response) -> str:
    """List the outputs: root mean square over lines and inputs, relative level, coherence."""
    rms = root_mean_squares(response)
    level = np.full(rms.size, -np.inf)
    np.log10(rms / (rms.max() or 1.0), out=level, where=rms > 0)
    columns = {
        "output": list(response.output_dofs),
        "unit": [unit or "–" for unit in response.units[0]],
        "rms": [f"{v:.4g}" for v in rms],
        "level [dB]": [f"{20 * v:.1f}" if np.isfinite(v) else "zero" for v in level],
    }
    coherence = response.coherence
    if coherence is not None:
        values = coherence.reshape(*coherence.shape[:2], -1)
        columns["mean coherence"] = [f"{v:.3f}" for v in values.mean(axis=(0, 2))]
        low = (values < _LOW_COHERENCE).mean(axis=(0, 2))
        columns[f"lines below {_LOW_COHERENCE}"] = [f"{100 * v:.1f} %" for v in low]
    order, caption = np.arange(rms.size), "Outputs: mean over all inputs and all lines or samples"
    if rms.size > _MAX_CHANNEL_ROWS:
        order = np.argsort(rms, kind="stable")[:_MAX_CHANNEL_ROWS]
        caption += f"; the weakest {order.size} of {rms.size}"
    rows = [[column[i] for column in columns.values()] for i in order]
    return table(list(columns), rows, words=[0, 1], caption=caption)


def settings_section(found: StabilizationDiagram | Identification, orders: Mapping[str, str]) -> Section:
    """List the method, its orders and its options."""
    facts = {"method": cell_label(found.method, found.domain), "domain": found.domain, **orders}
    facts |= {heading(key): value(key, content) for key, content in found.settings.items()}
    tolerances = getattr(found, "tolerances", {})
    facts |= {f"tolerance, {name}": value(name, limit) for name, limit in tolerances.items()}
    return Section("settings", "Settings", listing(facts.items()))


def orders_listed(orders: tuple[int, ...]) -> str:
    """Return orders in words."""
    if not orders:
        return "none"
    steps = set(np.diff(orders).tolist())
    if len(steps) == 1 and len(orders) > 2:
        return f"{orders[0]} to {orders[-1]}, step {steps.pop()}"
    return ", ".join(map(str, orders))


def notes_section(notes: Iterable[Note | str], kinds: Sequence[str] = ()) -> Section:
    """List the notes, and the number of poles that a diagram cannot show.

    `kinds`: of all poles.
    """
    hidden = [f"{kinds.count(kind)} {kind}" for kind in ("real", "nyquist", "zero") if kind in kinds]
    texts, computing = notes_that_matter(notes_of(notes))
    if hidden:
        computing.append(f"Poles without a frequency, not drawn: {', '.join(hidden)}.")
    body = "".join(map(paragraph, texts)) or paragraph("No notes on the result.")
    if computing:
        body += folded("How it was computed", "".join(map(paragraph, computing)))
    return Section("notes", "Notes", body)


def repeat_section(script_text: str, command: str | None) -> Section:
    """List the command and the script that repeat the result, and the versions of the programs."""
    body = paragraph("Command line:") + script(command) if command else ""
    versions = f"modalscope {VERSION}, numpy {version('numpy')}, scipy {version('scipy')}"
    body += paragraph("Python:") + script(script_text)
    body += paragraph(f"Python {platform.python_version()}, {versions}", "muted")
    return Section("repeat", "Repeat the analysis", body)
