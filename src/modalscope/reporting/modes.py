"""Write the verdict and the table of modes with grade and intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modalscope.checking.certificate import Certificate
from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.mode_table import told
from modalscope.data.response import Response
from modalscope.identification.method_names import cell_label
from modalscope.modal.rebuilt import explained, explains_enough
from modalscope.plot.web.poles import Fit, asked_ends
from modalscope.reporting.figures import certificate_svg, intervals_svg
from modalscope.reporting.grades import GRADES, Grade, alike_pairs, grades, half_widths
from modalscope.reporting.html import Section, decimals, folded, frequency, paragraph, percent, picture, table

# ----------------------------------------------------------------------------------------------------------- intervals
# The section of a report on how far values may be from the truth.

_ADVICE = (
    "No deviations are known. modalscope.refine(data, modes) takes the modes to the maximum of the likelihood and gives them; "
    "analyze does so by itself where the data allow it."
)


def intervals_section(modes: ModalModel) -> Section:
    """Draw 95 % intervals of frequencies and damping ratios, and say what they rest on; without deviations, how to have them."""
    title = "How sure"
    if modes.frequencies_std is None and modes.frequencies_repeatability is None:
        why = [str(note) for note in modes.notes if note.kind == "not refined"]
        return Section("intervals", title, "".join(paragraph(text) for text in (*why, _ADVICE)))
    pictures = "".join(
        picture(intervals_svg(modes, of), f"95 % intervals of every mode's {of}") for of in ("frequency", "damping")
    )
    words = "Intervals of 95 %, relative to each value: what the noise leaves open"
    words += (
        ", and how far groups of inputs, runs or setups disagree."
        if modes.frequencies_repeatability is not None
        else "."
    )
    told = "".join(paragraph(str(note)) for note in modes.notes)
    return Section("intervals", title, f'{paragraph(words, "muted")}<div class="pair">{pictures}</div>{told}')


def certificate_section(found: Certificate) -> Section:
    """Say of every interval whether it holds: bias, ratio and coverage over simulations of this very case."""
    good, count = int(found.holds.sum()), len(found.modes)
    all_of = "All intervals hold" if good == count else f"The intervals of {good} of {count} modes hold"
    lead = (
        f"{all_of}: this very case was simulated, with the modes above as the truth and noise like that of the data, and identified "
        f"again at order {found.order}. An interval holds when the bias is below half a deviation, the scatter is .8 to 1.25 of the "
        "predicted one, and the truth lies inside in 88 % or more. What fails is judged again on five times as many simulations."
    )
    pictures = "".join(
        picture(
            certificate_svg(found, of),
            f"What simulations showed of every mode's {of}, in predicted deviations from the truth",
        )
        for of in ("frequency", "damping")
    )
    caption = "Bias and scatter in predicted deviations; coverage of the 95 % interval; in how many simulations the mode was found"
    told = "".join(paragraph(str(note)) for note in found.notes)
    if good < count:
        told += paragraph("What does not hold has the deviation that the simulations show in its place.")
    body = f'{paragraph(lead)}<div class="pair">{pictures}</div>{table(*_of_certificate(found), words=[9], caption=caption)}{told}'
    return Section("certificate", "Do the intervals hold", body)


def _of_certificate(found: Certificate) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the table of a certificate."""
    rows = [
        [
            str(j + 1),
            f"{f:.5g}",
            *(
                f"{told[k][j]:.2f}"
                for told in (found.frequency, found.damping_ratio)
                for k in ("bias", "ratio", "coverage")
            ),
            f"{found.found[j]} of {found.replicates[j]}",
            "holds" if found.holds[j] else "does not hold",
        ]
        for j, f in enumerate(found.modes.frequencies)
    ]
    head = [
        "mode",
        "f [Hz]",
        *(f"{of}: {k}" for of in ("f", "ζ") for k in ("bias", "ratio", "coverage")),
        "found",
        "interval",
    ]
    return head, rows


