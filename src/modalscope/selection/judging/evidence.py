"""Weigh the evidence for a group of poles that orders count, and state it in a sentence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.data.indicators import cmif, prominence
from modalscope.data.modes import ModalModel
from modalscope.data.rebuilt import of_diagram, peak_sizes
from modalscope.data.response import Response, output_scale
from modalscope.data.results import StabilizationDiagram
from modalscope.data.shown import figures, percent
from modalscope.data.whitening import levels_of_channels
from modalscope.identification.orders import usable_orders
from modalscope.numerics.checks import Array, ComplexArray, RealArray
from modalscope.numerics.functions.poles import frequencies_and_damping, poles_from
from modalscope.selection.judging.tracking import GAP, Poles, consensus, join_broken, merge_splits, tracks
from modalscope.selection.likelihood.covariance import deviations_between
from modalscope.selection.likelihood.noise import typical_deviation
from modalscope.signals.preprocess.spectral_peaks import PEAK

#: Minimum number of orders with the mode, and minimum share of all orders used.
LEAST_ORDERS, LEAST_SHARE = 5, 0.15
#: Minimum share of the orders from the first one with the mode on.
LEAST_PERSISTENCE = 0.4
#: Minimum signal-to-noise ratio of the contribution of a mode, in standard deviations of its residue.
LEAST_SIGNAL = 6.0
#: Minimum share of the mode in the response at its frequency ...
LEAST_PEAK = 1 / 3
#: ... or minimum ratio of its CMIF peak to the surroundings.
LEAST_PROMINENCE = 1.2
#: For correlations, whose estimation errors every order fits as well as the modes: minimum ratio of the peak jointly with a minimum
#: share, or this share alone at half of the orders.
LEAST_PROMINENCE_AMBIENT, LEAST_PEAK_AMBIENT, WHOLE_PEAK = 1.5, 0.1, 0.9
#: Alternative criterion: standard deviations of frequency (half bandwidths) and damping (relative) below CERTAIN, found at
#: CERTAIN_SHARE of the orders, the last ones included. Five orders are then not required: few orders may end soon after the first
#: sufficient one.
CERTAIN, CERTAIN_SHARE = 0.3, 0.25
#: For correlations, maximum of these standard deviations: poles of noise exceed it ...
UNCERTAIN = 0.7
#: ... unless the spectra of the record have a peak there this many times as high as the test's threshold.
CLEAR = 2.0
#: What has not come back once in a free decay is no oscillation yet: the drift of a sensor bends as much.
NO_PERIOD = "less than one period of it was recorded, which a drift of sensors explains as well"
#: Minimum share of the members with a standard deviation, for the group to have one.
_MIN_SHARE_WITH_DEVIATION = 0.5


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the data say of a group of poles: the response's level and indicator curves over frequency, and its size.

    The data have decays of `added_damping` (1/s) more than the poles: what an exponential window added. `one_period`: frequency, Hz, of
    one period in a free decay; 0 for other data, whose errors do not drift with the time since the release.
    """

    frequencies: RealArray
    level: RealArray
    curves: RealArray
    samples: float
    ambient: bool
    added_damping: float = 0.0
    one_period: float = 0.0


@dataclass(frozen=True, eq=False)
class Own:
    """A pole with values of its own, where no orders of the diagram agree on any.

    `shape` (l,). `participation` (m,). `frequency_std`, `damping_std`: hz, ratio.
    """

    shape: ComplexArray
    participation: ComplexArray
    frequency_std: float
    damping_std: float


@dataclass(frozen=True, eq=False)
class Candidate:
    """Poles of several orders that agree, what speaks for them, and what against (empty when they are a mode).

    The gain is by how many standard deviations the data are explained better with it, where that is known. `own` stands in for the
    members where there are none. `residue` (l, m) is that of data which need more poles than there are modes: see `one_residue`.
    """

    members: Array
    frequency: float
    damping: float
    facts: dict[str, Any]
    against: tuple[str, ...]
    gain: float = np.nan
    own: Own | None = None
    residue: ComplexArray | None = None


