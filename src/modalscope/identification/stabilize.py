"""Compute the stabilization diagram: poles of all orders, and their stability from one order to the next (`stabilize`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Unpack

import numpy as np

from modalscope.data.indicators import mac
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.shown import counted
from modalscope.identification.method import Problem
from modalscope.identification.options import AllOptions
from modalscope.identification.pipeline import Pipeline
from modalscope.identification.prepare import prepare
from modalscope.identification.sweep import Cut, Sweep, over_pipeline, resolved_orders, start
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_kind, check_positive
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import working
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.handed import replaceable
from modalscope.numerics.progress import stage
from modalscope.numerics.resources import one_thread

#: Maximum difference of a stable pole to one of the previous order: relative frequency, relative damping, 1 - MAC.
TOLERANCES = {"frequency": 0.01, "damping": 0.05, "shape": 0.05}


def limits_of(tolerances: Mapping[str, float] | None) -> dict[str, float]:
    """Return the given tolerances, completed by the defaults."""
    given = {} if tolerances is None else tolerances
    check_kind("tolerances", given, Mapping)
    limits = {**TOLERANCES, **{k: check_positive(k, v) for k, v in given.items()}}
    if set(limits) != set(TOLERANCES):
        asked = f"tolerances for {', '.join(sorted(map(str, limits)))} were asked"
        raise DataError(asked, f"there are {', '.join(TOLERANCES)}", "Correct the names.")
    return limits


def stable_against(before: Cut, after: Cut, limits: Mapping[str, float] = TOLERANCES) -> Array:
    """Return for each pole of `after` whether frequency, damping and shape agree with one pole of `before`, (3, k).

    `limits`: tolerances of stability, all three.
    """
    new, old = after.reported, before.reported
    if not old.size or not new.size:
        return np.zeros((3, new.size), bool)
    f, zeta = frequencies_and_damping(after.modal.poles[new])
    g, eta = frequencies_and_damping(before.modal.poles[old])
    with np.errstate(divide="ignore", invalid="ignore"):
        frequency = np.abs(f[:, None] - g) <= limits["frequency"] * np.minimum(f[:, None], g)
        damping = np.abs(zeta[:, None] - eta) <= limits["damping"] * np.maximum(np.abs(zeta[:, None]), np.abs(eta))
    shape = 1 - mac(after.modal.shapes[:, new], before.modal.shapes[:, old]) <= limits["shape"]
    # damping and shape are compared among poles of the same frequency; the best of these counts
    score = frequency * (1 + damping + shape + (damping & shape))
    best, rows = np.argmax(score, axis=1), np.arange(new.size)
    return np.stack([frequency[rows, best], (frequency & damping)[rows, best], (frequency & shape)[rows, best]])


Progress = Callable[[int, int], None]

#: Called with the sweep and every cut as it is computed.
Watch = Callable[[Sweep, Cut], None]


@named(AllOptions.__annotations__)
@one_thread
def stabilize(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: Iterable[int] | None = None,
    tolerances: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
    deviations: bool | None = None,
    client: Any = None,
    **options: Unpack[AllOptions],
) -> StabilizationDiagram:
    """Identify at many orders from one factorization and judge each pole against the order before.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse, Signals, Records, a list of records, or Pipeline
        A pipeline was made by `factor`, and takes neither method nor options; its orders do not grow.
    method, domain : str, optional
        A cell of the table of methods, see `identify`.
    orders : iterable of int, optional
        Numbers of states (of "lscf" the degrees of the polynomials); 2, 4, ... up to 80 for frequency responses, 60 for impulse
        responses and 40 for correlations by default, and up to four times as many while the fit error falls as if modes were missing.
        Orders out of reach are left out, with a note.
    tolerances : mapping, optional
        Limits of stability by name, "frequency", "damping" (relative) and "shape" (1 - MAC); 1 %, 5 % and 5 % by default.
    progress : callable, optional
        Called with (orders done, orders in all).
    watch : callable, optional
        Called with (sweep, cut) for every order as it comes; see `sweep`. A sweep is started again where more orders are needed.
    deviations : bool, optional
        Standard deviations of the poles are computed when `frequencies_std` or `damping_ratios_std` of the diagram is first read, and
        those of selected poles alone in `select`; True computes all at once, False none ever.
    client : distributed.Client, optional
        Workers of a Dask scheduler, which sum over a stored record; see `working`.
    **options
        Band, channels, block sizes and the rest, as in `identify`.

    Returns
    -------
    StabilizationDiagram

    Raises
    ------
    DataError
        Data that cannot be used, or no order within reach.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> d = stabilize(chain5().state_space(dt=0.05).impulse_response(200), orders=range(2, 21, 2))
    >>> d.orders, d.exact_rank
    ((2, 4, 6, 8, 10), 10)
    """

    def computed(found: StabilizationDiagram) -> StabilizationDiagram:
        if deviations:
            _ = found.frequencies_std
        return found

    if isinstance(data, Pipeline):
        named_options = {"method": method, "domain": domain, **options}
        sweep = over_pipeline(data, orders, named_options, deviations=deviations is not False)
        return computed(swept(sweep, resolved_orders(data.problem, orders), tolerances, progress, watch))

    def diagram(asked: Iterable[int] | None = orders, **way: Any) -> StabilizationDiagram:
        with stage("preparing"):
            problem = prepare(examined, method, domain, **{**options, **way})
        first = stabilized(
            problem,
            resolved_orders(problem, asked),
            automatic=orders is None,
            tolerances=tolerances,
            progress=progress,
            watch=watch,
            deviations=deviations is not False,
        )
        if orders is not None or asked is not None or not problem.method.orders.truncates:
            return first
        return grown(first, lambda more: diagram(more, **way))

    with working(client):
        examined = data if isinstance(data, Response) else looked_through(data, options.get("exclude"))
        automatic = method is None and domain is None and options.get("route") in (None, "auto")
        return computed(by_instruments(diagram(), diagram) if automatic else diagram())


@replaceable("looked_through")
def looked_through(data: Any, exclude: Any) -> Any:
    """Return data as they are; a record without inputs is seen once for all orders, see `modalscope.identification.ambient_records`."""
    return data


@replaceable("grown")
def grown(found: StabilizationDiagram, again: Callable[[Iterable[int]], StabilizationDiagram]) -> StabilizationDiagram:
    """Return a diagram as it is, or with more orders while its fit error falls, see `modalscope.identification.orders`."""
    return found


@replaceable("by_instruments")
def by_instruments(found: StabilizationDiagram, again: Callable[..., StabilizationDiagram]) -> StabilizationDiagram:
    """Return a diagram as it is, or by instruments against unmeasured forces, see `modalscope.identification.instruments`."""
    return found


@replaceable("deferred_deviations")
def deferred_deviations(cuts: Sequence[Cut]) -> dict[str, Any]:
    """Return the fields of standard deviations, see `modalscope.identification.deviating`."""
    return {}


@replaceable("peaks_of_spectra")
def peaks_of_spectra(records: Any, poles: ComplexArray) -> dict[str, RealArray]:
    """Return indicators of a record's own spectra, see `modalscope.signals.preprocess.spectral_peaks`."""
    return {}


