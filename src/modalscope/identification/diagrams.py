"""Compute the diagram of data of any kind: with more orders while modes may be missing, by instruments against unmeasured forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Unpack

import numpy as np

from modalscope.data.notes import Note
from modalscope.data.record_residual import UNMEASURED
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.identification.options import AllOptions
from modalscope.identification.orders import grown
from modalscope.identification.pipeline import Pipeline
from modalscope.identification.prepare import prepare
from modalscope.identification.stabilize import Progress, Watch, stabilized, swept
from modalscope.identification.sweep import over_pipeline, resolved_orders
from modalscope.numerics.arguments import named
from modalscope.numerics.errors import DataError
from modalscope.numerics.executors import working
from modalscope.numerics.progress import stage
from modalscope.numerics.resources import one_thread


@named(AllOptions.__annotations__)
@one_thread
def stabilize(
    data: Any,
    *,
    method: str | None = None,
    domain: str | None = None,
    orders: int | Iterable[int] | None = None,
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
    orders : int or iterable of int, optional
        Numbers of states (of "lscf" the degrees of the polynomials), or the largest of 2, 4, ...; by default up to 80 for frequency
        responses, 60 for impulse responses and 40 for correlations, and up to four times as many while the fit error falls as if modes
        were missing. Orders out of reach are left out, with a note.
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

    def diagram(asked: int | Iterable[int] | None = orders, **way: Any) -> StabilizationDiagram:
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
        examined = _looked_through(data, options.get("exclude"))
        automatic = method is None and domain is None and options.get("route") in (None, "auto")
        return computed(by_instruments(diagram(), diagram) if automatic else diagram())


def _looked_through(data: Any, exclude: Any) -> Any:
    """Return a record without inputs as it is seen once for all orders; other data as they are."""
    if isinstance(data, Response):
        return data
    from modalscope.signals.preprocess.ambient_records import looked_through  # responses need none of its checks

    return looked_through(data, exclude)


def by_instruments(found: StabilizationDiagram, again: Callable[..., StabilizationDiagram]) -> StabilizationDiagram:
    """Return the diagram with past inputs and outputs as instruments where `found` shows unmeasured forces, else `found`.

    `again`: computes the diagram of a route, `route="subspace"`.
    """
    doubt = [note for note in found.notes if note.kind == UNMEASURED]
    if not doubt:
        return found
    try:
        other = again(route="subspace")
    except DataError:
        return found.changed(**withheld(found))
    text = "Past inputs and outputs used as instruments: they remove the effect of unmeasured forces, not of noise on the inputs"
    rest = (note for note in other.notes if note.kind != UNMEASURED)
    return other.changed(notes=(*doubt, Note("route changed", {}, text), *rest), **withheld(other))


def withheld(diagram: StabilizationDiagram) -> dict[str, Any]:
    """Return the field of the diagram without standard deviations of damping, which unmeasured forces bias beyond them."""
    without = diagram.deviations_at(np.zeros(0, dtype=int))[1] is None
    return {} if without else {"damping_ratios_std": np.full(len(diagram.poles), np.nan)}
