"""The bands that a result was identified in, each with its diagram and the modes that lie in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from modalscope.model import ModalModel, StabilizationDiagram
from modalscope.plot.web.poles import band_of, inside
from modalscope.reporting.html import Section

__all__ = ["Shown", "bands_of"]


@dataclass(frozen=True, eq=False, slots=True)
class Shown:
    """One band as a report shows it.

    Parameters
    ----------
    diagram : StabilizationDiagram
    modes : ModalModel
        Those that lie in the band.
    number : int
        Counted from 1.
    words : str
        Its ends.
    """

    diagram: StabilizationDiagram
    modes: ModalModel
    number: int
    words: str

    def named(self, section: Section, several: bool) -> Section:
        """Return a section with the band in its title, where there are several; the first keeps its anchor.

        Parameters
        ----------
        section : Section
        several : bool
        """
        if not several:
            return section
        anchor = section.anchor if self.number == 1 else f"{section.anchor}-{self.number}"
        return replace(section, anchor=anchor, title=f"{section.title}, {self.words}")


def bands_of(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> list[Shown]:
    """Return every band with its own modes; one band has all.

    Parameters
    ----------
    modes : ModalModel
        Of all bands.
    diagrams : sequence of StabilizationDiagram
        One a band.
    """
    found = []
    for k, diagram in enumerate(diagrams):
        low, high = band_of(diagram, len(diagrams))
        found.append(Shown(diagram, inside(modes, diagram, len(diagrams)), k + 1, f"{low:.4g} to {high:.4g} Hz"))
    return found
