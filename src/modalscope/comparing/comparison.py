"""Compare methods on the same data: their consensus, its trust, where they differ and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np

from modalscope.checking.certificate import matched
from modalscope.comparing.agreement import Group, pair
from modalscope.comparing.diagnosis import (
    Cause,
    Disagreement,
    channel_causes,
    disagreements,
    mode_causes,
    order_cause,
    sign_causes,
    without_dead,
)
from modalscope.comparing.identities import Identity, check_identities
from modalscope.comparing.kinship import Kinship, kinship
from modalscope.comparing.routes import route_causes, tasks_of, witnesses
from modalscope.comparing.run import Cell, MethodResult, Progress, run
from modalscope.comparing.scatter import LEVEL, Scatter, Tried, certified_best, interval_trouble, stated
from modalscope.comparing.verdict import Trust, judge, words
from modalscope.data.geometry import DofLike
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note, notes_of
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups, as_test
from modalscope.data.shown import Shown, cells_of, summary_of, text_table
from modalscope.identification.method import Method
from modalscope.identification.options import AllOptions
from modalscope.identification.prepare import Data, Measured, pose
from modalscope.identification.stabilize import stabilized
from modalscope.judging.select import select
from modalscope.modal.rebuilt import explained, explains_enough, fit_error_heard, rebuilt, share_explained
from modalscope.modal.shapes import joint_residues
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_count, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread

# -------------------------------------------------------------------------------------------------------------- labels
# What methods are called in tables and pictures, and how a result is found by any of its method's names.


def find_by_name(results: Sequence[MethodResult], name: str | tuple[str, str]) -> MethodResult:
    """Return the one result whose method has a name: `era (s)`, `ERA/s`, `ssi_cov`, `PolyMAX`; case, blanks and signs do not matter.

    Raises `DataError`: no such result, with the nearest name; or one name of several.
    """
    asked = name if isinstance(name, str) else "/".join(map(str, name))
    wanted = _plain(asked)
    found = [r for r in results if wanted in {n + r.method.domain for n in _names(r.method)}]
    found = found or [r for r in results if wanted in _names(r.method)]
    if len(found) == 1:
        return found[0]
    there = [str(r.method) for r in found or results]
    if found:
        raise DataError(f"the result of {asked!r} was asked", f"that is {' and '.join(there)}", "Name one of these.")
    spelt = {_plain(word): word for r in results for word in (str(r.method), r.method.label)}
    near = get_close_matches(wanted, spelt, n=1, cutoff=0.5)
    hint = f"Did you mean {spelt[near[0]]!r}? " if near else ""
    raise DataError(
        f"the result of {asked!r} was asked", f"there are {', '.join(there) or 'none'}", f"{hint}Name one of these."
    )


def _names(method: Method) -> set[str]:
    words = (method.name, method.label, method.common, *method.known_as, *method.aliases)
    return {_plain(word.partition(" on ")[0].partition(" with ")[0]) for word in words} | {_plain(method.label)}


def _plain(text: str) -> str:
    """Return letters and digits alone, in lower case."""
    return "".join(c for c in str(text).casefold() if c.isalnum())


# -------------------------------------------------------------------------------------------------------------- result

#: Modes that stand beside each other in a table of text.
_BESIDE = 5


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Comparison(Shown):
    """What all methods found on the same data, the modes that they agree on, and how far to trust each.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
        What all methods were given.
    results : tuple of MethodResult
        One a method: modes, diagram, fit error, seconds, or the failure.
    modes : ModalModel
        The consensus; `frequencies_spread` and `damping_ratios_spread` are the standard deviations between methods.
    groups : tuple of Group
        For every mode of the consensus what each method found.
    unconfirmed : tuple of Group
        What only methods on transformed data found: not in the consensus.
    scatter : Scatter
        Stated scatter of every mode.
    fit_error : float
        Of the consensus on `response`.
    trust : tuple of Trust
    kinship : Kinship
    identities : tuple of Identity
    disagreements : tuple of Disagreement
    findings : tuple of Cause
        What was found about channels and orders.
    verdict : str
    certified : Tried, optional
        The certificate of the method that fits best, where one was asked.
    settings : mapping
        What was asked: methods, orders, band, excluded channels.
    notes : tuple of Note
    """

    response: Response
    results: tuple[MethodResult, ...]
    modes: ModalModel
    groups: tuple[Group, ...]
    unconfirmed: tuple[Group, ...]
    scatter: Scatter
    fit_error: float
    trust: tuple[Trust, ...]
    kinship: Kinship
    identities: tuple[Identity, ...]
    disagreements: tuple[Disagreement, ...]
    findings: tuple[Cause, ...]
    verdict: str
    certified: Tried | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()

    @property
    def causes(self) -> frozenset[str]:
        """Names of all causes that were named, of the data or of a mode."""
        every = [*self.findings, *(c for t in self.trust for c in t.causes)]
        every += [c for d in self.disagreements for c in d.causes]
        return frozenset(c.name for c in every)

    def __getitem__(self, name: str | tuple[str, str]) -> MethodResult:
        """Return the result of one method, by any of its names: `comparison["era (s)"]`, `comparison["ssi-cov"]`.

        Raises
        ------
        DataError
            No method of that name was compared; the nearest is named.
        """
        return find_by_name(self.results, name)

    def label(self, name: str) -> str:
        """Return what the literature calls a method that groups and disagreements name.

        Parameters
        ----------
        name : str
            As in `MethodResult.name`.
        """
        return next((r.label for r in self.results if r.name == name), name)

    def table(self, each: bool = True) -> str:
        """Return modes, verdict and methods as text.

        Parameters
        ----------
        each : bool
            Whether what every method says of every mode follows.
        """
        parts = [self._modes_table(), self.verdict, self._methods_table(), *(self._each_tables() if each else ())]
        return "\n\n".join(part for part in parts if part)

    def _modes_table(self) -> str:
        head = ["mode", "f [Hz]", "+-", "zeta [%]", "+-", "methods", "MAC", "trust"]
        count = sum(r.modes is not None for r in self.results)
        rows = [
            [
                str(k + 1),
                f"{g.frequency:.4f}",
                f"{self.scatter.frequency[k]:.2g}",
                f"{100 * g.damping:.3f}",
                f"{100 * self.scatter.damping[k]:.2g}",
                f"{len(g.members)} of {count}",
                f"{min(g.mac.values()):.3f}",
                t.grade,
            ]
            for k, (g, t) in enumerate(zip(self.groups, self.trust, strict=True))
        ]
        lead = f"Consensus (+-: the truth within it in {100 * LEVEL:g} %, by the noise and by what methods disagree beyond it)"
        return f"{lead}\n{text_table([head, *rows], (0,))}" if rows else "No mode in common."

    def _methods_table(self) -> str:
        head = ["method", "modes", "fit error [%]", "seconds", ""]
        rows = []
        for r in self.results:
            if r.modes is None or r.fit_error is None:
                rows.append([r.label, "-", "-", f"{r.seconds:.1f}", f"failed: {r.failure}"])
                continue
            note = "" if r.exact else "no vote" if r.route else "transformed data, no vote"
            if not explains_enough(r.fit_error):
                note = f"EXPLAINS ONLY {100 * share_explained(r.fit_error):.0f} %" + (f"; {note}" if note else "")
            rows.append([r.label, str(len(r.modes)), f"{100 * r.fit_error:.2f}", f"{r.seconds:.1f}", note])
        return f"Methods\n{text_table([head, *rows], (0, 4))}"

    def _each_tables(self) -> list[str]:
        """Return what every method says of every mode, as tables of a few modes: lines that wrap cannot be read."""
        names = [r.name for r in self.results if r.modes is not None]
        starts = range(0, len(self.groups), _BESIDE) if names else ()
        return [self._each_table(names, range(first, min(first + _BESIDE, len(self.groups)))) for first in starts]

    def _each_table(self, names: Sequence[str], modes: Sequence[int]) -> str:
        head = ["f [Hz] / zeta [%]", *(f"mode {k + 1}" for k in modes)]
        groups = [self.groups[k] for k in modes]
        rows = [
            [
                self.label(name),
                *(
                    f"{g.frequencies[name]:.5g} / {100 * g.damping_ratios[name]:.3g}" if name in g.members else "-"
                    for g in groups
                ),
            ]
            for name in names
        ]
        lead = "Every method" if modes[0] == 0 else "Every method, further modes"
        return f"{lead}\n{text_table([head, *rows], (0,))}"


@summary_of.register
def _(found: Comparison) -> str:
    return f"comparison of {len(found.results)} methods: {summary_of(found.modes)}; {found.verdict.splitlines()[0]}"


@cells_of.register
def _(found: Comparison) -> list[list[str]]:
    return cells_of(found.modes)


# ------------------------------------------------------------------------------------------------------------- further
# Whether orders above those that were asked change the modes that are reported.

#: The largest order is raised twofold, by so many states at most, and by so many orders at least: a mode must be seen at some.
_MORE, _ORDERS = 40, 8

#: A mode has moved by this share of its half bandwidth (frequency), or of its damping.
_MOVED = 0.25


def changed_by_more_orders(
    tasks: Sequence[tuple[Measured, Cell]], results: Sequence[MethodResult], options: dict[str, Any]
) -> bool:
    """Return whether the method with a vote that fits best reports other modes when it is given more orders.

    Where they are out of reach nobody can tell, and they are taken to.

    `results`: one a task. `options`: of `compare`, for every method.
    """
    able = [(t, r) for t, r in zip(tasks, results, strict=True) if r.exact and r.modes is not None]
    if not able:
        return True
    (measured, cell), best = min(able, key=lambda pair: np.inf if pair[1].fit_error is None else pair[1].fit_error)
    top = cell.orders[-1]
    step = top - cell.orders[-2] if len(cell.orders) > 1 else top
    more = range(top + step, max(min(2 * top, top + _MORE), top + _ORDERS * step) + 1, step)
    try:
        diagram = stabilized(pose(measured, cell.method, {**cell.options, **options}), [*cell.orders, *more])
        found = select(diagram)
    except DataError:
        return True
    assert best.modes is not None
    return diagram.orders[-1] <= top or changed(best.modes, found)


def changed(before: ModalModel, after: ModalModel) -> bool:
    """Return whether modes are not the same: another number, another shape, or values moved by a quarter of the half bandwidth."""
    mine, theirs = matched(before, after)
    if not len(mine) == len(before) == len(after):
        return True
    old, new = before.take(mine), after.take(theirs)
    f = np.abs(new.frequencies - old.frequencies) > _MOVED * old.frequencies * old.damping_ratios
    zeta = np.abs(new.damping_ratios - old.damping_ratios) > _MOVED * old.damping_ratios
    return bool(np.any(f | zeta))


# ---------------------------------------------------------------------------------------------------------- comparison

#: Rank at which identities are checked: the consensus' own, but no more.
_IDENTITY_ORDER = 20


@named(AllOptions.__annotations__, ("tolerances",))
@one_thread
def compare(
    data: Data,
    methods: str | Iterable[Any] = "all",
    *,
    orders: Iterable[int] | None = None,
    band: tuple[float, float] | None = None,
    exclude: Iterable[DofLike] | DofLike | None = None,
    progress: Progress | None = None,
    workers: int | None = None,
    replicates: int = 0,
    **options: Any,
) -> Comparison:
    """Compare all methods on the same data: which modes they agree on, where they differ and why, and which to trust.

    Records are turned into responses once, for all methods. Each method has its own stabilization diagram and selection; modes are
    paired across methods by frequency, damping and shape. A method that fails is a row that says why. What has to be transformed from lines
    to samples or back is compared, but has no vote.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
    methods : "all" or iterable of str, (str, str) or Method
        Rows of the table ("era") or cells ("era/s").
    orders : iterable of int, optional
        Numbers of states, for every method.
    band : (float, float), optional
        Lowest and highest frequency in Hz.
    exclude : labels, optional
        Channels to leave out. Channels of zeros are left out in any case, as a finding.
    progress : callable, optional
        Called with (orders done, orders in all), over all methods.
    workers : int, optional
        Methods at a time.
    replicates : int
        So many simulations of the method that fits best certify the intervals (see `certify`); by default none are made.
    **options
        Of `stabilize`, for every method.

    Returns
    -------
    Comparison

    Raises
    ------
    DataError
        Data that no method can use, an unknown method, or none that the data allow.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> response = chain5().impulse_response(300, noise=0.01, seed=0)
    >>> c = compare(response, ["era/time", "least_squares/time"], orders=range(2, 21, 2))
    >>> len(c.modes), c.results[0].name, bool(c.kinship.distances[0, 1] < 1e-9)
    (5, 'era (time)', True)
    """
    data = as_test(data) if isinstance(data, list | tuple) else data
    if exclude is not None:
        data = data.select(exclude=exclude)
    check_kind("compare", data, (FrequencyResponse, ImpulseResponse, Signals, Records, Setups))
    if workers is not None:
        check_count("workers", workers)
    check_count("replicates", replicates, least=0)
    data, findings = without_dead(data)
    way = {name: options.pop(name, None) for name in ("route", "delays")}
    ways, failed = witnesses(data, band, **way)
    tasks, more = tasks_of(ways, methods, orders)
    given, cells = [w for w, _ in tasks], [cell for _, cell in tasks]
    results, causes = route_causes(run(given, cells, progress=progress, workers=workers, **options))
    response = ways[0].response
    tried = certified_best(results, [way.held for way in given], replicates)
    low = order_cause(results)
    if low is not None and changed_by_more_orders(tasks, results, options):
        causes.append(low)
    judged = _judged(response, results, [*findings, *causes], tried)
    same = [
        f"one and the same on these data, with one vote: {'; '.join(labels)}" for labels in judged["kinship"].equals
    ]
    return Comparison(
        response=response,
        results=results,
        settings={
            "methods": methods if isinstance(methods, str) else tuple(str(m) for m in methods),
            "orders": None if orders is None else tuple(int(n) for n in orders),
            "band": band,
            "exclude": exclude,
            **way,
            **options,
        },
        notes=notes_of((*ways[0].notes, *failed, *more, *same)),
        **judged,
    )


def _judged(
    response: Response, results: tuple[MethodResult, ...], findings: list[Cause], tried: Tried | None
) -> dict[str, Any]:
    """Return what the results say together, by the fields of a `Comparison`: the consensus, its trust, and what differs and why."""
    kin = kinship(results)
    groups, unconfirmed = pair(results, kin)
    scatter = stated(groups, results)
    modes = _consensus(response, groups, scatter)
    fitted = rebuilt(response, modes) if groups else 0 * response.values
    left = fit_error_heard(response, fitted)[0]
    if groups:
        # channels are examined one by one: of records that is their picture
        drawn = response.picture()
        shown = fitted if drawn is response else rebuilt(drawn, modes)
        findings += sign_causes(drawn)
        errors = (float(r.diagram.fit_errors.min()) for r in results if r.diagram is not None and r.exact)
        best = min(errors, default=np.inf)  # of the models of any order, real poles and all
        findings += channel_causes(drawn, shown, modes.poles - response.added_damping, best)
    trust = tuple(
        judge(
            g,
            scatter.frequency[k],
            scatter.damping[k],
            mode_causes(k, groups, response, results),
            findings,
            interval_trouble(g, scatter.frequency_noise[k], scatter.damping_noise[k], tried),
        )
        for k, g in enumerate(groups)
    )
    warned = f"{explained(left)}\n" if groups and not explains_enough(left) else ""
    return {
        "modes": modes,
        "groups": groups,
        "unconfirmed": unconfirmed,
        "scatter": scatter,
        "fit_error": left,
        "trust": trust,
        "kinship": kin,
        "identities": check_identities(response.picture(), min(max(2 * len(groups), 2), _IDENTITY_ORDER)),
        "disagreements": disagreements(groups, response, results, findings, scatter),
        "findings": tuple(findings),
        "verdict": f"{warned}{words(groups, trust, scatter, results, findings)}",
        "certified": tried,
    }


def _consensus(response: Response, groups: Sequence[Group], scatter: Scatter) -> ModalModel:
    """Return the modes in the middle of all methods, with participation fitted to the data."""
    poles = np.array([g.pole for g in groups], dtype=complex)
    shapes = np.array([g.shape for g in groups], dtype=complex).reshape(len(groups), len(response.output_dofs)).T
    shapes, fitted = joint_residues(response, poles, shapes)
    dt = None if response.sampling_rate is None else 1 / response.sampling_rate
    return ModalModel(
        poles=poles,
        shapes=shapes,
        quantity=response.quantity,
        dt=dt,
        held_input=response.held_input,
        frequencies_spread=np.array([g.frequency_between for g in groups]),
        damping_ratios_spread=np.array([g.damping_between for g in groups]),
        frequencies_std=scatter.deviation("frequency"),
        damping_ratios_std=scatter.deviation("damping"),
        indicators={"found_by": np.array([float(len(g.members)) for g in groups])},
        **response.labelled(),
        **fitted,
    ).normalized("unit")
