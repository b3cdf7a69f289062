"""Compare every method on the same data: `compare`, and its extension to further methods."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from modalscope.comparing.agreement import Group, pair
from modalscope.comparing.causes import Cause
from modalscope.comparing.diagnosis import (
    channel_causes,
    disagreements,
    mode_causes,
    order_cause,
    sign_causes,
    without_dead,
)
from modalscope.comparing.identities import check_identities
from modalscope.comparing.kinship import Kinship, kinship
from modalscope.comparing.result import Comparison
from modalscope.comparing.routes import route_causes, tasks_of, witnesses
from modalscope.comparing.run import Cell, MethodResult, Progress, run
from modalscope.comparing.scatter import Scatter, Tried, certified_best, interval_trouble, stated
from modalscope.comparing.verdict import judge, words
from modalscope.data.geometry import DofLike
from modalscope.data.modes import ModalModel
from modalscope.data.notes import notes_of
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.responses import FrequencyResponse, ImpulseResponse
from modalscope.data.setups import Setups, as_test
from modalscope.identification.options import AllOptions
from modalscope.identification.prepare import Data, Measured, pose
from modalscope.judging.certificate import matched
from modalscope.judging.select import select
from modalscope.judging.stabilize import stabilized
from modalscope.modal.rebuilt import explained, explains_enough, fit_error_heard, rebuilt
from modalscope.modal.shapes import joint_residues
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_count, check_kind
from modalscope.numerics.errors import DataError
from modalscope.numerics.resources import one_thread

__all__ = ["changed", "compare"]


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
    return Comparison(
        response=response,
        results=results,
        settings=_settings(methods, orders, {"band": band, "exclude": exclude, **way, **options}),
        notes=notes_of((*ways[0].notes, *failed, *more, *_equals(judged["kinship"]))),
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
        # channels are looked at one by one: of records that is their picture
        drawn = response.picture()
        shown = fitted if drawn is response else rebuilt(drawn, modes)
        findings += sign_causes(drawn)
        findings += channel_causes(drawn, shown, modes.poles - response.added_damping, _best_fit(results))
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


def _best_fit(results: Sequence[MethodResult]) -> float:
    """Return what the best model of any order leaves of the data, real poles and all."""
    return min(
        (float(r.diagram.fit_errors.min()) for r in results if r.diagram is not None and r.exact), default=np.inf
    )


def _consensus(response: Response, groups: Sequence[Group], scatter: Scatter) -> ModalModel:
    """Return the modes in the middle of all methods, with participation fitted to the data."""
    poles = np.array([g.pole for g in groups], dtype=complex)
    shapes = np.zeros((len(response.output_dofs), len(groups)), complex)
    for k, g in enumerate(groups):
        shapes[:, k] = g.shape
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


def _settings(methods: Any, orders: Any, options: dict[str, Any]) -> dict[str, Any]:
    named = methods if isinstance(methods, str) else tuple(str(m) for m in methods)
    asked = None if orders is None else tuple(int(n) for n in orders)
    return {"methods": named, "orders": asked, **options}


def _equals(kin: Kinship) -> list[str]:
    return [f"one and the same on these data, with one vote: {'; '.join(labels)}" for labels in kin.equals]
