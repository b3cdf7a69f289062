"""Which of the poles of a stabilization diagram are modes, and why."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modalscope.indicators import cmif, mac, prominence
from modalscope.model.checks import Array, DataError, RealArray
from modalscope.model.diagram import StabilizationDiagram
from modalscope.model.frequency import FrequencyResponse
from modalscope.model.impulse import ImpulseResponse
from modalscope.model.modes import ModalModel
from modalscope.residues import basis_of_lines, basis_of_samples, fit_error, fit_participation, residual_powers
from modalscope.stabilize import output_scale
from modalscope.tracking import Poles, consensus, join_broken, merge_splits, tracks

__all__ = ["fit_of", "fitted_terms", "rebuilt_from", "select"]

#: A mode is found at this many orders at least, and at this share of all that are used.
LEAST_ORDERS, LEAST_SHARE = 5, 0.15
#: From its first order on it is found at this share of the orders.
LEAST_PERSISTENCE = 0.4
#: Its own contribution stands this far above what the fit leaves, in standard deviations of an estimated residue.
LEAST_SIGNAL = 6.0
#: Its own term makes up this much of the whole response at its frequency ...
LEAST_PEAK = 1 / 3
#: ... or it stands out of a mode indicator curve by this ratio.
LEAST_PROMINENCE = 1.2
#: Correlations carry estimation errors that every order fits as well as the modes: there the indicator must show the mode
#: more clearly and the mode must have some part in the peak, unless it is the whole response and found at half of the orders.
LEAST_PROMINENCE_AMBIENT, LEAST_PEAK_AMBIENT, WHOLE_PEAK = 1.5, 0.1, 0.9
#: Orders are used up to twice (at least 20 above) the first whose fit is within this factor of the best.
SLACK = 1.2


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What the data say of a group of poles: the response's level and indicator curves over frequency, and its size."""

    frequencies: RealArray
    level: RealArray
    curves: RealArray
    samples: float
    ambient: bool


@dataclass(frozen=True, eq=False)
class _Candidate:
    """Poles of several orders that agree, what speaks for them, and what against (empty when they are a mode)."""

    members: Array
    frequency: float
    damping: float
    facts: dict[str, Any]
    against: tuple[str, ...]


def select(
    diagram: StabilizationDiagram, *, frequencies: Iterable[float] | None = None, tolerance: float = 0.01
) -> ModalModel:
    """Report the modes of a stabilization diagram with the reasons for each, or those at given frequencies.

    Poles are followed over the orders, and the members of a track that agree in frequency, damping and shape are taken
    together. The value reported is their median. A mode is found at many orders, persists from its first one on, stands
    above what the fit leaves, and either dominates the response at its frequency or shows as a peak of a mode indicator
    curve. Of two that are the same, the one found at fewer orders goes. Nothing is drawn at random: the same data give
    the same modes.

    Parameters
    ----------
    diagram : StabilizationDiagram
    frequencies : iterable of float, optional
        Hz; the modes nearest to these are returned, whatever else speaks against them.
    tolerance : float
        Largest relative distance from a given frequency to its mode.

    Returns
    -------
    ModalModel
        With `frequencies_spread`, `damping_ratios_spread`, `indicators` and `reasons`; real and unstable poles are not modes here.

    Raises
    ------
    DataError
        A given frequency at which there is no mode, or two that mean the same one.

    Examples
    --------
    >>> from modalscope import stabilize
    >>> from modalscope.systems import chain5
    >>> modes = select(stabilize(chain5().state_space(dt=0.05).impulse_response(200)))
    >>> len(modes)
    5
    """
    evidence = _evidence(diagram)
    poles = _oscillations(diagram)
    if diagram.exact_rank is not None:
        chosen = _exact(diagram, poles)
    else:
        poles, chosen = _candidates(diagram, poles, evidence)
    if frequencies is not None:
        chosen = _by_hand(chosen, [float(f) for f in frequencies], tolerance, diagram)
    else:
        chosen = _none_twice(poles, [c for c in chosen if not c.against])
    return _modal_model(diagram, poles, sorted(chosen, key=lambda c: c.frequency))


def _oscillations(diagram: StabilizationDiagram) -> Poles:
    kept = np.flatnonzero((np.array(diagram.kinds) == "mode") & (diagram.damping_ratios < 0.9))
    poles = Poles(
        diagram.orders, diagram.order_of_pole, diagram.poles, diagram.shapes, diagram.participation, _own(diagram)
    )
    return poles.take(kept)


