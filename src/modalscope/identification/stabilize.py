"""Compute the stabilization diagram of a problem: poles of all orders, and their stability from one order to the next.

The verb for data of any kind is `stabilize` of `modalscope.identification.diagrams`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.data.indicators import mac
from modalscope.data.notes import Note
from modalscope.data.results import StabilizationDiagram
from modalscope.data.shown import counted
from modalscope.identification.method import Problem
from modalscope.identification.pipeline import Pipeline, factor
from modalscope.identification.sweep import Cut, Sweep, over
from modalscope.numerics.checks import Array, ComplexArray, RealArray, check_kind, check_positive
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.poles import frequencies_and_damping
from modalscope.numerics.handed import replaceable
from modalscope.numerics.progress import stage

#: Maximum difference of a stable pole to one of the previous order: relative frequency, relative damping, 1 - MAC.
TOLERANCES = {"frequency": 0.01, "damping": 0.05, "shape": 0.05}


def limits_of(tolerances: Mapping[str, float] | None) -> dict[str, float]:
    """Return the given tolerances, completed by the defaults."""
    given = {} if tolerances is None else tolerances
    check_kind("tolerances", given, Mapping)
    limits = {**TOLERANCES, **{k: check_positive(k, v) for k, v in given.items()}}
    if set(limits) != set(TOLERANCES):
        asked = f"tolerances for {', '.join(sorted(map(str, limits)))}:"
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
    with stage("factoring"):
        sweep = over(factor(problem, asked[-1]), asked, automatic=automatic, deviations=deviations)
    return swept(sweep, asked, tolerances, progress, watch)


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
        raise DataError(f"orders {asked[0]} to {asked[-1]}:", str(found.notes[-1]), "Give other orders or block sizes.")
    return collected(found.pipeline, cuts, limits, (*found.notes, *found.notes_on(cuts)), asked)


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
    stable = [np.zeros((3, cuts[0].reported.size), bool), *(stable_against(a, b, limits) for a, b in pairwise(cuts))]
    flags = np.hstack(stable)
    names = set.intersection(*(set(cut.indicators) for cut in cuts))
    factors, decay = pipeline.factors, complex(pipeline.matrix.judged.added_damping)
    outside = sum(cut.modal.poles.size - cut.reported.size for cut in cuts)
    text = f"{counted(outside, 'pole')} not drawn: outside the band, or computational"
    outsiders = [Note("poles left out", {"poles": outside}, text)] if outside else []
    whitening, records = pipeline.problem.whitening, pipeline.problem.records
    poles = np.concatenate([cut.modal.poles[cut.reported] for cut in cuts])
    return StabilizationDiagram(
        response=pipeline.response,
        method=pipeline.method.name,
        domain=pipeline.method.domain,
        orders=tuple(cut.order for cut in cuts),
        order_of_pole=np.concatenate([np.full(cut.reported.size, cut.order) for cut in cuts]),
        poles=poles + decay,
        shapes=np.concatenate([cut.modal.shapes[:, cut.reported] for cut in cuts], axis=1),
        participation=np.concatenate([cut.modal.participation[cut.reported] for cut in cuts]),
        stable_frequency=flags[0],
        stable_damping=flags[1],
        stable_shape=flags[2],
        asked_orders=tuple(asked),
        **deferred_deviations(cuts),
        indicators={
            **{name: np.concatenate([c.indicators[name][c.reported] for c in cuts]) for name in sorted(names)},
            **({} if records is None else peaks_of_spectra(records, poles)),
        },
        singular_values=factors.spectrum,
        fit_errors=np.array([cut.misfit for cut in cuts]),
        exact_rank=factors.rank if _exact(pipeline, cuts[-1]) else None,
        tolerances=limits,
        outside=np.concatenate([cut.modal.poles[cut.outside] for cut in cuts]) + decay,
        order_of_outside=np.concatenate([np.full(cut.outside.size, cut.order) for cut in cuts]),
        settings=pipeline.settings,
        notes=(*pipeline.notes, *notes, *outsiders, *_doubts(pipeline, cuts, stable)),
        dt=pipeline.matrix.dt,
        measured=pipeline.transformed,
        output_whitening=None if whitening is None else whitening.outputs,
        reference_whitening=None if whitening is None else whitening.references,
    )


def _exact(pipeline: Pipeline, last: Cut) -> bool:
    """Return whether the last order is the rank of noise-free data; samples transformed from a band never count as such."""
    factors, exact = pipeline.factors, pipeline.transformed is None or pipeline.problem.measured.exact_samples
    return exact and last.order == factors.rank < factors.left.shape[1]


def _doubts(pipeline: Pipeline, cuts: Sequence[Cut], stable: Sequence[Array]) -> tuple[Note, ...]:
    """Return notes on the measurement from the model that fits best."""
    cut, flags = min(zip(cuts, stable, strict=True), key=lambda pair: pair[0].misfit)
    trusted = np.zeros(cut.modal.poles.size, bool)
    trusted[cut.reported[flags.all(axis=0)]] = True
    fit = cut.modal.fit
    return pipeline.response.doubts(cut.modal.poles, fit.shapes, fit.participation, fit.terms, trusted)
