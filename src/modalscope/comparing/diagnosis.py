"""Name the likely causes of disagreements between methods, mode by mode and for the data as a whole, with evidence.

heavy damping
    The damping ratio is above 10 %.
close pair
    Another mode lies within the sum of both half bandwidths.
weak mode
    Its own term is less than a third of the response at its frequency, or within four times the noise that `select` admits.
edge of the band
    It lies within one bandwidth (2 f zeta) of the first or the last line.
too few lines
    Fewer than three lines lie within its bandwidth.
too few blocks
    The block rows of the time-domain methods span less than one of its periods.
transformed data
    The methods that differ are those whose data were transformed from lines to samples or back.
bias
    Methods lie further from the consensus than the noise that they share can move them apart.
order too low
    See `modalscope.comparing.diagnosis`.
not separated
    None of the others.

Bandwidths of these rules are those in the data, with what an exponential window added.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.comparing.agreement import Group
from modalscope.comparing.run import MethodResult
from modalscope.comparing.scatter import Biased, Scatter
from modalscope.data.response import Response, line_step
from modalscope.data.results import StabilizationDiagram
from modalscope.doctor.findings import dead_channels, sides_of
from modalscope.doctor.polarity import check_polarity
from modalscope.identification.prepare import Data
from modalscope.judging.evidence import LEAST_PEAK, LEAST_SIGNAL
from modalscope.modal.shapes import free_residues
from modalscope.numerics.checks import Array
from modalscope.numerics.statistics import noise_threshold

# --------------------------------------------------------------------------------------------------------------- causes

#: Name of a cause -> what to do about it.
CAUSES = {
    "dead channel": "Check the sensor and its cable; leave the channel out or measure it again.",
    "swapped sign": "Check direction and polarity of the sensor or the hammer, and turn the channel's sign.",
    "bad channel": "Look at the channel's coherence and time record; leave it out or measure it again.",
    "order too low": "Raise the largest order.",
    "too few blocks": "Raise block_rows, or measure a longer record.",
    "too few lines": "Measure with a finer resolution (longer records).",
    "heavy damping": "Take its damping as an estimate; excite it alone or measure in a band of its own.",
    "close pair": "Use several inputs and a finer resolution, and look at the two shapes together.",
    "weak mode": "Put an input or a sensor where this mode moves, or average more.",
    "edge of the band": "Widen the band.",
    "transformed data": "Prefer the methods that work on the data as they were measured.",
    "leakage": "Trust the records on their own lines; for frequency responses use longer segments or periodic forces.",
    "unmeasured forces": "Measure all forces, and look for noise on the force sensors; take no damping from this record.",
    "delay": "Look for channels of other acquisition units or filters, and align them.",
    "bias": "Look whether a mode is missing or split there; a certificate (modalscope certify) tells which method is biased.",
    "poor fit": "Look at that way alone, with more orders or a narrower band; until then it says nothing against a mode.",
    "too short": "Measure a longer record.",
    "poor excitation": "Drive the inputs independently of each other, and over the whole band.",
    "not separated": "Look at the stabilization diagrams of the methods that miss it.",
}


@dataclass(frozen=True)
class Cause:
    """A likely cause.

    `name`: A key of `CAUSES`. `evidence`: the numbers that point to it. `channel`: the channel it concerns; empty when none.
    """

    name: str
    evidence: str
    channel: str = ""

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return CAUSES[self.name]

    def __str__(self) -> str:
        return f"{self.name} ({self.evidence})"


@dataclass(frozen=True)
class Disagreement:
    """Where methods differ, and why.

    `mode`: which mode of the consensus, counted from zero; None for what concerns the data as a whole. `what`: what differs, in words.
    `methods`: the methods that differ from the others. `causes`: the likely ones first.
    """

    mode: int | None
    what: str
    methods: tuple[str, ...]
    causes: tuple[Cause, ...]


# ------------------------------------------------------------------------------------------------------------ channels
# Rules about channels: dead, turned in sign, or bad. Each names its evidence.
#
# dead channel
#     It never changes, but for rounding (`modalscope.doctor.findings`); it is left out before anything is identified.
# swapped sign
#     By driving points and reciprocity (`modalscope.doctor.polarity`). A single response is turned
#     when more than 2 % of the residues is beyond rank one (a shape times a participation), and less than a third of that with
#     its sign changed.
# bad channel
#     Its fit error is above .25 and three times the median, and the modes leave no more than three times what the best model leaves.

_PLACE = 0.25  # half bandwidths: poles nearer than that lie in one place
_BAD, _TIMES = 0.25, 3.0
_MIXED, _REPAIRED = 0.02, 1 / 3


def without_dead(data: Data) -> tuple[Data, list[Cause]]:
    """Return the data without dead channels, and one finding for each; data of dead channels alone stay as they are.

    A channel that is dead in one of several setups alone stays: another one may need it.
    """
    dead: dict[str, dict[str, str]] = {}
    kept: dict[str, list[str]] = {}
    for side, flat, labels in sides_of(data):
        found = {finding.channels[0]: finding.reason for finding in dead_channels(flat, labels)}
        found = found if len(found) < len(labels) else {}
        dead[side] = dead.get(side, {}) | found
        kept.setdefault(side, []).extend(dof for dof in labels if dof not in found)
    causes = [
        Cause("dead channel", f"{side} {dof} was left out: {why}", dof)
        for side, found in dead.items()
        for dof, why in found.items()
        if dof not in kept[side]
    ]
    if not causes:
        return data, []
    return data.select(**{f"{side}s": tuple(dict.fromkeys(dofs)) for side, dofs in kept.items()}), causes


def channel_causes(response: Response, rebuilt: Array, poles: Array, best: float = np.inf) -> list[Cause]:
    """Judge every channel by what the consensus modes leave of it.

    `poles` (n,): of the consensus as they are in the data, rad/s. `best`: what the best model of any order leaves. When the modes leave
    much more, real poles carry the rest, and no channel is blamed for it.
    """
    left = np.abs(response.values - rebuilt) ** 2
    size = np.abs(response.values) ** 2
    causes: list[Cause] = []
    if np.sqrt(left.sum() / size.sum()) > _TIMES * best:
        return _turned_alone(response, poles)
    for side, axes, labels in (("output", (0, 2), response.output_dofs), ("input", (0, 1), response.input_dofs)):
        if len(labels) < 3:  # too few to say which is the odd one
            continue
        error = np.sqrt(left.sum(axis=axes) / np.maximum(size.sum(axis=axes), 1e-300))
        median = float(np.median(error))
        for i in np.flatnonzero(error > max(_BAD, _TIMES * median)):
            evidence = (
                f"{side} {labels[i]}: the modes leave {100 * error[i]:.0f} % of it, {100 * median:.2g} % of the others"
            )
            causes.append(Cause("bad channel", evidence, labels[i]))
    return causes + _turned_alone(response, poles)


def _turned_alone(response: Response, poles: Array) -> list[Cause]:
    """Name the single response whose sign, when turned, makes the residues of rank one that were not."""
    _, outputs, inputs = response.values.shape
    if min(outputs, inputs) < 2 or max(outputs, inputs) < 3 or not poles.size:
        return []
    # a response of the wrong sign makes two poles of one shape each out of every mode: one place counts once
    residues = free_residues(response.basis(_one_a_place(poles)))
    before = _beyond_rank_one(residues)
    after = np.empty((outputs, inputs))
    for o, i in np.ndindex(outputs, inputs):
        turned = residues.copy()
        turned[:, o, i] *= -1
        after[o, i] = _beyond_rank_one(turned)
    best = float(after.min())
    if before < _MIXED or best > _REPAIRED * before:
        return []
    # with two inputs the one response of a sensor cannot be told from its other one
    named = np.argwhere(after <= 1.5 * best + 1e-12)
    o = int(named[0, 0])
    sides = " or ".join(f"output {response.output_dofs[a]} with input {response.input_dofs[b]}" for a, b in named[:4])
    evidence = f"{sides}: turned, it lowers what no single shape explains from {100 * before:.2g} to {100 * best:.2g} %"
    return [Cause("swapped sign", evidence, response.output_dofs[o])]


def _one_a_place(poles: Array) -> Array:
    """Return poles of which none lies within a quarter of its half bandwidth of another."""
    kept: list[complex] = []
    for pole in np.asarray(poles, dtype=complex):
        if all(abs(pole - other) > _PLACE * min(abs(pole.real), abs(other.real)) for other in kept):
            kept.append(complex(pole))
    return np.array(kept)


def _beyond_rank_one(residues: Array) -> float:
    """Return the median over modes of the share of the squared residue that its largest singular direction leaves."""
    s2 = np.linalg.svd(residues, compute_uv=False) ** 2
    return float(np.median(1 - s2[:, 0] / np.maximum(s2.sum(axis=1), 1e-300)))


def sign_causes(response: Response) -> list[Cause]:
    """Find channels whose sign is turned, from driving points and reciprocity, by the rules of `modalscope.doctor.polarity`."""
    turned = [finding for finding in check_polarity(response) if finding.kind == "polarity"]
    return [Cause("swapped sign", f"{' or '.join(f.channels)}: {f.reason}", f.channels[0]) for f in turned]


# ------------------------------------------------------------------------------------------------------------- falling
# Whether the orders that were tried are too low.
#
# The fit error still falls at the largest order of most methods: by 15 % with every two states over the last quarter of the
# orders; or by a fifth over that quarter while more than a tenth is left. Or more than 3 % is left, and more singular values
# than the largest order has states exceed 2.86 times their median (Gavish and Donoho's threshold for square matrices). And more
# orders change the modes that are reported (`modalscope.comparing.comparison`).

_FALLS, _MUCH, _SOME, _STEEP, _SHARE = 0.8, 0.1, 0.03, 0.85, 0.75
_ROUNDING = 1e-9


def order_cause(results: Sequence[MethodResult]) -> Cause | None:
    """Whether the fit error still falls at the largest order, by most of the methods that worked on the data themselves."""
    diagrams = [r.diagram for r in results if r.diagram is not None and r.exact]
    said = [why for d in diagrams if (why := _still_falls(d))]
    if not diagrams or 2 * len(said) <= len(diagrams):
        return None
    return Cause("order too low", max(dict.fromkeys(said), key=said.count))


def _still_falls(diagram: StabilizationDiagram) -> str:
    """Return by which rule the fit error still falls, with its numbers; nothing when it has settled."""
    orders, errors = np.asarray(diagram.orders), np.asarray(diagram.fit_errors)
    below = orders <= _SHARE * orders[-1]
    below = below if below.any() else orders < orders[-1]
    if diagram.exact_rank is not None or errors.min() < _ROUNDING or not below.any():
        return ""
    left, fall = float(errors.min()), float(errors.min() / errors[below].min())
    pairs = max((orders[-1] - orders[below][-1]) / 2, 1.0)
    lead = f"at order {orders[-1]} {100 * left:.2g} % is left to explain"
    if fall ** (1 / pairs) < _STEEP:
        return f"{lead}, and every two states still take {100 * (1 - fall ** (1 / pairs)):.0f} % of it away"
    if left > _MUCH and fall < _FALLS:
        return f"{lead}; the last quarter of the orders still took it to {100 * fall:.0f} % of what it was"
    d = diagram.singular_values
    if left > _SOME and (count := np.count_nonzero(d > noise_threshold(d)) if d.size else 0) > orders[-1]:
        return f"{lead}, and {count} singular values stand out of the noise"
    return ""


# ----------------------------------------------------------------------------------------------------------- diagnosis

#: Damping ratio from which a mode is called heavily damped.
HEAVY = 0.10

#: A value differs when it is farther from the consensus than this share of the half bandwidth (frequency), of the damping, of 1 - MAC.
_OFF_FREQUENCY, _OFF_DAMPING, _OFF_SHAPE = 0.25, 0.25, 0.1

_WEAK_SIGNAL = 4 * LEAST_SIGNAL
_LINES = 3


@dataclass(frozen=True, eq=False)
class _Case:
    """One mode with what the rules look at."""

    group: Group
    others: Sequence[Group]
    response: Response
    results: Sequence[MethodResult]
    differing: Sequence[str]


def mode_causes(
    index: int,
    groups: Sequence[Group],
    response: Response,
    results: Sequence[MethodResult],
    differing: Sequence[str] = (),
) -> tuple[Cause, ...]:
    """Return what makes one mode hard to identify, by the rules of this module."""
    others = [g for k, g in enumerate(groups) if k != index]
    case = _Case(groups[index], others, response, results, differing)
    rules = (_heavy, _close, _weak, _edge, _lines, _blocks, _transformed)
    return tuple(cause for rule in rules if (cause := rule(case)) is not None)


def _heavy(case: _Case) -> Cause | None:
    zeta = case.group.damping
    return Cause("heavy damping", f"{100 * zeta:.3g} % of critical") if zeta > HEAVY else None


def _half(case: _Case, group: Group) -> float:
    """Return the half bandwidth |Re s| / 2 pi that a mode has in the data, Hz."""
    return group.half_bandwidth + case.response.added_damping / (2 * np.pi)


def _close(case: _Case) -> Cause | None:
    g = case.group
    near = [o for o in case.others if abs(o.frequency - g.frequency) < _half(case, o) + _half(case, g)]
    # beside a heavily damped mode everything lies within its half bandwidth
    near = [o for o in near if max(o.damping, g.damping) <= HEAVY]
    if not near:
        return None
    o = min(near, key=lambda o: abs(o.frequency - g.frequency))
    apart = abs(o.frequency - g.frequency)
    return Cause(
        "close pair",
        f"{o.frequency:.5g} Hz is {100 * apart / g.frequency:.2g} % away, "
        f"half bandwidths {_half(case, g):.2g} and {_half(case, o):.2g} Hz",
    )


def _reasons(case: _Case, key: str) -> list[float]:
    found = []
    for r in case.results:
        if r.modes is not None and r.name in case.group.members and r.modes.reasons:
            reason = r.modes.reasons[case.group.members[r.name]]
            if key in reason:
                found.append(float(reason[key]))
    return found


def _weak(case: _Case) -> Cause | None:
    share, signal = _reasons(case, "share_of_peak"), _reasons(case, "signal_to_noise")
    if not share:
        return None
    part, level = float(np.median(share)), float(np.median(signal))
    if part >= LEAST_PEAK and level >= _WEAK_SIGNAL:
        return None
    said = [f"makes up {100 * min(part, 1.0):.0f} % of the response at its frequency"] if part < LEAST_PEAK else []
    said += [f"{level:.3g} standard deviations above the noise"] if level < _WEAK_SIGNAL else []
    return Cause("weak mode", ", ".join(said))


def _edge(case: _Case) -> Cause | None:
    g, f = case.group, case.response.grid
    if f is None:
        return None
    away, width = min(g.frequency - f[0], f[-1] - g.frequency), 2 * _half(case, g)
    if away > width:
        return None
    return Cause(
        "edge of the band", f"{away:.3g} Hz inside the band {f[0]:.5g} to {f[-1]:.5g} Hz, bandwidth {width:.2g} Hz"
    )


def _lines(case: _Case) -> Cause | None:
    step, width = line_step(case.response), 2 * _half(case, case.group)
    if width >= _LINES * step:
        return None
    return Cause("too few lines", f"bandwidth {width:.2g} Hz, lines every {step:.2g} Hz")


def _blocks(case: _Case) -> Cause | None:
    spans = []
    for r in case.results:
        if r.diagram is None or not r.exact:
            continue
        span = r.method.rows_span(r.diagram.settings, r.diagram.dt)
        if span is not None:
            spans.append((span, r.diagram.settings["block_rows"]))
    if not spans or min(spans)[0] * case.group.frequency >= 1:
        return None
    return Cause(
        "too few blocks", f"{min(spans)[1]} block rows span {min(spans)[0] * case.group.frequency:.2g} periods"
    )


def _transformed(case: _Case) -> Cause | None:
    transformed = {r.name for r in case.results if not r.exact}
    if not case.differing or not transformed.issuperset(case.differing):
        return None
    return Cause(
        "transformed data",
        "only methods differ whose data were transformed to " + ("lines" if case.response.grid is None else "samples"),
    )


def disagreements(
    groups: Sequence[Group],
    response: Response,
    results: Sequence[MethodResult],
    data_causes: Sequence[Cause],
    scatter: Scatter | None = None,
) -> tuple[Disagreement, ...]:
    """Return where methods differ on a mode, with the likely causes; findings about the data as a whole come first.

    `data_causes`: found in the channels and the orders. `scatter`: which methods lie further from the consensus than the noise explains;
    by default, and for methods of which it is not known how the noise moves them, a quarter of the half bandwidth or of the damping
    counts.
    """
    found = [Disagreement(None, cause.evidence, (), (cause,)) for cause in data_causes]
    general = tuple(c for c in data_causes if c.name in ("order too low", "bad channel", "swapped sign"))
    for index, group in enumerate(groups):
        biased = {} if scatter is None else scatter.biased[index]
        missing, off = _differing(group, results, biased, frozenset() if scatter is None else scatter.known[index])
        if not missing and not off:
            continue
        labels = {r.name: r.label for r in results}
        words = [f"not found by {', '.join(labels[name] for name in missing)}"] if missing else []
        words += [f"{labels[name]}: {what}" for name, what in off.items()]
        names = (*missing, *off)
        causes = (*mode_causes(index, groups, response, results, names), *_bias(biased, labels)) or general
        causes = causes or (
            Cause("not separated", f"found by {len(group.members)} methods, and no other rule applies"),
        )
        found.append(Disagreement(index, "; ".join(words), names, causes))
    return tuple(found)


def _bias(biased: Mapping[str, Sequence[Biased]], labels: Mapping[str, str]) -> tuple[Cause, ...]:
    """Return the bias that methods are witnesses of, the one that lies furthest off by name."""
    if not biased:
        return ()
    name, worst = max(
        ((name, b) for name, each in biased.items() for b in each), key=lambda pair: abs(pair[1].deviations)
    )
    others = f", and {len(biased) - 1} more beyond the noise" if len(biased) > 1 else ""
    return (
        Cause(
            "bias",
            f"{labels[name]} is the witness: its {worst.kind} lies {abs(worst.deviations):.3g} deviations off{others}",
        ),
    )


def _differing(
    group: Group, results: Sequence[MethodResult], biased: Mapping[str, Sequence[Biased]], known: Collection[str]
) -> tuple[list[str], dict[str, str]]:
    """Return the methods that miss a mode, and those whose values are off, with what is."""
    missing, off = [], {}
    for r in results:
        if r.modes is None:
            continue
        if r.name not in group.members:
            missing.append(r.name)
            continue
        words = [_off(group, r.name, b) for b in biased.get(r.name, ())]
        f, zeta, like = group.frequencies[r.name], group.damping_ratios[r.name], group.mac[r.name]
        if r.name not in known and abs(f - group.frequency) > _OFF_FREQUENCY * group.half_bandwidth:
            words.append(f"frequency {f:.6g} Hz")
        if r.name not in known and abs(zeta - group.damping) > _OFF_DAMPING * group.damping:
            words.append(f"damping {100 * zeta:.3g} %")
        if like < 1 - _OFF_SHAPE:
            words.append(f"MAC {like:.2f}")
        if words:
            off[r.name] = ", ".join(words)
    return missing, off


def _off(group: Group, name: str, found: Biased) -> str:
    """Say how far a value lies off, beyond what the noise explains."""
    if found.kind == "frequency":
        value = f"frequency {group.frequencies[name]:.7g} Hz"
    else:
        value = f"damping {100 * group.damping_ratios[name]:.4g} %"
    return f"{value} ({abs(found.deviations):.3g} deviations of the difference)"
