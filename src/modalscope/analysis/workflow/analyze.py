"""Analyse a test: read, examine, identify at many orders, select and refine the modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Unpack

import numpy as np

from modalscope.analysis.workflow.bands import Choose, Look, looked_at, modes_chosen
from modalscope.analysis.workflow.sources import Reading, opened
from modalscope.data.analysis import Analysis
from modalscope.data.channels import choose_channels
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.rebuilt import (
    explains_enough,
    fit_error_heard,
    of_band,
    of_noise,
    rebuilt,
    share_explained,
    unexplained,
)
from modalscope.data.response import Response
from modalscope.data.results import Result, StabilizationDiagram
from modalscope.data.shown import summary_of
from modalscope.identification.method import checked_orders
from modalscope.identification.options import AllOptions, labels_of
from modalscope.io.options import EVERY, FIELDS
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, check_each, check_kind
from modalscope.numerics.progress import LOG, stage, tell
from modalscope.numerics.resources import one_thread
from modalscope.selection.judging.select import selected
from modalscope.selection.judging.surroundings import (
    EXPLAINED_NEARBY,
    LEFT_AT_END,
    OF_NYQUIST,
    explained_nearby,
    left_at_end,
    note_on_ends,
    note_on_window,
    with_reasons,
)
from modalscope.selection.likelihood.joint_fit import for_judging
from modalscope.selection.likelihood.noise import undenied
from modalscope.signals.doctor.examine import examine
from modalscope.signals.doctor.responses import sampled
from modalscope.signals.preprocess.excitation import still_there
from modalscope.signals.preprocess.frf import leakage_note

Progress = Callable[[int, int], None]


@named(AllOptions.__annotations__, elsewhere=dict.fromkeys((*FIELDS, *EVERY), ("reading={...}",)))
@one_thread
def analyze(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: int | Iterable[int] | None = None,
    frequencies: Iterable[float] | None = None,
    take: Iterable[float] = (),
    refuse: Iterable[float] = (),
    refine: bool = True,
    apart: bool = False,
    reading: Reading | None = None,
    progress: Progress | None = None,
    **options: Unpack[AllOptions],
) -> Result:
    """Find the modes of a test: read it, examine the data, identify at many orders, select modes and their uncertainty.

    This is what the command `modalscope identify` does. Nothing has to be set.

    Parameters
    ----------
    data : path, sequence of paths, FrequencyResponse, ImpulseResponse, Signals, or an object of pandas or xarray
        Several files are parts of one test: of the same outputs runs, of others setups (see `merge`). Objects of pandas and xarray are
        taken as `from_frame` takes them. The name of a measured test that comes with the program stands for its file.
    method, domain : str, optional
        A row of the table, or a name from the literature, and a column; by default what suits the data.
    orders : int or iterable of int, optional
        As in `stabilize`.
    frequencies : iterable of float, optional
        Hz: the modes there, and no others.
    take, refuse : iterable of float, optional
        Hz: modes to report beside the automatic ones, and automatic ones not to report.
    refine : bool
        Whether the selected modes are refined to the maximum of the likelihood where the data allow it (see `refine`), with standard
        deviations; `modes.unrefined` has the values before.
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
    exclude, route = options.pop("exclude", None), options.pop("route", None)
    excluded = () if exclude is None else labels_of(exclude)
    given = {} if reading is None else reading
    opened_data, sources, notes = opened(data, given, decays=route in (None, "auto"), exclude=excluded)
    bands = _bands(options.pop("band", None))
    reciprocal = options.pop("reciprocal", None)
    document = Analysis(
        files=sources,
        bands=bands,
        exclude=still_there(excluded, notes),
        route=route or "auto",
        reciprocal=reciprocal,
        method=method,
        domain=domain,
        orders=None if orders is None else tuple(checked_orders(orders)),
        options={name: value for name, value in options.items() if value is not None},
        frequencies=None if frequencies is None else tuple(check_each("frequencies", frequencies, "numbers in Hz")),
        taken=tuple(check_each("take", take, "numbers in Hz")),
        refused=tuple(check_each("refuse", refuse, "numbers in Hz")),
        refine=refine,
        apart=apart,
    )
    return analyzed(opened_data, document, progress, notes)


def analyzed(data: Any, document: Analysis, progress: Progress | None = None, told: tuple[Note, ...] = ()) -> Result:
    """Return the result of the choices in a document on data that were read; `told`: notes of reading. See `analyze`."""
    check_kind("document", document, Analysis)
    result = concluded(data, document, looked_at(data, document, progress), told)
    tell(summary_of(result.data), summary_of(result.modes), *result.notes)
    for settings in result.settings:
        LOG.debug("settings: %s", settings)
    return result


