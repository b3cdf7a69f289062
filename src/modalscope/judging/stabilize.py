"""Poles of all orders from one factorization, and what is stable from one order to the next."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from modalscope.blocks.threads import one_thread
from modalscope.identification.accuracy import indicators_of
from modalscope.identification.eigenmodes import Eigenmodes, eigenmodes, split_extraneous
from modalscope.identification.pipeline import Pipeline, build
from modalscope.identification.prepare import Data
from modalscope.modal.basis import basis_of_lines, basis_of_samples, rebuilt_rows
from modalscope.modal.indicators import mac
from modalscope.model.checks import (
    Array,
    DataError,
    check_band,
    check_count,
    check_each,
    check_kind,
    check_positive,
)
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.poles import frequencies_and_damping
from modalscope.model.response import output_scale, window_damping
from modalscope.model.signals import Signals

__all__ = ["TOLERANCES", "stabilize"]

#: A pole is stable when one of the order before differs by less: relative frequency, relative damping, 1 - MAC.
TOLERANCES = {"frequency": 0.01, "damping": 0.05, "shape": 0.05}

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class _Order:
    """The poles of one order that lie in the band."""

    order: int
    modes: Eigenmodes
    inside: Array
    indicators: Mapping[str, Array]
    misfit: float


@one_thread
def stabilize(
    data: Data,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: Iterable[int] | None = None,
    tolerances: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> StabilizationDiagram:
    """Identify at many orders from one factorization and judge each pole against the order before.

    Parameters
    ----------
    data : FrequencyResponse, ImpulseResponse or Signals
    method, domain : str, optional
        A cell of the table of methods, see `identify`.
    orders : iterable of int, optional
        Numbers of states (of "lscf" the degrees of the polynomials); 2, 4, ... up to 80 for frequency responses, 60 for impulse
        responses and 40 for correlations by default. Orders out of reach are left out, with a note.
    tolerances : mapping, optional
        Limits of stability by name, "frequency", "damping" (relative) and "shape" (1 - MAC); 1 %, 5 % and 5 % by default.
    progress : callable, optional
        Called with (orders done, orders in all).
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
    given = {} if tolerances is None else tolerances
    check_kind("tolerances", given, Mapping)
    limits = {**TOLERANCES, **{k: check_positive(k, v) for k, v in given.items()}}
    if set(limits) != set(TOLERANCES):
        raise DataError(
            f"tolerances for {', '.join(sorted(map(str, limits)))} were asked",
            f"there are {', '.join(TOLERANCES)}",
            "Correct the names.",
        )
    if options.get("band") is not None:
        options["band"] = check_band(options["band"])
    asked = _degrees(data) if orders is None and method == "lscf" else _orders_asked(data, orders, options.get("band"))
    pipeline, asked, notes = _build_within_reach(data, method, domain, asked, orders is None, options)
    cuts: list[_Order] = []
    misfit = _misfit_of(pipeline)
    for done, order in enumerate(asked):
        try:
            cuts.append(_one_order(pipeline, order, misfit))
        except DataError as error:
            notes.append(f"order {order} left out: {error.found}")
        if progress is not None:
            progress(done + 1, len(asked))
    if not cuts:
        raise DataError(
            f"orders {asked[0]} to {asked[-1]} were asked", notes[-1], "Choose other orders or block sizes."
        )
    return _diagram(pipeline, cuts, limits, notes)


def _orders_asked(data: Data, orders: Iterable[int] | None, band: tuple[float, float] | None) -> list[int]:
    if orders is None:
        return list(range(2, _largest_order(data, band) + 1, 2))
    found = sorted({check_count("order", n) for n in check_each("orders", orders, "whole numbers")})
    if not found:
        raise DataError(
            "at least one order was asked",
            "the range of orders is empty",
            "Give orders, for instance range(2, 61, 2) or 2:60:2.",
        )
    return found


