"""Select the modes among the poles of a stabilization diagram (`select`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from modalscope.data.channels import AUTO, check_groups
from modalscope.data.indicators import with_indicators_of_shapes
from modalscope.data.modes import ModalModel
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.orders import last_poles
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_each, check_kind, check_positive
from modalscope.numerics.errors import DataError
from modalscope.numerics.progress import stage
from modalscope.numerics.resources import one_thread
from modalscope.selection.judging.bare_peaks import with_note_on_peaks
from modalscope.selection.judging.evidence import Candidate, Gathered, counted, evidence_of, oscillations
from modalscope.selection.judging.no_structure import (
    harmonics_of_diagram,
    with_note_on_empty,
    with_note_on_errors,
    with_objections_of_record,
)
from modalscope.selection.judging.outcome import compared_with, modes_of, paired_with
from modalscope.selection.judging.refine import in_place
from modalscope.selection.judging.tracking import Poles
from modalscope.selection.judging.verdict import Contest, contest, has_likelihood, likely
from modalscope.selection.likelihood.covariance import LEAST_GROUPS
from modalscope.selection.likelihood.settling import needed_beside


@named()
@one_thread
def select(
    diagram: StabilizationDiagram,
    *,
    frequencies: Iterable[float] | None = None,
    take: Iterable[float] = (),
    refuse: Iterable[float] = (),
    tolerance: float = 0.01,
    reference: ModalModel | None = None,
) -> ModalModel:
    """Choose the modes of a stabilization diagram automatically, with the reasons for each, or those at given frequencies.

    Poles are followed over the orders, and the members of a track that agree in frequency, damping and shape are taken
    together. The value reported is their median.

    Of responses the likelihood decides which there are: all are refined together, each has to explain more than noise may, and
    what stands out of the residual is taken up. Where the residual is no white noise, poles that act as one are parts of one mode,
    and a mode is shown at a quarter of the orders. Of correlations, whose errors have no likelihood, a mode is found at many orders,
    persists from its first one on, and dominates the response, shows as a peak of a mode indicator curve, or is known well.
    Nothing is drawn at random: the same data give the same modes.

    Parameters
    ----------
    diagram : StabilizationDiagram
    frequencies : iterable of float, optional
        Hz; the modes nearest to these are returned, whatever else speaks against them.
    take, refuse : iterable of float, optional
        Hz; modes to report beside the automatic ones, and automatic ones not to report.
    tolerance : float
        Largest relative distance from a given frequency to its mode.
    reference : ModalModel, optional
        Modes of another program or test: those that are the same are returned, with the differences among their reasons, in standard
        deviations where these are known.

    Returns
    -------
    ModalModel
        With `frequencies_spread`, `damping_ratios_spread`, `gain`, `indicators`, `reasons` and `left_out`; real and unstable poles are
        not modes here.

    Raises
    ------
    DataError
        A given frequency at which there is no mode, or two that mean the same one; `take` or `refuse` beside `frequencies`, any of
        them beside a reference.

    Examples
    --------
    >>> from modalscope import stabilize
    >>> from modalscope.systems import chain5
    >>> modes = select(stabilize(chain5().state_space(dt=0.05).impulse_response(200)))
    >>> len(modes)
    5
    """
    by_hand: dict[str, Any] = {"frequencies": frequencies, "take": take, "refuse": refuse}
    return between_groups(diagram, selected(diagram, **by_hand, tolerance=tolerance, reference=reference))


def selected(
    diagram: StabilizationDiagram,
    *,
    frequencies: Iterable[float] | None = None,
    take: Iterable[float] = (),
    refuse: Iterable[float] = (),
    tolerance: float = 0.01,
    reference: ModalModel | None = None,
) -> ModalModel:
    """Return what `select` does with deviations from the noise alone, for modes that are refined next."""
    check_kind("select", diagram, StabilizationDiagram)
    wanted = None if frequencies is None else _wanted("frequencies", frequencies)
    added, refused = (check_each(name, given, "numbers in Hz") for name, given in (("take", take), ("refuse", refuse)))
    _check_one_way(wanted, [*added, *refused], reference)
    check_positive("tolerance", tolerance)
    with stage("selecting"):
        found = weighed(diagram)
    if reference is not None:
        return _like(reference, diagram, found, tolerance)
    return chosen_of(diagram, found, wanted, added, refused, tolerance)


def between_groups(diagram: StabilizationDiagram, modes: ModalModel) -> ModalModel:
    """Return modes with the scatter between inputs or runs where these are four at least, by their scores at the modes' values."""
    response = diagram.response
    groups = check_groups(AUTO, *response.parts, response.groups)
    if response.ambient or groups is None or len(set(groups)) < LEAST_GROUPS or not len(modes):
        return modes
    found = in_place(response.whole, modes, needed_beside(response, modes.poles, last_poles(diagram)))
    names = ("frequencies_repeatability", "damping_ratios_repeatability", "degrees")
    return replace(modes, **{name: getattr(found, name) for name in names})


