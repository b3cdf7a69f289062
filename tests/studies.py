"""Tables of `docs/validation/`, one page a subject: rows that studies measured in this run replace theirs, all others are kept."""

from __future__ import annotations

import datetime
import functools
import os
import re
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from modalscope import __version__
from tests.support import ROOT

__all__ = ["SUBJECTS", "Run", "Study", "this_run", "write"]

FOLDER = ROOT / "docs" / "validation"

#: Names of pages, which are also words for `make study WORD=...`, and their titles.
SUBJECTS = {
    "selection": "Selection of modes",
    "bands": "Modes of narrow bands and of parts of a band",
    "ablation": "Rules of the choice of modes, switched off one by one",
    "ambient": "Ambient records",
    "harmonics": "Harmonics of rotating machines",
    "inputs": "Records with inputs",
    "refinement": "Refinement and the Cramér-Rao bound",
    "methods": "Methods and published noise tables",
    "standard-deviations": "Standard deviations",
    "certificates": "Certificates",
    "checks": "Checks of data",
    "monitoring": "Months of records",
    "planning": "Places, and what to measure next",
    "resources": "Time and memory",
    "reading": "Exports of other programs",
    "robustness": "Damaged files, wrong arguments and interrupted programs",
}

HEAD = ("data", "figure", "seeds or cases", "asked", "measured", "holds", "date", "commit")
BEGIN, END = "<!-- overview: written by `make study` -->", "<!-- end of overview -->"


class Run(NamedTuple):
    """When, and of which state of the code, figures were measured."""

    date: str
    commit: str
    version: str


@functools.cache
def this_run() -> Run:
    """Return the run of this process; sources or tests that differ from the commit are said."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()

    changed = git("status", "--porcelain", "--", "src", "tests")
    commit = (git("rev-parse", "--short", "HEAD") or "unknown") + " with changes" * bool(changed)
    return Run(datetime.date.today().isoformat(), commit, __version__)


@dataclass
class Study:
    """Figures of one kind of data.

    Parameters
    ----------
    subject : str
        One of `SUBJECTS`.
    data : str
        What was tried; no two studies of a subject may share it.
    cases : str
        Seeds or cases, how many and which.
    run : Run
        When it was measured.
    """

    subject: str
    data: str
    cases: str
    run: Run
    rows: list[str] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.subject not in SUBJECTS:
            raise ValueError(f"There is no subject {self.subject!r}. Choose one of {', '.join(SUBJECTS)}.")
        if not self.cases.strip():
            raise ValueError(f"{self.data}: say which seeds or cases the figures are of.")

    def row(
        self,
        figure: str,
        measured: object,
        *,
        least: float | None = None,
        most: float | None = None,
        form: str = ".3g",
        unit: str = "",
    ) -> None:
        """Record a figure with the limits that it must keep; of several values the range is shown, and a text is shown as it is."""

        def shown(value: float) -> str:
            return str(int(value)) if float(value).is_integer() and abs(value) < 1e6 else f"{value:{form}}"

        asked, holds, text = "", "", measured
        if not isinstance(measured, str):
            values = np.atleast_1d(np.asarray(measured, float))
            low, high = values.min(), values.max()
            text = shown(low) if values.size == 1 else f"{shown(low)} to {shown(high)}"
            good = (least is None or low >= least) and (most is None or high <= most)
            bounds = [f"{word} {shown(x)}" for word, x in (("at least", least), ("at most", most)) if x is not None]
            if least is not None and least == most:
                bounds = [shown(least)]
            if bounds:
                asked, holds = ", ".join(bounds) + unit, "yes" if good else "no"
        cells = (self.data, figure, self.cases, asked, f"{text}{unit}", holds, self.run.date, self.run.commit)
        line = _line(cells)
        self.rows.append(line)
        if holds == "no":
            self.missed.append(f"{figure}: {text}{unit}, asked: {asked}")
        print(f"\n{line}")


def write(studies: Iterable[Study], folder: Path = FOLDER) -> None:
    """Replace the rows of these studies in the pages of their subjects, and the overview in `index.md`."""
    measured = [study for study in studies if study.rows]
    for subject in dict.fromkeys(study.subject for study in measured):
        here = [study for study in measured if study.subject == subject]
        names, run, path = {_line([study.data]) for study in here}, here[-1].run, folder / f"{subject}.md"
        rows = [line for line in _rows(path) if _line(_cells(line)[:1]) not in names]
        rows = sorted([*rows, *(row for study in here for row in study.rows)], key=_place)
        about = (
            f"Written by `make study`. Last run: {run.date}, commit {run.commit}, modalscope {run.version}. "
            f"`make study WORD={subject}` measures the figures again; each row names its seeds or cases, date and commit."
        )
        _replace(path, "\n".join([f"# {SUBJECTS[subject]}", "", about, "", *_table(HEAD, rows), ""]))
    index = folder / "index.md"
    before, _, rest = index.read_text(encoding="utf-8").partition(BEGIN)
    _replace(index, "\n".join([before + BEGIN, *overview(folder), END + rest.partition(END)[2]]))


def overview(folder: Path = FOLDER) -> list[str]:
    """Return the lines of the table of subjects: how many figures there are, how many are within what is asked, and the last run."""
    lines = []
    for subject, title in SUBJECTS.items():
        rows = [_cells(line) for line in _rows(folder / f"{subject}.md")]
        held = [row[5] for row in rows if row[5]]
        last = max((row[6] for row in rows), default="not run")
        cells = (
            f"[{title}]({subject}.md)",
            str(len(rows)),
            f"{held.count('yes')} of {len(held)}" if held else "",
            last,
        )
        lines.append(_line(cells if rows else (title, "", "", last)))
    return _table(("subject", "figures", "within what is asked", "last run"), lines)


def _table(head: Iterable[str], lines: Iterable[str]) -> list[str]:
    names = list(head)
    return [_line(names), _line(["---"] * len(names)), *lines]


def _line(cells: Iterable[str]) -> str:
    """Return a row; bars within a cell are escaped."""
    return "| " + " | ".join(re.sub(r"(?<!\\)\|", r"\\|", " ".join(cell.split())) for cell in cells) + " |"


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def _rows(path: Path) -> list[str]:
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [line for line in lines if line.startswith("| ")][2:]


def _place(line: str) -> list[tuple[float, str]]:
    """Return the place of a row among others: by its data, numbers by their size; the sort keeps figures in their order."""
    parts = re.split(r"(\d+\.?\d*)", _cells(line)[0])
    return [(float(part), "") if k % 2 else (np.inf, part) for k, part in enumerate(parts)]


def _replace(path: Path, text: str) -> None:
    """Write through a temporary file: a page is complete or what it was before."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
