"""Identify every band of an analysis and select its modes, refined where it helps; a band with too many modes is cut in parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import singledispatch
from itertools import groupby
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.analysis.workflow.refining import refined_where_it_helps
from modalscope.data.analysis import Analysis
from modalscope.data.geometry import indices_of
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Records, Signals, as_records
from modalscope.data.response import Response, output_scale
from modalscope.data.responses import FrequencyResponse
from modalscope.data.results import StabilizationDiagram
from modalscope.data.setups import Setups, setups_of
from modalscope.data.shown import counted
from modalscope.data.sizes import check_size
from modalscope.data.whitening import Whitening, levelling
from modalscope.identification.diagrams import stabilize
from modalscope.identification.orders import last_poles
from modalscope.identification.stabilize import Watch
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError
from modalscope.numerics.progress import stage
from modalscope.selection.judging.bands import (
    BandData,
    Part,
    cut_of,
    ending_in,
    holds_too_little,
    joined_diagram,
    joined_modes,
    merge_bands,
    of_ends,
    terms_of,
    with_terms_of_bands,
)
from modalscope.selection.judging.no_structure import without_unforced
from modalscope.selection.judging.select import between_groups, selected
from modalscope.signals.doctor.reciprocity import by_reciprocity
from modalscope.signals.preprocess.correlation import estimate_correlation
from modalscope.signals.preprocess.spectral_peaks import levels_of

if TYPE_CHECKING:
    from modalscope.signals.preprocess.ambient_records import SeenRecord

Progress = Callable[[int, int], None]
Choose = Callable[..., ModalModel]
Band = tuple[float, float] | None
Sweep = Callable[..., StabilizationDiagram]

#: Lines so far beyond either end of a band, as a part of that end, may be fitted with it: a mode at an end, or just outside, is seen whole.
#: In 80 bands that end among modes (seeds 94000-94039 and 95000-95039 of `tests.analysis.workflow.last_fit.part_of_a_band`) 306 of 312
#: modes are listed instead of 296.
_BEYOND = 0.1

#: Maximum number of times that a band is cut in two: into eight parts; and that orders are doubled for clear peaks.
_MAX_CUTS, _MAX_DOUBLINGS = 3, 2


@dataclass(frozen=True, eq=False, slots=True)
class Look:
    """One identified band of an analysis.

    `diagram`: of the whole band, joined of its parts. `fitted`: with the lines beyond the ends of the band that were fitted with it.
    `band`: Hz; None for all data. `parts`: with a range of orders each; none where orders, frequencies or several bands were given.
    `notes`: why this band. `setup`: its index, where setups are identified apart. `seen`: the examined record, where it is one without
    inputs.
    """

    diagram: StabilizationDiagram
    fitted: StabilizationDiagram
    band: Band = None
    parts: tuple[Part, ...] = ()
    notes: tuple[Note, ...] = ()
    setup: int = 0
    seen: SeenRecord | None = None

    @property
    def reported(self) -> tuple[float, float]:
        """Hz: the ends of the band."""
        return self.band or self.diagram.response.reported_band(None)


def looked_at(
    data: Any,
    document: Analysis,
    progress: Progress | None = None,
    watch: Watch | None = None,
    choose: Choose = selected,
) -> list[Look]:
    """Identify every band of an analysis; cut one with automatic orders where it has more modes than these can hold.

    `progress`, `watch`: as in `stabilize`. `choose`: `select`, or a version of it that caches its parts.
    """
    if document.apart:
        alone = replace(document, exclude=(), apart=False)
        return [
            replace(look, setup=k)
            for k, part in enumerate(setups_apart(data, document))
            for look in looked_at(part, alone, progress, watch, choose)
        ]

    seen, ambient = _seen(data, document)
    seen, reciprocal, told = _exchanged(seen, document)
    level = _levels(seen, document)

    def sweep(band: Band, orders: Sequence[int] | None = document.orders) -> StabilizationDiagram:
        within = seen if level is None else level.of_response(seen)
        found = stabilize(
            within,
            method=document.method,
            domain=document.domain,
            orders=orders,
            band=band,
            exclude=document.exclude or None,
            route=document.route,
            reciprocal=reciprocal,
            progress=progress,
            watch=watch,
            **document.options,
        )
        if level is None:
            return found
        own = _of_channels(level, seen, found.response)
        return in_units(found, own, seen if found.response.values is within.values else None)

    bands: tuple[tuple[float, float], ...] = document.bands
    if not bands and document.orders is None:
        bands, of_bands = _bands_of(seen, document)
        told = (*told, *of_bands)
    if len(bands) > 1 or document.orders is not None or document.frequencies is not None:
        by_hand = document.orders is not None or document.frequencies is not None
        swept = sweep if by_hand else lambda band: _with_clear_peaks(ambient, sweep, band, choose)
        found = [(band, swept(_fitted(seen, band))) for band in bands or (None,)]
        return [Look(ending_in(each, band), each, band, notes=told, seen=ambient) for band, each in found]
    band = bands[0] if bands else None
    ends = _fitted(seen, band)
    whole = _with_clear_peaks(ambient, sweep, ends, choose)
    by_line = not isinstance(document.options.get("weights"), str | None)  # they belong to the lines of the whole band
    parts = _parts(sweep, choose, _part(choose, ends, whole, band), 0 if by_line else _MAX_CUTS)
    shown = ending_in(whole, band)
    return [
        Look(shown if len(parts) == 1 else joined_diagram(shown, parts), whole, band, tuple(parts), told, seen=ambient)
    ]


#: Options of single channels: they are meant for the channels as they are.
_OF_SIDES = (f"{side}_{what}" for side in ("row", "column") for what in ("subsets", "weights", "compression"))
_OF_CHANNELS = frozenset(("initial_values", *_OF_SIDES))


def _exchanged(data: Any, document: Analysis) -> tuple[Any, bool | None, tuple[Note, ...]]:
    """Return responses exchanged by reciprocity where that is asked or helps, what is left to ask, and notes.

    Of the channels and lines that are analysed, as they were measured: levels of single channels leave nothing reciprocal.
    """
    if not _plain(data) or data.exchanged:
        return data, document.reciprocal, ()
    kept = data.select(exclude=document.exclude) if document.exclude else data
    if document.bands:
        kept = kept.in_band((min(low for low, _ in document.bands), max(high for _, high in document.bands)))
    found, notes = by_reciprocity(kept, document.reciprocal)
    if found.exchanged:
        return data.transposed(), document.reciprocal, notes
    return data, False if notes else document.reciprocal, notes


def _levels(data: Any, document: Analysis) -> Whitening | None:
    """Return levels by which outputs and inputs of responses are of one size, so that no unit counts; None of other data."""
    if not _plain(data):
        return None
    check_size(data)
    return None if _OF_CHANNELS & set(document.options) else levelling(data.values)


def _plain(data: Any) -> bool:
    """Whether data are responses to forces that act one by one."""
    return isinstance(data, Response) and data.separable and not data.of_correlations


def _of_channels(level: Whitening, whole: Response, part: Response) -> Whitening:
    """Return levels of the channels that a part of a response has."""
    outputs = indices_of("output", part.output_dofs, whole.output_dofs)
    inputs = indices_of("input", part.input_dofs, whole.input_dofs)
    return Whitening(level.outputs[outputs], level.references[inputs])


def in_units(diagram: StabilizationDiagram, level: Whitening, whole: Response | None = None) -> StabilizationDiagram:
    """Return a diagram of levelled channels as that of the channels, which knows how they were levelled.

    `level`: of the diagram's own channels. `whole`: what its response is where nothing of that was left out or changed.
    """
    return diagram.changed(
        response=level.inverse.of_response(diagram.response) if whole is None else whole,
        measured=None if diagram.measured is None else level.inverse.of_response(diagram.measured),
        shapes=level.outputs_back(diagram.shapes),
        participation=level.references_back(diagram.participation),
        output_whitening=level.outputs,
        reference_whitening=level.references,
    )


def _fitted(data: Any, band: Band) -> Band:
    """Return the band (Hz) whose lines are fitted for a band that was asked: to where the response is least within a tenth beyond each end.

    The same band where no lines are cut to it.
    """
    seen = None if band is None else _level(data)
    if band is None or seen is None:
        return band
    (f, level), (low, high) = seen, band
    below, above = (f >= low * (1 - _BEYOND)) & (f <= low), (f >= high) & (f <= high * (1 + _BEYOND))
    ends = [
        float(f[side][np.argmin(level[side])]) if side.any() else end for end, side in ((low, below), (high, above))
    ]
    return ends[0], ends[1]


@singledispatch
def _level(data: Any) -> tuple[RealArray, RealArray] | None:
    """Return frequencies (Hz) and the mean square of the outputs there, each relative to its own; None of data without lines."""
    return None


@_level.register
def _(data: FrequencyResponse) -> tuple[RealArray, RealArray]:
    return data.frequencies, np.asarray(np.mean(np.abs(data.values / output_scale(data)[:, None]) ** 2, axis=(1, 2)))


@_level.register(Signals)
@_level.register(Records)
def _(data: Signals | Records) -> tuple[RealArray, RealArray]:
    """Of the longest run."""
    seen = levels_of(max(as_records(data).runs, key=lambda run: run.samples))
    return seen.frequencies, np.asarray(seen.levels.mean(axis=1))


def _seen(data: Any, document: Analysis) -> tuple[Any, SeenRecord | None]:
    """Return data as they are identified, and the same as an examined record without inputs where they are one."""
    if isinstance(data, Response):
        return data, None
    from modalscope.signals.preprocess.ambient_records import (  # responses need none of its checks
        SeenRecord,
        looked_through,
    )

    late: Any = document.options.get("delays")
    seen = looked_through(data, document.exclude or None, late)
    return seen, seen if isinstance(seen, SeenRecord) else None


def _bands_of(seen: Any, document: Analysis) -> tuple[tuple[tuple[float, float], ...], tuple[Note, ...]]:
    """Return the bands of records without inputs, none of others, and notes on them."""
    if isinstance(seen, Response):
        return (), ()
    from modalscope.signals.preprocess.ambient_records import bands_of_record, bands_of_setups

    if setups_of(seen):
        return bands_of_setups(seen.select(exclude=document.exclude) if document.exclude else seen)
    return bands_of_record(seen)


def _with_clear_peaks(seen: SeenRecord | None, sweep: Sweep, band: Band, choose: Choose) -> StabilizationDiagram:
    """Return the diagram of a band; of more orders as long as clear peaks of an ambient record then get the modes that they lack."""
    found = sweep(band)
    if seen is None:
        return found
    from modalscope.analysis.workflow.ambient_lines import machines_in, peaks_in, without_mode

    peaks = peaks_in(seen.levels, [found.response.reported_band(found.settings.band)], machines_in(seen.lines))
    lacking = len(without_mode(peaks, choose(found)))
    for _ in range(_MAX_DOUBLINGS):
        if not lacking:
            break
        more = sweep(band, range(2, 2 * found.orders[-1] + 1, 2))
        still = len(without_mode(peaks, choose(more)))
        if still >= lacking:
            break
        text = f"orders extended to {more.orders[-1]}: {counted(lacking - still, 'clear peak')} had no mode at {found.orders[-1]}"
        found = replace(more, notes=(*more.notes, Note("orders grew", {"largest": more.orders[-1]}, text)))
        lacking = still
    return found


def setups_apart(data: Any, document: Analysis) -> tuple[Signals, ...]:
    """Return the records of every setup without the excluded channels; raise `DataError` for other data and several bands."""
    if not setups_of(data) or len(document.bands) > 1:
        have = f"there is {type(data).__name__} with {counted(len(document.bands), 'band')}"
        change = "Give several ambient records with common outputs, and one band or none."
        raise DataError("identifying setups apart:", have, change)
    return setups_of(data.select(exclude=document.exclude) if document.exclude else data)


def _part(choose: Choose, band: Band, diagram: StabilizationDiagram, core: Band = None) -> Part:
    low, high = diagram.response.reported_band(band)
    return Part(
        (low, high) if core is None else (max(low, core[0]), min(high, core[1])), band, diagram, choose(diagram)
    )


def _parts(sweep: Sweep, choose: Choose, part: Part, deeper: int) -> list[Part]:
    """Return a part, cut in two as long as its orders do not hold it."""
    cut = cut_of(part) if deeper and holds_too_little(part.diagram, part.modes) else None
    if cut is None:
        return [part]
    halves = (_part(choose, band, sweep(band), core) for core, band in cut.halves(part))
    return [found for half in halves for found in _parts(sweep, choose, half, deeper - 1)]


def modes_chosen(data: Any, document: Analysis, looks: Sequence[Look], choose: Choose = selected) -> ModalModel:
    """Return the modes of all identified bands, refined where that was asked and helps; `choose`: as in `looked_at`."""
    if not setups_of(data):
        seen = looks[0].seen
        if seen is None:
            return _of_bands(document, looks, choose)
        from modalscope.analysis.workflow.ambient_lines import with_lines_of_record

        found, diagrams = _of_bands(replace(document, refine=False), looks, choose), [look.diagram for look in looks]
        found = with_lines_of_record(seen, found, diagrams, chosen=document.frequencies is None, refine=document.refine)
        return _with_terms_of_correlations(found, looks)
    from modalscope.analysis.workflow.ambient_lines import with_lines_of_setups

    found = _of_setups(data, replace(document, refine=False), looks, choose)
    kept = data.select(exclude=document.exclude) if document.exclude else data
    if document.refine:
        from modalscope.selection.likelihood.refine_setups import refine_setups

        found = refine_setups(kept, found, apart=document.apart)
    found = with_lines_of_setups(kept, found)
    return found if document.apart else _with_terms_of_correlations(found, looks)


def _with_terms_of_correlations(modes: ModalModel, looks: Sequence[Look]) -> ModalModel:
    """Return modes of correlations with residual terms: the poles of the last order that the correlations need besides them."""
    if not len(modes):
        return modes
    bands = [BandData(look.diagram.response, look.reported, last_poles(look.diagram)) for look in looks]
    return with_terms_of_bands(modes, bands)


def _of_setups(data: Setups, document: Analysis, looks: Sequence[Look], choose: Choose) -> ModalModel:
    """Return the modes of setups that were identified together, or one by one and merged."""
    if not document.apart:
        return _of_bands(document, looks, choose, between=True)
    from modalscope.analysis.workflow.setups import merge_modes

    return merge_modes(
        [_of_bands(document, list(apart), choose) for _, apart in groupby(looks, key=attrgetter("setup"))],
        responses=[estimate_correlation(part) for part in setups_apart(data, document)],
        groups=data.groups,
    )


def _of_bands(document: Analysis, looks: Sequence[Look], choose: Choose, *, between: bool = False) -> ModalModel:
    """Return the modes of every band, with their repeatability `between` setups; frequencies given by hand belong to their band."""
    if len(looks) == 1:
        return _repeated(_of_band(document, looks[0], choose), looks[0], between)
    parts: list[tuple[Look, ModalModel]] = []
    for look in looks:
        low, high = look.reported
        frequencies, taken, refused = (
            tuple(f for f in given or () if low <= f <= high)
            for given in (document.frequencies, document.taken, document.refused)
        )
        if document.frequencies is not None and not frequencies:
            continue
        here = replace(
            document, frequencies=None if document.frequencies is None else frequencies, taken=taken, refused=refused
        )
        parts.append((look, _repeated(_of_band(here, look, choose), look, between)))
    if not parts:
        raise DataError("the given frequencies need to lie in a band", "none does", "Give bands that contain them.")
    level = np.sqrt(np.mean([output_scale(look.diagram.response) ** 2 for look, _ in parts], axis=0))
    merged = merge_bands([modes for _, modes in parts], [look.reported for look, _ in parts], level=level)
    if looks[0].diagram.response.ambient or not len(merged):  # their shapes are still to come
        return merged
    return with_terms_of_bands(
        merged, [BandData(look.diagram.response, look.reported, *terms_of(modes)) for look, modes in parts]
    )


def _repeated(modes: ModalModel, look: Look, between: bool) -> ModalModel:
    if not between:
        return modes
    from modalscope.analysis.workflow.setups import with_repeatability

    return with_repeatability(modes, look.diagram.response)


def _of_band(document: Analysis, look: Look, choose: Choose) -> ModalModel:
    """Return the modes of one band."""

    def improved(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
        if not document.refine:
            return between_groups(diagram, modes)
        with stage("refining"):
            found = refined_where_it_helps(diagram, modes)
            by_hand = document.frequencies is not None or document.taken
            return found if by_hand else without_unforced(diagram, found)

    if not look.parts:
        by_hand = {"frequencies": document.frequencies, "take": document.taken, "refuse": document.refused}
        return of_ends(improved(look.fitted, choose(look.fitted, **by_hand)), look.diagram, look.fitted)
    cuts = [part.core[1] for part in look.parts[:-1]]

    def reported(k: int, part: Part) -> ModalModel:
        take, refuse = (
            [f for f in given if np.searchsorted(cuts, f) == k] for given in (document.taken, document.refused)
        )
        found = choose(part.diagram, take=take, refuse=refuse) if take or refuse else part.modes
        return improved(part.diagram, found)

    models = [reported(k, part) for k, part in enumerate(look.parts)]
    if len(models) == 1:
        return of_ends(models[0], look.diagram, look.fitted)
    return joined_modes(look.parts, models, look.diagram.response)
