"""Refine modes of ambient setups by Whittle's likelihood of their lines, jointly or one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.mode_fields import degrees_of
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.setups import Setups
from modalscope.data.shown import figures, list_some
from modalscope.numerics.checks import Array, BoolArray, ComplexArray, IntArray, RealArray
from modalscope.numerics.resources import one_thread
from modalscope.selection.likelihood.ambient import Cells, Scored, Transformed, cells_of, deviations, scored, unknowns
from modalscope.selection.likelihood.covariance import (
    LEAST_GROUPS,
    degrees_of_wider,
    deviations_of_poles,
    pole_blocks,
    sandwich,
)
from modalscope.selection.likelihood.descent import astray
from modalscope.selection.likelihood.noise import KIND
from modalscope.signals.preprocess.harmonics import lines_in
from modalscope.signals.preprocess.spectra import Spectrum

#: Lines extend beyond the first and the last mode by this fraction of the frequency, and by this many half bandwidths.
_MARGIN, _MARGIN_HALF_BANDWIDTHS = 0.15, 10.0

#: Lines of modes overlap within so many times the sum of their half bandwidths.
_OVERLAP = 3.0

#: What is known of frequencies and damping ratios.
_STD = ("frequencies_std", "damping_ratios_std")
_REPEATED = ("frequencies_repeatability", "damping_ratios_repeatability")

#: Rotating-machine lines are excluded with this fraction of their frequency on either side, and this many standard deviations: leakage.
_LINE_MARGIN, _LINE_SPREADS = 0.01, 3.0

#: Maximum count of products in one step of all setups; residual variance relative to the expected one above which a note is given.
_MAX_PRODUCTS, _MAX_QUIET_MISFIT = 5e9, 1.1

#: Residual variance relative to the expected one above which other modes must be present.
_MAX_MISFIT = 2.0


class _Seen(NamedTuple):
    """Setups, and what serves all places: the transform of every part, and the spectrum in which machines are looked for."""

    setups: Setups
    parts: list[Transformed]
    spectra: list[Spectrum]


class _Place(NamedTuple):
    """Modes that are refined together, `core`, and `all` that stand on their lines, from `band[0]` to `band[1]` Hz."""

    core: IntArray
    all: IntArray
    band: tuple[float, float]


class _Refined(NamedTuple):
    """Modes of one place at their optimum: poles, deviations (2, n), degrees (n, 2) and repeatability (2, n)."""

    poles: ComplexArray
    std: RealArray
    degrees: RealArray
    repeated: RealArray
    misfit: float


@one_thread
def refine_setups(setups: Setups, modes: ModalModel, *, apart: bool = False) -> ModalModel:
    """Refine modes of ambient setups, and say how sure that is: Whittle's likelihood of their periodograms (`spectral_likelihood`).

    Poles are common, everything else is every setup's own: shapes, what drives them, background. Correlations, from which the modes were
    found, follow what is strong; here every line counts as much as it tells. Modes whose lines overlap are refined together, each such
    place by itself, on the combinations of outputs that their shapes span.

    `setups`: with the channels that the modes have. `modes`: where to start. `apart`: whether every setup is refined by itself and the
    poles are means weighted by their information; a pole that goes astray in a setup is not counted there. By default the poles are
    refined over all setups at once.

    Returns
    -------
    ModalModel
        With deviations from the lines' own scatter and, of four groups of setups or more, repeatability. Modes stay as they were, with a
        note that says why, where that is out of reach: too many modes in a place, more in the lines than modes, or an optimum that is
        another.
    """
    if not len(modes):
        return modes
    order = np.argsort(modes.poles.imag, kind="stable")
    parts = setups.parts
    seen = _Seen(setups, [Transformed.of(part) for part in parts], [Spectrum.of(part) for part in parts])
    return _wrapped(modes, _refined_places(seen, modes, order, apart))


def _refined_places(
    seen: _Seen, modes: ModalModel, core: IntArray, apart: bool, failed: tuple[int, str] = (0, "")
) -> list[tuple[IntArray, _Refined | str]]:
    """Return what is found of modes in ascending order: together, or where that fails on either side of their widest gap.

    Far lines tell a mode's phase, so that more modes in one place are better known. `failed`: number of modes and reason where more modes
    were tried; a part of them that stands on the lines of them all would fail alike.
    """
    place = _place(modes.poles, core)
    found = failed[1] if len(place.all) == failed[0] else _at_place(seen, modes, place, apart)
    if not isinstance(found, str) or len(core) < 2 or len(place.all) == failed[0]:
        return [(core, found)]
    f, half = modes.frequencies[core], np.abs(modes.poles.real)[core]
    cut = 1 + int(np.argmax(np.diff(f) / (half[1:] + half[:-1])))
    why = (len(place.all), found)
    return [part for own in (core[:cut], core[cut:]) for part in _refined_places(seen, modes, own, apart, why)]


def _place(poles: ComplexArray, core: IntArray) -> _Place:
    """Return the lines of modes, from below the first to above the last, and all modes whose lines reach in."""
    f, half = poles.imag / (2 * np.pi), np.abs(poles.real) / (2 * np.pi)
    reach = np.maximum(_MARGIN * f, _MARGIN_HALF_BANDWIDTHS * half)
    low, high = float(np.min((f - reach)[core])), float(np.max((f + reach)[core]))
    while True:  # a mode on the edge belongs in with all of its lines
        within = (f + _OVERLAP * half > low) & (f - _OVERLAP * half < high)
        ends = float(np.min((f - _OVERLAP * half)[within])), float(np.max((f + _OVERLAP * half)[within]))
        if ends[0] >= low and ends[1] <= high:
            return _Place(core, np.flatnonzero(within), (low, high))
        low, high = min(low, ends[0]), max(high, ends[1])


def _at_place(seen: _Seen, modes: ModalModel, place: _Place, apart: bool) -> _Refined | str:
    """Return the modes of a place at the maximum of the likelihood, or why they stay as they were."""
    setups, start = seen.setups, modes.poles[place.all]
    few = min(part.samples / part.sampling_rate for part in setups.parts) * (place.band[1] - max(place.band[0], 0.0))
    outputs = min(len(start), min(len(part.output_dofs) for part in setups.parts))
    if few * outputs < unknowns(len(start), outputs):
        return f"{few:.0f} lines are too few for {unknowns(len(start), outputs)} unknowns"
    cells = _cells(seen, modes.take(place.all), place.band)
    work = sum(
        len(each.counts) * (4 * unknowns(len(start), len(each.values[0])) * len(each.values[0])) ** 2 for each in cells
    )
    if work > _MAX_PRODUCTS:
        return f"{len(start)} modes on the same lines exceed the limit on computing time by a factor {figures(work / _MAX_PRODUCTS, 2)}"
    found = _means([scored([each], start) for each in cells], start) if apart else scored(cells, start)
    if found.misfit > _MAX_MISFIT:
        return _more_there(found.misfit)
    own = np.searchsorted(place.all, place.core)
    if not found.converged or np.any(astray(start, found.poles)[own]):
        return "their optimum lies elsewhere" if found.converged else "no optimum was reached"
    std, degrees = deviations(found)
    std, degrees, repeated = np.array(std)[:, own], degrees[:, own], np.full((2, len(own)), np.nan)
    if (between := _between(setups, found)) is not None:
        repeated = np.array(deviations_of_poles(found.poles, pole_blocks(between, 2 * np.arange(len(start)))))[:, own]
        degrees = degrees_of_wider(std, degrees, repeated, len(set(setups.groups or ())))
    return _Refined(found.poles[own], std, degrees.T, repeated, found.misfit)


def _cells(seen: _Seen, modes: ModalModel, band: tuple[float, float]) -> list[Cells]:
    """Return the lines of all setups in a band, in the combinations of outputs that the shapes of the modes span, without machines'."""
    ends = max(band[0], 0.0), min(band[1], 0.49 * seen.setups.sampling_rate)
    cells = []
    for part, whole, spectrum in zip(seen.setups.parts, seen.parts, seen.spectra, strict=True):
        rows = [modes.output_dofs.index(dof) for dof in part.output_dofs]
        cells.append(_without_lines(cells_of(whole, modes.poles, ends, modes.shapes[rows]), spectrum))
    return cells


