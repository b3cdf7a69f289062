"""The whole job in one call: a path or data in, modes with their reasons out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Unpack

import numpy as np

from modalscope.data.analysis import Analysis
from modalscope.data.channels import choose_channels
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.results import Result, StabilizationDiagram
from modalscope.doctor.examine import examine
from modalscope.identification.options import AllOptions, labels_of
from modalscope.judging.select import select
from modalscope.modal.rebuilt import explained, explains_enough, fit_of, of_noise, share_explained
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_each, check_kind
from modalscope.numerics.resources import one_thread
from modalscope.preprocess.frf import leakage_note
from modalscope.workflow.bands import Choose, Look, looked_at, modes_chosen
from modalscope.workflow.sources import Reading, opened

__all__ = ["analyze", "analyzed", "concluded"]

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
    apart: bool = False,
    reading: Reading | None = None,
    progress: Progress | None = None,
    **options: Unpack[AllOptions],
) -> Result:
    """Find the modes of a test: read it, examine the data, identify at many orders, select, and say how sure that is.

    This is what the command `modalscope identify` does. Nothing has to be set.

    Parameters
    ----------
    data : path, sequence of paths, FrequencyResponse, ImpulseResponse, Signals, or an object of pandas or xarray
        Several files are parts of one test: of the same outputs runs, of others setups (see `merge`). Objects of pandas and xarray are
        taken as `from_frame` takes them.
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
    apart : bool
        Whether ambient setups are identified one by one and their modes put together (see `merge_modes`); by default they are
        identified together.
    reading : mapping, or one for each file, optional
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
        apart=apart,
    )
    return analyzed(thing, document, progress, told)


def analyzed(data: Any, document: Analysis, progress: Progress | None = None, told: tuple[Note, ...] = ()) -> Result:
    """Return the result of the choices in a document on data that were read; see `analyze`.

    `told`: what of the data's file was left.
    """
    check_kind("document", document, Analysis)
    return concluded(data, document, looked_at(data, document, progress), told)


def concluded(
    data: Any,
    document: Analysis,
    looks: Sequence[Look],
    told: tuple[Note, ...] = (),
    choose: Choose = select,
    check: Callable[[Any], tuple[Any, ...]] = examine,
) -> Result:
    """Return the result of bands that were identified: their modes chosen and refined, the data examined.

    `looks`: one a band of the document. `told`: what of the data's file was left. `choose`, `check`: `select` and `examine`, or what
    keeps their parts from one choice to the next.
    """
    modes, diagrams = modes_chosen(data, document, looks, choose), [look.diagram for look in looks]
    harmless, out = _harmless(diagrams), _left_out(data, document)
    told_of = [finding for finding in check(data) if finding.kind not in harmless]
    findings = tuple(
        finding.beside(document.bands) for finding in told_of if not finding.channels or set(finding.channels) - out
    )
    seen = tuple(Note(f"data: {finding.kind}", {}, str(finding)) for finding in findings)
    return Result(
        modes=modes,
        diagrams=tuple(diagrams),
        findings=findings,
        notes=_each_once(
            *modes.notes,
            *(note for look in looks for note in look.notes),
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


def _harmless(diagrams: Sequence[StabilizationDiagram]) -> tuple[str, ...]:
    """Return the kinds of findings that harm frequency responses alone: records on lines eliminate what a run begins and ends with."""
    return ("leakage",) if all(diagram.settings.route == "records" for diagram in diagrams) else ()


def _left_out(data: Any, document: Analysis) -> set[str]:
    """Return the labels of the channels that were left out: what was seen in these alone has been answered."""
    if not document.exclude:
        return set()
    rows, columns = choose_channels(data.output_dofs, data.input_dofs, None, None, document.exclude)
    kept = {*(data.output_dofs[i] for i in rows), *(data.input_dofs[i] for i in columns)}
    return {*data.output_dofs, *data.input_dofs} - kept


def _leaking(data: Any, modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> tuple[Note, ...]:
    """Return a warning where frequency responses were averaged over segments too short for the modes."""
    note = leakage_note(data, diagrams[0].response, modes.frequencies, modes.damping_ratios)
    return () if note is None else (note,)


def _loud(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> tuple[Note, ...]:
    """Return a warning where the modes explain little of what was measured, of one band, and what is not counted there."""
    if len(diagrams) != 1:
        return ()
    unheard = of_noise(diagrams[0].response)
    left = fit_of(modes, diagrams[0].response) if len(modes) else 0.0
    if explains_enough(left):
        return unheard
    return (*unheard, Note("little explained", {"share": share_explained(left), "fit_error": left}, explained(left)))


def _each_once(*notes: Note) -> tuple[Note, ...]:
    """Return notes in order, without those that were told already."""
    return tuple(dict.fromkeys(notes))