def oscillations(diagram: StabilizationDiagram) -> Poles:
    """Return the decaying oscillations of a diagram; real, unstable and nearly aperiodic poles are no modes to select.

    Nor is what falls by e within a sample: models put such poles in the place of a delay.
    """
    lasting = -diagram.poles.real * (diagram.dt or 0.0) < 1
    kept = np.flatnonzero((np.array(diagram.kinds) == "mode") & (diagram.damping_ratios < 0.9) & lasting)
    own = of_diagram(diagram)
    poles = Poles(diagram.orders, diagram.order_of_pole, diagram.poles, diagram.shapes.T, diagram.participation, own)
    return poles.take(kept)


def evidence_of(diagram: StabilizationDiagram) -> Evidence:
    """Gather what the data themselves show, outputs scaled to one level."""
    response, scale = diagram.response, output_scale(diagram.response)[:, None]
    outputs, inputs = response.values.shape[1:]
    ambient = response.ambient
    parts = [(f, cmif(H / scale), np.linalg.norm(H / scale, axis=(1, 2))) for f, H in response.spectra()]
    f, curves, level = (np.concatenate(part) for part in zip(*parts, strict=True))
    size = np.sqrt(response.count * outputs * inputs / (outputs + inputs))
    given, shown = diagram.as_measured, np.sqrt(curves) if ambient else curves
    one_period = (given.sampling_rate or 0.0) / given.count if given.decaying else 0.0
    return Evidence(f, level, shown, float(size), ambient, response.added_damping, one_period)


class Gathered:
    """What data show, gathered once for all diagrams of the same ones: rows of one domain have the same lines or samples."""

    def __init__(self) -> None:
        self._known: list[tuple[Response, Evidence]] = []

    def of(self, diagram: StabilizationDiagram) -> Evidence:
        """Return what the data of a diagram show."""
        response = diagram.response
        for other, known in self._known:
            if response is other or same_data(response, other):
                return known
        found = evidence_of(diagram)
        self._known.append((response, found))
        return found


def same_data(one: Response, other: Response) -> bool:
    """Whether two responses are the same data."""
    facts = {(r.span, r.ambient, r.added_damping, r.grid is None) for r in (one, other)}
    arrays = [(one.values, other.values), *([] if one.grid is None or other.grid is None else [(one.grid, other.grid)])]
    return len(facts) == 1 and all(np.array_equal(*both) for both in arrays)


def peaks(diagram: StabilizationDiagram, poles: Poles, evidence: Evidence) -> RealArray:
    """Return the size of each pole's term at its frequency over that of the whole response there."""
    size = peak_sizes(diagram.response, poles.pole, poles.shape, poles.participation)
    f, _ = frequencies_and_damping(poles.pole - evidence.added_damping)
    return np.asarray(size / np.interp(f, evidence.frequencies, evidence.level))