def _without_lines(cells: Cells, spectrum: Spectrum) -> Cells:
    """Return cells without rotating-machine lines."""
    kept = np.ones(cells.frequencies.size, dtype=bool)
    for line in lines_in(spectrum, (float(cells.frequencies[0]), float(cells.frequencies[-1]))):
        kept &= np.abs(cells.frequencies - line.frequency) > _LINE_MARGIN * line.frequency + _LINE_SPREADS * line.spread
    if kept.all():
        return cells
    return cells.without(~kept)


def _means(each: Sequence[Scored], start: ComplexArray) -> Scored:
    """Return the mean of poles that setups gave one by one, weighted by their information; one astray is eliminated there."""
    informations, away = [], []
    for one in each:
        step = np.stack([(one.poles - start).real, (one.poles - start).imag], axis=1)
        lost = np.repeat(astray(start, one.poles) if one.converged else np.ones(len(start), bool), 2)
        informations.append(_without(one.informations[0], lost))
        away.append(np.where(lost, 0, step.ravel()))
    held, steps = np.array(informations), np.array(away)
    mean = np.linalg.lstsq(held.sum(axis=0), np.einsum("jab,jb->a", held, steps), rcond=None)[0]
    scores = np.einsum("jab,jb->ja", held, steps - mean)
    misfit = float(np.mean([one.misfit for one in each]))
    known = bool(np.all(np.diag(held.sum(axis=0)) > 0))
    told = tuple(part for one in each for part in one.told)
    return Scored(start + mean[::2] + 1j * mean[1::2], held, scores, misfit, known, told)


