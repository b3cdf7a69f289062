"""Write the sections on data, settings, notes, and the script that repeats the analysis."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.comparing import Comparison
from modalscope.data import FrequencyResponse, ImpulseResponse, StabilizationDiagram
from modalscope.data.analysis import VERSION
from modalscope.data.response import Response, root_mean_squares
from modalscope.data.results import Result, Settings
from modalscope.doctor import Finding, examine
from modalscope.identification.identify import Identification
from modalscope.identification.method_names import cell_label
from modalscope.numerics.checks import Array
from modalscope.reporting.html import Section, heading, list_some, listing, paragraph, script, table, value

# ------------------------------------------------------------------------------------------------------------- scripts
# The scripts that repeat what a report shows.


def stabilization_script(diagram: StabilizationDiagram, source: str | None) -> str:
    """Return the script that repeats a stabilization diagram and the selection from it."""
    lines = [
        f"    method={diagram.method!r},\n",
        f"    domain={diagram.domain!r},\n",
        f"    orders={_script_orders(diagram.asked_orders or diagram.orders)},\n",
        *_options(diagram.settings),
    ]
    if diagram.tolerances:
        lines.append(f"    tolerances={ {name: float(limit) for name, limit in diagram.tolerances.items()}!r},\n")
    after = 'modes = ms.select(diagram)\nprint(modes.table())\nms.report((modes, diagram), "report.html")\n'
    return _call("diagram", "stabilize", source, lines) + after


def result_script(result: Result) -> str:
    """Return the script that repeats a whole analysis."""
    document = result.analysis
    paths = [file.path for file in document.files if file.path]
    reading = {"reading": document.reading} if document.reading else {}
    lines = _options(reading | document.choices())
    arrays = "import numpy as np\n\n" if any("np." in line for line in lines) else ""
    source = repr(paths if len(paths) > 1 else paths[0]) + "," if paths else "data,  # which came from no file"
    head = f"{arrays}import modalscope as ms\n\nresult = ms.analyze(\n    {source}\n"
    return f"{head}{''.join(lines)})\n" + 'print(result.modes.table())\nms.report(result, "report.html")\n'


def identification_script(found: Identification, source: str | None) -> str:
    """Return the script that repeats an identification at one order."""
    lines = [
        f"    method={found.method!r},\n",
        f"    domain={found.domain!r},\n",
        f"    order={int(found.order)},\n",
        *_options(found.settings),
    ]
    after = 'print(found.modes.table())\nms.report(found, "report.html")\n'
    return _call("found", "identify", source, lines) + after


def comparison_script(c: Comparison, source: str | None) -> str:
    """Return the script that repeats a comparison."""
    lines = _options({name: value for name, value in c.settings.items() if value is not None})
    after = 'print(comparison.table())\nms.report(comparison, "report.html")\n'
    return _call("comparison", "compare", source, lines) + after


def _call(name: str, verb: str, source: str | None, lines: list[str]) -> str:
    arrays = "import numpy as np\n\n" if any("np." in line for line in lines) else ""
    head = f"{arrays}import modalscope as ms\n\ndata = ms.read({source or 'your file'!r})\n"
    return f"{head}{name} = ms.{verb}(\n    data,\n{''.join(lines)})\n"


def _options(settings: Settings | Mapping[str, Any]) -> list[str]:
    """Return options as arguments, each as Python writes it: the script gives the same result to the last bit."""
    return [f"    {name}={_literal(value)},\n" for name, value in settings.items()]


def _literal(value: Any) -> str:
    """Return what Python reads back as the same value; numbers keep all their digits."""
    if isinstance(value, np.ndarray):
        return f"np.array({value.tolist()!r})"
    if isinstance(value, np.generic):
        return repr(value.item())
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_literal(item)}" for key, item in value.items()) + "}"
    if isinstance(value, tuple | list):
        parts = ", ".join(_literal(part) for part in value)
        return f"[{parts}]" if isinstance(value, list) else f"({parts}{',' if len(value) == 1 else ''})"
    return repr(value)


def _script_orders(orders: tuple[int, ...]) -> str:
    steps = {b - a for a, b in pairwise(orders)}
    if len(steps) == 1:
        return f"range({orders[0]}, {orders[-1] + 1}, {int(steps.pop())})"
    return repr(tuple(int(order) for order in orders))


# -------------------------------------------------------------------------------------------------------------- record

#: Channels that are listed one by one.
_ROWS = 60


def data_section(
    response: Response, source: str | None, findings: Sequence[Finding] | None = None, record: object = None
) -> Section:
    """What was measured: channels, lines or samples, quantity, processing; level and coherence of every output; what is wrong with it.

    `source`: where the data came from. `findings`: of the data before they were turned into the response; by default the response itself
    is examined. `record`: what was measured; of records their own length, rate and processing are told beside those of the response.
    """
    facts = {"source": source or "not stated", **_recorded(record), **_extent(response)}
    facts["quantity"] = response.quantity or "not stated"
    facts["outputs"] = f"{len(response.output_dofs)}: {list_some(response.output_dofs)}"
    facts[f"{response.column_word}s"] = f"{len(response.input_dofs)}: {list_some(response.input_dofs)}"
    facts["geometry"] = "none" if response.geometry is None else f"{len(response.geometry.nodes)} nodes"
    facts["processing"] = "; ".join(response.processing) or "none"
    found = examine(response) if findings is None else findings
    return Section("data", "Data and their quality", listing(facts.items()) + _quality(found) + _channels(response))


def _recorded(record: Any) -> dict[str, str]:
    """Return length, rate and processing of what was measured; nothing of responses, which speak for themselves."""
    recordings = getattr(record, "recordings", ())
    if not recordings:
        return {}
    runs, lengths = sum(run.runs for run in recordings), sorted({run.samples for run in recordings})
    rate = record.sampling_rate
    several = "" if runs == 1 else f"{runs} runs of "
    ends = tuple(dict.fromkeys((lengths[0], lengths[-1])))
    samples, seconds = " to ".join(map(str, ends)), " to ".join(_lasting(n / rate) for n in ends)
    return {
        "record": f"{several}{samples} samples at {rate:.6g} Hz: {seconds}",
        "done to the record": "; ".join(record.processing) or "nothing",
    }


def _lasting(seconds: float) -> str:
    """Return a duration as people say it."""
    return f"{seconds:.4g} s" if seconds < 600 else f"{seconds / 60:.4g} min"


def _quality(findings: Sequence[Finding]) -> str:
    """List what an examination found wrong, and what to do about it."""
    if not findings:
        return paragraph("Their examination found nothing wrong.")
    rows = [[f.kind, list_some(f.channels), f.reason, f.change] for f in findings]
    return table(["finding", "channels", "what was seen", "what to do"], rows, words=[0, 1, 2, 3])


def _extent(response: Response) -> dict[str, str]:
    if isinstance(response, ImpulseResponse):
        return {
            "kind": "correlations" if response.ambient else f"{response.kind} response",
            "lags"
            if response.ambient
            else "samples": f"{response.samples} at {response.sampling_rate:.6g} Hz, {response.samples / response.sampling_rate:.4g} s",
        }
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
        facts["exponential window"] = f"added {response.added_damping:.4g} 1/s to every pole; taken out again"
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
        each = coherence.reshape(*coherence.shape[:2], -1)
        columns["mean coherence"] = [f"{v:.3f}" for v in each.mean(axis=(0, 2))]
        columns["lines below 0.8"] = [f"{100 * v:.1f} %" for v in (each < 0.8).mean(axis=(0, 2))]
    order = _weakest_first(rms)
    caption = "Outputs, over all lines or samples and inputs"
    if order.size < rms.size:
        caption += f"; the weakest {order.size} of {rms.size}"
    rows = [[column[i] for column in columns.values()] for i in order]
    return table(list(columns), rows, words=[0, 1], caption=caption)


def _weakest_first(rms: Array) -> Array:
    """Keep the channels' own order unless they are too many; then the weak ones matter."""
    return np.arange(rms.size) if rms.size <= _ROWS else np.argsort(rms, kind="stable")[:_ROWS]


