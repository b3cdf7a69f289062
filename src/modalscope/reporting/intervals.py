"""The section of a report on how far values may be from the truth."""

from __future__ import annotations

from modalscope.judging.certificate import Certificate
from modalscope.model import ModalModel
from modalscope.reporting.figures import certificate_svg, intervals_svg
from modalscope.reporting.html import Section, paragraph, picture, table

__all__ = ["certificate_section", "intervals_section"]

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
