"""Refine modes of ambient setups by Whittle's likelihood of their lines, jointly or one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.records import Signals
from modalscope.data.setups import Setups
from modalscope.numerics.checks import BoolArray, ComplexArray, RealArray
from modalscope.numerics.resources import one_thread
from modalscope.selection.likelihood.ambient import Cells, Scored, cells_of, deviations, scored, unknowns
from modalscope.selection.likelihood.covariance import (
    LEAST_GROUPS,
    degrees_of_wider,
    deviations_of_poles,
    pole_blocks,
    sandwich,
)
from modalscope.selection.likelihood.descent import astray
from modalscope.selection.likelihood.noise import KIND
from modalscope.signals.preprocess.harmonics import find_lines

#: Lines extend beyond the first and the last mode by this fraction of the frequency, and by this many half bandwidths.
_MARGIN, _MARGIN_HALF_BANDWIDTHS = 0.15, 10.0

#: Rotating-machine lines are excluded with this fraction of their frequency on either side, and this many standard deviations: leakage.
_LINE_MARGIN, _LINE_SPREADS = 0.01, 3.0

#: Maximum count of products in one step of all setups; residual variance relative to the expected one above which a note is given.
_MAX_PRODUCTS, _MAX_QUIET_MISFIT = 2e11, 1.2

#: Residual variance relative to the expected one above which other modes must be present.
_MAX_MISFIT = 2.0


@one_thread
def refine_setups(setups: Setups, modes: ModalModel, *, apart: bool = False) -> ModalModel:
    """Refine modes of ambient setups, and say how sure that is: Whittle's likelihood of their periodograms (`spectral_likelihood`).

    Poles are common, everything else is every setup's own: shapes, what drives them, background. Correlations, from which the modes were
    found, follow what is strong; here every line counts as much as it tells.

    `setups`: with the channels that the modes have. `modes`: where to start; all of them stand in the band. `apart`: whether every setup
    is refined by itself and the poles are means weighted by their information; a pole that goes astray in a setup is not counted there.
    By default the poles are refined over all setups at once.

    Returns
    -------
    ModalModel
        With deviations from the lines' own scatter and, of four groups of setups or more, repeatability. As it was, with a note that says
        why, where that is out of reach: too many channels and modes, more in the lines than modes, or an optimum that is another.
    """
    if not len(modes):
        return modes
    cells = _cells(setups, modes.poles)
    work = sum(
        len(each.counts) * (4 * unknowns(len(modes), len(each.values[0])) * len(each.values[0])) ** 2 for each in cells
    )
    if work > _MAX_PRODUCTS:
        return _kept(
            modes,
            f"{len(modes)} modes in these channels exceed the limit on computing time by a factor {work / _MAX_PRODUCTS:.2g}",
        )
    found = (
        _means([scored([each], modes.poles) for each in cells], modes.poles) if apart else scored(cells, modes.poles)
    )
    away = astray(modes.poles, found.poles)
    if found.misfit > _MAX_MISFIT:
        return _kept(modes, f"residual {found.misfit:.2g} x its expected variance: other modes or machines are present")
    if not found.converged or np.any(away):
        where = ", ".join(f"{f:.5g} Hz" for f in modes.frequencies[away])
        return _kept(modes, f"the optimum lies far from {where}" if where else "no optimum was reached")
    return _wrapped(setups, modes, found)


def _cells(setups: Setups, poles: ComplexArray) -> list[Cells]:
    """Return the lines of all setups from below the first mode to above the last."""
    f, half = poles.imag / (2 * np.pi), np.abs(poles.real) / (2 * np.pi)
    reach = np.maximum(_MARGIN * f, _MARGIN_HALF_BANDWIDTHS * half)
    band = (float(np.min(f - reach)), float(min(np.max(f + reach), 0.49 * setups.sampling_rate)))
    return [_without_lines(cells_of(part, poles, band), part) for part in setups.parts]


def _without_lines(cells: Cells, record: Signals) -> Cells:
    """Return cells without rotating-machine lines."""
    kept = np.ones(cells.frequencies.size, dtype=bool)
    for line in find_lines(record, (float(cells.frequencies[0]), float(cells.frequencies[-1]))):
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


def _wrapped(setups: Setups, modes: ModalModel, found: Scored) -> ModalModel:
    """Return the refined modes with their deviations and what these rest on."""
    (f, zeta), degrees = deviations(found)
    notes = [note for note in modes.notes if note.kind != KIND]
    text = "standard deviations from the lines of every setup, left out one at a time in Whittle's likelihood, and pieces in time"
    notes.append(Note(KIND, {"misfit": found.misfit}, text))
    if found.misfit > _MAX_QUIET_MISFIT:
        text = f"Residual {found.misfit:.2g} x its expected variance: other modes may be present"
        notes.append(Note("more than modes", {"misfit": found.misfit}, text))
    repeated: tuple[RealArray | None, RealArray | None] = (
        modes.frequencies_repeatability,
        modes.damping_ratios_repeatability,
    )
    if (between := _between(setups, found)) is not None:
        repeated = deviations_of_poles(found.poles, pole_blocks(between, 2 * np.arange(len(modes))))
        degrees = degrees_of_wider(np.array([f, zeta]), degrees, np.array(repeated), len(set(setups.groups or ())))
    return replace(
        modes,
        poles=found.poles,
        frequencies_std=f,
        damping_ratios_std=zeta,
        degrees=degrees.T,
        frequencies_repeatability=repeated[0],
        damping_ratios_repeatability=repeated[1],
        unrefined=replace(modes, unrefined=None),
        converged=True,
        notes=tuple(notes),
    )


def _between(setups: Setups, found: Scored) -> RealArray | None:
    """Return the covariance of the poles by how far groups of setups disagree; None of fewer than four."""
    labels = () if setups.groups is None else tuple(dict.fromkeys(setups.groups))
    if len(labels) < LEAST_GROUPS or setups.groups is None:
        return None
    member = np.array([[own == label for own in setups.groups] for label in labels], dtype=float)
    each, held = (np.tensordot(member, of_setups, axes=1) for of_setups in (found.scores, found.informations))
    return sandwich(np.linalg.pinv(found.informations.sum(axis=0), hermitian=True), each, held)


def _kept(modes: ModalModel, why: str) -> ModalModel:
    return modes.noted(Note("not refined", {}, f"Not refined: {why}"))
