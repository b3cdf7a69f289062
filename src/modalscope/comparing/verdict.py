"""Grade how far each mode can be trusted, and state the verdict in words.

A mode is **trusted** when at least two thirds of the methods with a vote (and two at least, where two have one) found it, it has an
interval, which its certificate does not refute (where one was asked), and its stated scatter is within a half bandwidth in
frequency and within 30 % in damping. It is trusted **in frequency only** when its damping scatters more, or its interval is not known
or does not hold. Otherwise it is **doubtful**. When the largest order is too low no mode is trusted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from modalscope.comparing.agreement import Group
from modalscope.comparing.diagnosis import Cause
from modalscope.comparing.run import MethodResult
from modalscope.comparing.scatter import Scatter

GRADES = ("trusted", "frequency only", "doubtful")

_SHARE = 2 / 3
_FREQUENCY, _DAMPING = 1.0, 0.3

#: Findings that throw doubt on every mode.
_FATAL = ("order too low",)


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
    `interval`: what is wrong with its interval; empty when nothing is.
    """
    votes, voters = len(group.votes), group.voters
    found = f"found by {votes} of {voters} independent methods"
    fatal = [c for c in data_causes if c.name in _FATAL]
    if fatal:
        return Trust("doubtful", f"{found}, but {fatal[0].name}", causes)
    if votes < _SHARE * voters or votes < min(2, voters):
        return Trust("doubtful", f"only {found}" + _because(causes), causes)
    if frequency_scatter > _FREQUENCY * group.half_bandwidth:
        return Trust(
            "doubtful", f"{found}, but its frequency is open by ±{frequency_scatter:.2g} Hz" + _because(causes), causes
        )
    if damping_scatter > _DAMPING * group.damping:
        share = 100 * damping_scatter / group.damping
        return Trust("frequency only", f"{found}; its damping is open by ±{share:.0f} %" + _because(causes), causes)
    return Trust("frequency only", f"{found}; {interval}", causes) if interval else Trust("trusted", found, causes)


def _because(causes: tuple[Cause, ...]) -> str:
    return f": {', '.join(c.name for c in causes)}" if causes else ""


def words(
    groups: Sequence[Group],
    trust: Sequence[Trust],
    scatter: Scatter,
    results: Sequence[MethodResult],
    data_causes: Sequence[Cause],
) -> str:
    """Return the verdict, one statement a line."""
    ran = [r for r in results if r.modes is not None]
    failed = [r for r in results if r.modes is None]
    if not ran:
        return f"No method could use these data. {failed[0].failure if failed else ''}".strip()
    lines = []
    sure = [k for k, t in enumerate(trust) if t.trusted]
    if sure:
        which = ", ".join(f"{groups[k].frequency:.5g}" for k in sure)
        count = f"All {len(sure)} modes" if len(sure) == len(groups) > 1 else f"{len(sure)} of {len(groups)} modes"
        worst = max(sure, key=lambda k: scatter.damping[k] / groups[k].damping)
        lines.append(
            f"{count} can be trusted in frequency and damping: {which} Hz. "
            f"The widest stated scatter among them is ±{100 * scatter.damping[worst] / groups[worst].damping:.2g} % "
            f"of the damping, at {groups[worst].frequency:.5g} Hz."
        )
    elif groups:
        lines.append(f"None of the {len(groups)} modes can be trusted in full.")
    else:
        lines.append("No mode stands out of the data by any method.")
    for grade, lead in (
        ("frequency only", "Trust the frequency, but not the damping, of"),
        ("doubtful", "Do not trust"),
    ):
        lines += [f"{lead} {groups[k].frequency:.5g} Hz: {t.why}." for k, t in enumerate(trust) if t.grade == grade]
    lines += [f"{_lead(c)}. {c.remedy}" for c in data_causes]
    if failed:
        lines.append(f"{len(failed)} of {len(results)} methods failed: {'; '.join(r.label for r in failed)}.")
    return "\n".join(lines)


def _lead(cause: Cause) -> str:
    """Return the name of a cause and its evidence as the beginning of a sentence, the name once."""
    evidence = cause.evidence.removesuffix(".")
    said = evidence.lower().startswith(cause.name)
    return evidence[:1].upper() + evidence[1:] if said else f"{cause.name.capitalize()}: {evidence}"
