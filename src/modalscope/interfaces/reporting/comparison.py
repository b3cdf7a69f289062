"""Write the sections of a report on a comparison of methods."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modalscope.analysis.comparing import CAUSES, Comparison, MethodResult
from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.scatter import LEVEL
from modalscope.analysis.comparing.verdict import LEADS
from modalscope.data.mode_fields import told
from modalscope.data.rebuilt import explains_enough, unexplained
from modalscope.data.shown import figures
from modalscope.interfaces.plot.diagrams import stabilization_picture
from modalscope.interfaces.plot.methods import deviations_picture, map_picture
from modalscope.interfaces.reporting import record, sections
from modalscope.interfaces.reporting.html import Section, figure, folded, listing, paragraph, table
from modalscope.interfaces.reporting.record import comparison_script
from modalscope.selection.judging.description import decimals

#: Maximum number of drawn stabilization diagrams.
_MAX_DIAGRAMS = 6

#: Beginnings of the lines of the verdict on single modes, which the table contains.
_LINES_ON_MODES = (*LEADS.values(), "Methods differ on")

#: A map is drawn of at least so many classes of methods, at this maximum distance at least (half-power half-bandwidths).
_MIN_MAP_CLASSES, _MIN_MAP_DISTANCE = 4, 0.01

#: The table of MAC values is omitted if all are at least this.
_ALIKE_MAC = 0.99


def comparison_sections(c: Comparison, *, source: str | None = None, command: str | None = None) -> Iterator[Section]:
    """Yield the sections on a comparison in the order of reading, each drawn when it is asked for."""
    yield _verdict(c)
    yield _modes(c)
    yield _methods(c)
    if len(c.kinship.names) > 1:
        yield _kinship(c)
    yield _disagreements(c)
    if any(r.diagram is not None for r in c.results):
        yield _stabilization(c)
    if len(c.modes):
        yield from sections.mode_pictures(c.modes)
        yield sections.all_responses(c.modes, c.response)
    yield record.data_section(c.response, source)
    yield _settings(c)
    yield record.repeat_section(comparison_script(c, source), command)


def _verdict(c: Comparison) -> Section:
    low, high = c.response.span
    lead = f"The same data for all, {low:.5g} to {high:.5g} Hz; {len(c.modes)} modes in the consensus."
    if c.groups and explains_enough(c.fit_error):
        lead += f" {unexplained(c.fit_error)}"
    lines = [line for line in c.verdict.splitlines() if not line.startswith(_LINES_ON_MODES)] or [c.verdict]
    first = "loud" if c.groups and not explains_enough(c.fit_error) else "verdict"
    body = paragraph(c.headline) + paragraph(lines[0], first) + "".join(paragraph(line) for line in lines[1:])
    return Section("verdict", "Verdict", body + paragraph(lead, "muted"))


def consensus_table(c: Comparison) -> list[list[str]]:
    """Return the table of the consensus cell by cell, its heads first."""
    digits, ran = decimals(c.modes.frequencies, 6), sum(r.modes is not None for r in c.results)
    columns = {
        "mode": [str(k + 1) for k in range(len(c.groups))],
        "f [Hz]": [f"{g.frequency:.{digits}f}" for g in c.groups],
        "± [Hz]": [told(v) for v in c.scatter.frequency],
        "between [Hz]": [figures(g.frequency_between, 2) for g in c.groups],
        "damping [%]": [f"{100 * g.damping:.3f}" for g in c.groups],
        "± [%]": [told(100 * v) for v in c.scatter.damping],
        "between [%]": [figures(100 * g.damping_between, 2) for g in c.groups],
        "found by": [f"{len(g.members)} of {ran}" for g in c.groups],
        "MAC": [f"{min(g.mac.values()):.3f}" for g in c.groups],
        "grade": [t.grade for t in c.trust],
        "methods": [t.agreement.removeprefix("methods ") for t in c.trust],
        "reason and causes": ["; ".join([t.why.partition(":")[0], *(x.name for x in t.causes)]) for t in c.trust],
    }
    return [list(columns), *map(list, zip(*columns.values(), strict=True))]


def _modes(c: Comparison) -> Section:
    head, *rows = consensus_table(c)
    body = table(head, rows, words=[9, 10, 11], graded=9) if rows else paragraph("No significant mode.")
    body += paragraph(
        f"±: {100 * LEVEL:g} % interval from the noise and the scatter between methods, no narrower than that of the analysis; "
        "between: standard deviation between methods; MAC: the lowest of the methods' shapes with the consensus.",
        "muted",
    )
    if c.unconfirmed:
        which = ", ".join(f"{g.frequency:.5g} Hz ({'; '.join(map(c.label, g.members))})" for g in c.unconfirmed)
        words = paragraph(f"Identified from transformed data only, not in the consensus: {which}.")
        body += folded(f"{len(c.unconfirmed)} more from transformed data only", words)
    if c.groups:
        caption = "Every method relative to the consensus; grey: the ± interval. Open marks: inverse-transformed data, not counted."
        body += figure(deviations_picture(c), caption, 900, 484)
    return Section("modes", "Modes: the consensus", body)


def _methods(c: Comparison) -> Section:
    rows = [_method_row(r) for r in c.results]
    head = ["method", "realization", "modes", "unexplained [%]", "orders", "seconds", "remark"]
    caption = "Unexplained: residual of the method's modes on the responses it was applied to"
    body = table(head, rows, words=[0, 1, 6], caption=caption)
    for kind, title, scale in (
        ("frequencies", "Frequencies [Hz]", 1.0),
        ("damping_ratios", "Damping [%]", 100.0),
        ("mac", "MAC with the consensus", 1.0),
    ):
        if kind != "mac" or any(min(g.mac.values()) < _ALIKE_MAC for g in c.groups):
            body += _values_table(c, kind, title, scale)
    return Section("methods", "Methods compared", body)


def _method_row(r: MethodResult) -> list[str]:
    if r.modes is None or r.fit_error is None or r.diagram is None:
        return [r.label, r.method.realization, "–", "–", "–", f"{r.seconds:.1f}", f"failed: {r.failure}"]
    remark = "" if r.exact else "not counted" if r.route else "transformed data, not counted"
    numbers = [f"{100 * r.fit_error:.2f}", f"{r.diagram.orders[0]} to {r.diagram.orders[-1]}", f"{r.seconds:.1f}"]
    return [r.label, r.method.realization, str(len(r.modes)), *numbers, remark]


def _values_table(c: Comparison, kind: str, title: str, scale: float) -> str:
    names = [r.name for r in c.results if r.modes is not None]
    if not names or not c.groups:
        return ""
    digits = {"frequencies": decimals(c.modes.frequencies, 6), "damping_ratios": 3, "mac": 3}[kind]

    def cell(group: Group, name: str) -> str:
        return f"{scale * getattr(group, kind)[name]:.{digits}f}" if name in group.members else "–"

    rows = [[c.label(name), *(cell(g, name) for g in c.groups)] for name in names]
    return table(["method", *(f"{k + 1}" for k in range(len(c.groups)))], rows, words=[0], caption=title)


def _kinship(c: Comparison) -> Section:
    kin = c.kinship
    equal = [" = ".join(labels) for labels in kin.equals]
    body = paragraph(
        f"Distance of two methods: how far their poles of order {kin.order} lie apart, in half-power half-bandwidths; strong poles count "
        "more (0: equal poles, 1: none in common). On the map, methods with similar poles lie close together."
    )
    if equal:
        body += paragraph(f"Equal methods on these data, to rounding: {'; '.join(equal)}.")
    distance = float(np.max(kin.distances))
    if len(kin.classes) < _MIN_MAP_CLASSES or distance < _MIN_MAP_DISTANCE:
        text = f"All methods agree within {figures(distance, 2)} half-power half-bandwidths: no map."
        return Section("map", "Map of methods", body + paragraph(text))
    body += figure(map_picture(kin), width=900)
    return Section("map", "Map of methods", body)


def _disagreements(c: Comparison) -> Section:
    if not c.disagreements:
        return Section("disagreements", "Disagreements", paragraph("All methods agree within the noise."))
    rows = []
    for d in c.disagreements:
        where = "data" if d.mode is None else f"{d.mode + 1}: {c.groups[d.mode].frequency:.5g} Hz"
        rows.append([where, d.what, "; ".join(str(x) for x in d.causes) if d.mode is not None else d.causes[0].name])
    named = dict.fromkeys(x.name for d in c.disagreements for x in d.causes)
    body = table(["mode", "difference", "likely cause"], rows, words=[1, 2])
    body += paragraph("Remedies:") + listing((name, CAUSES[name]) for name in named)
    return Section("disagreements", "Disagreements and their causes", body)


def _stabilization(c: Comparison) -> Section:
    """Draw one diagram of each class of equal methods, those with a vote and the best fit first."""
    kept, classes = [], set()
    for r in sorted((r for r in c.results if r.diagram is not None), key=lambda r: (not r.exact, r.fit_error)):
        kind = c.kinship.class_of(r.name)
        if kind not in classes:
            classes.add(kind)
            kept.append(r)
    parts = [
        figure(stabilization_picture([r.diagram], r.modes), r.label, height=330)
        for r in kept[:_MAX_DIAGRAMS]
        if r.diagram is not None and r.modes is not None
    ]
    lead = paragraph("One diagram of each class of methods, best fit first; lines mark its selected modes.", "muted")
    return Section("stabilization", "Stabilization", f'{lead}<div class="pair">{"".join(parts)}</div>')


def _settings(c: Comparison) -> Section:
    """List the settings, the data matrix of every method, and each note once with the methods that have it."""
    facts = {key: str(content) for key, content in c.settings.items() if content is not None}
    rows, told = [], dict[str, list[str]]()
    for r in c.results:
        if r.diagram is not None:
            options = ", ".join(f"{k} {v}" for k, v in r.diagram.settings.items())
            rows.append([r.label, options])
            for note in map(str, r.diagram.notes):
                told.setdefault(note, []).append(r.label)
    notes = [[text, "all" if len(labels) == len(rows) else ", ".join(labels)] for text, labels in told.items()]
    body = listing(facts.items()) + table(["method", "data matrix"], rows, words=[0, 1])
    body += table(["note", "methods"], notes, words=[0, 1]) if notes else ""
    body += "".join(paragraph(str(note)) for note in c.notes)
    return Section("settings", "Settings and notes", body)