def stabilized(
    problem: Problem,
    asked: list[int],
    *,
    automatic: bool = False,
    tolerances: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
    deviations: bool = True,
) -> StabilizationDiagram:
    """Return the diagram of a problem; see `stabilize`.

    `asked`: orders, increasing. `automatic`: whether nobody asked for just these: then some order is always found.
    """
    limits = limits_of(tolerances)
    with stage("factoring"):
        sweep = start(problem, asked, automatic=automatic, deviations=deviations)
    return swept(sweep, asked, limits, progress, watch)


def swept(
    found: Sweep,
    asked: Sequence[int],
    tolerances: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
) -> StabilizationDiagram:
    """Return the diagram of the remaining orders of a sweep. `asked`: the orders that were requested."""
    limits, cuts = limits_of(tolerances), []
    for cut in found:
        cuts.append(cut)
        if watch is not None:
            watch(found, cut)
        if progress is not None:
            progress(len(found.orders) - len(found.remaining), len(found.orders))
    if not cuts:
        orders = f"orders {asked[0]} to {asked[-1]} were asked"
        raise DataError(orders, str(found.notes[-1]), "Choose other orders or block sizes.")
    notes = (*found.notes, *found.notes_on(cuts))
    return collected(found.pipeline, cuts, limits, notes, asked)


