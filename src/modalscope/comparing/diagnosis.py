"""Rules that name the likely cause of a disagreement, mode by mode and for the data as a whole. Each names its evidence.

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
    See `modalscope.comparing.falling`.
not separated
    None of the others.

Bandwidths of these rules are those in the data, with what an exponential window added.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modalscope.comparing.agreement import Group
from modalscope.comparing.causes import Cause, Disagreement
from modalscope.comparing.run import MethodResult
from modalscope.comparing.scatter import Biased, Scatter
from modalscope.judging.evidence import LEAST_PEAK, LEAST_SIGNAL
from modalscope.model.response import Response
from modalscope.model.window import line_step

__all__ = ["HEAVY", "disagreements", "mode_causes"]

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
        "edge of the band",
        f"{away:.3g} Hz inside the band {f[0]:.5g} to {f[-1]:.5g} Hz, bandwidth {width:.2g} Hz",
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
    if not case.differing:
        return None
    carried = {r.name for r in case.results if not r.exact}
    if not set(case.differing) <= carried:
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

    Parameters
    ----------
    groups : sequence of Group
    response : FrequencyResponse or ImpulseResponse
    results : sequence of MethodResult
    data_causes : sequence of Cause
        Found in the channels and the orders.
    scatter : Scatter, optional
        Which methods lie further from the consensus than the noise explains; by default, and for methods of which it is not known how
        the noise moves them, a quarter of the half bandwidth or of the damping counts.
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
