"""Reproduce the published tables of the founding report on this machine, as one page."""

from __future__ import annotations

from pathlib import Path

from modalscope.analysis.checking.selfcheck import Value, recomputed
from modalscope.interfaces.reporting.document import write_page
from modalscope.interfaces.reporting.html import Section, paragraph, table
from modalscope.numerics.arguments import named

__all__ = ["reproduce"]


@named()
def reproduce(path: str | Path) -> tuple[Value, ...]:
    """Recompute published tables, write them as one page, and return every value with what this machine gives.

    Parameters
    ----------
    path : path
        The page, `.html`.

    Raises
    ------
    DataError
        Another suffix, or a place that cannot be written.
    """
    values = recomputed()
    text = paragraph(f"{sum(v.same for v in values)} of {len(values)} published values agree in all printed digits.")
    head = ("table", "row", "value", "published", "computed", "same")
    rows = [
        (v.table, str(v.row), v.column, f"{v.published:.{v.digits}f}", f"{v.computed:.8g}", "yes" if v.same else "NO")
        for v in values
    ]
    section = Section("tables", "Published tables", text + table(head, rows, words=(0, 2, 5)))
    write_page(path, "The report, reproduced", "published tables recomputed on this machine", [section])
    return values
