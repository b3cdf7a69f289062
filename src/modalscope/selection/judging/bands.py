"""Merge modes that were selected in several bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.deferred import Deferred
from modalscope.data.indicators import with_indicators_of_shapes
from modalscope.data.mode_fields import PER_MODE, joined
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.residual_terms import ResidualTerms
from modalscope.data.response import Response, output_scale
from modalscope.data.results import DEVIATIONS, StabilizationDiagram
from modalscope.data.sameness import divided, log_ratios
from modalscope.identification.orders import ORDERS_END, last_poles
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import (
    Array,
    ComplexArray,
    IntArray,
    RealArray,
    check_band,
    check_each,
    check_kind,
    optional_array,
)
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.selection.judging.bare_peaks import BARE, with_note_on_peaks
from modalscope.selection.judging.selection_problem import MAX_DAMPING_OF_RESONANCES
from modalscope.selection.likelihood.joint_fit import with_terms
from modalscope.selection.likelihood.settling import needed_beside, out_of_band_poles


@named()
def merge_bands(
    results: Sequence[ModalModel], bands: Sequence[tuple[float, float]], *, tolerance: float = 0.005, level: Any = None
) -> ModalModel:
    """Return the modes of several bands by frequency, those that lie in two of them once.

    Modes outside their own band are left out. Of two that are the same (see `same_mode`) the one that lies deeper inside its band stays:
    near an edge part of the resonance is missing.

    Parameters
    ----------
    results : sequence of ModalModel
        Of the same outputs and inputs.
    bands : sequence of (float, float)
        Of each result, Hz.
    tolerance : float
        Relative standard deviation by which the edge of a band may bias a frequency.
    level : array, (outputs,), optional
        What outputs are divided by before shapes are compared: their size in the data, so that no unit counts.

    Raises
    ------
    DataError
        No result, a band for each is missing, or other channels.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> len(merge_bands([modes, modes], [(0, 4.5), (4, 8)]))
    5
    """
    results = check_each("merge_bands", results, "a list of modes, one per band")
    for result in results:
        check_kind("each result of a band", result, ModalModel)
    bands = [check_band(band) for band in check_each("bands", bands, "a list of pairs in Hz")]
    if not results or len(results) != len(bands):
        raise DataError(
            "merge_bands: one band per result:",
            f"there are {len(results)} results and {len(bands)} bands",
            "Give one band for each result.",
        )
    _same_channels(results)
    inside: list[ModalModel] = [
        modes.take((modes.frequencies >= low) & (modes.frequencies <= high))
        for modes, (low, high) in zip(results, bands, strict=True)
    ]
    origin = np.concatenate([np.full(len(modes), i) for i, modes in enumerate(inside)])
    everything = joined(inside)
    f = everything.frequencies
    ends = np.array(bands, dtype=float)[origin.astype(int)].reshape(-1, 2)
    depth = np.minimum(f - ends[:, 0], ends[:, 1] - f) / f
    size = optional_array("level", level, "(outputs,)", (len(everything.output_dofs),))
    even = everything if size is None else divided(everything, size)
    same = log_ratios(even, even, tolerance) > 0
    kept: list[int] = []
    for i in np.argsort(-depth, kind="stable"):
        if not np.any(same[i, kept] & (origin[kept] != origin[i])):
            kept.append(int(i))
    order = np.array(sorted(kept, key=lambda i: f[i]), dtype=int)
    words = ", ".join(f"{low:g} to {high:g} Hz" for low, high in bands)
    return everything.take(order).processed(f"merged from bands {words}")


def evened(parts: Sequence[ModalModel]) -> list[ModalModel]:
    """Return modes of several parts with the same fields: NaN where only others have a value, the start where one is not refined."""
    axes = {**dict.fromkeys(PER_MODE, ()), "degrees": (2,)}
    known = [name for name in axes if any(getattr(part, name) is not None for part in parts)]
    refined = any(part.unrefined is not None for part in parts)
    filled = []
    for part in parts:
        missing: dict[str, Any] = {
            name: np.full((len(part), *axes[name]), np.nan) for name in known if getattr(part, name) is None
        }
        if refined and part.unrefined is None:
            missing["unrefined"] = part
        filled.append(replace(part, **missing) if missing else part)
    return filled


def _same_channels(results: Sequence[ModalModel]) -> None:
    first = results[0]
    for other in results[1:]:
        if other.output_dofs != first.output_dofs or other.input_dofs != first.input_dofs:
            raise DataError(
                "merge_bands: results of the same channels:",
                "outputs or inputs differ",
                "Select the same channels in every band.",
            )


# --------------------------------------------------------------------------------------------------------------- parts
# A band that one ladder of orders cannot hold: where it is cut, and its parts as one diagram and one list of modes.

#: A core, and the band around it, Hz.
Ends = tuple[tuple[float, float], tuple[float, float]]

#: The kind of the note that says that a band was identified in parts.
SPLIT = "band split"

#: Parts overlap on either side of a cut by this many half bandwidths of the median damping ratio, where the edge of a band biases
#: poles, and at most by this fraction of the frequency.
_EDGE_HALF_BANDWIDTHS, _MAX_OVERLAP = 10.0, 0.1

#: Minimum number of lines of a part: two for each order tried by default, so that the orders are not limited by the lines.
_MIN_LINES = 160


@dataclass(frozen=True, eq=False, slots=True)
class Part:
    """A part of a band: what it reports, and what was identified for that.

    `core`: hz: its modes lie here. `band`: hz: its data, which reach further; None for all. `modes`: selected automatically.
    """

    core: tuple[float, float]
    band: tuple[float, float] | None
    diagram: StabilizationDiagram
    modes: ModalModel


@dataclass(frozen=True, slots=True)
class Cut:
    """Where a part is cut, and how far the data of either half reach.

    `at`: hz. `lower`, `upper`: hz: the upper end of the lower half's data, and the lower end of the upper half's.
    """

    at: float
    lower: float
    upper: float

    def halves(self, part: Part) -> tuple[Ends, Ends]:
        """Return core and band of the lower and of the upper half."""
        low, high = part.core if part.band is None else part.band
        return ((part.core[0], self.at), (low, self.lower)), ((self.at, part.core[1]), (self.upper, high))


def holds_too_little(diagram: StabilizationDiagram, modes: ModalModel) -> bool:
    """Return whether the orders of a diagram end before its data do: the fit still falls, or modes come up at the last orders only.

    `modes`: selected from it.
    """
    return any(note.kind == ORDERS_END for note in (*diagram.notes, *modes.notes))


def cut_of(part: Part) -> Cut | None:
    """Return where a part is cut in two; None where it cannot be.

    Each half has a quarter of the resonances of the best order at least. Between these bounds the cut lies in the widest gap between
    neighbours, in half bandwidths of both.
    """
    response, (low, high) = part.diagram.response, part.core
    f, zeta = _resonances(part.diagram, low, high)
    if f.size < 4 or response.grid is None or response.in_band((low, (low + high) / 2)) is response:
        return None
    between = np.arange(f.size // 4, f.size - f.size // 4 - 1)
    if not between.size:
        between = np.array([f.size // 2 - 1])
    width = f * zeta
    gap = (f[between + 1] - f[between]) / (width[between + 1] + width[between])
    k = int(between[np.argmax(gap)])
    cut = float((f[k] * width[k + 1] + f[k + 1] * width[k]) / (width[k] + width[k + 1]))
    room = min(_EDGE_HALF_BANDWIDTHS * float(np.median(zeta)), _MAX_OVERLAP)
    lower, upper = cut * (1 + room), cut / (1 + room)
    lines = response.grid
    counts = np.count_nonzero(lines <= lower), np.count_nonzero(lines >= upper)
    if min(counts) < _MIN_LINES:
        return None
    return Cut(cut, lower, upper)


def _resonances(diagram: StabilizationDiagram, low: float, high: float) -> tuple[RealArray, RealArray]:
    """Return frequencies and damping ratios of the lightly damped poles of the order that fits best, by frequency."""
    best = diagram.orders[int(np.argmin(diagram.fit_errors))]
    f, zeta = frequencies_and_damping(diagram.poles[(diagram.order_of_pole == best) & (diagram.poles.imag > 0)])
    kept = (f > low) & (f < high) & (zeta > 0) & (zeta < MAX_DAMPING_OF_RESONANCES)
    order = np.argsort(f[kept], kind="stable")
    return f[kept][order], zeta[kept][order]


def joined_modes(parts: Sequence[Part], modes: Sequence[ModalModel], whole: Response) -> ModalModel:
    """Return the modes of the parts of one band, each once, with residues fitted together to the whole.

    A part reports what lies in its core, and a half bandwidth around it: a mode at a cut may fall on either side.

    `modes`: those that each part reports, refined or not.
    """
    inside = evened([_of_core(each, part.core) for part, each in zip(parts, modes, strict=True)])
    merged = merge_bands(inside, [part.band or part.core for part in parts], level=output_scale(whole))
    if not len(merged):
        return merged
    merged = with_terms(whole, merged, np.zeros(0, complex), whole.outside_powers)
    bands = [
        BandData(whole.in_band(part.core), part.core, *terms_of(each)) for part, each in zip(parts, modes, strict=True)
    ]
    joined = with_terms_of_bands(replace(merged, scaling="as fitted").normalized("unit"), bands)
    return with_note_on_peaks(with_indicators_of_shapes(joined), whole, (parts[0].core[0], parts[-1].core[1]))


def of_ends(modes: ModalModel, shown: StabilizationDiagram, fitted: StabilizationDiagram) -> ModalModel:
    """Return the modes of a diagram that end where `shown` does, of `ending_in`, with residual terms fitted to its lines."""
    if shown is fitted:
        return modes
    low, high = shown.settings.band or shown.response.span
    inside = (modes.frequencies >= low) & (modes.frequencies <= high)
    kept = replace(modes.take(inside), left_out=tuple(c for c in modes.left_out if low <= c.frequency <= high))
    if any(note.kind == BARE for note in modes.notes):
        kept = with_note_on_peaks(kept, shown.response, (low, high))
    if not len(kept) or shown.response.ambient:
        return kept
    poles, powers = terms_of(modes)
    own = np.append(poles, last_poles(fitted))
    return with_terms_of_bands(kept, [BandData(shown.response, (low, high), own, powers)])


def terms_of(modes: ModalModel) -> tuple[ComplexArray, tuple[int, ...]]:
    """Return the poles (rad/s) and the powers of the residual terms of modes."""
    poles = [np.zeros(0, complex), *(each.poles for each in modes.residual_terms)]
    return np.concatenate(poles), next((each.powers for each in modes.residual_terms if each.powers), ())


class BandData(NamedTuple):
    """What residual terms of one band are fitted to: its response and its ends (Hz), poles that they may have (rad/s), and powers."""

    response: Response
    ends: tuple[float, float]
    poles: ComplexArray
    powers: tuple[int, ...] = ()


def with_terms_of_bands(modes: ModalModel, bands: Sequence[BandData]) -> ModalModel:
    """Return modes with residual terms fitted to what they leave of every band, with those poles that it needs.

    Where lines of two bands overlap, each has its half. Samples of a band hold its own modes; those of other bands are poles among
    others there, for their residues belong to samples at another rate.
    """
    terms: list[ResidualTerms] = []
    participation = modes.known_participation("residual terms").copy()
    bands = sorted(bands, key=lambda band: band.ends)
    for k, (response, ends, poles, powers) in enumerate(bands):
        own, part = modes, response
        if response.grid is None:
            ends = ends[0], min(ends[1], response.span[1])
            inside = (modes.frequencies >= ends[0]) & (modes.frequencies <= ends[1])
            seen = modes.frequencies < response.span[1]
            own, poles = modes.take(inside), np.concatenate([modes.poles[~inside & seen], poles])
        else:
            before, after = (bands[j].response.span if 0 <= j < len(bands) else None for j in (k - 1, k + 1))
            part = response.in_band(_own_half(response.span, before, after))
        fixed = needed_beside(part, own.poles, np.concatenate([poles, out_of_band_poles(part, ends)]))
        found = with_terms(part, own, fixed, powers or part.refined_powers)
        if response.grid is None:
            participation[inside] = found.known_participation("residual terms")
        terms += [each if response.grid is not None else replace(each, band=ends) for each in found.residual_terms]
    return replace(modes, participation=participation, residual_terms=tuple(terms))


def _own_half(
    span: tuple[float, float], before: tuple[float, float] | None, after: tuple[float, float] | None
) -> tuple[float, float]:
    """Return a band without the half of what it shares with its neighbours."""
    low = span[0] if before is None or before[1] <= span[0] else np.nextafter((before[1] + span[0]) / 2, np.inf)
    high = span[1] if after is None or after[0] >= span[1] else (after[0] + span[1]) / 2
    return (low, high) if low < high else span


def _of_core(modes: ModalModel, core: tuple[float, float]) -> ModalModel:
    low, high = core
    f, half = modes.frequencies, np.abs(modes.poles.real) / (2 * np.pi)
    kept = modes.take((f + half >= low) & (f - half <= high))
    return replace(kept, left_out=tuple(c for c in modes.left_out if low <= c.frequency < high))


def ending_in(diagram: StabilizationDiagram, band: tuple[float, float] | None) -> StabilizationDiagram:
    """Return the poles and lines of a diagram in a band (Hz) where it was fitted with more lines than that; else the diagram."""
    if band is None or diagram.settings.band == band or diagram.response.in_band(band) is diagram.response:
        return diagram
    whole = diagram.changed(response=diagram.response.in_band(band), settings=replace(diagram.settings, band=band))
    f = diagram.frequencies
    return replace(whole, **_together([diagram], [(f >= band[0]) & (f <= band[1])]))


def joined_diagram(whole: StabilizationDiagram, parts: Sequence[Part]) -> StabilizationDiagram:
    """Return the poles of all parts as one diagram of the whole band, each part's own within its core.

    Fit errors are those of the parts together; singular values stay those of the whole, whose orders ended too soon.

    `parts`: by frequency.
    """
    kept = [_in_core(part, first=k == 0, last=k == len(parts) - 1) for k, part in enumerate(parts)]
    diagrams = [part.diagram for part in parts]
    orders = tuple(sorted(set().union(*(d.orders for d in diagrams))))
    return replace(
        whole,
        **_together(diagrams, kept),
        orders=orders,
        fit_errors=_fit_errors(parts, orders),
        notes=(*(note for note in whole.notes if note.kind != ORDERS_END), _told(parts)),
    )


def _together(diagrams: Sequence[StabilizationDiagram], kept: Sequence[Array]) -> dict[str, Any]:
    """Return fields of one diagram with the poles that are kept of each of several."""

    def together(name: str, axis: int = 0) -> Array:
        return np.concatenate(
            [np.compress(k, getattr(d, name), axis=axis) for d, k in zip(diagrams, kept, strict=True)], axis=axis
        )

    named = ("poles", "participation", "stable_frequency", "stable_damping", "stable_shape")
    flat: dict[str, Any] = {name: together(name) for name in named}
    names = set.intersection(*(set(d.indicators) for d in diagrams))
    order = together("order_of_pole")
    by_order = np.argsort(order, kind="stable")
    flat = {name: values[by_order] for name, values in flat.items()} | _joined_deviations(diagrams, kept, by_order)
    indicators = {
        name: np.concatenate([d.indicators[name][k] for d, k in zip(diagrams, kept, strict=True)])[by_order]
        for name in sorted(names)
    }
    return {
        **flat,
        "order_of_pole": order[by_order],
        "shapes": together("shapes", 1)[:, by_order],
        "indicators": indicators,
    }


def _joined_deviations(
    diagrams: Sequence[StabilizationDiagram], kept: Sequence[Array], by_order: Array
) -> dict[str, Any]:
    """Return the standard deviations of the poles of all parts as fields of the whole, each computed by its part when it is read.

    `kept`: which poles of each. `by_order`: places of these poles, one part after the other, in the whole.
    """
    nothing = np.zeros(0, dtype=int)
    if any(values is None for d in diagrams for values in d.deviations_at(nothing)):
        return dict.fromkeys(DEVIATIONS)
    own = np.concatenate([np.flatnonzero(k) for k in kept])[by_order]
    part = np.repeat(np.arange(len(kept)), [np.count_nonzero(k) for k in kept])[by_order]

    def compute(index: IntArray) -> RealArray:
        found = np.empty((2, len(index)))
        for k, d in enumerate(diagrams):
            of_part = part[index] == k
            found[:, of_part] = d.deviations_at(own[index[of_part]])
        return found

    return dict.fromkeys(DEVIATIONS, Deferred(len(own), compute))


def _in_core(part: Part, *, first: bool, last: bool) -> Array:
    """Return which poles lie in the core; the first and the last part have all beyond it where its data end with it."""
    f, (low, high) = part.diagram.frequencies, part.core if part.band is None else part.band
    first, last = first and low >= part.core[0], last and high <= part.core[1]
    return np.asarray((first | (f >= part.core[0])) & (last | (f < part.core[1])))


def _fit_errors(parts: Sequence[Part], orders: Sequence[int]) -> RealArray:
    """Return what all parts leave of all data at each order, a part at its next lower order where it has none."""
    sizes = np.array([np.linalg.norm(part.diagram.response.values) for part in parts])
    places = [np.searchsorted(part.diagram.orders, orders, side="right") - 1 for part in parts]
    errors = np.array(
        [part.diagram.fit_errors[np.maximum(place, 0)] for part, place in zip(parts, places, strict=True)]
    )
    return np.asarray(np.sqrt(np.sum((errors * sizes[:, None]) ** 2, axis=0) / np.sum(sizes**2)))


def _told(parts: Sequence[Part]) -> Note:
    where = ", ".join(f"{low:.5g} to {high:.5g} Hz" for low, high in (part.core for part in parts))
    text = f"Too many modes for one range of orders: band identified in {len(parts)} parts, {where}, and merged"
    return Note(SPLIT, {"parts": len(parts)}, text)
