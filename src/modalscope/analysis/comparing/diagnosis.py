"""Name the likely causes of disagreements between methods, mode by mode, with evidence.

heavy damping
    The damping ratio is above 10 %.
close pair
    Another mode lies within the sum of both half bandwidths.
weak mode
    Its single-mode response is less than a third of the response at its frequency, or within four times the noise that `select` admits.
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
not separated
    None of the others.

Bandwidths of these rules are those in the data, with the damping that an exponential window added. Causes that concern the data as a whole
are in `data_causes` and `routes`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.run import MethodResult
from modalscope.analysis.comparing.scatter import Biased, Scatter
from modalscope.data.response import Response, line_step
from modalscope.data.shown import figures, percent
from modalscope.identification.suits import rows_span
from modalscope.selection.judging.evidence import LEAST_PEAK, LEAST_SIGNAL

#: Name of a cause -> what to do about it.
CAUSES = {
    "dead channel": "Check the sensor and its cable; leave the channel out or measure it again.",
    "swapped sign": "Check direction and polarity of the sensor or the hammer, and change the channel's sign.",
    "bad channel": "Check the channel's coherence and time record; leave it out or measure it again.",
    "order too low": "Raise the largest order.",
    "too few blocks": "Raise block_rows, or measure a longer record.",
    "too few lines": "Measure with a finer resolution (longer records).",
    "heavy damping": "Take its damping as an estimate; excite it alone or use a band around it.",
    "close pair": "Use several inputs and a finer resolution, and compare the two shapes.",
    "weak mode": "Put an input or a sensor where this mode moves, or average more.",
    "edge of the band": "Widen the band.",
    "transformed data": "Prefer the methods that use the data as they were measured.",
    "leakage": "Trust the records on lines; for frequency responses use longer segments or periodic forces.",
    "unmeasured forces": "Measure all forces, and look for noise on the force sensors; take no damping from this record.",
    "delay": "Look for channels of other acquisition units or filters, and align them.",
    "bias": "Check whether a mode is missing or split there; a certificate (modalscope certify) shows which method is biased.",
    "poor fit": "Run that route alone, with more orders or a narrower band; it is no evidence against a mode.",
    "too short": "Measure a longer record.",
    "poor excitation": "Drive the inputs independently of each other, and over the whole band.",
    "not separated": "Check the stabilization diagrams of the methods that miss it.",
}


@dataclass(frozen=True)
class Cause:
    """A likely cause.

    `name`: a key of `CAUSES`. `evidence`: the numbers that support it. `channel`: the channel that it concerns; empty when none.
    """

    name: str
    evidence: str
    channel: str = ""

    @property
    def remedy(self) -> str:
        """The remedy."""
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


#: Damping ratio from which a mode is called heavily damped.
HEAVY = 0.10

#: Minimum distance of a value that differs from the consensus: in half bandwidths (frequency), relative (damping), and of the MAC from 1.
_MIN_FREQUENCY_ERROR, _MIN_DAMPING_ERROR, _MIN_SHAPE_ERROR = 0.25, 0.25, 0.1

#: Signal-to-noise ratio below which a mode is weak.
_WEAK_SIGNAL = 4 * LEAST_SIGNAL

#: Minimum number of lines in a bandwidth.
_MIN_LINES = 3


@dataclass(frozen=True, eq=False)
class _Case:
    """One mode with the data of the rules."""

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
    """Return the causes that make one mode hard to identify, by the rules of this module."""
    others = [g for k, g in enumerate(groups) if k != index]
    case = _Case(groups[index], others, response, results, differing)
    rules = (_heavy, _close, _weak, _edge, _lines, _blocks, _transformed)
    return tuple(cause for rule in rules if (cause := rule(case)) is not None)


def _heavy(case: _Case) -> Cause | None:
    zeta = case.group.damping
    return Cause("heavy damping", f"damping ratio {percent(zeta)}") if zeta > HEAVY else None


def _half(case: _Case, group: Group) -> float:
    """Return the half bandwidth |Re s| / 2 pi that a mode has in the data, Hz."""
    return group.half_bandwidth + case.response.added_damping / (2 * np.pi)


def _close(case: _Case) -> Cause | None:
    g = case.group
    near = [o for o in case.others if abs(o.frequency - g.frequency) < _half(case, o) + _half(case, g)]
    # next to a heavily damped mode everything lies within its half bandwidth
    near = [o for o in near if max(o.damping, g.damping) <= HEAVY]
    if not near:
        return None
    o = min(near, key=lambda o: abs(o.frequency - g.frequency))
    distance = 100 * abs(o.frequency - g.frequency) / g.frequency
    widths = f"half bandwidths {figures(_half(case, g), 2)} and {figures(_half(case, o), 2)} Hz"
    return Cause("close pair", f"{o.frequency:.5g} Hz is {figures(distance, 2)} % away, {widths}")


def _reasons(case: _Case, key: str) -> list[float]:
    """Return a number that the methods have among the reasons of the mode."""
    members = case.group.members
    pairs = ((r.modes, members[r.name]) for r in case.results if r.modes is not None and r.name in members)
    reasons = (modes.reasons[j] for modes, j in pairs if modes.reasons)
    return [float(reason[key]) for reason in reasons if key in reason]


def _weak(case: _Case) -> Cause | None:
    share, signal = _reasons(case, "share_of_peak"), _reasons(case, "signal_to_noise")
    if not share:
        return None
    part, level = float(np.median(share)), float(np.median(signal))
    if part >= LEAST_PEAK and level >= _WEAK_SIGNAL:
        return None
    evidence = [f"{100 * min(part, 1.0):.0f} % of the response at its frequency"] if part < LEAST_PEAK else []
    evidence += [f"{figures(level)} standard deviations above the noise"] if level < _WEAK_SIGNAL else []
    return Cause("weak mode", ", ".join(evidence))


def _edge(case: _Case) -> Cause | None:
    g, f = case.group, case.response.grid
    if f is None:
        return None
    distance, width = min(g.frequency - f[0], f[-1] - g.frequency), 2 * _half(case, g)
    if distance > width:
        return None
    evidence = f"{figures(distance)} Hz inside the band {f[0]:.5g} to {f[-1]:.5g} Hz, bandwidth {figures(width, 2)} Hz"
    return Cause("edge of the band", evidence)


def _lines(case: _Case) -> Cause | None:
    step, width = line_step(case.response), 2 * _half(case, case.group)
    if width >= _MIN_LINES * step:
        return None
    return Cause("too few lines", f"bandwidth {figures(width, 2)} Hz, lines every {figures(step, 2)} Hz")


def _blocks(case: _Case) -> Cause | None:
    diagrams = [(r.method, r.diagram) for r in case.results if r.diagram is not None and r.exact]
    rows = [(rows_span(method, d.settings, d.dt), d.settings.get("block_rows")) for method, d in diagrams]
    spans = [(span, count) for span, count in rows if span is not None]
    if not spans or min(spans)[0] * case.group.frequency >= 1:
        return None
    span, count = min(spans)
    return Cause("too few blocks", f"{count} block rows span {figures(span * case.group.frequency, 2)} periods")


def _transformed(case: _Case) -> Cause | None:
    transformed = {r.name for r in case.results if not r.exact}
    if not case.differing or not transformed.issuperset(case.differing):
        return None
    target = "lines" if case.response.grid is None else "samples"
    return Cause("transformed data", f"only methods on data transformed to {target} differ")


def disagreements(
    groups: Sequence[Group],
    response: Response,
    results: Sequence[MethodResult],
    data_causes: Sequence[Cause],
    scatter: Scatter | None = None,
) -> tuple[Disagreement, ...]:
    """Return where methods differ on a mode, with the likely causes; causes that concern the data as a whole come first.

    `data_causes`: of the channels and the orders. `scatter`: which methods lie further from the consensus than the noise explains; without,
    and for methods on which the effect of the noise is unknown, a quarter of the half bandwidth or of the damping counts.
    """
    differences = [Disagreement(None, cause.evidence, (), (cause,)) for cause in data_causes]
    general = tuple(c for c in data_causes if c.name in ("order too low", "bad channel", "swapped sign"))
    labels = {r.name: r.label for r in results}
    for index, group in enumerate(groups):
        biased = {} if scatter is None else scatter.biased[index]
        missing, off = _differing(group, results, biased, frozenset() if scatter is None else scatter.known[index])
        if not missing and not off:
            continue
        words = [f"not found by {', '.join(labels[name] for name in missing)}"] if missing else []
        words += [f"{labels[name]}: {values}" for name, values in off.items()]
        names = (*missing, *off)
        causes = (*mode_causes(index, groups, response, results, names), *_bias(biased, labels)) or general
        if not causes:
            causes = (Cause("not separated", f"found by {len(group.members)} methods, and no other rule applies"),)
        differences.append(Disagreement(index, "; ".join(words), names, causes))
    return tuple(differences)


def _bias(biased: Mapping[str, Sequence[Biased]], labels: Mapping[str, str]) -> tuple[Cause, ...]:
    """Return the bias beyond the noise, with the method that lies furthest off."""
    if not biased:
        return ()
    pairs = ((name, b) for name, values in biased.items() for b in values)
    name, worst = max(pairs, key=lambda pair: abs(pair[1].deviations))
    others = f"; {len(biased) - 1} more methods beyond the noise" if len(biased) > 1 else ""
    distance = f"{figures(abs(worst.deviations))} standard deviations off"
    return (Cause("bias", f"{worst.kind} by {labels[name]} is {distance}{others}"),)


def _differing(
    group: Group, results: Sequence[MethodResult], biased: Mapping[str, Sequence[Biased]], known: Collection[str]
) -> tuple[list[str], dict[str, str]]:
    """Return the methods that miss a mode, and those whose values are off, with these values."""
    missing, off = [], {}
    for r in results:
        if r.modes is None:
            continue
        if r.name not in group.members:
            missing.append(r.name)
            continue
        f, zeta, like = group.frequencies[r.name], group.damping_ratios[r.name], group.mac[r.name]
        words = []
        for b in biased.get(r.name, ()):
            value = f"frequency {f:.7g} Hz" if b.kind == "frequency" else f"damping {100 * zeta:.4g} %"
            words.append(f"{value} ({figures(abs(b.deviations))} standard deviations of the difference)")
        if r.name not in known and abs(f - group.frequency) > _MIN_FREQUENCY_ERROR * group.half_bandwidth:
            words.append(f"frequency {f:.6g} Hz")
        if r.name not in known and abs(zeta - group.damping) > _MIN_DAMPING_ERROR * group.damping:
            words.append(f"damping {percent(zeta)}")
        if like < 1 - _MIN_SHAPE_ERROR:
            words.append(f"MAC {like:.2f}")
        if words:
            off[r.name] = ", ".join(words)
    return missing, off