def collected(
    pipeline: Pipeline,
    cuts: Sequence[Cut],
    limits: Mapping[str, float],
    notes: Sequence[Note] = (),
    asked: Sequence[int] = (),
) -> StabilizationDiagram:
    """Return the diagram of the given orders.

    `cuts`: at least one, by increasing order. `limits`: tolerances of stability, all three. `notes`: on orders left out. `asked`: orders
    that were requested.
    """
    stable = [np.zeros((3, cuts[0].reported.size), bool)]
    stable += [stable_against(before, after, limits) for before, after in pairwise(cuts)]
    flags = np.hstack(stable)
    names = set.intersection(*(set(cut.indicators) for cut in cuts))
    factors, decay = pipeline.factors, complex(pipeline.matrix.judged.added_damping)
    outside = sum(cut.modal.poles.size - cut.reported.size for cut in cuts)
    text = f"{counted(outside, 'pole')} outside the band, or extraneous, not in the diagram"
    outsiders = [Note("poles left out", {"poles": outside}, text)] if outside else []
    whitening, records = pipeline.problem.whitening, pipeline.problem.records
    poles = [cut.modal.poles[cut.reported] for cut in cuts]
    return StabilizationDiagram(
        response=pipeline.response,
        method=pipeline.method.name,
        domain=pipeline.method.domain,
        orders=tuple(cut.order for cut in cuts),
        order_of_pole=np.concatenate([np.full(cut.reported.size, cut.order) for cut in cuts]),
        poles=np.concatenate(poles) + decay,
        shapes=np.concatenate([cut.modal.shapes[:, cut.reported] for cut in cuts], axis=1),
        participation=np.concatenate([cut.modal.participation[cut.reported] for cut in cuts]),
        stable_frequency=flags[0],
        stable_damping=flags[1],
        stable_shape=flags[2],
        asked_orders=tuple(asked),
        **deferred_deviations(cuts),
        indicators={
            **{name: np.concatenate([c.indicators[name][c.reported] for c in cuts]) for name in sorted(names)},
            **({} if records is None else peaks_of_spectra(records, np.concatenate(poles))),
        },
        singular_values=factors.spectrum,
        fit_errors=np.array([cut.misfit for cut in cuts]),
        exact_rank=factors.rank if _exact(pipeline, cuts[-1]) else None,
        tolerances=limits,
        settings=pipeline.settings,
        notes=(*pipeline.notes, *notes, *outsiders, *_doubts(pipeline, cuts, stable)),
        dt=pipeline.matrix.dt,
        measured=pipeline.transformed,
        output_whitening=None if whitening is None else whitening.outputs,
        reference_whitening=None if whitening is None else whitening.references,
    )


def _exact(pipeline: Pipeline, last: Cut) -> bool:
    """Return whether the last order is the rank of noise-free data; samples transformed from a band never count as such."""
    factors, problem = pipeline.factors, pipeline.problem
    if pipeline.transformed is not None and not problem.measured.exact_samples:
        return False
    return factors.rank < factors.left.shape[1] and factors.rank == last.order


def _doubts(pipeline: Pipeline, cuts: Sequence[Cut], stable: Sequence[Array]) -> tuple[Note, ...]:
    """Return notes on the measurement from the model that fits best."""
    cut, flags = min(zip(cuts, stable, strict=True), key=lambda pair: pair[0].misfit)
    trusted = np.zeros(cut.modal.poles.size, bool)
    trusted[cut.reported[flags.all(axis=0)]] = True
    fit = cut.modal.fit
    return pipeline.response.doubts(cut.modal.poles, fit.shapes, fit.participation, fit.terms, trusted)