def concluded(
    data: Any,
    document: Analysis,
    looks: Sequence[Look],
    told: tuple[Note, ...] = (),
    choose: Choose = selected,
    check: Callable[[Any], tuple[Any, ...]] = examine,
) -> Result:
    """Return the result of identified bands: select and refine their modes, examine the data.

    `told`: notes of reading. `choose`, `check`: `select` and `examine`, or versions of them that cache their parts.
    """
    diagrams = [look.diagram for look in looks]
    modes, fit = _explained(data, modes_chosen(data, document, looks, choose), diagrams)
    # leakage harms frequency responses alone: records on lines eliminate what a run begins and ends with, decays end anywhere
    harmless = ("leakage",) if all(diagram.settings.route in ("records", "decays") for diagram in diagrams) else ()
    excluded = _excluded(data, document)
    with stage("examining"):
        every = check(data)
    findings = tuple(
        finding.beside(document.bands)
        for finding in every
        if finding.kind not in harmless and (not finding.channels or set(finding.channels) - excluded)
    )
    response = diagrams[0].response
    if any(finding.kind == "leakage" for finding in findings):
        modes = with_reasons(modes, {LEFT_AT_END: left_at_end(response, modes)})
    leakage = (
        (note_on_ends(response, modes), note_on_window(response, modes))
        if isinstance(data, Response) and not response.ambient
        else (leakage_note(data, response, modes.frequencies, modes.damping_ratios),)
    )
    notes = [
        *modes.notes,
        *(note for look in looks for note in look.notes),
        *told,
        *(Note(f"data: {finding.kind}", {}, str(finding)) for finding in findings),
        *sampled(data),
        *(note for note in leakage if note is not None),
        *fit,
        *undenied(modes, (note for diagram in diagrams for note in diagram.notes)),
    ]
    return Result(
        modes=modes,
        diagrams=tuple(diagrams),
        findings=findings,
        notes=tuple(dict.fromkeys(notes)),
        analysis=document,
        data=_as_identified(data, diagrams[0]),
    )


def _as_identified(data: Any, diagram: StabilizationDiagram) -> Any:
    """Return responses with inputs and outputs exchanged where they were identified so."""
    turned = isinstance(data, Response) and diagram.response.exchanged and not data.exchanged
    return data.transposed() if turned else data


def _bands(band: Any) -> tuple[tuple[float, float], ...]:
    """Return one band or several as a tuple of bands."""
    if band is None:
        return ()
    listed = check_each("band", band, "two frequencies in Hz, or several such pairs")
    return tuple(listed) if listed and np.ndim(listed[0]) == 1 else (tuple(listed),)


def _excluded(data: Any, document: Analysis) -> set[str]:
    """Return the labels of the excluded channels, whose findings need no answer any more."""
    rows, columns = choose_channels(data.output_dofs, data.input_dofs, None, None, document.exclude)
    kept = {*(data.output_dofs[i] for i in rows), *(data.input_dofs[i] for i in columns)}
    return {*data.output_dofs, *data.input_dofs} - kept


def _explained(
    data: Any, modes: ModalModel, diagrams: Sequence[StabilizationDiagram]
) -> tuple[ModalModel, tuple[Note, ...]]:
    """Return modes with the explained part of the response around each, and the unexplained part of a band.

    A warning where they explain little, and the lines of noise that are not counted.
    """
    if not len(modes):
        return modes, of_noise(diagrams[0].response) if len(diagrams) == 1 else ()
    nearby, notes = np.full(len(modes), np.nan), tuple[Note, ...]()
    for diagram in diagrams:
        response = diagram.response
        channels = None if modes.participation is None else (len(modes.shapes), modes.participation.shape[1])
        if response.values.shape[1:] != channels:  # setups apart: each has channels of its own
            continue
        fitted = rebuilt(response, for_judging(response, of_band(modes, diagram, len(diagrams))))
        nearby = np.fmax(nearby, explained_nearby(response, fitted, modes))
        notes = _unexplained(response, fitted) if len(diagrams) == 1 else ()
    rate = getattr(getattr(data, "parts", (data,))[0], "sampling_rate", None)
    highest = rate / 2 if rate is not None and diagrams[0].response.ambient else np.nan
    return with_reasons(modes, {EXPLAINED_NEARBY: nearby, OF_NYQUIST: modes.frequencies / highest}), notes


def _unexplained(response: Response, fitted: Array) -> tuple[Note, ...]:
    error, noise = fit_error_heard(response, fitted)[0], of_noise(response)
    if explains_enough(error):
        return noise
    return (*noise, Note("little explained", {"share": share_explained(error), "fit_error": error}, unexplained(error)))
