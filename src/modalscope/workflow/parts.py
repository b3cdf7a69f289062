"""The diagram of a band, and of one that no ladder of orders holds: identified in parts by itself, and merged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from modalscope.data.analysis import Analysis
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.results import StabilizationDiagram
from modalscope.data.setups import Setups
from modalscope.identification.ambient import bands_of_record, bands_of_setups, looked_through
from modalscope.judging.bands import Part, cut_of, holds_too_little, joined_diagram
from modalscope.judging.select import select
from modalscope.judging.stabilize import Watch, stabilize
from modalscope.numerics.errors import DataError

__all__ = ["Choose", "Look", "looked_at", "setups_apart"]

Progress = Callable[[int, int], None]
Choose = Callable[..., ModalModel]
Band = tuple[float, float] | None
Sweep = Callable[[Band], StabilizationDiagram]

#: A band is cut in two so many times after another at most: into eight parts.
_DEEPEST = 3


@dataclass(frozen=True, eq=False, slots=True)
class Look:
    """One band of a document, identified.

    `diagram`: of the whole band, joined where there are several parts. `band`: hz; None for all data. `parts`: what one ladder of orders
    holds each; none where orders, frequencies or several bands were given: these are not cut. `notes`: why this band. `setup`: of which
    setup, where every one is identified apart.
    """

    diagram: StabilizationDiagram
    band: Band = None
    parts: tuple[Part, ...] = ()
    notes: tuple[Note, ...] = ()
    setup: int = 0

    @property
    def reported(self) -> tuple[float, float]:
        """Hz: the ends of the band."""
        return self.band or self.diagram.response.reported_band(None)


def looked_at(
    data: Any, document: Analysis, progress: Progress | None = None, watch: Watch | None = None, choose: Choose = select
) -> list[Look]:
    """Return every band of a document identified; one where nobody chose orders is cut where one ladder of them does not hold it.

    `progress`, `watch`: as in `stabilize`. `choose`: `select`, or what keeps its parts from one choice to the next.
    """
    if document.apart:
        alone = replace(document, exclude=(), apart=False)
        return [
            replace(look, setup=k)
            for k, part in enumerate(setups_apart(data, document))
            for look in looked_at(part, alone, progress, watch, choose)
        ]

    seen = looked_through(data, document.exclude or None)

    def sweep(band: Band) -> StabilizationDiagram:
        return stabilize(
            seen,
            method=document.method,
            domain=document.domain,
            orders=document.orders,
            band=band,
            exclude=document.exclude or None,
            route=document.route,
            progress=progress,
            watch=watch,
            **document.options,
        )

    bands: tuple[tuple[float, float], ...] = document.bands
    told: tuple[Note, ...] = ()
    if not bands and document.orders is None:
        bands, told = _own_bands(seen, document.exclude or None)
    if len(bands) > 1 or document.orders is not None or document.frequencies is not None:
        return [Look(sweep(band), band, notes=told) for band in bands or (None,)]
    band = bands[0] if bands else None
    whole = sweep(band)
    by_line = not isinstance(document.options.get("weights"), str | None)  # they belong to the lines of the whole band
    parts = _parts(sweep, choose, _part(choose, band, whole), 0 if by_line else _DEEPEST)
    return [Look(whole if len(parts) == 1 else joined_diagram(whole, parts), band, tuple(parts), told)]


def _own_bands(data: Any, exclude: Any) -> tuple[tuple[tuple[float, float], ...], tuple[Note, ...]]:
    """Return the bands that ambient records fall into by themselves, and what is said about them."""
    if isinstance(data, Setups):
        return bands_of_setups(data if exclude is None else data.select(exclude=exclude))
    return bands_of_record(data)


def setups_apart(data: Any, document: Analysis) -> tuple[Signals, ...]:
    """Return the records of every setup, without the channels that a document leaves out.

    Raises `DataError`: other data, or several bands.
    """
    if not isinstance(data, Setups) or len(document.bands) > 1:
        what = f"{len(document.bands)} bands" if isinstance(data, Setups) else type(data).__name__
        raise DataError(
            "an identification of every setup apart was asked",
            f"there {'are' if isinstance(data, Setups) else 'is'} {what}",
            "Give several ambient records with common outputs, and one band or none.",
        )
    return (data.select(exclude=document.exclude) if document.exclude else data).parts


def _part(choose: Choose, band: Band, diagram: StabilizationDiagram, core: Band = None) -> Part:
    low, high = diagram.response.reported_band(band)
    return Part(core or (low, high), band, diagram, choose(diagram))


def _parts(sweep: Sweep, choose: Choose, part: Part, deeper: int) -> list[Part]:
    """Return a part, cut in two as long as its orders do not hold it."""
    cut = cut_of(part) if deeper and holds_too_little(part.diagram, part.modes) else None
    if cut is None:
        return [part]
    halves = (_part(choose, band, sweep(band), core) for core, band in cut.halves(part))
    return [found for half in halves for found in _parts(sweep, choose, half, deeper - 1)]
