"""Refine modes to the maximum of the likelihood, with their standard deviations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modalscope.data.channels import AUTO, Groups, check_groups
from modalscope.data.mode_fields import PER_MODE, joined
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Candidate, Note
from modalscope.data.records import Signals
from modalscope.data.response import Response
from modalscope.data.results import Settings
from modalscope.data.setups import Setups, as_test
from modalscope.data.shown import counted
from modalscope.identification.prepare import measure
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread
from modalscope.selection.judging.evidence import retold
from modalscope.selection.likelihood.descent import Astray
from modalscope.selection.likelihood.information import residual
from modalscope.selection.likelihood.refined import refined
from modalscope.selection.likelihood.settling import Settled, Task, least_gain, levels_of_lines, settle, task_of
from modalscope.signals.doctor.reciprocity import by_reciprocity

#: Maximum number of added modes, and of steps of a descent with one: a mode takes two to seven, what runs to no width never ends.
_MAX_ADDED, _STEPS_OF_ADDED = 8, 20

#: Poles, shapes and participation.
_Modes = tuple[ComplexArray, ComplexArray, ComplexArray]


def completed(task: Task, modes: ModalModel, settled: Settled) -> ModalModel:
    """Return the modes of an optimum, followed by those at significant peaks of its residual, strongest first.

    Lines of records are divided by the level of what is left of them: a peak counts beside what is left around it. Nothing is added where
    the residual remains coloured, poles would then fit the error of the model, and nothing that has no optimum.
    """
    count = len(modes)
    best: _Modes = (settled.descent.point.poles, *settled.residues)
    if settled.colour.coloured and settled.descent.point.problem.records:
        task = replace(task, rows=levels_of_lines(task.response, task, settled))
        settled = settle(task, *best)
    for _ in range(_MAX_ADDED):
        more = _with_peak(task, settled)
        if more is None:
            break
        settled = _pruned(task, settle(task, *more, most=_STEPS_OF_ADDED), count)
        sound = settled.descent.converged and (settled.descent.point.problem.records or not settled.colour.coloured)
        if len(settled.descent.point.poles) <= len(best[0]) or not sound:
            break
        best = (settled.descent.point.poles, *settled.residues)
    if len(best[0]) == count:
        return modes
    poles, shapes, participation = best
    return joined([modes, _added_modes(task, modes, poles[count:], shapes[:, count:], participation[count:])])


def _with_peak(task: Task, settled: Settled) -> _Modes | None:
    """Return the modes with one at the strongest peak of the residual; None where no peak is significant."""
    point, fitted = settled.descent.point, settled.descent.fitted
    least = 2 * least_gain(task) * settled.variance
    peaks = point.problem.peaks(residual(point, fitted), point.poles, least)
    if not peaks:
        return None
    peak, (shapes, participation) = peaks[0], settled.residues
    return (
        np.append(point.poles, peak.pole),
        np.column_stack([shapes, peak.shape]),
        np.vstack([participation, peak.participation]),
    )


def _pruned(task: Task, settled: Settled, count: int) -> Settled:
    """Remove the weakest of the modes behind the first `count` while it is not significant."""
    while (gain := settled.gain[count:]).size and gain.min() < 2 * least_gain(task):
        out = count + int(np.argmin(gain))
        shapes, participation = settled.residues
        poles = np.delete(settled.descent.point.poles, out)
        settled = settle(task, poles, np.delete(shapes, out, axis=1), np.delete(participation, out, axis=0))
    return settled


def _added_modes(
    task: Task, modes: ModalModel, poles: ComplexArray, shapes: ComplexArray, participation: ComplexArray
) -> ModalModel:
    """Return the added modes alone; columns that only the given modes have are NaN."""
    unknown = np.full(len(poles), np.nan)
    columns: dict[str, Any] = {name: unknown for name in PER_MODE if getattr(modes, name) is not None}
    return ModalModel(
        poles=poles + task.response.added_damping,
        shapes=shapes,
        participation=task.response.shortest_participation(task.response.of_inputs(participation)),
        quantity=modes.quantity,
        indicators=dict.fromkeys(modes.indicators, unknown),
        reasons=tuple({"text": "significant in the residual of the other modes"} for _ in poles)
        if modes.reasons
        else (),
        **columns,
        **task.response.labelled(),
    )


Progress = Callable[[int, int], None]


@named()
@one_thread
def refine(
    data: Any,
    modes: ModalModel,
    *,
    groups: Any = AUTO,
    weights: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
    complete: bool = False,
    settings: Settings | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> ModalModel:
    """Refine modes to the maximum of the likelihood, and estimate their standard deviations.

    min over poles s, shapes c, participation b and terms of sum |Y - sum_j (c_j b_j g(s_j) + conjugate) - terms|^2 / variance. The variance
    is that of each channel: given with the data, or that of the residual, estimated together with the modes.

    Two standard deviations are given. *Noise*: of records from their lines, left out one at a time, and from eight parts of the record in
    time where these scatter more; of responses from the variance of every channel, and where the residual is coloured from lines, parts
    in time, and what outputs and inputs differ by, too. *Repeatability*: from the differences between groups: inputs, runs or setups.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse, Signals, Records, Setups or a list of records
        Records with inputs on their own lines, where nothing is averaged; records without inputs, and setups, by Whittle's likelihood of
        their lines (`refine_setups`), whose options are none of those below.
        In the band of the identification: what no mode explains biases the modes.
    modes : ModalModel
        Starting values. Poles that are no decaying oscillations are kept fixed, and not reported.
    groups : "auto", None or sequence of labels
        One an input (of records: a run): those of the data, none, or others.
    weights : array (F,), optional
        1 / standard deviation of the lines or samples; by default from the variance of the data where they carry one.
    fixed : array of complex, optional
        rad/s: fixed poles with free residues in every channel; they are not reported. By default those of the modes' residual terms.
    complete : bool
        Whether modes at significant peaks of the residual are added, where it is then white.
    settings : Settings or mapping, optional
        Those that the modes were found with: the data are taken in their `band`, without what they `exclude`, records with inputs
        by their `route` and with their `delays`. By default all that was measured, as `identify` would take it.
    progress : callable, optional
        Called with (iterations done, iterations at most), round by round.

    Returns
    -------
    ModalModel
        With `frequencies_std`, `damping_ratios_std`, `shapes_std`, repeatability, `gain`, `unrefined`, `converged` and `notes`.

    Raises
    ------
    DataError
        Correlations, modes of other channels, more unknowns than data.

    Examples
    --------
    >>> from modalscope import identify
    >>> from modalscope.systems import chain5
    >>> response = chain5().impulse_response(300, noise=0.01, seed=0)
    >>> found = identify(response, method="era", order=10).modes
    >>> refined = refine(response, found)
    >>> refined.converged, bool(refined.frequencies_std[0] < 1e-4)
    (True, True)
    """
    check_kind("modes of refine", modes, ModalModel)
    setups = _ambient(data)
    if setups is not None:
        from modalscope.selection.likelihood.refine_setups import refine_setups  # its likelihood is another

        missing = [dof for dof in setups.output_dofs if dof not in modes.output_dofs]
        return refine_setups(setups.select(exclude=missing) if missing else setups, modes)
    return refinement(
        data,
        modes,
        groups=groups,
        weights=weights,
        fixed=fixed,
        complete=complete,
        settings=settings,
        progress=progress,
    ).modes()


@dataclass(frozen=True, eq=False, slots=True)
class Refinement:
    """Modes at the maximum of the likelihood, before their standard deviations, which take as long as the way there.

    `start`: significant modes before. `settled`: the optimum, None without any mode. `lost`: modes that are not significant. `added`: so
    many, the last of `start`, stood at peaks of the residual.
    """

    task: Task
    start: ModalModel
    settled: Settled | None
    groups: Groups
    lost: list[Candidate]
    notes: list[Note]
    added: int = 0

    @property
    def poles(self) -> ComplexArray:
        """Of the optimum, one for each of `start`, rad/s."""
        settled = self.settled
        return self.start.poles if settled is None else settled.descent.point.poles + self.task.response.added_damping

    @property
    def converged(self) -> bool:
        """Whether the optimum was reached."""
        return self.settled is None or self.settled.descent.converged

    def modes(self) -> ModalModel:
        """Return the modes with their standard deviations; added ones that the data do not determine are none."""
        found = retold(refined(self.task, self.start, self.settled, self.groups, self.lost, self.notes))
        if not self.added or found.degrees is None:
            return found
        last = np.arange(len(found)) >= len(found) - self.added
        added = last[np.argsort(np.abs(self.poles), kind="stable")]
        stays = ~added | (found.degrees[:, 0] > 0)
        where = [f"{f:.5g} Hz" for f in found.frequencies[added & stays]]
        note = Note("added", {"modes": len(where)}, f"Modes added at peaks of the residual: {', '.join(where)}")
        return found.take(stays).noted(note) if where else found.take(stays)


@one_thread
def refinement(
    data: Any,
    modes: ModalModel,
    *,
    groups: Any = AUTO,
    weights: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
    complete: bool = False,
    confined: bool = False,
    settings: Settings | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Refinement:
    """Return modes of responses or of records with inputs at the maximum of the likelihood; arguments as in `refine`.

    `confined`: raise `Astray` with the poles, as they were given, of modes that leave for the optimum of others.
    """
    response = _response(data, modes, Settings() if settings is None else settings).around(modes.poles)
    chosen = check_groups(groups, *response.parts, response.groups)
    poles = modes.poles - response.added_damping
    able = (poles.real < 0) & np.array([kind == "mode" for kind in modes.kinds], dtype=bool)
    own = [terms.poles for terms in modes.residual_terms]
    given = np.concatenate([np.zeros(0), *own] if fixed is None else [np.asarray(fixed, dtype=complex).ravel()])
    held = np.concatenate([given - response.added_damping, poles[~able]])
    task = task_of(response, held, None if weights is None else np.asarray(weights), progress)
    notes, new = list[Note](), 0
    if count := len(task.fixed):
        f, (low, high) = np.abs(task.fixed) / (2 * np.pi), response.span
        outside = int(np.count_nonzero((f < low) | (f > high)))
        text = f"{counted(count, 'computational pole')} kept fixed during refinement"
        text += f", {outside} outside the band" * bool(outside)
        notes.append(Note("held", {"poles": count, "outside": outside}, text))
    start = modes.take(able)
    settled, kept, lost = _significant(task, start, confined)
    start = start.take(kept)
    if complete and settled is not None:
        more = completed(task, start, settled)
        while len(more) > len(start):
            try:
                settled, kept, also = _significant(task, more, confined)
            except Astray as away:
                stays = ~np.isin(more.poles, away.homes)
                if not stays[: len(start)].all():
                    raise
                more = more.take(stays)  # what was added and leaves for the optimum of others is no mode of its own
                continue
            new = sum(k >= len(start) for k in kept)
            start, lost = more.take(kept), [*lost, *also]
            break
        else:
            notes += [] if confined else [Note("added", {"modes": 0}, "no mode was added")]
    if settled is not None and not settled.descent.converged:
        descent = settled.descent
        text = f"Refinement did not converge: {descent.why}; these are the best values so far"
        notes.append(Note("not converged", {"iterations": descent.iterations}, text))
    return Refinement(task, start, settled, chosen, lost, notes, new)


def _ambient(data: Any) -> Setups | None:
    """Return records without inputs as setups, a record alone as the only one; None of other data."""
    test = data if isinstance(data, Setups | Signals) else as_test(data) if isinstance(data, list | tuple) else None
    if isinstance(test, Setups):
        return test
    return Setups(parts=(test,), groups=None) if isinstance(test, Signals) and not test.input_dofs else None


def _response(data: Any, modes: ModalModel, settings: Settings | Mapping[str, Any]) -> Response:
    """Return the response that the modes are of."""
    check_kind("settings", settings, (Settings, Mapping))
    given = {name: settings.get(name) for name in ("band", "exclude", "route", "delays")}
    response = measure(data, **given, reciprocal=False).response
    if set(modes.output_dofs) == set(response.input_dofs) != set(response.output_dofs):  # they were found exchanged
        response, _ = by_reciprocity(response, True)
    if response.ambient:
        raise DataError(
            "refinement on correlations:",
            "errors of correlations are correlated between lags: least squares do not maximize the likelihood",
            "Give the records of the correlations.",
        )
    outputs, inputs = response.values.shape[1], len(response.input_dofs)
    if len(modes.shapes) != outputs or (modes.participation is not None and modes.participation.shape[1] != inputs):
        raise DataError(
            "refinement of modes:",
            f"the data have {outputs} outputs and {inputs} inputs, the modes others",
            "Give the data of the identification, or select the same channels in both.",
        )
    return response


def _significant(task: Task, modes: ModalModel, confined: bool) -> tuple[Settled | None, list[int], list[Candidate]]:
    """Refine the modes; remove the weakest while it is not significant, and refine the others again."""
    kept = list(range(len(modes)))
    lost: list[Candidate] = []
    poles, shapes, rows = modes.poles - task.response.added_damping, modes.shapes, _participation(task, modes)
    home = poles
    while kept:
        try:
            settled = settle(task, poles, shapes, rows, home=home[kept] if confined else None)
        except Astray as away:
            raise Astray(modes.poles[np.isin(home, away.homes)]) from None
        task = replace(task, powers=settled.powers)
        gain = settled.gain
        weakest = int(np.argmin(gain))
        if gain[weakest] >= least_gain(task):
            return settled, kept, lost
        lost.append(_candidate(modes, kept.pop(weakest), float(gain[weakest])))
        shapes, rows = settled.residues
        poles = np.delete(settled.descent.point.poles, weakest)
        shapes, rows = np.delete(shapes, weakest, axis=1), np.delete(rows, weakest, axis=0)
    return None, kept, lost


def _participation(task: Task, modes: ModalModel) -> ComplexArray:
    given = modes.participation
    if given is not None and given.shape[1] == task.response.drives:
        return given
    poles = modes.poles - task.response.added_damping
    participation, _ = task.response.basis(poles, task.response.outside_powers).fit_participation(modes.shapes)
    return participation


def _candidate(modes: ModalModel, j: int, gain: float) -> Candidate:
    return Candidate(
        frequency=float(modes.frequencies[j]),
        damping_ratio=float(modes.damping_ratios[j]),
        gain=float(np.sqrt(gain / 2)),
        reason="not significant in the joint refinement",
        remedy="Analyse a band of its own around it, or measure with less noise; refine=False reports it unrefined.",
    )


def as_given(response: Response, modes: ModalModel, fixed: Array) -> tuple[Task, Settled]:
    """Return decaying modes where they are, as an optimum that needs no descent, under the noise that is seen there.

    `fixed` (k,): rad/s: further poles.
    """
    added = response.added_damping
    task = task_of(response, np.asarray(fixed, dtype=np.complex128) - added, None, None)
    return task, settle(task, modes.poles - added, modes.shapes, _participation(task, modes), most=0)


def in_place(response: Response, modes: ModalModel, fixed: Array, groups: Any = AUTO) -> ModalModel:
    """Return the modes with both standard deviations at the given poles, from information and scores there.

    Repeatability follows from the scores of each group of inputs or runs; their sum need not vanish.

    `modes`: decaying oscillations. `fixed` (k,): rad/s: further poles. `groups`: as in `refine`.
    """
    task, settled = as_given(response, modes, fixed)
    found = retold(refined(task, modes, settled, check_groups(groups, *response.parts, response.groups), [], []))
    return found.take(np.argsort(np.argsort(np.abs(modes.poles), kind="stable"), kind="stable"))
