"""Whether orders above those that were asked change the modes that are reported."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modalscope.comparing.plan import Cell
from modalscope.comparing.run import MethodResult
from modalscope.identification.measured import Measured
from modalscope.identification.prepare import pose
from modalscope.judging.replicates import matched
from modalscope.judging.select import select
from modalscope.judging.stabilize import stabilized
from modalscope.model.checks import DataError
from modalscope.model.modes import ModalModel

__all__ = ["changed", "changed_by_more_orders"]

#: The largest order is raised twofold, by so many states at most, and by so many orders at least: a mode must be seen at some.
_MORE, _ORDERS = 40, 8

#: A mode has moved by this share of its half bandwidth (frequency), or of its damping.
_MOVED = 0.25


def changed_by_more_orders(
    tasks: Sequence[tuple[Measured, Cell]], results: Sequence[MethodResult], options: dict[str, Any]
) -> bool:
    """Return whether the method with a vote that fits best reports other modes when it is given more orders.

    Where they are out of reach nobody can tell, and they are taken to.

    Parameters
    ----------
    tasks : sequence of (Measured, Cell)
    results : sequence of MethodResult
        One a task.
    options : dict
        Of `compare`, for every method.
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
    """Return whether modes are not the same: another number, another shape, or values moved by a quarter of the half bandwidth.

    Parameters
    ----------
    before, after : ModalModel
    """
    mine, theirs = matched(before, after)
    if not len(mine) == len(before) == len(after):
        return True
    old, new = before.take(mine), after.take(theirs)
    f = np.abs(new.frequencies - old.frequencies) > _MOVED * old.frequencies * old.damping_ratios
    zeta = np.abs(new.damping_ratios - old.damping_ratios) > _MOVED * old.damping_ratios
    return bool(np.any(f | zeta))
