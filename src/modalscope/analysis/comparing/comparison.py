"""Compare methods on the same data: their consensus, its trust, where they differ and why."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modalscope.analysis.checking.certify import MOST_REPLICATES
from modalscope.analysis.comparing.agreement import Group, pair
from modalscope.analysis.comparing.beside import analysis_of, beside
from modalscope.analysis.comparing.data_causes import (
    Data,
    changed_by_more_orders,
    channel_causes,
    order_cause,
    sign_causes,
    without_dead,
)
from modalscope.analysis.comparing.diagnosis import Cause, Disagreement, disagreements, mode_causes
from modalscope.analysis.comparing.identities import Identity, check_identities
from modalscope.analysis.comparing.kinship import Kinship, kinship
from modalscope.analysis.comparing.principles import Principle, Witness, headline, principles_of, witnesses_of
from modalscope.analysis.comparing.routes import responses_by_route, route_causes, tasks_of
from modalscope.analysis.comparing.run import MethodResult, Partial, Progress, find_by_name, run
from modalscope.analysis.comparing.scatter import LEVEL, Scatter, stated
from modalscope.analysis.comparing.verdict import Tried, Trust, certified_best, judge, refuted, words
from modalscope.data.geometry import DofLike
from modalscope.data.mode_fields import told
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note, notes_of
from modalscope.data.rebuilt import explains_enough, fit_error_heard, rebuilt, unexplained
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.results import Result
from modalscope.data.setups import Setups, as_test
from modalscope.data.shown import Shown, cells_of, figures, summary_of, text_table
from modalscope.identification.method import checked_orders
from modalscope.identification.options import AllOptions
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_count, check_kind
from modalscope.numerics.progress import tell
from modalscope.numerics.resources import one_thread
from modalscope.selection.likelihood.joint_fit import joint_residues

#: Modes in a row of a table of text.
_MODES_A_TABLE = 5

#: Maximum rank at which identities are checked; that of the consensus where it is lower.
_MAX_IDENTITY_ORDER = 20


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Comparison(Shown):
    """Results of all methods on the same data, the modes on which they agree, and how far each is known.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
        The data of all methods.
    results : tuple of MethodResult
        One per method: modes, diagram, fit error, seconds, or the failure.
    modes : ModalModel
        The consensus; `frequencies_spread` and `damping_ratios_spread` are the standard deviations between methods.
    groups : tuple of Group
        For every mode of the consensus the values of each method.
    unconfirmed : tuple of Group
        Modes of methods on transformed data alone: not in the consensus.
    scatter : Scatter
        Stated scatter of every mode.
    fit_error : float
        Of the consensus on `response`.
    trust : tuple of Trust
    kinship : Kinship
    identities : tuple of Identity
    disagreements : tuple of Disagreement
    findings : tuple of Cause
        Causes that concern channels and orders.
    verdict : str
    certified : Tried, optional
        The certificate of the method that fits best, where one was asked.
    analysis : Result, optional
        What `analyze` finds in the same data: intervals of the consensus are no narrower than its, and grades are its grades.
    settings : mapping
        Arguments: methods, orders, band, excluded channels.
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
    analysis: Result | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()

    @property
    def causes(self) -> frozenset[str]:
        """Names of all causes, of the data or of a mode."""
        causes = [*self.findings, *(c for t in self.trust for c in t.causes)]
        return frozenset(c.name for c in (*causes, *(c for d in self.disagreements for c in d.causes)))

    def __getitem__(self, name: str | tuple[str, str]) -> MethodResult:
        """Return the result of one method, by any of its names: `comparison["era (s)"]`, `comparison["ssi-cov"]`.

        Raises
        ------
        DataError
            No method of that name was compared; the nearest is named.
        """
        return find_by_name(self.results, name)

    @property
    def principles(self) -> tuple[Principle, ...]:
        """Which methods are one and the same estimator on these data, and why; every method with modes is in one."""
        return principles_of(self.kinship, self.identities)

    @property
    def witnesses(self) -> tuple[tuple[Witness, ...], ...]:
        """Return for every mode the independent witnesses that its trust counts, each by route, domain and principle."""
        return witnesses_of(self.groups, self.results, self.principles)

    @property
    def headline(self) -> str:
        """How many methods ran, how many of them are different, which are one, and to what the identities hold: counted and measured."""
        return headline(self.kinship, self.results, self.principles, self.identities)

    def __str__(self) -> str:
        return self.table(each=False)

    def label(self, name: str) -> str:
        """Return the name in the literature of a method that groups and disagreements name.

        Parameters
        ----------
        name : str
            As in `MethodResult.name`.
        """
        return next((r.label for r in self.results if r.name == name), name)

    def table(self, each: bool = True) -> str:
        """Return how many methods differ, modes, verdict and methods as text.

        Parameters
        ----------
        each : bool
            Whether the values of every method for every mode follow.
        """
        parts = [self.headline, self._modes_table(), self.verdict, self._methods_table()]
        parts += self._each_tables() if each else ()
        return "\n\n".join(part for part in parts if part)

    def _modes_table(self) -> str:
        head = ["mode", "f [Hz]", "+-", "zeta [%]", "+-", "methods", "MAC", "", "grade"]
        count = sum(r.modes is not None for r in self.results)
        rows = [
            [
                str(k + 1),
                f"{g.frequency:.4f}",
                told(self.scatter.frequency[k]),
                f"{100 * g.damping:.3f}",
                told(100 * self.scatter.damping[k]),
                f"{len(g.members)} of {count}",
                f"{min(g.mac.values()):.3f}",
                t.agreement,
                t.grade,
            ]
            for k, (g, t) in enumerate(zip(self.groups, self.trust, strict=True))
        ]
        lead = f"Consensus (+-: {100 * LEVEL:g} % intervals, of noise and disagreement beyond it, no narrower than those of the analysis)"
        return f"{lead}\n{text_table([head, *rows], (0, 7, 8))}" if rows else "No mode in common."

    def _methods_table(self) -> str:
        head = ["method", "modes", "unexplained [%]", "seconds", ""]
        rows = []
        for r in self.results:
            if r.modes is None or r.fit_error is None:
                rows.append([r.label, "-", "-", f"{r.seconds:.1f}", f"failed: {r.failure}"])
                continue
            notes = [] if explains_enough(r.fit_error) else ["TOO MUCH UNEXPLAINED"]
            notes += [] if r.exact else ["not counted" if r.route else "transformed data, not counted"]
            rows.append([r.label, str(len(r.modes)), f"{100 * r.fit_error:.2f}", f"{r.seconds:.1f}", "; ".join(notes)])
        return f"Methods\n{text_table([head, *rows], (0, 4))}"

    def _each_tables(self) -> list[str]:
        """Return the values of every method for every mode, as tables of a few modes that fit on a line."""
        names = [r.name for r in self.results if r.modes is not None]
        tables = []
        for first in range(0, len(self.groups) if names else 0, _MODES_A_TABLE):
            groups = self.groups[first : first + _MODES_A_TABLE]
            head = ["f [Hz] / zeta [%]", *(f"mode {k + 1}" for k in range(first, first + len(groups)))]
            rows = [[self.label(name), *(_value(g, name) for g in groups)] for name in names]
            lead = "Every method, further modes" if first else "Every method"
            tables.append(f"{lead}\n{text_table([head, *rows], (0,))}")
        return tables


