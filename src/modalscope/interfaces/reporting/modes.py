"""Write the sections on modes: verdict, table with grades, intervals and their certificate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from modalscope.analysis.checking.certificate import Certificate
from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.analysis import named_near
from modalscope.data.rebuilt import asked_ends, explains_enough, unexplained
from modalscope.data.shown import counted, frequency, percent
from modalscope.identification.identify import Identification
from modalscope.identification.method_names import cell_label
from modalscope.interfaces.plot.intervals import certificate_picture, intervals_picture
from modalscope.interfaces.plot.web.fits import Fit
from modalscope.interfaces.plot.web.verdict import verdict_of
from modalscope.interfaces.reporting.html import Section, figure, folded, paragraph, table
from modalscope.numerics.checks import BoolArray
from modalscope.selection.judging.description import HEADS, WORDS, described, table_of
from modalscope.selection.judging.grades import Grade

#: Meaning of the indicators, for the legend below their table.
_INDICATOR_MEANINGS = {
    "amplitude_coherence": "amplitude coherence: agreement of the mode's evolution with that of its pole (best 1)",
    "emac": "emac: extended modal amplitude coherence, over outputs and inputs (best 1)",
    "emaco": "emaco: emac over outputs alone",
    "mpc": "mpc: modal phase collinearity, 1 if all points move in phase or in opposition",
    "cmi": "cmi: consistent mode indicator, emac times mpc",
    "msv": "msv: modal singular value, share of the mode in the response (largest 1)",
    "mpd": "mpd: mean phase deviation of the shape in degrees (best 0)",
    "peak": "peak: height of the spectral peak in the best combination of channels, relative to its noise bound (above 1)",
}


def intervals_section(modes: ModalModel) -> Section:
    """Draw the 95 % intervals of frequencies and damping ratios, or state how to obtain them."""
    title = "Confidence intervals"
    if modes.frequencies_std is None and modes.frequencies_repeatability is None:
        reasons = [str(note) for note in modes.notes if note.kind == "not refined"]
        advice = "No standard deviations are known. modalscope.refine(data, modes) computes them; analyze does so if possible."
        return Section("intervals", title, "".join(map(paragraph, (*reasons, advice))))
    scatter = " and the scatter between groups" if modes.frequencies_repeatability is not None else ""
    lead = paragraph(f"95 % intervals, each mode on its own axis; from the noise{scatter}.", "muted")
    drawn = [intervals_picture(modes, of) for of in ("frequency", "damping")]
    pictures = "".join(figure(picture, height=76 + 21 * len(modes)) for picture in drawn)
    return Section("intervals", title, f'{lead}<div class="pair">{pictures}</div>')


def certificate_section(certificate: Certificate) -> Section:
    """State for every interval whether it holds: bias, ratio and coverage in simulations of this case."""
    good, count = int(certificate.holds.sum()), len(certificate.modes)
    result = "All intervals hold" if good == count else f"The intervals of {good} of {count} modes hold"
    lead = (
        f"{result}. This case was simulated with the modes above as the truth and noise like that of the data, and identified again "
        f"at order {certificate.order}. An interval holds if the bias is below half a standard deviation, the scatter .8 to 1.25 of "
        "the predicted one, and the coverage at least 88 %. Intervals that fail are tried again with five times as many simulations."
    )
    pictures = "".join(figure(certificate_picture(certificate, of)) for of in ("frequency", "damping"))
    notes = "".join(paragraph(str(note)) for note in certificate.notes)
    if good < count:
        notes += paragraph("Intervals that do not hold are replaced by the scatter of the simulations.")
    body = f'{paragraph(lead)}<div class="pair">{pictures}</div>{_certificate_table(certificate)}{notes}'
    return Section("certificate", "Coverage of the intervals", body)


def _certificate_table(c: Certificate) -> str:
    measures = ("bias", "ratio", "coverage")
    rows = []
    for j, f in enumerate(c.modes.frequencies):
        numbers = [f"{values[k][j]:.2f}" for values in (c.frequency, c.damping_ratio) for k in measures]
        verdict = "holds" if c.holds[j] else "does not hold"
        rows.append([str(j + 1), f"{f:.5g}", *numbers, f"{c.found[j]} of {c.replicates[j]}", verdict])
    head = ["mode", "f [Hz]", *(f"{of}: {k}" for of in ("f", "ζ") for k in measures), "identified", "interval"]
    caption = (
        "Bias and scatter in predicted standard deviations; coverage of the 95 % interval; simulations with the mode"
    )
    return table(head, rows, words=[9], caption=caption)


def summary_section(
    modes: ModalModel,
    diagrams: Sequence[StabilizationDiagram],
    fit: Fit,
    *,
    band: str = "",
    judged: Sequence[Grade] | None = None,
) -> Section:
    """Write the verdict: warnings, number of modes, what is unexplained, grades, and the least certain mode.

    `diagrams`: one per band. `fit`: fit error in all and per channel. `band`: sentence on the chosen band.
    """
    diagram, ends = diagrams[0], [asked_ends(d) for d in diagrams]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    orders = f"orders {diagram.orders[0]} to {diagram.orders[-1]}" if diagram.orders else "no order"
    lead = f"{counted(len(modes), 'mode')} between {low:.5g} and {high:.5g} Hz, by {cell_label(diagram.method, diagram.domain)}, {orders}."
    verdict = verdict_of(modes, diagram.response, fit, judged)
    lines = (*verdict.graded, band, *verdict.taken, _least_certain(modes), odd_poles(modes))
    body = "".join(paragraph(text, "loud") for text in verdict.warnings)
    body += paragraph(" ".join([lead, *verdict.unexplained]), "verdict")
    return Section("summary", "Summary", body + "".join(paragraph(text) for text in lines if text))


def identification_summary(identified: Identification) -> Section:
    """Write the verdict on one identification: number of modes, what is unexplained, poles that are no modes."""
    modes, (low, high) = identified.modes, identified.response.span
    method = cell_label(identified.method, identified.domain)
    lead = f"{counted(len(modes), 'mode')} between {low:.5g} and {high:.5g} Hz, by {method}, order {identified.order}."
    body = paragraph(lead, "verdict")
    misfit = unexplained(identified.fit_error)  # by the whole model, with its real and unstable poles
    body = body + paragraph(misfit) if explains_enough(identified.fit_error) else paragraph(misfit, "loud") + body
    odd = odd_poles(modes)
    body += paragraph(odd) if odd else ""
    body += paragraph("One order cannot separate modes from noise; use stabilize and select.", "muted")
    return Section("summary", "Summary", body)


def odd_poles(modes: ModalModel) -> str:
    """Name the poles that are no modes, such as unstable ones."""
    return "; ".join(f"mode {i + 1} is {kind}" for i, kind in enumerate(modes.kinds) if kind != "mode")


def _least_certain(modes: ModalModel) -> str:
    """Name the mode whose damping scatters most over the orders, relative to its value."""
    spread, zeta = modes.damping_ratios_spread, modes.damping_ratios
    if spread is None or not len(modes):
        return ""
    share = np.divide(spread, np.abs(zeta), out=np.full(len(modes), np.nan), where=zeta != 0)
    if not np.any(np.isfinite(share)):
        return ""
    worst = int(np.nanargmax(share))
    where = f"mode {worst + 1} at {frequency(modes.frequencies[worst])}"
    return f"Least certain: {where}, whose damping scatters by {percent(share[worst], 2)} over the orders."


def modes_section(
    modes: ModalModel, holds: BoolArray | None = None, names: Mapping[str, str] = MappingProxyType({})
) -> Section:
    """Write the table of modes: values, 95 % intervals, grade and its reason, and names if any; all indicators are folded."""
    head, graded = list(HEADS.values()), list(HEADS).index("grade")
    rows = [list(each.to_dict().values()) for each in described(modes, holds)]
    words = [named_near(names, f) for f in modes.frequencies]
    if any(words):
        head, rows = [*head, "name"], [[*row, name] for row, name in zip(rows, words, strict=True)]
    body = table(head, rows, words=(*WORDS, len(HEADS)), graded=graded)
    return Section("modes", "Modes", body + folded("All values: deviations, spreads, indicators", figures_of(modes)))


def figures_of(modes: ModalModel) -> str:
    """Return the table of modes with spreads, significance and indicators, and the meaning of their names."""
    head, *rows = table_of(modes, wide=True)
    body = table(head, rows, words=[k for k, name in enumerate(head) if name in ("kind", "grade", "reason")])
    meanings = [_INDICATOR_MEANINGS[name] for name in modes.indicators if name in _INDICATOR_MEANINGS]
    if modes.frequencies_spread is not None:
        meanings = ["spread: standard deviation over the orders at which the mode was identified", *meanings]
    return body + (paragraph(f"{'; '.join(meanings)}.", "muted") if meanings else "")