def judge(
    poles: Poles,
    group: Array,
    peak: RealArray,
    fit: float,
    evidence: Evidence,
    left_open: float = np.nan,
    height: float = np.inf,
) -> Candidate:
    """Weigh a group of poles that agree: what speaks for it, and what against.

    `peak` (p,): of every pole, see `peaks`. `fit`: what the best fit leaves of the data. `left_open`: the larger standard deviation of
    frequency in half bandwidths and of damping in damping ratios; NaN where it is not known. `height`: of the peak of the record's own
    lines, see `peak_heights`.
    """
    f, zeta = float(np.median(poles.frequency[group])), float(np.median(poles.damping[group]))
    first, orders = int(poles.order[group].min()), np.array(poles.orders)
    persistence = group.size / max(int((orders >= first).sum()), min(LEAST_ORDERS, len(orders)))
    signal = float(np.median(poles.own[group])) / max(fit, 1e-15) * evidence.samples
    shown = frequencies_and_damping(poles_from(f, zeta) - evidence.added_damping)
    stands_out = prominence(evidence.curves, evidence.frequencies, *(float(v) for v in shown))
    share = float(np.median(peak[group]))
    found = group.size / len(orders)
    lasting = int(poles.order[group].max()) >= orders[-min(GAP, len(orders))]
    certain = evidence.ambient and left_open < CERTAIN and found >= CERTAIN_SHARE and lasting
    against = []
    if f < evidence.one_period:
        against.append(NO_PERIOD)
    if not certain and group.size < max(min(LEAST_ORDERS, len(orders)), LEAST_SHARE * len(orders)):
        against.append(f"found at {group.size} of {len(orders)} orders only")
    if persistence < LEAST_PERSISTENCE:
        against.append(f"intermittent: found at {100 * persistence:.0f} % of the orders from its first one on")
    if not evidence.ambient and signal < LEAST_SIGNAL:
        against.append(f"signal-to-noise ratio {signal:.1f}: not significant")
    if not certain and not _visible(stands_out, share, found, evidence.ambient):
        against.append("weak response and no CMIF peak at its frequency")
    if evidence.ambient and left_open >= UNCERTAIN and not CLEAR <= height < np.inf:
        against.append(
            f"frequency or damping uncertain: standard deviation {left_open:.2g} of its half bandwidth or damping"
        )
    facts = {
        "orders_found": int(group.size),
        "orders_tried": len(orders),
        "first_order": first,
        "last_order": int(poles.order[group].max()),
        "persistence": persistence,
        "signal_to_noise": signal,
        "share_of_peak": share,
        "indicator_prominence": stands_out,
        **({"left_open": left_open} if np.isfinite(left_open) else {}),
        **({"peak_height": height} if np.isfinite(height) else {}),
    }
    return Candidate(group, f, zeta, facts, tuple(against))


def _visible(stands_out: float, share: float, found: float, ambient: bool) -> bool:
    """Whether the data show a mode at its frequency, as a peak or as most of the response there."""
    if not ambient:
        return stands_out >= LEAST_PROMINENCE or share >= LEAST_PEAK
    return (stands_out >= LEAST_PROMINENCE_AMBIENT and share >= LEAST_PEAK_AMBIENT) or (
        share >= WHOLE_PEAK and found >= 0.5
    )


def sentence(facts: dict[str, Any], loss: float) -> str:
    """Say in words why a mode is reported."""
    signs = []
    if facts["share_of_peak"] >= LEAST_PEAK:
        signs.append(f"{100 * min(facts['share_of_peak'], 1.0):.0f} % of the response at its frequency")
    if facts["indicator_prominence"] >= LEAST_PROMINENCE:
        ratio = facts["indicator_prominence"]
        signs.append(f"CMIF peak {figures(ratio)} x its surroundings" if np.isfinite(ratio) else "isolated CMIF peak")
    reasons = [_orders_of(facts), *(signs or ["weak at its frequency"])]
    if "gain" in facts:
        gain = float(f"{facts['gain']:.3g}")
        reasons.insert(0, f"significance {gain:.10g}; noise alone reaches {figures(facts['noise_gain'], 2)}")
    if "rests_on" in facts:
        reasons.append(f"significant for input {facts['rests_on']} only")
    if "uncertain" in facts:
        reasons.append(facts["uncertain"])
    change = "grows" if loss >= 0 else "falls"
    return f"{'; '.join(reasons)}; without it the unexplained part {change} by {percent(abs(loss), 2)}"


def retold(modes: ModalModel) -> ModalModel:
    """Return refined modes whose reasons tell the significance of the values that are reported, as `ModalModel.significance` does.

    That of the choice rests on the noise that all poles of a diagram leave, and on values of few iterations.
    """
    reasons, gain = list(modes.reasons), np.full(len(modes), np.nan) if modes.gain is None else modes.gain
    for j, why in enumerate(modes.reasons):
        if "gain" in why and np.isfinite(gain[j]):
            told = {**why, "gain": float(gain[j])}
            reasons[j] = {**told, "text": sentence(told, why["fit_loss"])}
    return replace(modes, reasons=tuple(reasons))