# --------------------------------------------------------------------------------------------------------------- modes

#: What the indicators say, for readers who meet them for the first time.
_WORDS = {
    "amplitude_coherence": "amplitude coherence: how well the mode evolves as one pole must (1 best)",
    "emac": "emac: extended modal amplitude coherence, over outputs and inputs (1 best)",
    "emaco": "emaco: the same over outputs alone",
    "mpc": "mpc: modal phase collinearity, 1 when all points move in phase or in opposition",
    "cmi": "cmi: consistent mode indicator, emac times mpc",
    "msv": "msv: modal singular value, share of the mode in the response (largest 1)",
    "mpd": "mpd: mean phase deviation of the shape in degrees (0 best)",
    "peak": "peak: height of the record's spectral peak in the best combination of channels, over what noise reaches (above 1)",
}


def summary_section(
    modes: ModalModel,
    diagrams: Sequence[StabilizationDiagram],
    fit: Fit,
    *,
    band: str = "",
    judged: Sequence[Grade] | None = None,
) -> Section:
    """The verdict: warnings first, how many modes where, how much they explain, how many of them are good, and the least sure.

    `diagrams`: one a band. `fit`: fit error in all and per channel. `band`: the band that was asked, in words.
    """
    diagram, ends = diagrams[0], [asked_ends(each) for each in diagrams]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    count = f"{len(modes)} mode{'' if len(modes) == 1 else 's'}"
    orders = f"orders {diagram.orders[0]} to {diagram.orders[-1]}" if diagram.orders else "no order"
    verdict = f"{count} between {low:.5g} and {high:.5g} Hz, by {cell_label(diagram.method, diagram.domain)}, {orders}."
    said = verdict_of(modes, diagram.response, fit)
    verdict += "".join(f" {text}" for text in said.explained)
    odd = [f"mode {i + 1} is {kind}" for i, kind in enumerate(modes.kinds) if kind != "mode"]
    graded = _counted(grades(modes) if judged is None else judged)
    lines = (graded, band, *said.taken, _least_sure(modes), "; ".join(odd))
    warned = "".join(paragraph(text, "loud") for text in said.warnings)
    return Section(
        "summary",
        "Summary",
        warned + paragraph(verdict, "verdict") + "".join(paragraph(text) for text in lines if text),
    )


class Verdict(NamedTuple):
    """Sentences on a list of modes, which a report and the terminal give alike.

    `taken`: what the data were taken as, where that is a choice. `explained`: how much the modes explain, where it is enough. `warnings`:
    that they explain too little, and that shapes are alike.
    """

    taken: tuple[str, ...]
    explained: tuple[str, ...]
    warnings: tuple[str, ...]


def verdict_of(modes: ModalModel, response: Response, fit: Fit) -> Verdict:
    """Return the sentences on a list of modes.

    `response`: what they were identified from; of several bands the first. `fit`: fit error in all and per channel, of all bands; None
    where it is not known.
    """
    share = () if fit is None else (explained(fit[0]),)
    enough = fit is None or explains_enough(fit[0])
    taken = ("No force was measured: taken as ambient vibration.",) if response.ambient else ()
    return Verdict(taken, share if enough else (), (*(() if enough else share), *_alike(modes)))


def _alike(modes: ModalModel) -> list[str]:
    """Return the warning that shapes are alike, where they are."""
    likes = alike_pairs(modes)
    if not likes:
        return []
    i, j, value = likes[0]
    which = f"modes {i + 1} and {j + 1} ({frequency(modes.frequencies[i])} and {frequency(modes.frequencies[j])})"
    more = f"; so are {len(likes) - 1} more pairs" if len(likes) > 1 else ""
    return [
        f"WARNING: the shapes of {which} are alike (MAC {value:.2f}){more}. Too few sensors tell them apart, something stronger "
        "than the modes stands in all of them, or one mode was taken twice."
    ]


