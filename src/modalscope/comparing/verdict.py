"""Grade how far each mode can be trusted, and state the verdict.

A witness is a method with a vote: one of each route, or else of each domain and principle (`principles`). A mode is **trusted** when at
least two thirds of the witnesses (and two at least, where there are two) found it, it has an interval, which its certificate does not
refute (where one was asked), and its stated scatter is within a half bandwidth in frequency and within 30 % in damping. It is trusted
**in frequency only** when its damping scatters more, or its interval is not known or does not hold. Otherwise it is **doubtful**. When
the largest order is too low no mode is trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modalscope.checking.certificate import Certificate, certified, replicates_of
from modalscope.comparing.agreement import Group
from modalscope.comparing.diagnosis import Cause
from modalscope.comparing.run import MethodResult
from modalscope.comparing.scatter import Scatter
from modalscope.data.records import Signals

GRADES = ("trusted", "frequency only", "doubtful")

#: Minimum part of the methods with a vote.
_MIN_VOTES = 2 / 3

#: Maximum stated scatter of a trusted mode: of its frequency in half bandwidths, of its damping, relative.
_MAX_FREQUENCY_SCATTER, _MAX_DAMPING_SCATTER = 1.0, 0.3

#: Causes that make every mode doubtful.
_FATAL_CAUSES = ("order too low",)


@dataclass(frozen=True)
class Trust:
    """How far one mode is trusted.

    `causes`: what makes it hard, whether or not methods differ.
    """

    grade: str
    why: str
    causes: tuple[Cause, ...]

    @property
    def trusted(self) -> bool:
        """Frequency and damping both."""
        return self.grade == GRADES[0]


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


def interval_trouble(group: Group, frequency_noise: float, damping_noise: float, tried: Tried | None) -> str:
    """Return the fault of the interval of a mode: it is unknown, or refuted by its certificate; "" otherwise.

    `frequency_noise`, `damping_noise`: standard deviations; NaN where unknown.
    """
    unknown = [w for w, v in (("frequency", frequency_noise), ("damping", damping_noise)) if not np.isfinite(v)]
    if unknown:
        return f"standard deviation of its {' and '.join(unknown)} unknown"
    if tried is None or tried.method not in group.members or tried.certificate.holds[group.members[tried.method]]:
        return ""
    return "its interval is refuted by its certificate"


def judge(
    group: Group,
    frequency_scatter: float,
    damping_scatter: float,
    causes: tuple[Cause, ...],
    data_causes: Sequence[Cause],
    interval: str = "",
) -> Trust:
    """Grade one mode by the rules of this module.

    `frequency_scatter`, `damping_scatter`: stated, Hz and ratio. `causes`, `data_causes`: of the mode, and of the data as a whole.
    `interval`: the fault of its interval; "" without one.
    """
    votes, voters = len(group.votes), group.voters
    support = f"found by {votes} of {voters} independent witnesses"
    because = f": {', '.join(c.name for c in causes)}" if causes else ""
    fatal = [c.name for c in data_causes if c.name in _FATAL_CAUSES]
    if fatal:
        return Trust("doubtful", f"{support}, but {fatal[0]}", causes)
    if votes < _MIN_VOTES * voters or votes < min(2, voters):
        return Trust("doubtful", f"only {support}{because}", causes)
    if frequency_scatter > _MAX_FREQUENCY_SCATTER * group.half_bandwidth:
        return Trust("doubtful", f"{support}; frequency uncertain by ±{frequency_scatter:.2g} Hz{because}", causes)
    if damping_scatter > _MAX_DAMPING_SCATTER * group.damping:
        share = 100 * damping_scatter / group.damping
        return Trust("frequency only", f"{support}; damping uncertain by ±{share:.0f} %{because}", causes)
    return Trust("frequency only", f"{support}; {interval}", causes) if interval else Trust("trusted", support, causes)


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
    trusted = [k for k, t in enumerate(trust) if t.trusted]
    if trusted:
        listed = ", ".join(f"{groups[k].frequency:.5g}" for k in trusted)
        count = f"All {len(groups)}" if len(trusted) == len(groups) > 1 else f"{len(trusted)} of {len(groups)}"
        worst = max(trusted, key=lambda k: scatter.damping[k] / groups[k].damping)
        widest = f"±{100 * scatter.damping[worst] / groups[worst].damping:.2g} % at {groups[worst].frequency:.5g} Hz"
        lines = [
            f"{count} modes can be trusted in frequency and damping: {listed} Hz. Widest damping interval: {widest}."
        ]
    else:
        lines = [f"None of the {len(groups)} modes can be trusted in full." if groups else "No method found a mode."]
    leads = {"frequency only": "Trust the frequency, but not the damping, of", "doubtful": "Do not trust"}
    for grade, lead in leads.items():
        lines += [f"{lead} {groups[k].frequency:.5g} Hz: {t.why}." for k, t in enumerate(trust) if t.grade == grade]
    for c in data_causes:  # the name of the cause once
        evidence = c.evidence.removesuffix(".")
        named = evidence.lower().startswith(c.name)
        lines.append(
            f"{evidence[:1].upper()}{evidence[1:]}. {c.remedy}"
            if named
            else f"{c.name.capitalize()}: {evidence}. {c.remedy}"
        )
    if failed:
        lines.append(f"{len(failed)} of {len(results)} methods failed: {'; '.join(r.label for r in failed)}.")
    return "\n".join(lines)