def _without(information: RealArray, lost: BoolArray) -> RealArray:
    """Return the information of the other unknowns where some are free, and none of these."""
    kept = np.zeros_like(information)
    a, b = np.ix_(~lost, ~lost), np.ix_(~lost, lost)
    own = information[np.ix_(lost, lost)]
    kept[a] = information[a] - information[b] @ np.linalg.pinv(own, hermitian=True) @ information[b].T
    return kept


def _wrapped(modes: ModalModel, found: Sequence[tuple[IntArray, _Refined | str]]) -> ModalModel:
    """Return the modes as they are at the optima of their places where they are better known there, and notes on what was done."""
    known = _widths(modes)
    most = _MAX_MISFIT if np.isnan(known).all() else _MAX_QUIET_MISFIT  # no other values have an interval
    tried = [
        (core, one if isinstance(one, str) or one.misfit < most else _more_there(one.misfit)) for core, one in found
    ]
    done = [(core, one) for core, one in tried if not isinstance(one, str)]
    left = [(core, why) for core, why in tried if isinstance(why, str)]
    notes = []
    if left:
        reasons = {why: np.concatenate([core for core, other in left if other == why]) for _, why in left}
        text = "; ".join(f"{_names(modes, cores)} ({why})" for why, cores in reasons.items())
        notes = [Note("not refined", {"modes": float(sum(len(core) for core, _ in left))}, f"Not refined: {text}")]
    if not done:
        return modes.noted(notes)
    before = _columns(modes)
    new = {name: np.array(column) for name, column in before.items()}
    for core, one in done:
        for name, values in zip(before, (one.poles, *one.std, *one.repeated, one.degrees), strict=True):
            new[name][core] = values
    better = np.isin(np.arange(len(modes)), np.concatenate([core for core, _ in done]))
    better &= np.nanprod(_widths(_with(modes, new)) / known, axis=0) <= 1  # what was not known is no loss
    if not better.any():
        return modes.noted(notes)
    columns = {name: np.where(better if a.ndim == 1 else better[:, None], new[name], a) for name, a in before.items()}
    misfit = max(one.misfit for _, one in done)
    text = "Intervals from the spectra (Whittle's likelihood): lines left out one at a time, and pieces in time"
    if not better.all():
        text += f"; unchanged for {_names(modes, np.flatnonzero(~better))}, which spectra do not narrow"
    notes.append(Note(KIND, {"misfit": misfit}, text))
    if misfit > _MAX_QUIET_MISFIT:
        text = f"Residual {figures(misfit, 2)} x its expected variance: other modes may be present"
        notes.append(Note("more than modes", {"misfit": misfit}, text))
    kept = [note for note in modes.notes if note.kind != KIND or not better.all()]
    refined = replace(_with(modes, columns), unrefined=replace(modes, unrefined=None), converged=True)
    return replace(refined, notes=(*kept, *notes))


def _more_there(misfit: float) -> str:
    return f"residual {figures(misfit, 2)} x its expected variance: other modes or machines?"


def _names(modes: ModalModel, which: IntArray) -> str:
    return list_some(f"{f:.5g} Hz" for f in np.sort(modes.frequencies[which]))


def _columns(modes: ModalModel) -> dict[str, Array]:
    """Return what refinement changes, by name: poles, deviations, repeatability and degrees, NaN where they are not known."""
    unknown = np.full(len(modes), np.nan)
    known = {name: unknown if (own := getattr(modes, name)) is None else own for name in (*_STD, *_REPEATED)}
    return {"poles": modes.poles, **known, "degrees": degrees_of(modes)}


def _with(modes: ModalModel, columns: Mapping[str, Array]) -> ModalModel:
    """Return the modes with other columns, None where nothing in one is known."""
    own: dict[str, Any] = {name: None if np.isnan(a).all() and name != "degrees" else a for name, a in columns.items()}
    return replace(modes, **own)


def _widths(modes: ModalModel) -> RealArray:
    """Return the widths of the intervals of frequencies and damping ratios, (2, n), NaN where they are not known."""
    if modes.frequencies_std is None and modes.frequencies_repeatability is None:
        return np.full((2, len(modes)), np.nan)
    return np.array([np.diff(ends, axis=1)[:, 0] for ends in modes.interval().values()])


def _between(setups: Setups, found: Scored) -> RealArray | None:
    """Return the covariance of the poles by how far groups of setups disagree; None of fewer than four."""
    labels = () if setups.groups is None else tuple(dict.fromkeys(setups.groups))
    if len(labels) < LEAST_GROUPS or setups.groups is None:
        return None
    member = np.array([[own == label for own in setups.groups] for label in labels], dtype=float)
    each, held = (np.tensordot(member, of_setups, axes=1) for of_setups in (found.scores, found.informations))
    return sandwich(np.linalg.pinv(found.informations.sum(axis=0), hermitian=True), each, held)