def _orders_of(facts: dict[str, Any]) -> str:
    if not facts["orders_found"]:
        return "found in the residual of the other modes, not in the diagram; values are refined"
    where = f"({facts['first_order']} to {facts['last_order']})"
    return f"found at {facts['orders_found']} of {facts['orders_tried']} orders {where}"


# ------------------------------------------------------------------------------------------------------------- counted
# Modes by counting orders: where the errors of the data have no likelihood that modes could maximize.


def counted(diagram: StabilizationDiagram, poles: Poles, evidence: Evidence) -> tuple[Poles, list[Candidate]]:
    """Return the groups of poles that agree over orders, splits merged, with what speaks for each and what against."""
    (orders, fit), known = usable_orders(diagram), _known(diagram)
    every = merge_splits(poles, known, levels_of_channels(diagram.response.values))
    poles = replace(every, orders=orders).take(np.flatnonzero(every.order <= orders[-1]))
    groups = [group for group in (consensus(poles, t) for t in tracks(poles)) if group.size >= min(3, len(orders))]
    peak = peaks(diagram, poles, evidence)
    groups = join_broken(poles, groups)
    candidates = [
        judge(poles, group, peak, fit, evidence, float(left_open), _height(diagram, poles, group))
        for group, left_open in zip(groups, _all_left_open(diagram, poles, groups), strict=True)
    ]
    return every, candidates


def _known(diagram: StabilizationDiagram) -> RealArray | None:
    """Return the deviation of every pole in rad/s where the errors are those of records on their own lines.

    Of correlations, and of responses with a coloured residual, two poles that are known well may be one mode that changes.
    """
    if diagram.response.ambient or diagram.response.separable:
        return None
    f, zeta = diagram.frequencies_std, diagram.damping_ratios_std
    if f is None or zeta is None:
        return None
    return np.asarray(2 * np.pi * np.hypot(f, zeta * diagram.frequencies))


def _all_left_open(diagram: StabilizationDiagram, poles: Poles, groups: list[Array]) -> RealArray:
    """Return the larger deviation of every group, see `_left_open`; of merged setups, whose noise is not known, by what these disagree."""
    own = np.array([_left_open(diagram, poles, group) for group in groups])
    middles = [(np.median(poles.frequency[group]), np.median(poles.damping[group])) for group in groups]
    f, zeta = np.array(middles).reshape(-1, 2).T
    between = deviations_between(poles_from(f, zeta), diagram.response) if np.isnan(own).all() else None
    return own if between is None else np.asarray(np.max(between / [f * zeta, zeta], axis=0))


def _left_open(diagram: StabilizationDiagram, poles: Poles, group: Array) -> float:
    """Return the larger deviation of a group: of frequency in half bandwidths, or of damping in damping ratios; NaN without any."""
    by_frequency, by_damping = diagram.deviations_at(poles.index[group])
    if by_frequency is None or by_damping is None:
        return float("nan")
    f, zeta = np.median(poles.frequency[group]), np.median(poles.damping[group])
    return float(max(_of_most(by_frequency) / (f * zeta), _of_most(by_damping) / zeta))


def _height(diagram: StabilizationDiagram, poles: Poles, group: Array) -> float:
    """Return the typical height of the record's peak at the poles of a group; infinity where it was not tested."""
    heights = diagram.indicators.get(PEAK)
    return np.inf if heights is None else float(np.median(heights[poles.index[group]]))


def _of_most(values: RealArray) -> float:
    """Return the typical deviation of a group; NaN where it is withheld at most of its members: the others are those that split."""
    return typical_deviation(values) if np.isfinite(values).mean() >= _MIN_SHARE_WITH_DEVIATION else float("nan")