def contest_of(diagrams: Sequence[StabilizationDiagram]) -> Contest | None:
    """Return what poles the data of several diagrams need, one contest of all their candidates; None where data have no likelihood.

    `diagrams`: of the same data. It starts from the one that fits best; the others add what that does not show.
    """
    able = [d for d in diagrams if d.exact_rank is None and has_likelihood(d)]
    if not able:
        return None
    best, *others = sorted(able, key=lambda d: float(d.fit_errors.min()))
    return contest(best, oscillations(best), [oscillations(other) for other in others])


class Weighed(NamedTuple):
    """The poles of a diagram that may be modes, and the groups of them with what speaks for and against each."""

    poles: Poles
    candidates: list[Candidate]


@one_thread
def weighed(diagram: StabilizationDiagram, gathered: Gathered | None = None, known: Contest | None = None) -> Weighed:
    """Return all that might be a mode, by the rule that suits the data: what takes the time of `select`, whatever is chosen then.

    `gathered`, `known`: what data show, and need, where several diagrams of the same ones are weighed.
    """
    diagram = diagram.whitened()
    poles = oscillations(diagram)
    if diagram.exact_rank is not None:
        return Weighed(poles, _exact(diagram, poles))
    evidence = evidence_of(diagram) if gathered is None else gathered.of(diagram)
    found = likely(diagram, poles, evidence, known) if has_likelihood(diagram) else None
    poles, candidates = found or counted(diagram, poles, evidence)
    return Weighed(poles, with_objections_of_record(diagram, candidates))


@one_thread
def chosen_of(
    diagram: StabilizationDiagram,
    found: Weighed,
    wanted: Sequence[float] | None = None,
    added: Sequence[float] = (),
    refused: Sequence[float] = (),
    tolerance: float = 0.01,
) -> ModalModel:
    """Return the modes among what was weighed: those at given frequencies, or the automatic ones with the changes by hand.

    `found`: of the same diagram. `wanted`, `added`, `refused`: hz, as `frequencies`, `take` and `refuse` of `select`.
    """
    measured, diagram, candidates = diagram, diagram.whitened(), found.candidates
    if wanted is not None:
        chosen = _by_hand(candidates, list(wanted), tolerance, diagram)
    else:
        chosen = [c for c in candidates if not c.against]
        chosen = _changed(candidates, chosen, list(added), list(refused), tolerance, diagram)
    left = [c for c in candidates if not any(c is k for k in chosen)]
    modes = modes_of(
        diagram, found.poles, sorted(chosen, key=lambda c: c.frequency), sorted(left, key=lambda c: c.frequency)
    )
    told = with_note_on_empty(with_note_on_errors(_of_channels(modes, measured), diagram), diagram)
    response = measured.response
    return told if wanted else with_note_on_peaks(told, response, response.reported_band(measured.settings.band))


def _of_channels(modes: ModalModel, diagram: StabilizationDiagram) -> ModalModel:
    """Return modes that were selected in whitened channels as those of the channels; indicators of shapes are those of these shapes."""
    whitening = diagram.whitening
    own = modes if whitening is None else whitening.modes_back(modes).normalized("unit")
    return with_indicators_of_shapes(own)


def _check_one_way(wanted: list[float] | None, changes: list[float], reference: ModalModel | None) -> None:
    """Refuse two ways at once of saying which modes are reported."""
    if reference is not None:
        check_kind("reference", reference, ModalModel)
    ways = {"the reference": reference is not None, "frequencies": wanted is not None, "take or refuse": bool(changes)}
    whole, *others = [name for name, there in ways.items() if there] or [""]
    if others:
        either = f"{whole}, or {' and '.join(others)}"
        raise DataError(
            f"select has {' and '.join([whole, *others])}", f"{whole} already states the whole list", f"Give {either}."
        )