def _own(diagram: StabilizationDiagram) -> RealArray:
    """Return the norm of every pole's own contribution over that of the data, outputs scaled to one level."""
    response, scale = diagram.response, output_scale(diagram.response)
    size = np.linalg.norm(diagram.shapes / scale, axis=1) * np.linalg.norm(diagram.participation, axis=1)
    decay = np.maximum(np.abs(diagram.poles.real), 1e-12 * np.abs(diagram.poles))
    total = np.linalg.norm(response.values / scale[:, None])
    if isinstance(response, FrequencyResponse):
        # integral of |1 / (j w - s)|^2 over w is pi / |Re s|; lines lie `step` apart in w
        step = 2 * np.pi * np.median(np.diff(response.frequencies)) if response.lines > 1 else 1.0
        return np.asarray(size * np.sqrt(np.pi / decay / step) / total)
    # sum over samples of |2 Re R exp(s t)|^2 is about |R|^2 fs / |Re s|, over no more than the samples there are
    return np.asarray(size * np.sqrt(np.minimum(response.sampling_rate / decay, 2 * response.samples)) / total)


def _evidence(diagram: StabilizationDiagram) -> _Evidence:
    response, scale = diagram.response, output_scale(diagram.response)[:, None]
    outputs, inputs = response.values.shape[1:]
    ambient = isinstance(response, ImpulseResponse) and response.kind == "correlation"
    H: Array
    if isinstance(response, FrequencyResponse):
        f, H, count = response.frequencies, response.values / scale, response.lines
    else:
        count = response.samples
        # zeros behind the samples: lines fine enough that a neighbour's peak is not taken for a mode's own
        f = np.fft.rfftfreq(8 * count, 1 / response.sampling_rate)
        H = np.fft.rfft(response.values / scale, n=8 * count, axis=0) / response.sampling_rate
    curves = cmif(H)
    size = np.sqrt(count * outputs * inputs / (outputs + inputs))
    return _Evidence(f, np.linalg.norm(H, axis=(1, 2)), np.sqrt(curves) if ambient else curves, float(size), ambient)


def _exact(diagram: StabilizationDiagram, poles: Poles) -> list[_Candidate]:
    """Noise-free data: the modes are those of the order that is the rank."""
    members = np.flatnonzero((poles.order == diagram.exact_rank) & (poles.own > 1e-9))
    facts = {
        "orders_found": 1,
        "orders_tried": 1,
        "text": f"the data have the exact rank {diagram.exact_rank}, and this is one of its poles",
    }
    return [_Candidate(np.array([i]), float(poles.frequency[i]), float(poles.damping[i]), facts, ()) for i in members]


def _candidates(diagram: StabilizationDiagram, poles: Poles, evidence: _Evidence) -> tuple[Poles, list[_Candidate]]:
    orders, fit = _usable_orders(diagram)
    poles = replace(poles, orders=orders).take(np.flatnonzero(poles.order <= orders[-1]))
    poles = merge_splits(poles)
    groups = [group for group in (consensus(poles, t) for t in tracks(poles)) if group.size >= min(3, len(orders))]
    peak = _peaks(diagram, poles, evidence)
    return poles, [_judge(poles, group, peak, fit, evidence) for group in join_broken(poles, groups)]


def _usable_orders(diagram: StabilizationDiagram) -> tuple[tuple[int, ...], float]:
    """Return the orders to use and the best fit among them: beyond there is only noise left to explain."""
    errors, orders = np.asarray(diagram.fit_errors), np.asarray(diagram.orders)
    enough = orders[np.argmax(errors <= SLACK * errors.min())]
    used = orders <= max(2 * enough, enough + 20)
    return tuple(int(n) for n in orders[used]), float(errors[used].min())


def _peaks(diagram: StabilizationDiagram, poles: Poles, evidence: _Evidence) -> RealArray:
    """Return the size of each pole's own term at its frequency over that of the whole response there."""
    scale = output_scale(diagram.response)
    size = np.linalg.norm(poles.shape / scale, axis=1) * np.linalg.norm(poles.participation, axis=1)
    return np.asarray(size / np.abs(poles.pole.real) / np.interp(poles.frequency, evidence.frequencies, evidence.level))