def settings_section(diagram: StabilizationDiagram) -> Section:
    """How it was identified."""
    facts = {"method": cell_label(diagram.method, diagram.domain), "domain": diagram.domain}
    facts |= {"orders": value("orders", _orders(diagram.orders)), **settings_listed(diagram.settings)}
    facts |= {f"tolerance, {name}": value(name, limit) for name, limit in diagram.tolerances.items()}
    return Section("settings", "Settings", listing(facts.items()))


def settings_listed(settings: Settings) -> dict[str, str]:
    """Return the options that were used, in words."""
    return {heading(key): value(key, found) for key, found in settings.items() if found is not None}


def _orders(orders: tuple[int, ...]) -> str:
    if not orders:
        return "none"
    steps = set(np.diff(orders).tolist())
    if len(steps) == 1 and len(orders) > 2:
        return f"{orders[0]} to {orders[-1]}, step {steps.pop()}"
    return ", ".join(map(str, orders))


def notes_section(notes: Sequence[object], kinds: Sequence[str] = ()) -> Section:
    """What was chosen, converted or left out on the way, and poles (of these kinds) that a diagram does not show."""
    hidden = [f"{kinds.count(kind)} {kind}" for kind in ("real", "nyquist", "zero") if kind in kinds]
    texts = [str(note) for note in notes]
    if hidden:
        texts.append(f"Poles without a place on a frequency axis, not drawn: {', '.join(hidden)}.")
    return Section("notes", "Notes", "".join(map(paragraph, texts)) or paragraph("Nothing was left out."))


def repeat_section(script_text: str, command: str | None) -> Section:
    """The command and the script that give the same result, and the versions that gave this one."""
    parts = [paragraph("At the command line:"), script(command)] if command else []
    parts += [paragraph("In Python:"), script(script_text)]
    return Section("repeat", "How to repeat it", "".join(parts) + paragraph(versions(), "muted"))


def versions() -> str:
    """Return the programs that gave a result, with their versions."""
    return (
        f"Python {platform.python_version()}, modalscope {VERSION}, numpy {version('numpy')}, scipy {version('scipy')}"
    )