def _value(group: Group, name: str) -> str:
    if name not in group.members:
        return "-"
    return f"{group.frequencies[name]:.5g} / {figures(100 * group.damping_ratios[name])}"


@summary_of.register
def _(comparison: Comparison) -> str:
    return f"comparison of {comparison.headline}; {summary_of(comparison.modes)}; {comparison.verdict.splitlines()[0]}"


@cells_of.register
def _(comparison: Comparison) -> list[list[str]]:
    return cells_of(comparison.modes)


@named(AllOptions.__annotations__, ("tolerances",))
@one_thread
def compare(
    data: Data,
    methods: str | Iterable[Any] = "all",
    *,
    orders: int | Iterable[int] | None = None,
    band: tuple[float, float] | None = None,
    exclude: Iterable[DofLike] | DofLike | None = None,
    progress: Progress | None = None,
    workers: int | None = None,
    replicates: int = 0,
    all_sets: bool = False,
    partial: Partial | None = None,
    analysis: Result | None = None,
    **options: Any,
) -> Comparison:
    """Compare all methods on the same data: the modes on which they agree, where they differ and why, and how far each is known.

    Responses are estimated from records once, for all methods, and each method has a stabilization diagram. Which modes the data need is
    decided once, from the poles of all of them; a method has found those that its own poles show, with its own values. Modes are paired
    across methods by frequency, damping and shape. A method that fails is a row with its reason. A method on data transformed from lines to
    samples or back is compared, but has no vote. What methods share (leakage, loading) they cannot see: intervals of the consensus are no
    narrower than those that `analyze` finds in the same data, and a mode has its grade there.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
    methods : "all" or iterable of str, (str, str) or Method
        Rows of the table ("era") or cells ("era/s").
    orders : int or iterable of int, optional
        Numbers of states, for every method, or the largest.
    band : (float, float), optional
        Lowest and highest frequency in Hz.
    exclude : labels, optional
        Channels to leave out. Dead channels are left out in any case, as a finding.
    progress : callable, optional
        Called with (orders done, orders in all), over all methods.
    workers : int, optional
        Methods at a time.
    replicates : int
        Number of simulations of the method that fits best, which certify the intervals (see `certify`); none by default.
    all_sets : bool
        With methods "all": whether rows that have no vote are run, too. They are shown, and decide nothing.
    partial : callable, optional
        Called with the result of each method as it comes; which of them have a vote is decided at the end.
    analysis : Result, optional
        Of `analyze`, of the same data and band; by default it is made.
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
    check_count("replicates", replicates, least=0, most=MOST_REPLICATES)
    data, causes = without_dead(data)
    route_options = {name: options.pop(name, None) for name in ("route", "delays", "reciprocal")}
    routes, failed = responses_by_route(data, band, **route_options)
    tasks, refused = tasks_of(routes, methods, orders, all_sets=all_sets)
    measured, cells = [data for data, _ in tasks], [cell for _, cell in tasks]
    ran = run(measured, cells, progress=progress, workers=workers, partial_results=partial, **options)
    results, of_routes = route_causes(ran)
    causes += of_routes
    tried = certified_best(results, [data.held for data in measured], replicates)
    low = order_cause(results)
    if low is not None and changed_by_more_orders(tasks, results, options):
        causes.append(low)
    check_kind("analysis", analysis, (Result, type(None)))
    without = ""
    if analysis is None and any(r.modes is not None for r in results):
        analysis, without = analysis_of(data, band, orders, {**route_options, **options})
    judged = _judged(routes[0].response, results, causes, tried, analysis)
    equal = [f"Identical on these data, with one vote: {'; '.join(labels)}" for labels in judged["kinship"].equals]
    settings = {
        "methods": methods if isinstance(methods, str) else tuple(map(str, methods)),
        "orders": None if orders is None else tuple(checked_orders(orders)),
        "band": band,
        "exclude": exclude,
        **({"all_sets": True} if all_sets else {}),
    }
    unknown = [f"No analysis of the same data, so that no mode is good: {without}"] if without else []
    notes = notes_of((*routes[0].notes, *failed, *refused, *equal, *unknown))
    settings |= {**route_options, **options}
    found = Comparison(response=routes[0].response, results=results, settings=settings, notes=notes, **judged)
    tell(found.headline, found.verdict, *notes)
    return found


def _judged(
    response: Response,
    results: tuple[MethodResult, ...],
    findings: list[Cause],
    tried: Tried | None,
    analysis: Result | None,
) -> dict[str, Any]:
    """Return the consensus, how far it is known, and what differs and why, by the fields of a `Comparison`."""
    kin = kinship(results)
    groups, unconfirmed = pair(results, kin)
    scatter = stated(groups, results)
    modes = _consensus(response, groups, scatter)
    in_analysis = beside(modes, analysis)
    scatter = scatter.at_least(np.reshape([b.half_widths for b in in_analysis], (-1, 2)).T)
    modes = replace(modes, **_deviations(scatter))
    fitted = rebuilt(response, modes) if groups else 0 * response.values
    fit_error = fit_error_heard(response, fitted)[0]
    if groups:
        picture = response.picture()  # of records: channels are examined one by one
        of_picture = fitted if picture is response else rebuilt(picture, modes)
        findings += sign_causes(picture)
        errors = (float(r.diagram.fit_errors.min()) for r in results if r.diagram is not None and r.exact)
        best = min(errors, default=np.inf)  # of the models of any order, real poles and all
        findings += channel_causes(picture, of_picture, modes.poles - response.added_damping, best)
    trust = []
    for k, g in enumerate(groups):
        causes = mode_causes(k, groups, response, results)
        spread = scatter.beyond_noise("frequency")[k], scatter.beyond_noise("damping")[k]
        half = scatter.frequency[k], scatter.damping[k]
        trust.append(judge(g, spread, in_analysis[k], causes, findings, interval=half, refuted=refuted(g, tried)))
    warning = f"{unexplained(fit_error)}\n" if groups and not explains_enough(fit_error) else ""
    return {
        "modes": modes,
        "groups": groups,
        "unconfirmed": unconfirmed,
        "scatter": scatter,
        "fit_error": fit_error,
        "trust": tuple(trust),
        "kinship": kin,
        "identities": check_identities(response.picture(), min(max(2 * len(groups), 2), _MAX_IDENTITY_ORDER)),
        "disagreements": disagreements(groups, response, results, findings, scatter),
        "findings": tuple(findings),
        "verdict": f"{warning}{words(groups, trust, scatter, results, findings)}",
        "certified": tried,
        "analysis": analysis,
    }


def _deviations(scatter: Scatter) -> dict[str, Any]:
    return {
        f"{name}_std": scatter.deviation(kind)
        for name, kind in (("frequencies", "frequency"), ("damping_ratios", "damping"))
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
        **_deviations(scatter),
        degrees=np.stack([scatter.degrees] * 2, axis=1),
        indicators={"found_by": np.array([float(len(g.members)) for g in groups])},
        **response.labelled(),
        **fitted,
    ).normalized("unit")
