"""Sections on the record itself: the data and their quality, the settings, what was left out, how to repeat it."""

from __future__ import annotations

import platform
from importlib.metadata import version

import numpy as np

from modalscope.model import FrequencyResponse, ImpulseResponse, StabilizationDiagram
from modalscope.model.checks import Array
from modalscope.model.response import Response, output_scale
from modalscope.model.version import VERSION
from modalscope.reporting.html import Section, listing, paragraph, script, table
from modalscope.reporting.numbers import heading, list_some, value

__all__ = ["data_section", "notes_section", "program", "repeat_section", "settings_section", "versions"]

#: Channels that are listed one by one.
_ROWS = 60


def data_section(response: Response, source: str | None) -> Section:
    """What was measured: channels, lines or samples, quantity, processing; level and coherence of every output."""
    facts = {"source": source or "not stated", **_extent(response)}
    facts["quantity"] = response.quantity or "not stated"
    facts["outputs"] = f"{len(response.output_dofs)}: {list_some(response.output_dofs)}"
    facts["inputs"] = f"{len(response.input_dofs)}: {list_some(response.input_dofs)}"
    facts["geometry"] = "none" if response.geometry is None else f"{len(response.geometry.nodes)} nodes"
    facts["processing"] = "; ".join(response.processing) or "none"
    return Section("data", "Data and their quality", listing(facts.items()) + _channels(response))


def _extent(response: Response) -> dict[str, str]:
    if isinstance(response, ImpulseResponse):
        return {
            "kind": f"{response.kind} response",
            "samples": f"{response.samples} at {response.sampling_rate:.6g} Hz, {response.samples / response.sampling_rate:.4g} s",
        }
    f = response.frequencies
    steps = np.diff(f)
    even = steps.size and np.allclose(steps, steps[0], rtol=1e-6)
    step = f", every {steps[0]:.4g} Hz" if even else ", unevenly spaced" if steps.size else ""
    facts = {"kind": "frequency responses", "lines": f"{f.size} from {f[0]:.6g} to {f[-1]:.6g} Hz{step}"}
    if response.averages is not None:
        facts["averages"] = str(response.averages)
    if response.added_damping:
        facts["exponential window"] = f"added {response.added_damping:.4g} 1/s to every pole; taken out again"
    return facts


def _channels(response: Response) -> str:
    """List the outputs: root mean square over lines and inputs, relative level, coherence."""
    rms = output_scale(response)
    level = np.full(rms.size, -np.inf)
    np.log10(rms / (rms.max() or 1.0), out=level, where=rms > 0)
    columns = {
        "output": list(response.output_dofs),
        "unit": [unit or "–" for unit in response.units[0]],
        "rms": [f"{v:.4g}" for v in rms],
        "level [dB]": [f"{20 * v:.1f}" if np.isfinite(v) else "zero" for v in level],
    }
    coherence = response.coherence if isinstance(response, FrequencyResponse) else None
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
    facts = {"method": diagram.method, "domain": diagram.domain, "orders": value("orders", _orders(diagram.orders))}
    facts |= {heading(key): value(key, found) for key, found in diagram.settings.items() if found is not None}
    facts |= {f"tolerance, {name}": value(name, limit) for name, limit in diagram.tolerances.items()}
    return Section("settings", "Settings", listing(facts.items()))


def _orders(orders: tuple[int, ...]) -> str:
    if not orders:
        return "none"
    steps = set(np.diff(orders).tolist())
    if len(steps) == 1 and len(orders) > 2:
        return f"{orders[0]} to {orders[-1]}, step {steps.pop()}"
    return ", ".join(map(str, orders))


def notes_section(diagram: StabilizationDiagram) -> Section:
    """What was chosen, converted or left out on the way, and poles that the diagram does not show."""
    kinds = diagram.kinds
    hidden = [f"{kinds.count(kind)} {kind}" for kind in ("real", "nyquist", "zero") if kind in kinds]
    notes = [str(note) for note in diagram.notes]
    if hidden:
        notes.append(f"Poles without a place on a frequency axis, not drawn: {', '.join(hidden)}.")
    body = "".join(paragraph(note) for note in notes) or paragraph("Nothing was left out.")
    return Section("notes", "Notes", body)


def repeat_section(diagram: StabilizationDiagram, source: str | None, command: str | None) -> Section:
    """The command and the script that give the same result, and the versions that gave this one."""
    parts = [paragraph("At the command line:"), script(command)] if command else []
    parts += [paragraph("In Python:"), script(program(diagram, source))]
    return Section("repeat", "How to repeat it", "".join(parts) + paragraph(versions(), "muted"))


def versions() -> str:
    """Return the programs that gave a result, with their versions."""
    return (
        f"Python {platform.python_version()}, modalscope {VERSION}, numpy {version('numpy')}, scipy {version('scipy')}"
    )


def program(diagram: StabilizationDiagram, source: str | None) -> str:
    """Return the script that repeats an identification."""
    low_high = ""
    if isinstance(diagram.response, FrequencyResponse):
        f = diagram.response.frequencies
        low_high = f"    band=({float(f[0])!r}, {float(f[-1])!r}),\n"
    kept = {key: found for key, found in diagram.settings.items() if found is not None}
    options = "".join(f"    {key}={found!r},\n" for key, found in kept.items() if _plain(key, found))
    lost = [key for key, found in kept.items() if not _plain(key, found)]
    if diagram.tolerances:
        options += f"    tolerances={ {name: float(limit) for name, limit in diagram.tolerances.items()}!r},\n"
    note = f"    # and as they were given: {', '.join(lost)}\n" if lost else ""
    return (
        "import modalscope as ms\n\n"
        f"data = ms.read({source or 'your file'!r})\n"
        "diagram = ms.stabilize(\n"
        "    data,\n"
        f"    method={diagram.method!r},\n"
        f"    domain={diagram.domain!r},\n"
        f"    orders={_orders_in_python(diagram.orders)},\n"
        f"{low_high}{options}{note}"
        ")\n"
        "modes = ms.select(diagram)\n"
        "print(modes.table())\n"
        'ms.report((modes, diagram), "report.html")\n'
    )


def _plain(key: str, found: object) -> bool:
    """Whether an option can be written down as it stands."""
    return isinstance(found, str | int | float | bool) and not (key == "weights" and found == "given")


def _orders_in_python(orders: tuple[int, ...]) -> str:
    steps = set(np.diff(orders).tolist())
    if len(steps) == 1:
        step = int(steps.pop())
        return f"range({orders[0]}, {orders[-1] + 1}, {step})"
    return repr(tuple(int(order) for order in orders))
