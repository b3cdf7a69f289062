"""What all rows of the table share: the response that data of any kind become, and how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from modalscope.model.notes import Note
from modalscope.model.records import Records
from modalscope.model.response import Response
from modalscope.model.signals import Signals
from modalscope.model.stored import StoredSignals

__all__ = ["Measured"]


@dataclass(frozen=True, eq=False, slots=True)
class Measured:
    """What all rows share: the response in the band, the records behind correlations, and what was done.

    Parameters
    ----------
    response : Response
    records : Signals or StoredSignals, optional
        Records without inputs, filtered to the band.
    given : str
        What it was made of, in words.
    row, domain : str
        The row and the column that are taken when none is asked.
    band : (float, float), optional
        As asked, Hz; of hits and of records without inputs what was chosen where none was asked.
    exclude : object
        Channels left out, as asked.
    route : str, optional
        The way from records with inputs.
    driven : Records, optional
        Records with inputs, delays taken out.
    delays : mapping of label to int, optional
        Samples by which outputs came late.
    notes : tuple of Note
    sizes : mapping
        Block sizes that suit the response where none are asked, for rows that have them.
    """

    response: Response
    records: Signals | StoredSignals | None
    given: str
    row: str
    domain: str
    band: tuple[float, float] | None = None
    exclude: Any = None
    route: str | None = None
    driven: Records | None = None
    delays: Mapping[str, int] | None = None
    notes: tuple[Note, ...] = ()
    sizes: Mapping[str, int] = field(default_factory=dict)

    @property
    def held(self) -> Signals | None:
        """The records, where they are in memory."""
        return self.records if isinstance(self.records, Signals) else None