def _degrees(data: Data) -> list[int]:
    """Return the degrees of a matrix fraction to try: up to 60, and to 240 poles, as each of them has as many as there are inputs."""
    inputs = data.values.shape[2] if isinstance(data, FrequencyResponse | ImpulseResponse) else len(data.input_dofs)
    top = max(min(60, 240 // max(inputs, 1)), 4)
    return list(range(2, top + 1, 2 if top > 40 else 1))


def _largest_order(data: Data, band: tuple[float, float] | None) -> int:
    """Return the largest order to try when none is given: half of what the lines could carry, and no more than is useful."""
    if isinstance(data, FrequencyResponse):
        f = data.frequencies
        lines = data.lines if band is None else int(np.count_nonzero((f >= band[0]) & (f <= band[1])))
        return int(max(min(80, lines * data.values.shape[2]), 2))
    if isinstance(data, Signals) and data.inputs is not None:
        return 80
    return 40 if not isinstance(data, ImpulseResponse) or data.kind == "correlation" else 60


def _build_within_reach(
    data: Data, method: str | None, domain: str | None, asked: list[int], automatic: bool, options: dict[str, Any]
) -> tuple[Pipeline, list[int], list[str]]:
    """Build for the largest order; orders that the data cannot carry are left out, with a note."""
    pipeline = build(data, method=method, domain=domain, order=asked[-1], **options)
    notes = list(pipeline.notes)
    if pipeline.method.factors in ("complete", "fraction"):
        return pipeline, asked, notes
    reach = pipeline.factors.rank
    beyond = [n for n in asked if n > reach]
    if beyond:
        notes.append(f"orders {beyond[0]} to {beyond[-1]} left out: the data matrix has rank {reach}")
    within = [n for n in asked if n <= reach]
    if not within and not automatic:
        raise DataError(
            f"orders {asked[0]} to {asked[-1]} were asked",
            f"the data matrix has rank {reach}",
            f"Lower the orders to at most {reach}.",
        )
    exact = reach < min(pipeline.factors.P.shape[1], asked[-1])
    if (exact or not within) and reach not in within:
        within.append(reach)
    return pipeline, within, notes


def _one_order(pipeline: Pipeline, order: int, misfit: Callable[[Eigenmodes], float]) -> _Order:
    model = pipeline.triple(order)
    modes = eigenmodes(pipeline, model)
    own, _ = split_extraneous(modes, model)
    f, _ = frequencies_and_damping(modes.poles)
    low, high = _band(pipeline)
    inside = own[(f[own] >= low) & (f[own] <= high)]
    return _Order(order, modes, inside, indicators_of(pipeline, order, modes), misfit(modes))


def _band(pipeline: Pipeline) -> tuple[float, float]:
    response = pipeline.response
    if isinstance(response, FrequencyResponse):
        return float(response.frequencies[0]), float(response.frequencies[-1])
    if pipeline.band is not None:
        return pipeline.band
    # real poles of a sampled system may lie above half the sampling rate
    return 0.0, np.inf


def _misfit_of(pipeline: Pipeline) -> Callable[[Eigenmodes], float]:
    """Return the measure of what modes leave unexplained, outputs brought level, with what all orders share computed once."""
    response = pipeline.response
    scale = output_scale(response)[:, None]
    level = response.values / scale
    target = np.concatenate([level.real, level.imag]) if isinstance(response, FrequencyResponse) else level
    whole = np.linalg.norm(target)

    def misfit(modes: Eigenmodes) -> float:
        if isinstance(response, FrequencyResponse):
            basis = basis_of_lines(response, modes.poles, modes.powers)
            terms = modes.terms / scale
        else:
            basis = basis_of_samples(response, modes.poles)
            terms = np.zeros((0, *response.values.shape[1:]))
        with np.errstate(over="ignore", invalid="ignore"):
            left = np.subtract(target, rebuilt_rows(basis, modes.shapes / scale, modes.participation, terms))
            ratio = np.linalg.norm(left) / whole
        return float(ratio) if np.isfinite(ratio) else np.inf

    return misfit


def _diagram(
    pipeline: Pipeline, cuts: list[_Order], limits: Mapping[str, float], notes: list[str]
) -> StabilizationDiagram:
    stable = [np.zeros((3, cuts[0].inside.size), bool)]
    stable += [_stable(before, after, limits) for before, after in pairwise(cuts)]
    flags = np.hstack(stable)
    names = set.intersection(*(set(cut.indicators) for cut in cuts))
    rank = pipeline.factors.rank
    outside = sum(cut.modes.poles.size - cut.inside.size for cut in cuts)
    if outside:
        notes.append(f"{outside} poles outside the band or extraneous are not in the diagram")
    return StabilizationDiagram(
        response=pipeline.response,
        method=pipeline.method.name,
        domain=pipeline.method.domain,
        orders=tuple(cut.order for cut in cuts),
        order_of_pole=np.concatenate([np.full(cut.inside.size, cut.order) for cut in cuts]),
        poles=np.concatenate([cut.modes.poles[cut.inside] + window_damping(pipeline.response) for cut in cuts]),
        shapes=np.concatenate([cut.modes.shapes[:, cut.inside].T for cut in cuts]),
        participation=np.concatenate([cut.modes.participation[cut.inside] for cut in cuts]),
        stable_frequency=flags[0],
        stable_damping=flags[1],
        stable_shape=flags[2],
        indicators={name: np.concatenate([cut.indicators[name][cut.inside] for cut in cuts]) for name in sorted(names)},
        singular_values=pipeline.factors.spectrum,
        fit_errors=np.array([cut.misfit for cut in cuts]),
        exact_rank=rank if rank < pipeline.factors.P.shape[1] and rank == cuts[-1].order else None,
        tolerances=limits,
        settings=pipeline.settings,
        notes=tuple(notes),
        dt=pipeline.matrix.dt,
    )


def _stable(before: _Order, after: _Order, limits: Mapping[str, float]) -> Array:
    """Return for each pole of `after` whether frequency, damping and shape are those of one pole of `before`, (3, k)."""
    new, old = after.inside, before.inside
    if not old.size or not new.size:
        return np.zeros((3, new.size), bool)
    f, zeta = frequencies_and_damping(after.modes.poles[new])
    g, eta = frequencies_and_damping(before.modes.poles[old])
    with np.errstate(divide="ignore", invalid="ignore"):
        frequency = np.abs(f[:, None] - g) <= limits["frequency"] * np.minimum(f[:, None], g)
        damping = np.abs(zeta[:, None] - eta) <= limits["damping"] * np.maximum(np.abs(zeta[:, None]), np.abs(eta))
    shape = 1 - mac(after.modes.shapes[:, new], before.modes.shapes[:, old]) <= limits["shape"]
    # damping and shape are compared with the poles of the same frequency only, and the best of them is taken
    score = frequency * (1 + damping + shape + (damping & shape))
    best, rows = np.argmax(score, axis=1), np.arange(new.size)
    return np.stack([frequency[rows, best], (frequency & damping)[rows, best], (frequency & shape)[rows, best]])
