"""Name the likely causes of disagreements that concern the data as a whole: channels and orders, each with its evidence.

dead channel
    It never changes, but for rounding (`modalscope.signals.doctor.findings`); it is left out before anything is identified.
swapped sign
    By driving points and reciprocity (`modalscope.signals.doctor.polarity`). For a single response: more than 2 % of the residues is
    beyond rank one (a shape times a participation), and less than a third of that with its sign changed.
bad channel
    Its fit error is above .25 and three times the median, and the modes leave no more than three times the residual of the best model.
order too low
    The fit error still falls at the largest order of most methods: by 15 % with every two states over the last quarter of the orders; or by
    a fifth over that quarter while more than a tenth is unexplained. Or more than 3 % is unexplained, and more singular values than the
    largest order has states exceed 2.86 times their median (Gavish and Donoho's threshold for square matrices). And more orders change the
    modes that are reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modalscope.analysis.comparing.diagnosis import Cause
from modalscope.analysis.comparing.run import Cell, MethodResult
from modalscope.analysis.workflow.shapes import free_residues
from modalscope.data.modes import ModalModel
from modalscope.data.records import Records, Signals
from modalscope.data.response import Response
from modalscope.data.results import StabilizationDiagram
from modalscope.data.sameness import same_modes
from modalscope.data.setups import Setups
from modalscope.data.shown import figures, percent
from modalscope.identification.prepare import Measured, pose
from modalscope.identification.stabilize import stabilized
from modalscope.numerics.checks import Array
from modalscope.numerics.errors import DataError
from modalscope.numerics.statistics import noise_threshold
from modalscope.selection.judging.select import select
from modalscope.signals.doctor.findings import dead_channels, sides_of
from modalscope.signals.doctor.polarity import check_polarity

#: What is compared.
Data = Signals | Records | Setups | Response

#: Poles within this part of a half bandwidth count once.
_SAME_POLE = 0.25

#: Minimum fit error of a bad channel, and its ratio to the median of all.
_BAD_FIT, _BAD_RATIO = 0.25, 3.0

#: Minimum part of the residues beyond rank one with a wrong sign, and its maximum ratio once that is corrected.
_MIN_BEYOND_RANK_ONE, _MAX_CORRECTED = 0.02, 1 / 3

#: Part of the orders below the last quarter.
_LOWER_ORDERS = 0.75

#: Maximum ratio of the fit error that still falls, with every two states; and over the last quarter of the orders, above the next error.
_FALL_OF_TWO_STATES, _FALL_OF_LAST_QUARTER, _LARGE_ERROR = 0.85, 0.8, 0.1

#: Minimum fit error at which singular values above the noise count; and fit error that is rounding.
_MIN_ERROR, _ROUNDING = 0.03, 1e-9

#: The largest order is doubled, with so many states more at most, and so many orders more at least: a mode must show at some.
_MAX_MORE_STATES, _MIN_MORE_ORDERS = 40, 8

#: Minimum change of a mode, in half bandwidths (frequency) or relative (damping).
_MIN_CHANGE = 0.25


def without_dead(data: Data) -> tuple[Data, list[Cause]]:
    """Return the data without dead channels, and one finding for each; data of dead channels alone stay as they are.

    A channel that is dead in one of several setups alone stays: another one may need it.
    """
    dead: dict[str, dict[str, str]] = {}
    kept: dict[str, list[str]] = {}
    for side, flat, labels in sides_of(data):
        reasons = {finding.channels[0]: finding.reason for finding in dead_channels(flat, labels)}
        reasons = reasons if len(reasons) < len(labels) else {}
        dead[side] = dead.get(side, {}) | reasons
        kept.setdefault(side, []).extend(dof for dof in labels if dof not in reasons)
    causes = [
        Cause("dead channel", f"{side} {dof} was left out: {why}", dof)
        for side, reasons in dead.items()
        for dof, why in reasons.items()
        if dof not in kept[side]
    ]
    if not causes:
        return data, []
    return data.select(**{f"{side}s": tuple(dict.fromkeys(dofs)) for side, dofs in kept.items()}), causes


def channel_causes(response: Response, rebuilt: Array, poles: Array, best: float = np.inf) -> list[Cause]:
    """Judge every channel by its residual from the consensus modes.

    `poles` (n,): of the consensus as they are in the data, rad/s. `best`: fit error of the best model of any order. Where that of the modes
    is much larger, real poles explain the difference, and no channel is bad for it.
    """
    residual = np.abs(response.values - rebuilt) ** 2
    size = np.abs(response.values) ** 2
    causes: list[Cause] = []
    if np.sqrt(residual.sum() / size.sum()) > _BAD_RATIO * best:
        return _reversed_response(response, poles)
    for side, axes, labels in (("output", (0, 2), response.output_dofs), ("input", (0, 1), response.input_dofs)):
        if len(labels) < 3:  # too few to say which is the odd one
            continue
        error = np.sqrt(residual.sum(axis=axes) / np.maximum(size.sum(axis=axes), 1e-300))
        median = float(np.median(error))
        for i in np.flatnonzero(error > max(_BAD_FIT, _BAD_RATIO * median)):
            evidence = (
                f"{side} {labels[i]}: fit error {100 * error[i]:.0f} %, median of the channels {percent(median, 2)}"
            )
            causes.append(Cause("bad channel", evidence, labels[i]))
    return causes + _reversed_response(response, poles)


def _reversed_response(response: Response, poles: Array) -> list[Cause]:
    """Name the single response without whose sign the residues are of rank one."""
    _, outputs, inputs = response.values.shape
    if min(outputs, inputs) < 2 or max(outputs, inputs) < 3 or not poles.size:
        return []
    # a response of the wrong sign splits every mode into two poles of one shape each: they count once
    distinct: list[complex] = []
    for pole in np.asarray(poles, dtype=complex):
        if all(abs(pole - other) > _SAME_POLE * min(abs(pole.real), abs(other.real)) for other in distinct):
            distinct.append(complex(pole))
    residues = free_residues(response.basis(np.array(distinct)))
    before = _beyond_rank_one(residues)
    after = np.empty((outputs, inputs))
    for o, i in np.ndindex(outputs, inputs):
        corrected = residues.copy()
        corrected[:, o, i] *= -1
        after[o, i] = _beyond_rank_one(corrected)
    best = float(after.min())
    if before < _MIN_BEYOND_RANK_ONE or best > _MAX_CORRECTED * before:
        return []
    # with two inputs the two responses of a sensor cannot be distinguished
    candidates = np.argwhere(after <= 1.5 * best + 1e-12)
    pairs = (f"output {response.output_dofs[o]} with input {response.input_dofs[i]}" for o, i in candidates[:4])
    change = f"from {figures(100 * before, 2)} to {percent(best, 2)}"
    evidence = f"{' or '.join(pairs)}: the opposite sign lowers what one shape a mode cannot explain {change}"
    return [Cause("swapped sign", evidence, response.output_dofs[int(candidates[0, 0])])]


def _beyond_rank_one(residues: Array) -> float:
    """Return the median over modes of the share of the squared residue beyond its largest singular direction."""
    s2 = np.linalg.svd(residues, compute_uv=False) ** 2
    return float(np.median(1 - s2[:, 0] / np.maximum(s2.sum(axis=1), 1e-300)))


def sign_causes(response: Response) -> list[Cause]:
    """Find channels of the wrong sign, from driving points and reciprocity, by the rules of `modalscope.signals.doctor.polarity`."""
    findings = [finding for finding in check_polarity(response) if finding.kind == "polarity"]
    return [Cause("swapped sign", f"{' or '.join(f.channels)}: {f.reason}", f.channels[0]) for f in findings]


def order_cause(results: Sequence[MethodResult]) -> Cause | None:
    """Return the cause that the fit error still falls at the largest order, for most of the methods on untransformed data."""
    diagrams = [r.diagram for r in results if r.diagram is not None and r.exact]
    reasons = [why for d in diagrams if (why := _still_falls(d))]
    if not diagrams or 2 * len(reasons) <= len(diagrams):
        return None
    return Cause("order too low", max(dict.fromkeys(reasons), key=reasons.count))


def _still_falls(diagram: StabilizationDiagram) -> str:
    """Return by which rule the fit error still falls, with its numbers; nothing when it has converged."""
    orders, errors = np.asarray(diagram.orders), np.asarray(diagram.fit_errors)
    below = orders <= _LOWER_ORDERS * orders[-1]
    below = below if below.any() else orders < orders[-1]
    if diagram.exact_rank is not None or errors.min() < _ROUNDING or not below.any():
        return ""
    error, fall = float(errors.min()), float(errors.min() / errors[below].min())
    pairs = max((orders[-1] - orders[below][-1]) / 2, 1.0)
    lead = f"fit error {percent(error, 2)} at order {orders[-1]}"
    if fall ** (1 / pairs) < _FALL_OF_TWO_STATES:
        return f"{lead}, still falling by {100 * (1 - fall ** (1 / pairs)):.0f} % with every two states"
    if error > _LARGE_ERROR and fall < _FALL_OF_LAST_QUARTER:
        return f"{lead}, {100 * fall:.0f} % of that before the last quarter of the orders"
    d = diagram.singular_values
    if error > _MIN_ERROR and (count := np.count_nonzero(d > noise_threshold(d)) if d.size else 0) > orders[-1]:
        return f"{lead}, and {count} singular values exceed the noise"
    return ""


def changed_by_more_orders(
    tasks: Sequence[tuple[Measured, Cell]], results: Sequence[MethodResult], options: dict[str, Any]
) -> bool:
    """Return whether the method with a vote that fits best reports other modes when it is given more orders.

    It is also true where more orders are out of reach.

    `results`: one per task. `options`: of `compare`, for every method.
    """
    able = [(t, r) for t, r in zip(tasks, results, strict=True) if r.exact and r.modes is not None]
    if not able:
        return True
    (measured, cell), best = min(able, key=lambda pair: np.inf if pair[1].fit_error is None else pair[1].fit_error)
    top = cell.orders[-1]
    step = top - cell.orders[-2] if len(cell.orders) > 1 else top
    more = range(top + step, max(min(2 * top, top + _MAX_MORE_STATES), top + _MIN_MORE_ORDERS * step) + 1, step)
    try:
        diagram = stabilized(pose(measured, cell.method, {**cell.options, **options}), [*cell.orders, *more])
        modes = select(diagram)
    except DataError:
        return True
    assert best.modes is not None
    return diagram.orders[-1] <= top or changed(best.modes, modes)


def changed(before: ModalModel, after: ModalModel) -> bool:
    """Return whether modes are not the same: another number, another shape, or values moved by a quarter of the half bandwidth."""
    indices = same_modes(before, after)
    if not len(indices[0]) == len(before) == len(after):
        return True
    old, new = before.take(indices[0]), after.take(indices[1])
    f = np.abs(new.frequencies - old.frequencies) > _MIN_CHANGE * old.frequencies * old.damping_ratios
    zeta = np.abs(new.damping_ratios - old.damping_ratios) > _MIN_CHANGE * old.damping_ratios
    return bool(np.any(f | zeta))
