"""The whole job in one call: a path or data in, modes with their reasons out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Unpack

import numpy as np

from modalscope.blocks.threads import one_thread
from modalscope.identification.options import AllOptions, labels_of
from modalscope.judging.bands import merge_bands
from modalscope.judging.select import select
from modalscope.judging.stabilize import stabilize
from modalscope.modal.explained import explained, explains_enough, share_explained
from modalscope.modal.rebuilt import fit_of
from modalscope.model.analysis import Analysis
from modalscope.model.checks import DataError, check_each
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.keywords import named
from modalscope.model.kinds import check_kind
from modalscope.model.modes import ModalModel
from modalscope.model.notes import Note
from modalscope.model.result import Result
from modalscope.preprocess.quality import examine
from modalscope.preprocess.resolution import leakage_note
from modalscope.workflow.refining import refined_where_it_helps
from modalscope.workflow.sources import opened

__all__ = ["analyze"]

Progress = Callable[[int, int], None]


@named(AllOptions.__annotations__)
@one_thread
def analyze(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: Iterable[int] | None = None,
    frequencies: Iterable[float] | None = None,
    take: Iterable[float] = (),
    refuse: Iterable[float] = (),
    refine: bool = True,
    reading: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    **options: Unpack[AllOptions],
) -> Result:
    """Find the modes of a test: read it, examine the data, identify at many orders, select, and say how sure that is.

    This is what the command `modalscope identify` does. Nothing has to be set.

    Parameters
    ----------
    data : path, sequence of paths, FrequencyResponse, ImpulseResponse or Signals
        Several files are parts of one test: of the same outputs runs, of others setups (see `merge`).
    method, domain : str, optional
        A row of the table, or a name from the literature, and a column; by default what suits the data.
    orders : iterable of int, optional
        As in `stabilize`.
    frequencies : iterable of float, optional
        Hz: the modes there, and no others.
    take, refuse : iterable of float, optional
        Hz: modes to report beside the automatic ones, and automatic ones not to report.
    refine : bool
        Whether the selected modes are refined to the maximum of the likelihood where the data allow it: see `refine`. It brings
        deviations with it; `modes.unrefined` has the values before.
    reading : mapping, optional
        How the file is read: options of `read`, such as {"quantity": "acceleration"}.
    progress : callable, optional
        Called with (orders done, orders in all).
    band : (float, float) or sequence of these, optional
        Hz. Several bands are identified one by one, and their modes merged.
    **options
        Channels, block sizes and the rest, as in `identify`.

    Returns
    -------
    Result

    Raises
    ------
    DataError
        A file or data that cannot be used, an option that cannot be met, a mode that is not there.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> result = analyze(chain5().impulse_response(300, noise=0.01, seed=0))
    >>> len(result.modes), result.analysis.method is None
    (5, True)
    """
    thing, sources, told = opened(data, {} if reading is None else reading)
    bands = _bands(options.pop("band", None))
    exclude, route = options.pop("exclude", None), options.pop("route", None)
    document = Analysis(
        files=sources,
        bands=bands,
        exclude=() if exclude is None else labels_of(exclude),
        route=route or "auto",
        method=method,
        domain=domain,
        orders=None if orders is None else tuple(check_each("orders", orders, "whole numbers")),
        options={name: value for name, value in options.items() if value is not None},
        frequencies=None if frequencies is None else tuple(check_each("frequencies", frequencies, "numbers in Hz")),
        taken=tuple(check_each("take", take, "numbers in Hz")),
        refused=tuple(check_each("refuse", refuse, "numbers in Hz")),
        refine=refine,
    )
    return analyzed(thing, document, progress, told)


def analyzed(data: Any, document: Analysis, progress: Progress | None = None, told: tuple[Note, ...] = ()) -> Result:
    """Return the result of the choices in a document on data that were read; see `analyze`.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
    document : Analysis
    progress : callable, optional
    told : tuple of Note
        What of the data's file was left.
    """
    check_kind("document", document, Analysis)
    diagrams = [_diagram(data, document, band, progress) for band in document.bands or (None,)]
    modes = _selected(document, diagrams)
    findings, seen = _examined(data)
    return Result(
        modes=modes,
        diagrams=tuple(diagrams),
        findings=findings,
        notes=_each_once(
            *modes.notes,
            *told,
            *seen,
            *_leaking(data, modes, diagrams),
            *_loud(modes, diagrams),
            *(note for diagram in diagrams for note in diagram.notes),
        ),
        analysis=document,
        data=data,
    )


def _bands(band: Any) -> tuple[tuple[float, float], ...]:
    """Return one band or several as a tuple of bands."""
    if band is None:
        return ()
    listed = check_each("band", band, "two frequencies in Hz, or several such pairs")
    return tuple(listed) if listed and np.ndim(listed[0]) == 1 else (tuple(listed),)


def _diagram(
    data: Any, document: Analysis, band: tuple[float, float] | None, progress: Progress | None
) -> StabilizationDiagram:
    return stabilize(
        data,
        method=document.method,
        domain=document.domain,
        orders=document.orders,
        band=band,
        exclude=document.exclude or None,
        route=document.route,
        progress=progress,
        **document.options,
    )


def _selected(document: Analysis, diagrams: list[StabilizationDiagram]) -> ModalModel:
    """Return the modes of every band; a frequency given by hand belongs to the band that it lies in."""
    improved = refined_where_it_helps if document.refine else _as_they_are
    if len(diagrams) == 1:
        found = select(diagrams[0], frequencies=document.frequencies, take=document.taken, refuse=document.refused)
        return improved(diagrams[0], found)
    parts = []
    for diagram, (low, high) in zip(diagrams, document.bands, strict=True):
        by_hand = [
            tuple(f for f in given or () if low <= f <= high)
            for given in (document.frequencies, document.taken, document.refused)
        ]
        if document.frequencies is not None and not by_hand[0]:
            continue
        wanted = None if document.frequencies is None else by_hand[0]
        found = select(diagram, frequencies=wanted, take=by_hand[1], refuse=by_hand[2])
        parts.append(((low, high), improved(diagram, found)))
    if not parts:
        raise DataError(
            "modes at given frequencies were asked", "none of these lies in a band", "Give bands that hold them."
        )
    return merge_bands([modes for _, modes in parts], [band for band, _ in parts])


def _as_they_are(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    return modes


def _examined(data: Any) -> tuple[tuple[Any, ...], tuple[Note, ...]]:
    """Return the findings on the data, each also as a note."""
    findings = examine(data)
    return findings, tuple(Note(f"data: {finding.kind}", {}, str(finding)) for finding in findings)


def _leaking(data: Any, modes: ModalModel, diagrams: list[StabilizationDiagram]) -> tuple[Note, ...]:
    """Return a warning where frequency responses were averaged over segments too short for the modes."""
    note = leakage_note(data, diagrams[0].response, modes.frequencies, modes.damping_ratios)
    return () if note is None else (note,)


def _loud(modes: ModalModel, diagrams: list[StabilizationDiagram]) -> tuple[Note, ...]:
    """Return a warning where the modes explain little of what was measured, of one band."""
    if len(diagrams) != 1 or not len(modes):
        return ()
    left = fit_of(modes, diagrams[0].response)
    if explains_enough(left):
        return ()
    return (Note("little explained", {"share": share_explained(left), "fit_error": left}, explained(left)),)


def _each_once(*notes: Note) -> tuple[Note, ...]:
    """Return notes in order, without those that were told already."""
    return tuple(dict.fromkeys(notes))