def _spread(values: Array) -> float:
    """Standard deviation over orders, robustly: 1.4826 times the median absolute deviation."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def _judge(poles: Poles, group: Array, peak: RealArray, fit: float, evidence: _Evidence) -> _Candidate:
    f, zeta = float(np.median(poles.frequency[group])), float(np.median(poles.damping[group]))
    first, orders = int(poles.order[group].min()), np.array(poles.orders)
    persistence = group.size / max(int((orders >= first).sum()), min(LEAST_ORDERS, len(orders)))
    signal = float(np.median(poles.own[group])) / max(fit, 1e-15) * evidence.samples
    stands_out = prominence(evidence.curves, evidence.frequencies, f, zeta)
    share = float(np.median(peak[group]))
    against = []
    if group.size < max(min(LEAST_ORDERS, len(orders)), LEAST_SHARE * len(orders)):
        against.append(f"found at {group.size} of {len(orders)} orders only")
    if persistence < LEAST_PERSISTENCE:
        against.append(f"comes and goes: at {100 * persistence:.0f} % of the orders since its first")
    if not evidence.ambient and signal < LEAST_SIGNAL:
        against.append(f"within the noise: {signal:.1f} standard deviations")
    if not _visible(stands_out, share, group.size / len(orders), evidence.ambient):
        against.append("weak, and no peak of the mode indicator")
    facts = {
        "orders_found": int(group.size),
        "orders_tried": len(orders),
        "first_order": first,
        "last_order": int(poles.order[group].max()),
        "persistence": persistence,
        "signal_to_noise": signal,
        "share_of_peak": share,
        "indicator_prominence": stands_out,
    }
    return _Candidate(group, f, zeta, facts, tuple(against))


def _visible(stands_out: float, share: float, found: float, ambient: bool) -> bool:
    """Whether the data show a mode at its frequency, as a peak or as most of the response there."""
    if not ambient:
        return stands_out >= LEAST_PROMINENCE or share >= LEAST_PEAK
    return (stands_out >= LEAST_PROMINENCE_AMBIENT and share >= LEAST_PEAK_AMBIENT) or (
        share >= WHOLE_PEAK and found >= 0.5
    )


def _none_twice(poles: Poles, chosen: list[_Candidate]) -> list[_Candidate]:
    """Drop, of two within a half bandwidth and of one shape, the one found at fewer orders."""
    kept: list[_Candidate] = []
    for c in sorted(chosen, key=lambda c: (-c.members.size, c.frequency)):
        same = any(
            abs(c.frequency - k.frequency) < max(c.frequency * c.damping, k.frequency * k.damping)
            and c.members.size > 1
            and np.median(mac(poles.shape[c.members].T, poles.shape[k.members].T)) > 0.9
            for k in kept
        )
        if not same:
            kept.append(c)
    return kept


def _by_hand(
    candidates: list[_Candidate], wanted: list[float], tolerance: float, diagram: StabilizationDiagram
) -> list[_Candidate]:
    """Return the candidate at each frequency; one that has none is an error, never its neighbour."""
    chosen: list[_Candidate] = []
    for f in wanted:
        near = [c for c in candidates if abs(c.frequency - f) <= tolerance * f]
        if not near:
            known = ", ".join(f"{c.frequency:.4g}" for c in sorted(candidates, key=lambda c: abs(c.frequency - f))[:3])
            raise DataError(
                f"a mode at {f:g} Hz was asked",
                f"no pole stays within {100 * tolerance:g} % of it over the orders {diagram.orders[0]} to {diagram.orders[-1]}",
                f"The nearest that do are at {known or 'no frequency'} Hz; ask for one of these, or try other orders or another method.",
            )
        best = min(near, key=lambda c: (bool(c.against), -c.members.size if len(near) > 1 else 0, abs(c.frequency - f)))
        if any(best is c for c in chosen):
            raise DataError(
                f"different modes at {', '.join(f'{v:g}' for v in wanted)} Hz were asked",
                f"two of these mean the one at {best.frequency:.6g} Hz",
                "Leave one out, or lower the tolerance.",
            )
        chosen.append(best)
    return chosen


def _modal_model(diagram: StabilizationDiagram, poles: Poles, chosen: list[_Candidate]) -> ModalModel:
    """Wrap the chosen modes: median poles, the shape nearest to all others, participation fitted to the data."""
    response = diagram.response
    picked = [c.members[np.argmax(mac(poles.shape[c.members].T).sum(axis=1))] for c in chosen]
    values = np.array(
        [2 * np.pi * c.frequency * (-c.damping + 1j * np.sqrt(1 - c.damping**2)) for c in chosen], dtype=complex
    )
    added = response.added_damping if isinstance(response, FrequencyResponse) else 0.0
    shapes = poles.shape[picked].T if chosen else np.zeros((response.values.shape[1], 0), complex)
    fitted = fitted_terms(response, values - added, shapes)
    members = [c.members for c in chosen]
    spreads = [
        {"frequency_spread_hz": _spread(poles.frequency[m]), "damping_ratio_spread": _spread(poles.damping[m])}
        for m in members
    ]
    held = response.sampling_rate is not None if isinstance(response, FrequencyResponse) else response.kind == "pulse"
    model = ModalModel(
        poles=values,
        shapes=shapes,
        quantity=response.quantity,
        dt=diagram.dt,
        held_input=held,
        frequencies_spread=np.array([spread["frequency_spread_hz"] for spread in spreads]),
        damping_ratios_spread=np.array([spread["damping_ratio_spread"] for spread in spreads]),
        indicators=_indicators(diagram, members, poles),
        output_dofs=response.output_dofs,
        input_dofs=response.input_dofs,
        units=response.units,
        geometry=response.geometry,
        processing=response.processing,
        **fitted,
    )
    facts = [{**c.facts, **spread} for c, spread in zip(chosen, spreads, strict=True)]
    reasons = _reasons(model, response, added, facts)
    return replace(model, reasons=reasons).normalized("unit")


def fitted_terms(response: FrequencyResponse | ImpulseResponse, poles: Array, shapes: Array) -> dict[str, Any]:
    """Fit participation and, on lines, the residuals of the modes outside the band: fields of a `ModalModel`."""
    if isinstance(response, ImpulseResponse):
        participation, _ = fit_participation(basis_of_samples(response, poles), shapes)
        return {"participation": participation, "feedthrough": response.feedthrough}
    # a line at 0 Hz cannot carry the negative powers of the lower residual
    residuals = response.sampling_rate is None and response.frequencies[0] > 0 and response.lines > 8
    powers = residual_powers(response.quantity, residuals)
    participation, terms = fit_participation(basis_of_lines(response, poles, powers), shapes)
    top = 2 * np.pi * float(response.frequencies[-1])
    if len(powers) == 1:
        return {"participation": participation, "feedthrough": terms[0]}
    lower, upper = (terms[k] / top**power for k, power in enumerate(powers))
    return {"participation": participation, "lower_residual": lower, "upper_residual": upper}


def _indicators(diagram: StabilizationDiagram, members: list[Array], poles: Poles) -> dict[str, RealArray]:
    """Return for every mode the median of its members' indicators; members are found again by order and pole."""
    found: dict[str, list[float]] = {name: [] for name in diagram.indicators}
    for group in members:
        nearest = []
        for order, pole in zip(poles.order[group], poles.pole[group], strict=True):
            same = np.flatnonzero(diagram.order_of_pole == order)
            nearest.append(same[np.argmin(np.abs(diagram.poles[same] - pole))])
        for name, column in diagram.indicators.items():
            found[name].append(float(np.median(column[nearest])))
    return {name: np.array(column) for name, column in found.items()}


