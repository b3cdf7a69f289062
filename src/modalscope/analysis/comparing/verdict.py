"""Say of each mode whether methods agree on it, and how far it is known by the analysis of the same data.

A witness is a method with a vote: one of each route, or else of each domain and principle (`principles`). **Methods agree** on a mode when
at least two thirds of the witnesses (and two at least, where there are two) found it, their values scatter beyond the noise by at most a
half bandwidth in frequency and 30 % in damping (95 %), and the refined values of the analysis lie within the interval of the consensus.
Otherwise, and for every mode when the largest order is too low, **methods differ**. The grade is that of the analysis
(`judging.grades`): of what methods share, such as leakage and loading, their agreement tells nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modalscope.analysis.checking.certificate import Certificate, certified, replicates_of
from modalscope.analysis.comparing.agreement import Group
from modalscope.analysis.comparing.beside import Beside
from modalscope.analysis.comparing.diagnosis import Cause
from modalscope.analysis.comparing.run import MethodResult
from modalscope.analysis.comparing.scatter import Scatter
from modalscope.data.records import Signals
from modalscope.data.shown import figures, percent
from modalscope.selection.judging.grades import GRADES, Grade

#: What is said of a mode.
AGREE, DIFFER = "methods agree", "methods differ"

#: Beginnings of the lines on modes that are not good.
LEADS = {"look": "Look at", "doubtful": "Doubtful is"}

#: Minimum part of the methods with a vote.
_MIN_VOTES = 2 / 3

#: Maximum scatter of methods that agree, beyond the noise: of the frequency in half bandwidths, of the damping, relative.
_MAX_FREQUENCY_SCATTER, _MAX_DAMPING_SCATTER = 1.0, 0.3

#: Causes by which methods of more states would differ.
_FATAL_CAUSES = ("order too low",)


@dataclass(frozen=True)
class Trust:
    """How far one mode is known.

    `grade`, one of good, look and doubtful, by the analysis of the same data. `agreement`: "methods agree" or "methods differ". `why`: the
    reasons of both. `causes`: what makes it hard, whether or not methods differ.
    """

    grade: str
    why: str
    causes: tuple[Cause, ...]
    agreement: str = AGREE

    @property
    def agreed(self) -> bool:
        """Whether methods agree."""
        return self.agreement == AGREE

    @property
    def trusted(self) -> bool:
        """Whether the mode is good, and methods agree on it."""
        return self.grade == GRADES[0] and self.agreed


class Tried(NamedTuple):
    """The certificate of one method, by its `MethodResult.name`."""

    method: str
    certificate: Certificate


def certified_best(results: Sequence[MethodResult], records: Sequence[Signals | None], replicates: int) -> Tried | None:
    """Return the certificate of the method that fits best of those whose standard deviations are known; None without replicates.

    `records`: of the responses of each, where they are correlations.
    """
    able = [
        (r, signals)
        for r, signals in zip(results, records, strict=True)
        if r.exact and r.moved is not None and r.modes is not None and r.diagram is not None
    ]
    if not replicates or not able:
        return None
    best, signals = min(able, key=lambda pair: np.inf if pair[0].fit_error is None else pair[0].fit_error)
    assert best.diagram is not None
    assert best.modes is not None
    simulated = replicates_of(best.diagram, best.modes, signals)
    return Tried(best.name, certified(simulated, replicates, np.random.default_rng(0)))


def refuted(group: Group, tried: Tried | None) -> bool:
    """Whether the certificate refutes the interval of a mode."""
    return (
        tried is not None and tried.method in group.members and not tried.certificate.holds[group.members[tried.method]]
    )


def judge(
    group: Group,
    scatter: tuple[float, float],
    beside: Beside,
    causes: tuple[Cause, ...],
    data_causes: Sequence[Cause],
    *,
    interval: tuple[float, float] = (np.inf, np.inf),
    refuted: bool = False,
) -> Trust:
    """Say of one mode by the rules of this module whether methods agree, with its grade.

    `scatter`: half widths of what frequency (Hz) and damping ratio scatter by beyond the noise. `interval`: half widths of the interval of
    the consensus. `beside`: the mode in the analysis. `causes`, `data_causes`: of the mode, and of the data as a whole.
    """
    support = f"found by {len(group.votes)} of {group.voters} independent methods"
    differs = _difference(group, scatter, beside, data_causes, interval)
    grade = beside.grade
    if refuted and grade.word == GRADES[0]:
        grade = Grade(GRADES[1], "its interval is refuted by its certificate")
    because = f": {', '.join(c.name for c in causes)}" if causes and differs else ""
    return Trust(grade.word, f"{grade.reason}; {support}{differs}{because}", causes, DIFFER if differs else AGREE)


def _difference(
    group: Group,
    scatter: tuple[float, float],
    beside: Beside,
    data_causes: Sequence[Cause],
    interval: tuple[float, float],
) -> str:
    """Return by what methods differ on a mode; "" where they agree."""
    votes, voters = len(group.votes), group.voters
    fatal = [c.name for c in data_causes if c.name in _FATAL_CAUSES]
    if fatal:
        return f", but {fatal[0]}"
    if votes < _MIN_VOTES * voters or votes < min(2, voters):
        return " only"
    if scatter[0] > _MAX_FREQUENCY_SCATTER * group.half_bandwidth:
        return f", whose frequencies scatter by ±{figures(scatter[0], 2)} Hz"
    if scatter[1] > _MAX_DAMPING_SCATTER * group.damping:
        return f", whose damping scatters by ±{100 * scatter[1] / group.damping:.0f} %"
    # comparisons with what is not known are false
    away = np.abs(beside.values - [group.frequency, group.damping]) > interval
    if away[0]:
        return f", but refined it lies at {beside.values[0]:.6g} Hz"
    return f", but refined its damping is {percent(float(beside.values[1]), 3)}" if away[1] else ""


def words(
    groups: Sequence[Group],
    trust: Sequence[Trust],
    scatter: Scatter,
    results: Sequence[MethodResult],
    data_causes: Sequence[Cause],
) -> str:
    """Return the verdict, one statement a line."""
    failed = [r for r in results if r.modes is None]
    if len(failed) == len(results):
        return f"No method could use these data. {failed[0].failure if failed else ''}".strip()
    agreed = [k for k, t in enumerate(trust) if t.agreed]
    if agreed:
        listed = ", ".join(f"{groups[k].frequency:.5g}" for k in agreed)
        count = f"all {len(groups)}" if len(agreed) == len(groups) > 1 else f"{len(agreed)} of {len(groups)}"
        shares = {k: scatter.damping[k] / groups[k].damping for k in agreed if np.isfinite(scatter.damping[k])}
        worst = max(shares, key=lambda k: shares[k], default=None)
        widest = "" if worst is None else f"±{percent(shares[worst], 2)} at {groups[worst].frequency:.5g} Hz"
        lines = [
            f"Methods agree on {count} modes: {listed} Hz.{widest and f' Widest damping interval of these: {widest}.'}"
        ]
    else:
        lines = [f"Methods agree on none of the {len(groups)} modes." if groups else "No method found a mode."]
    if groups:
        counts = {word: sum(t.grade == word for t in trust) for word in GRADES}
        told = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
        lines.append(
            f"Graded by the analysis of the same data: {told}. What methods share (leakage, loading) they cannot see."
        )
    for k, t in enumerate(trust):
        if not t.trusted:
            lines.append(f"{LEADS.get(t.grade, 'Methods differ on')} {groups[k].frequency:.5g} Hz: {t.why}.")
    for c in data_causes:  # the name of the cause once
        evidence = c.evidence.removesuffix(".")
        named = evidence if evidence.lower().startswith(c.name) else f"{c.name}: {evidence}"
        lines.append(f"{named[:1].upper()}{named[1:]}. {c.remedy}")
    if failed:
        lines.append(f"{len(failed)} of {len(results)} methods failed: {'; '.join(r.label for r in failed)}.")
    return "\n".join(lines)
