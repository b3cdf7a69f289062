"""The result of a whole analysis: modes, the diagrams they were selected from, and all that must be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from modalscope.model.analysis import Analysis
from modalscope.model.checks import DataError, freeze
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note, notes_of
from modalscope.model.settings import Settings
from modalscope.model.shown import Shown

__all__ = ["Result"]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True, repr=False)
class Result(Shown):
    """What `analyze` gives.

    Parameters
    ----------
    modes : ModalModel
        With the reasons of each.
    diagrams : tuple of StabilizationDiagram
        One a band; none in a result that was read from a file.
    findings : tuple of Finding
        What an examination of the data saw.
    notes : tuple of Note
        What was chosen, converted and left out, and what to be careful about.
    analysis : Analysis
        The choices: `modalscope.replay(result.analysis)` gives the same result again.
    data : object, optional
        What was analysed; None in a result that was read from a file.
    """

    modes: ModalModel
    diagrams: tuple[StabilizationDiagram, ...] = ()
    findings: tuple[Any, ...] = ()
    notes: tuple[Note, ...] = ()
    analysis: Analysis
    data: Any = None

    def __post_init__(self) -> None:
        freeze(self, notes=notes_of(self.notes), diagrams=tuple(self.diagrams), findings=tuple(self.findings))

    @property
    def diagram(self) -> StabilizationDiagram:
        """The stabilization diagram; of several bands the first."""
        if not self.diagrams:
            raise DataError(
                "the stabilization diagram of a result was asked",
                "it was read from a file, which holds none",
                "Make it again: modalscope.replay(result.analysis).",
            )
        return self.diagrams[0]

    @property
    def settings(self) -> tuple[Settings, ...]:
        """Every option with the value that was taken, one a band."""
        return tuple(diagram.settings for diagram in self.diagrams)