def _reasons(
    model: ModalModel, response: FrequencyResponse | ImpulseResponse, added: float, facts: list[dict[str, Any]]
) -> tuple[dict[str, Any], ...]:
    """Complete the reasons: what the rebuilt response loses without the mode, and a sentence."""
    if not len(model):
        return ()
    whole = replace(model, poles=model.poles - added)
    size = np.linalg.norm(response.values)
    left = response.values - rebuilt_from(whole, response)
    error = np.linalg.norm(left) / size
    reasons = []
    for j, known in enumerate(facts):
        alone = replace(whole.take([j]), feedthrough=None, lower_residual=None, upper_residual=None)
        loss = np.linalg.norm(left + rebuilt_from(alone, response)) / size - error
        text = known.get("text") or _sentence(known, float(loss))
        reasons.append({**known, "fit_loss": float(loss), "text": text})
    return tuple(reasons)


def fit_of(model: ModalModel, response: FrequencyResponse | ImpulseResponse) -> float:
    """Return norm(measured - rebuilt from the modes) / norm(measured) over all channels."""
    added = response.added_damping if isinstance(response, FrequencyResponse) else 0.0
    return fit_error(response.values, rebuilt_from(replace(model, poles=model.poles - added), response))[0]


def rebuilt_from(model: ModalModel, response: FrequencyResponse | ImpulseResponse) -> Array:
    """Return the modes' response on the lines or samples of the data, (F or N, l, m)."""
    if isinstance(response, FrequencyResponse):
        return model.frequency_response(response.frequencies).values
    return model.impulse_response(response.samples, response.sampling_rate, first_sample=response.first_sample).values


def _sentence(facts: dict[str, Any], loss: float) -> str:
    seen = []
    if facts["share_of_peak"] >= LEAST_PEAK:
        seen.append(f"makes up {100 * min(facts['share_of_peak'], 1.0):.0f} % of the response at its frequency")
    if facts["indicator_prominence"] >= LEAST_PROMINENCE:
        ratio = facts["indicator_prominence"]
        seen.append(
            f"stands out of the mode indicator by a factor {ratio:.3g}"
            if np.isfinite(ratio)
            else "stands alone in the mode indicator"
        )
    return (
        f"found at {facts['orders_found']} of {facts['orders_tried']} orders ({facts['first_order']} to {facts['last_order']}), "
        f"{' and '.join(seen) or 'weak at its frequency'}; without it the fit error grows by {100 * loss:.2g} %"
    )
