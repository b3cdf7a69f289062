"""Hold a comparison: the result of every method, the consensus, and the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Protocol, TypeVar

from modalscope.comparing.agreement import Group
from modalscope.comparing.causes import Cause, Disagreement
from modalscope.comparing.identities import Identity
from modalscope.comparing.kinship import Kinship
from modalscope.comparing.run import MethodResult
from modalscope.comparing.scatter import LEVEL, Scatter, Tried
from modalscope.comparing.verdict import Trust
from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Response
from modalscope.data.shown import Shown, cells_of, summary_of
from modalscope.identification.method import Method
from modalscope.modal.rebuilt import explains_enough, share_explained
from modalscope.numerics.errors import DataError

__all__ = ["Comparison", "find_by_name"]


# -------------------------------------------------------------------------------------------------------------- labels
# What methods are called in tables and pictures, and how a result is found by any of its method's names.


class _HasMethod(Protocol):
    @property
    def method(self) -> Method: ...


T = TypeVar("T", bound=_HasMethod)


def find_by_name(results: Iterable[T], name: str | tuple[str, str]) -> T:
    """Return the one result whose method has a name: `era (s)`, `ERA/s`, `ssi_cov`, `PolyMAX`; case, blanks and signs do not matter.

    Raises `DataError`: no such result, with the nearest name; or one name of several.
    """
    known = list(results)
    asked = name if isinstance(name, str) else "/".join(map(str, name))
    wanted = _plain(asked)
    found = [r for r in known if wanted in {n + r.method.domain for n in _names(r.method)}]
    found = found or [r for r in known if wanted in _names(r.method)]
    if len(found) == 1:
        return found[0]
    there = [str(r.method) for r in found or known]
    if found:
        raise DataError(f"the result of {asked!r} was asked", f"that is {' and '.join(there)}", "Name one of these.")
    spelt = {_plain(word): word for r in known for word in (str(r.method), r.method.label)}
    near = get_close_matches(wanted, spelt, n=1, cutoff=0.5)
    hint = f"Did you mean {spelt[near[0]]!r}? " if near else ""
    raise DataError(
        f"the result of {asked!r} was asked", f"there are {', '.join(there) or 'none'}", f"{hint}Name one of these."
    )


def _names(method: Method) -> set[str]:
    words = (method.name, method.label, method.common, *method.known_as, *method.aliases)
    return {_plain(word.partition(" on ")[0].partition(" with ")[0]) for word in words} | {_plain(method.label)}


def _plain(text: str) -> str:
    """Return letters and digits alone, in lower case."""
    return "".join(c for c in str(text).casefold() if c.isalnum())


# -------------------------------------------------------------------------------------------------------------- result

#: Modes that stand beside each other in a table of text.
_BESIDE = 5


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Comparison(Shown):
    """What all methods found on the same data, the modes that they agree on, and how far to trust each.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
        What all methods were given.
    results : tuple of MethodResult
        One a method: modes, diagram, fit error, seconds, or the failure.
    modes : ModalModel
        The consensus; `frequencies_spread` and `damping_ratios_spread` are the standard deviations between methods.
    groups : tuple of Group
        For every mode of the consensus what each method found.
    unconfirmed : tuple of Group
        What only methods on transformed data found: not in the consensus.
    scatter : Scatter
        Stated scatter of every mode.
    fit_error : float
        Of the consensus on `response`.
    trust : tuple of Trust
    kinship : Kinship
    identities : tuple of Identity
    disagreements : tuple of Disagreement
    findings : tuple of Cause
        What was found about channels and orders.
    verdict : str
    certified : Tried, optional
        The certificate of the method that fits best, where one was asked.
    settings : mapping
        What was asked: methods, orders, band, excluded channels.
    notes : tuple of Note
    """

    response: Response
    results: tuple[MethodResult, ...]
    modes: ModalModel
    groups: tuple[Group, ...]
    unconfirmed: tuple[Group, ...]
    scatter: Scatter
    fit_error: float
    trust: tuple[Trust, ...]
    kinship: Kinship
    identities: tuple[Identity, ...]
    disagreements: tuple[Disagreement, ...]
    findings: tuple[Cause, ...]
    verdict: str
    certified: Tried | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()

    @property
    def causes(self) -> frozenset[str]:
        """Names of all causes that were named, of the data or of a mode."""
        every = [*self.findings, *(c for t in self.trust for c in t.causes)]
        every += [c for d in self.disagreements for c in d.causes]
        return frozenset(c.name for c in every)

    def __getitem__(self, name: str | tuple[str, str]) -> MethodResult:
        """Return the result of one method, by any of its names: `comparison["era (s)"]`, `comparison["ssi-cov"]`.

        Raises
        ------
        DataError
            No method of that name was compared; the nearest is named.
        """
        return find_by_name(self.results, name)

    def label(self, name: str) -> str:
        """Return what the literature calls a method that groups and disagreements name.

        Parameters
        ----------
        name : str
            As in `MethodResult.name`.
        """
        return next((r.label for r in self.results if r.name == name), name)

    def table(self, each: bool = True) -> str:
        """Return modes, verdict and methods as text.

        Parameters
        ----------
        each : bool
            Whether what every method says of every mode follows.
        """
        parts = [self._modes_table(), self.verdict, self._methods_table(), *(self._each_tables() if each else ())]
        return "\n\n".join(part for part in parts if part)

    def _modes_table(self) -> str:
        head = ["mode", "f [Hz]", "+-", "zeta [%]", "+-", "methods", "MAC", "trust"]
        rows = []
        for k, (g, t) in enumerate(zip(self.groups, self.trust, strict=True)):
            rows.append(
                [
                    str(k + 1),
                    f"{g.frequency:.4f}",
                    f"{self.scatter.frequency[k]:.2g}",
                    f"{100 * g.damping:.3f}",
                    f"{100 * self.scatter.damping[k]:.2g}",
                    f"{len(g.members)} of {sum(r.modes is not None for r in self.results)}",
                    f"{min(g.mac.values()):.3f}",
                    t.grade,
                ]
            )
        lead = f"Consensus (+-: the truth within it in {100 * LEVEL:g} %, by the noise and by what methods disagree beyond it)"
        return _aligned([head, *rows], lead) if rows else "No mode in common."

    def _methods_table(self) -> str:
        head = ["method", "modes", "fit error [%]", "seconds", ""]
        rows = []
        for r in self.results:
            if r.modes is None or r.fit_error is None:
                rows.append([r.label, "-", "-", f"{r.seconds:.1f}", f"failed: {r.failure}"])
                continue
            note = "" if r.exact else "no vote" if r.route else "transformed data, no vote"
            if not explains_enough(r.fit_error):
                note = f"EXPLAINS ONLY {100 * share_explained(r.fit_error):.0f} %" + (f"; {note}" if note else "")
            rows.append([r.label, str(len(r.modes)), f"{100 * r.fit_error:.2f}", f"{r.seconds:.1f}", note])
        return _aligned([head, *rows], "Methods", left=(0, 4))

    def _each_tables(self) -> list[str]:
        """Return what every method says of every mode, as tables of a few modes: lines that wrap cannot be read."""
        names = [r.name for r in self.results if r.modes is not None]
        starts = range(0, len(self.groups), _BESIDE) if names else ()
        return [self._each_table(names, range(first, min(first + _BESIDE, len(self.groups)))) for first in starts]

    def _each_table(self, names: Sequence[str], modes: Sequence[int]) -> str:
        head = ["f [Hz] / zeta [%]", *(f"mode {k + 1}" for k in modes)]
        groups = [self.groups[k] for k in modes]
        rows = [
            [
                self.label(name),
                *(
                    f"{g.frequencies[name]:.5g} / {100 * g.damping_ratios[name]:.3g}" if name in g.members else "-"
                    for g in groups
                ),
            ]
            for name in names
        ]
        return _aligned([head, *rows], "Every method" if modes[0] == 0 else "Every method, further modes")


def _aligned(rows: list[list[str]], lead: str, left: tuple[int, ...] = (0,)) -> str:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.ljust(w) if k in left else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    return "\n".join([lead, *lines])


@summary_of.register
def _(found: Comparison) -> str:
    return f"comparison of {len(found.results)} methods: {summary_of(found.modes)}; {found.verdict.splitlines()[0]}"


@cells_of.register
def _(found: Comparison) -> list[list[str]]:
    return cells_of(found.modes)
