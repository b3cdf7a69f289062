"""State what a result has to say in whole: verdict, warnings, findings and notes, as terminal, page, report and notebook give them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from modalscope.data import ModalModel
from modalscope.data.notes import Finding, Note
from modalscope.data.rebuilt import explains_enough, unexplained
from modalscope.data.response import Response
from modalscope.data.results import Result
from modalscope.data.shown import counted
from modalscope.interfaces.plot.web.fits import Fit, fit_of_result
from modalscope.selection.judging.grades import GRADES, Grade, alike_pairs, grades

#: Kinds of notes on how something was computed, which say nothing about the result.
_ON_COMPUTING = (
    "combinations",
    "cost",
    "data matrix",
    "deviations",
    "estimated",
    "excerpt",
    "held",
    "lags used",
    "order chosen",
    "orders grew",
    "orders left out",
    "participation",
    "poles left out",
    "real shapes",
    "realization",
    "records on lines",
    "shapes of lines",
    "transformed",
)

#: Disagreement of channels on frequencies, in per cent, below which it says nothing about the result.
_SMALL_SHIFT = 0.05

#: Kinds of notes that verdict and findings state already.
_STATED = ("little explained", "no mode")


@dataclass(frozen=True, slots=True)
class Verdict:
    """Sentences on a result.

    `taken`: how the data are interpreted, if that is a choice. `unexplained`: the misfit, if it is small. `warnings`: the misfit is large;
    shapes are alike. `graded`: how many modes have which grade.
    """

    taken: tuple[str, ...]
    unexplained: tuple[str, ...]
    warnings: tuple[str, ...]
    graded: tuple[str, ...]


def verdict_of(modes: ModalModel, response: Response, fit: Fit, judged: Sequence[Grade] | None = None) -> Verdict:
    """Return the sentences on a list of modes.

    `response`: that of the first band. `fit`: fit error of all bands, in all and per channel; None if it is not known. `judged`: the
    grades, if they are known.
    """
    share = () if fit is None else (unexplained(fit[0]),)
    enough = fit is None or explains_enough(fit[0])
    taken = ("No force was measured: taken as ambient vibration.",) if response.ambient else ()
    counts = Counter(grade.word for grade in (grades(modes) if judged is None else judged))
    listed = [f"{counts[word]} {word}" for word in GRADES if counts[word]]
    graded = (f"Graded: {', '.join(listed)}.",) if listed else ()
    return Verdict(taken, share if enough else (), (*(() if enough else share), *_alike(modes)), graded)


def verdict_of_result(result: Result) -> Verdict:
    """Return the sentences on the result of an analysis."""
    return verdict_of(result.modes, result.diagrams[0].response, fit_of_result(result))


def _alike(modes: ModalModel) -> tuple[str, ...]:
    """Return the warning that shapes are alike, if they are."""
    pairs = alike_pairs(modes)
    if not pairs:
        return ()
    i, j, value = pairs[0]
    more = f", and of {counted(len(pairs) - 1, 'more pair')}" if len(pairs) > 1 else ""
    causes = "few sensors, a common signal, a duplicate?"
    return (f"WARNING: shapes of modes {i + 1} and {j + 1} are alike (MAC {value:.2f}){more}: {causes}",)


def grouped(findings: Iterable[Finding]) -> list[Finding]:
    """Return findings of one kind with one remedy as one: the channels of all, the reason of the first."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.kind, finding.change), []).append(finding)
    together = []
    for alike in groups.values():
        channels = tuple(dict.fromkeys(name for finding in alike for name in finding.channels))
        others = len({finding.reason for finding in alike}) - 1
        reason = alike[0].reason + (f" (and {counted(others, 'finding')} of this kind)" if others else "")
        together.append(alike[0]._replace(channels=channels, reason=reason))
    return together


def notes_that_matter(notes: Iterable[Note]) -> tuple[list[str], list[str]]:
    """Return the texts of notes, each once: those about the result, and those about computing."""
    texts: tuple[dict[str, None], dict[str, None]] = ({}, {})
    for note in notes:
        if note.kind not in _STATED and not note.kind.startswith("data: "):
            small = note.kind == "shifts" and max(note.numbers.values()) < _SMALL_SHIFT
            texts[small or note.kind in _ON_COMPUTING].setdefault(str(note), None)
    return list(texts[0]), list(texts[1])
