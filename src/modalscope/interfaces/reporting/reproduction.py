"""Errata and conformance: published tables, identities and misprints of the founding report, recomputed on this machine, as one page."""

from __future__ import annotations

import io
import re
import runpy
from contextlib import redirect_stdout
from pathlib import Path

from modalscope.analysis.checking.selfcheck import recomputed
from modalscope.interfaces.reporting.document import write_page
from modalscope.interfaces.reporting.html import Section, table
from modalscope.numerics.arguments import named

__all__ = ["reproduce"]

#: Sections of the report as programs: an installed package holds them beside this module, a checkout in `docs/`.
_PLACES = (Path(__file__).parent / "executed", Path(__file__).parents[4] / "docs" / "executed")

#: What a program states on a line of its own: how far two routes are apart, and two numbers where it names them.
_TWO_NUMBERS = r"expected (\S+), computed (\S+), apart by "
_STATED = re.compile(rf"^(.+?): +(?:{_TWO_NUMBERS})?(\S+) \((at most|at least) (\S+)\)$", re.MULTILINE)

_HEAD = ("statement", "expected", "computed", "difference", "same")


@named()
def reproduce(path: str | Path) -> dict[str, list[tuple[str, ...]]]:
    """Recompute published tables and the founding report section by section, and write them as one page.

    Parameters
    ----------
    path : path
        The page, `.html`.

    Returns
    -------
    dict
        Title of every section -> its rows: statement, expected, computed, difference, and "yes" or "NO".

    Raises
    ------
    DataError
        Another suffix, or a place that cannot be written.
    """
    rows: list[tuple[str, ...]] = []
    for v in recomputed():
        name, printed = f"{v.table}, {v.column}, row {v.row}", f"{v.published:.{v.digits}f}"
        rows.append((name, printed, f"{v.computed:.8g}", f"{v.computed - v.published:.1e}", "yes" if v.same else "NO"))
    scripts = sorted(next(place for place in _PLACES if place.is_dir()).glob("plot_[1-9]*.py"))
    parts = {"Published values": rows} | dict(map(_executed, scripts))
    page = [Section(f"part-{k}", title, table(_HEAD, parts[title], words=(0, 4))) for k, title in enumerate(parts)]
    write_page(path, "Errata and conformance", "what was published, recomputed on this machine", page)
    return parts


def _executed(script: Path) -> tuple[str, list[tuple[str, ...]]]:
    """Run a section and return its title and what it states; that it stopped is a statement that does not hold."""
    import matplotlib.pyplot as plt

    said = io.StringIO()
    with redirect_stdout(said):
        try:
            runpy.run_path(str(script))
        except Exception as stopped:  # noqa: BLE001 - whatever it is, the page says it
            said.write(f"\nstopped by {type(stopped).__name__} {' '.join(str(stopped).split())}: nan (at most 0)\n")
    plt.close("all")
    rows: list[tuple[str, ...]] = []
    for what, expected, computed, apart, bound, limit in _STATED.findall(said.getvalue()):
        off = float(apart) - float(limit)
        holds = off <= 0 if bound == "at most" else off >= 0
        rows.append((what, expected or f"{bound} {limit}", computed or apart, apart, "yes" if holds else "NO"))
    return script.read_text(encoding="utf-8").splitlines()[1], rows
