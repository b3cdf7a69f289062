"""Write the sections of a report on a comparison of methods."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from modalscope import plot
from modalscope.comparing import CAUSES, Comparison, MethodResult
from modalscope.comparing.kinship import Kinship
from modalscope.comparing.scatter import LEVEL
from modalscope.modal.rebuilt import explained, explains_enough
from modalscope.plot.web.poles import fit_of
from modalscope.reporting import record, sections
from modalscope.reporting.figures import draw, stabilization_svg
from modalscope.reporting.html import Section, decimals, folded, listing, paragraph, picture, table
from modalscope.reporting.record import comparison_script

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Stabilization diagrams that are drawn; the others stand in the table only.
_DIAGRAMS = 6

#: How lines of the verdict on single modes begin.
_OF_ONE_MODE = ("Do not trust", "Trust the frequency")

#: From so many methods that differ, and with this distance between some of them (half bandwidths), a map says more than a sentence.
_MAPPED, _APART = 4, 0.01

#: From so many methods on the table of distances needs the width of the page.
_WIDE = 9

#: Where all shapes are as like as this, a table of them says nothing.
_ALIKE = 0.99


def comparison_sections(c: Comparison, *, source: str | None = None, command: str | None = None) -> Iterator[Section]:
    """Give the sections on a comparison in the order of reading, each drawn when it is asked for."""
    fit = fit_of(c.modes, c.response) if len(c.modes) else None
    yield _verdict(c)
    yield _modes(c)
    yield _methods(c)
    if len(c.kinship.names) > 1:
        yield _kinship(c)
    yield _identities(c)
    yield _disagreements(c)
    if any(r.diagram is not None for r in c.results):
        yield _stabilization(c)
    if len(c.modes):
        yield from sections.mode_pictures(c.modes)
        yield sections.responses_section(c.modes, c.response, fit)
    yield record.data_section(c.response, source)
    yield _settings(c)
    yield record.repeat_section(comparison_script(c, source), command)


def _verdict(c: Comparison) -> Section:
    low, high = c.response.span
    ran = [r for r in c.results if r.modes is not None]
    count = f"{len(ran)} of {len(c.results)} methods" if len(ran) < len(c.results) else f"{len(ran)} methods"
    lead = f"{count} on the same data, {low:.5g} to {high:.5g} Hz; {len(c.modes)} modes in the consensus"
    lead += "."
    if c.groups and explains_enough(c.fit_error):
        lead += f" {explained(c.fit_error)}"
    digits = decimals(c.modes.frequencies)
    rows = [
        [
            str(k + 1),
            f"{g.frequency:.{digits}f}",
            f"{c.scatter.frequency[k]:.2g}",
            f"{100 * g.damping:.3f}",
            f"{100 * c.scatter.damping[k]:.2g}",
            t.grade,
            "; ".join([t.why.partition(":")[0], *(x.name for x in t.causes)]),
        ]
        for k, (g, t) in enumerate(zip(c.groups, c.trust, strict=True))
    ]
    # what is said of single modes stands in the table
    lines = [line for line in c.verdict.splitlines() if not line.startswith(_OF_ONE_MODE)] or [c.verdict]
    first = "loud" if c.groups and not explains_enough(c.fit_error) else "verdict"
    body = paragraph(lines[0], first) + "".join(paragraph(line) for line in lines[1:])
    head = ["mode", "frequency [Hz]", "± [Hz]", "damping [%]", "± [%]", "trust", "why, and what makes it hard"]
    body += table(head, rows, words=[5, 6], graded=5) if rows else ""
    body += paragraph(lead, "muted")
    return Section("verdict", "Verdict", body)


def _modes(c: Comparison) -> Section:
    digits = decimals(c.modes.frequencies)
    ran = sum(r.modes is not None for r in c.results)
    columns = {
        "mode": [str(k + 1) for k in range(len(c.groups))],
        "frequency [Hz]": [f"{g.frequency:.{digits}f}" for g in c.groups],
        "± [Hz]": [f"{v:.2g}" for v in c.scatter.frequency],
        "between [Hz]": [f"{g.frequency_between:.2g}" for g in c.groups],
        "damping [%]": [f"{100 * g.damping:.3f}" for g in c.groups],
        "± [%]": [f"{100 * v:.2g}" for v in c.scatter.damping],
        "between [%]": [f"{100 * g.damping_between:.2g}" for g in c.groups],
        "found by": [f"{len(g.members)} of {ran}" for g in c.groups],
        "least MAC": [f"{min(g.mac.values()):.3f}" for g in c.groups],
        "trust": [t.grade for t in c.trust],
    }
    rows = list(zip(*columns.values(), strict=True))
    body = table(list(columns), rows, words=[9]) if rows else paragraph("No mode stands out of the data.")
    body += paragraph(
        f"±: the truth lies within it in {100 * LEVEL:g} %, by the noise and by what the methods disagree beyond it; "
        "between: the standard deviation between methods alone; least MAC: of the methods' shapes with the consensus.",
        "muted",
    )
    if c.unconfirmed:
        which = ", ".join(f"{g.frequency:.5g} Hz ({'; '.join(map(c.label, g.members))})" for g in c.unconfirmed)
        words = paragraph(f"Shown by transformed data only, and not in the consensus: {which}.")
        body += folded(f"{len(c.unconfirmed)} more were shown by transformed data only", words)
    if c.groups:
        caption = "Every method against the consensus; grey: the stated scatter. Open marks: transformed data, which have no vote."
        body += picture(
            draw((10.0, 6.2), lambda figure: _deviations(figure, c)),
            "Deviation of every method from the consensus",
            caption,
        )
    return Section("modes", "Modes: the consensus", body)


def _deviations(figure: Figure, c: Comparison) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True)
    plot.deviations(c, (upper, lower))


def _methods(c: Comparison) -> Section:
    rows = [_method_row(r) for r in c.results]
    head = ["method", "realization", "modes", "fit error [%]", "orders", "seconds", "remark"]
    body = table(
        head, rows, words=[0, 1, 6], caption="Fit error: what the method's modes leave of the responses it worked on"
    )
    for kind, title, scale in (
        ("frequencies", "Frequencies [Hz]", 1.0),
        ("damping_ratios", "Damping [%]", 100.0),
        ("mac", "MAC with the consensus", 1.0),
    ):
        if kind != "mac" or any(min(g.mac.values()) < _ALIKE for g in c.groups):
            body += _each(c, kind, title, scale)
    return Section("methods", "Methods compared", body)


def _method_row(r: MethodResult) -> list[str]:
    if r.modes is None or r.fit_error is None or r.diagram is None:
        return [r.label, r.method.realization, "–", "–", "–", f"{r.seconds:.1f}", f"failed: {r.failure}"]
    orders = f"{r.diagram.orders[0]} to {r.diagram.orders[-1]}"
    remark = "" if r.exact else "no vote" if r.route else "transformed data, no vote"
    return [
        r.label,
        r.method.realization,
        str(len(r.modes)),
        f"{100 * r.fit_error:.2f}",
        orders,
        f"{r.seconds:.1f}",
        remark,
    ]


def _each(c: Comparison, kind: str, title: str, scale: float) -> str:
    names = [r.name for r in c.results if r.modes is not None]
    if not names or not c.groups:
        return ""
    digits = {"frequencies": decimals(c.modes.frequencies), "damping_ratios": 3, "mac": 3}[kind]
    rows = [
        [
            c.label(name),
            *(f"{scale * getattr(g, kind)[name]:.{digits}f}" if name in g.members else "–" for g in c.groups),
        ]
        for name in names
    ]
    return table(["method", *(f"{k + 1}" for k in range(len(c.groups)))], rows, words=[0], caption=title)


def _kinship(c: Comparison) -> Section:
    kin = c.kinship
    equal = [" = ".join(labels) for labels in kin.equals]
    body = paragraph(
        f"Distance of two methods: how far their poles of order {kin.order} lie apart, in half bandwidths, "
        "each weighted by its share of the response (0: the same poles, 1: none in common). "
        "A map places the methods so that these distances are kept as well as a plane can; "
        "a table adds the largest angle between the subspaces that the reported modes span in time and space."
    )
    if equal:
        body += paragraph(f"The same method on these data, to rounding: {'; '.join(equal)}.")
    if len(kin.classes) < _MAPPED or float(np.max(kin.distances)) < _APART:
        return Section("map", "Map of methods", body + paragraph(_all_near(kin)))
    side = max(4.6, 0.46 * len(kin.names) + 2.2)
    body += picture(draw((10.0, 5.6), lambda f: plot.method_map(c, f.add_subplot())), "Map of methods")
    caption = "Below the diagonal distances of pole sets, above it principal angles in degrees."
    drawn = draw((side + 0.8, side), lambda f: plot.method_distances(c, f.add_subplot()))
    kind = "narrow" if len(kin.names) < _WIDE else "whole"
    body += f'<div class="{kind}">{picture(drawn, "Distances between methods", caption)}</div>'
    return Section("map", "Map of methods", body)


def _all_near(kin: Kinship) -> str:
    """Say in a sentence what a map of a few methods, or of methods that hardly differ, would draw."""
    which = (
        f"{len(kin.classes)} kinds of methods differ on these data"
        if len(kin.classes) > 1
        else "No method differs from another"
    )
    return f"{which}, by {float(np.max(kin.distances)):.2g} half bandwidths at most: no map is drawn."


def _identities(c: Comparison) -> Section:
    lead = paragraph(
        "These relations hold with noise, on any data, to rounding. They are computed here by two routes each on the data of this report: "
        "a residual above 1e-9 would be a fault of the programs, not of the measurement."
    )
    rows = [
        [
            i.name,
            i.domain,
            i.source,
            str(i.order),
            f"{i.residual:.1e}" if np.isfinite(i.residual) else f"not checked: {i.note}",
        ]
        for i in c.identities
    ]
    return Section(
        "identities",
        "Identities on these data",
        lead + table(["identity", "domain", "report", "order", "residual"], rows, words=[0, 2]),
    )


def _disagreements(c: Comparison) -> Section:
    if not c.disagreements:
        return Section(
            "disagreements", "Where methods disagree", paragraph("Nowhere beyond what the noise moves them apart.")
        )
    rows = []
    for d in c.disagreements:
        where = "data" if d.mode is None else f"{d.mode + 1}: {c.groups[d.mode].frequency:.5g} Hz"
        rows.append([where, d.what, "; ".join(str(x) for x in d.causes) if d.mode is not None else d.causes[0].name])
    named = dict.fromkeys(x.name for d in c.disagreements for x in d.causes)
    body = table(["mode", "what differs", "likely cause"], rows, words=[1, 2])
    body += paragraph("What to do:") + listing((name, CAUSES[name]) for name in named)
    return Section("disagreements", "Where methods disagree, and why", body)


def _stabilization(c: Comparison) -> Section:
    """Draw the diagrams of the methods with a vote, one of each class of equals, best fit first."""
    kept, classes = [], set()
    for r in sorted((r for r in c.results if r.diagram is not None), key=lambda r: (not r.exact, r.fit_error)):
        kind = c.kinship.class_of(r.name)
        if kind not in classes:
            classes.add(kind)
            kept.append(r)
    parts = [
        picture(stabilization_svg(r.diagram, r.modes), f"Stabilization diagram of {r.label}", r.label)
        for r in kept[:_DIAGRAMS]
        if r.diagram is not None and r.modes is not None
    ]
    lead = "One diagram for each method that differs from the others, best fit first; the modes that it selected are marked."
    return Section(
        "stabilization", "Stabilization", paragraph(lead, "muted") + f'<div class="pair">{"".join(parts)}</div>'
    )


def _settings(c: Comparison) -> Section:
    facts = {key: str(found) for key, found in c.settings.items() if found is not None}
    blocks = []
    for r in c.results:
        if r.diagram is not None:
            found = ", ".join(f"{k} {v}" for k, v in r.diagram.settings.items() if v is not None)
            blocks.append([r.label, found, "; ".join(map(str, r.diagram.notes))])
    body = listing(facts.items()) + table(["method", "data matrix", "notes"], blocks, words=[0, 1, 2])
    body += "".join(paragraph(str(note)) for note in c.notes)
    return Section("settings", "Settings and notes", body)