def _like(reference: ModalModel, diagram: StabilizationDiagram, found: Weighed, tolerance: float) -> ModalModel:
    """Return the candidates that are modes of a reference, with the differences."""
    poles, candidates = found
    measured, diagram, whitening = diagram, diagram.whitened(), diagram.whitening
    asked = reference
    if whitening is not None and len(reference.shapes) == len(diagram.shapes):
        asked = replace(reference, shapes=whitening.of_shapes(reference.shapes))
    pairs = sorted(paired_with(asked, candidates, poles, tolerance), key=lambda pair: pair[0].frequency)
    chosen = [c for c, _ in pairs]
    others = (c for c in candidates if not any(c is k for k in chosen))
    left = [c if c.against else replace(c, against=("not a mode of the reference",)) for c in others]
    modes = _of_channels(modes_of(diagram, poles, chosen, sorted(left, key=lambda c: c.frequency)), measured)
    return compared_with(modes, reference, np.array([k for _, k in pairs], dtype=int))


def _changed(
    candidates: list[Candidate],
    chosen: list[Candidate],
    added: list[float],
    refused: list[float],
    tolerance: float,
    diagram: StabilizationDiagram,
) -> list[Candidate]:
    """Return the automatic choice without what is refused and with what is taken; what cannot be done is an error, not nothing."""
    if refused:
        gone = _by_hand(chosen, _wanted("refuse", refused), tolerance, diagram)
        chosen = [c for c in chosen if not any(c is g for g in gone)]
    if added:
        others = [c for c in candidates if not any(c is k for k in chosen)]
        # of a mode that is listed nothing is left to do, unless another lies beside it
        listed = [f for f in _wanted("take", added) if not _near(others, f, tolerance) and _near(chosen, f, tolerance)]
        wanted = [f for f in added if f not in listed]
        chosen = [*chosen, *_by_hand(others, wanted, tolerance, diagram)]
    return chosen


def _near(candidates: list[Candidate], f: float, tolerance: float) -> list[Candidate]:
    return [c for c in candidates if abs(c.frequency - f) <= tolerance * f]


def _wanted(name: str, frequencies: Iterable[float]) -> list[float]:
    """Return the frequencies asked by hand; none at all is an error, not an empty result."""
    wanted = [check_positive(f"each of {name}", f) for f in check_each(name, frequencies, "numbers in Hz")]
    if not wanted:
        raise DataError(f"{name} in Hz:", "the list is empty", "Give frequencies in Hz, or omit the argument.")
    return wanted


def _exact(diagram: StabilizationDiagram, poles: Poles) -> list[Candidate]:
    """Noise-free data: the modes are those of the order that is the rank."""
    members = np.flatnonzero((poles.order == diagram.exact_rank) & (poles.own > 1e-9))
    facts = {
        "orders_found": 1,
        "orders_tried": 1,
        "text": f"noise-free data of exact rank {diagram.exact_rank}: a pole of that order",
    }
    return [Candidate(np.array([i]), float(poles.frequency[i]), float(poles.damping[i]), facts, ()) for i in members]


def _by_hand(
    candidates: list[Candidate], wanted: list[float], tolerance: float, diagram: StabilizationDiagram
) -> list[Candidate]:
    """Return the candidate at each frequency; one that has none is an error, never its neighbour."""
    chosen: list[Candidate] = []
    for f in wanted:
        near = _near(candidates, f, tolerance)
        if not near:
            raise _none_there(candidates, f, tolerance, diagram)
        best = min(near, key=lambda c: (bool(c.against), -c.members.size if len(near) > 1 else 0, abs(c.frequency - f)))
        if any(best is c for c in chosen):
            raise DataError(
                f"different modes at {', '.join(f'{v:g}' for v in wanted)} Hz:",
                f"two of them match the mode at {best.frequency:.6g} Hz",
                "Drop one, or lower the tolerance.",
            )
        chosen.append(best)
    return chosen


def _none_there(candidates: list[Candidate], f: float, tolerance: float, diagram: StabilizationDiagram) -> DataError:
    """Return what to say where there is no candidate: that a machine's line was taken off there, or which are the nearest."""
    asked = f"a mode at {f:g} Hz:"
    removed = any(note.kind == "lines removed" for note in diagram.notes)
    if removed and any(abs(line.frequency - f) <= tolerance * f for line in harmonics_of_diagram(diagram)):
        return DataError(
            asked,
            "a rotating-machine line at that frequency was removed from the record",
            "Keep lines with stabilize(estimate_correlation(record)), and select it there.",
        )
    near = [f"{c.frequency:.4g}" for c in sorted(candidates, key=lambda c: abs(c.frequency - f))[:3]]
    found = f"no pole lies within {100 * tolerance:g} % of it at orders {diagram.orders[0]} to {diagram.orders[-1]}"
    if not near:
        return DataError(asked, found, "Try other orders or another method: all candidates are reported already.")
    return DataError(
        asked, found, f"Select one of the nearest, {', '.join(near)} Hz, or try other orders or another method."
    )