def _counted(judged: Sequence[Grade]) -> str:
    """Say how many modes have which grade."""
    counts = [(word, sum(grade.word == word for grade in judged)) for word in GRADES]
    known = [f"{number} {word}" for word, number in counts if number]
    return f"Graded: {', '.join(known)}." if known else ""


def _least_sure(modes: ModalModel) -> str:
    """Name the mode whose damping scatters most over the orders, relative to its value."""
    spread, zeta = modes.damping_ratios_spread, modes.damping_ratios
    if spread is None or not len(modes):
        return ""
    share = np.divide(spread, np.abs(zeta), out=np.full(len(modes), np.nan), where=zeta != 0)
    if not np.any(np.isfinite(share)):
        return ""
    worst = int(np.nanargmax(share))
    where = f"mode {worst + 1} at {frequency(modes.frequencies[worst])}"
    return f"Least sure is {where}: its damping scatters by {percent(share[worst], 2)} of its value over the orders."


def modes_section(modes: ModalModel, judged: Sequence[Grade] | None = None) -> Section:
    """A grade for each mode with the one reason, 95 % intervals beside the values; every figure behind."""
    judged = grades(modes) if judged is None else judged
    digits = decimals(modes.frequencies)
    open_by = half_widths(modes)
    columns = {
        "mode": [str(i + 1) for i in range(len(modes))],
        "frequency [Hz]": [f"{v:.{digits}f}" for v in modes.frequencies],
        "± 95 % [Hz]": [told(v) for v in open_by[0]],
        "damping [%]": [f"{100 * v:.3f}" for v in modes.damping_ratios],
        "± 95 % [%]": [told(100 * v) for v in open_by[1]],
        "grade": [grade.word for grade in judged],
        "why": [grade.reason for grade in judged],
    }
    if not any(np.isfinite(half).any() for half in open_by):
        del columns["± 95 % [Hz]"], columns["± 95 % [%]"]
    rows = list(zip(*columns.values(), strict=True))
    places = list(columns)
    body = table(places, rows, words=[places.index("grade"), places.index("why")], graded=places.index("grade"))
    return Section("modes", "Modes", body + folded("All figures: deviations, spreads, indicators", figures_of(modes)))


def figures_of(modes: ModalModel) -> str:
    """Return the table of all figures of the modes, and what their names mean."""
    digits = decimals(modes.frequencies)
    columns: dict[str, list[str]] = {"mode": [str(i + 1) for i in range(len(modes))]}
    for name, title, scale, places in (
        ("frequencies", "frequency [Hz]", 1.0, digits),
        ("damping_ratios", "damping [%]", 100.0, 3),
    ):
        columns[title] = [f"{scale * v:.{places}f}" for v in getattr(modes, name)]
        for suffix, word in (("spread", "spread"), ("std", "± noise"), ("repeatability", "± repeatability")):
            found = getattr(modes, f"{name}_{suffix}")
            if found is not None:
                unit = title[title.index("[") :]
                columns[f"{word} {unit}{' ' * (name == 'damping_ratios')}"] = [told(scale * v) for v in found]
    if any(kind != "mode" for kind in modes.kinds):
        columns["kind"] = list(modes.kinds)
    for name, values in modes.indicators.items():
        columns[name.replace("_", " ")] = [f"{v:.3f}" if np.isfinite(v) else "–" for v in values]
    words = [i for i, name in enumerate(columns) if name == "kind"]
    body = table([name.strip() for name in columns], zip(*columns.values(), strict=True), words=words)
    known = [_WORDS[name] for name in modes.indicators if name in _WORDS]
    if modes.frequencies_spread is not None:
        known = ["spread: standard deviation over the orders at which the mode was found", *known]
    if modes.frequencies_std is not None:
        known = ["± noise: one standard deviation", *known]
    return body + (paragraph(f"{'; '.join(known)}.", "muted") if known else "")
