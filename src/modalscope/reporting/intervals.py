"""The section of a report on how far values may be from the truth."""

from __future__ import annotations

from modalscope.model import ModalModel
from modalscope.reporting.figures import intervals_svg
from modalscope.reporting.html import Section, paragraph, picture

__all__ = ["intervals_section"]

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
