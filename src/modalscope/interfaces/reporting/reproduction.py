"""Reproduce the founding report on this machine: its published numbers, and its sections executed, as one page."""

from __future__ import annotations

import io
import re
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modalscope.analysis.checking.selfcheck import Value, recomputed
from modalscope.interfaces.reporting.document import write_page
from modalscope.interfaces.reporting.html import Section, escaped, paragraph, table
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import check_path

__all__ = ["Reproduction", "reproduce"]

#: An installed package holds the pages; a checkout has them in `docs/`.
_PLACES = (Path(__file__).parent / "executed", Path(__file__).parents[4] / "docs" / "executed")

_ROLES = re.compile(r":\w+:`([^`]*)`")


@dataclass(frozen=True)
class Reproduction:
    """What was reproduced.

    Attributes
    ----------
    values : tuple of Value
        Every published value, and what this machine gives.
    pages : dict of str to str
        Title of every executed page -> the error that stopped it, or an empty text.
    path : Path
        The page that was written.
    """

    values: tuple[Value, ...]
    pages: dict[str, str]
    path: Path

    @property
    def faults(self) -> tuple[str, ...]:
        """What differs from what was published, or did not run."""
        values = [
            f"{v.table}: {v.computed:.8g} was computed, {v.published:g} is published" for v in self.values if not v.same
        ]
        return (*values, *(f"{title}: {error}" for title, error in self.pages.items() if error))


@named()
def reproduce(path: str | Path, *, progress: Callable[[int, int], None] | None = None) -> Reproduction:
    """Recompute published tables and run the founding report section by section, and write one page of all.

    Every page of the report is a program of a few lines: its text, its code, what it prints and draws on this machine.

    Parameters
    ----------
    path : path
        The page, `.html`.
    progress : callable, optional
        Called with (pages done, pages in all).

    Raises
    ------
    DataError
        Another suffix, or a place that cannot be written.
    """
    values = recomputed()
    scripts = sorted(next(place for place in _PLACES if place.is_dir()).glob("plot_*.py"))
    pages: dict[str, str] = {}

    def parts() -> Iterator[Section]:
        yield _of_tables(values)
        for done, script in enumerate(scripts):
            section, error = _executed(script)
            pages[section.title] = error
            if progress is not None:
                progress(done + 1, len(scripts))
            yield section

    subtitle = "published tables recomputed, and the report section by section, on this machine"
    written = write_page(check_path(path), "The report, reproduced", subtitle, parts())
    return Reproduction(values, pages, written)


def _of_tables(values: tuple[Value, ...]) -> Section:
    same = sum(value.same for value in values)
    text = paragraph(f"{same} of {len(values)} published values agree in all printed digits.")
    head = ("table", "row", "value", "published", "computed", "same")
    rows = [
        (v.table, str(v.row), v.column, f"{v.published:.{v.digits}f}", f"{v.computed:.8g}", "yes" if v.same else "NO")
        for v in values
    ]
    return Section("tables", "Published tables", text + table(head, rows, words=(0, 2, 5)))


def _executed(script: Path) -> tuple[Section, str]:
    """Return the section of one page and the error that stopped it."""
    import matplotlib.pyplot as plt

    title, blocks = _blocks(script.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    body, error = [], ""
    for text, code in blocks:
        body += [paragraph(line) for line in text.split("\n\n") if line.strip()]
        if not code.strip():
            continue
        told = io.StringIO()
        plt.close("all")
        try:
            with redirect_stdout(told):
                exec(compile(code, script.name, "exec"), names)
        except Exception as stopped:  # noqa: BLE001 - whatever it is, the page says it
            error = f"{type(stopped).__name__}: {stopped}"
        body.append(f"<pre>{escaped(code.strip())}</pre>")
        body.append(f"<pre><b>{escaped(told.getvalue().rstrip())}</b></pre>" if told.getvalue() else "")
        body += [_picture(plt.figure(number), title) for number in plt.get_fignums()]
        if error:
            body.append(paragraph(error, "warning"))
            break
    plt.close("all")
    return Section(script.stem, title, "".join(body)), error


def _picture(figure: Any, title: str) -> str:
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=100)
    return f'<img alt="{escaped(title)}" src="data:image/png;base64,{b64encode(drawn.getvalue()).decode()}">'


def _blocks(source: str) -> tuple[str, list[tuple[str, str]]]:
    """Return the title of a page, and its blocks: text, and the code that follows it.

    Examples
    --------
    >>> _blocks(
    ...     chr(34) * 3
    ...     + "Title"
    ...     + chr(10)
    ...     + "====="
    ...     + chr(10) * 2
    ...     + "Text."
    ...     + chr(10)
    ...     + chr(34) * 3
    ...     + chr(10)
    ...     + "x = 1"
    ... )
    ('Title', [('Text.', 'x = 1')])
    """
    _, head, rest = source.split('"""', 2)
    title, _, text = head.strip().partition("\n")
    blocks = [(_plain(text.lstrip("=\n")), "")]
    first, *others = re.split(r"^# %%\n", rest, flags=re.MULTILINE)
    blocks[0] = (blocks[0][0], first.strip("\n"))
    for part in others:
        lines = part.splitlines()
        count = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
        words = "\n".join(line.removeprefix("#").removeprefix(" ") for line in lines[:count])
        blocks.append((_plain(words), "\n".join(lines[count:])))
    return title, blocks


def _plain(text: str) -> str:
    """Return the text of a page without its marks."""
    return (
        _ROLES.sub(r"\1", text)
        .replace("``", "")
        .replace("**", "")
        .replace(".. math:: ", "")
        .replace("\\\\", "\\")
        .strip()
    )
