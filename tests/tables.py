"""Tables of the documentation that studies write: rows that were measured this time, beside those that stay as they were."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from tests.support import ROOT

__all__ = ["Table"]


@dataclass
class Table:
    """One table of a page of docs/, between two marks that name it.

    Parameters
    ----------
    page : str
        File name.
    name : str
        What the marks call it.
    head : tuple of str
        Its columns.
    """

    page: str
    name: str
    head: tuple[str, ...]
    rows: dict[str, str] = field(default_factory=dict)

    def keep(self, label: str, *cells: str) -> None:
        """Keep and print the row of a label, which may be several cells itself."""
        self.rows[label] = f"| {' | '.join((label, *cells))} |"
        print(f"\n{self.rows[label]}")

    def write(self, labels: Iterable[str]) -> None:
        """Write the rows in the order of their labels; a row that was not measured this time stays as it was."""
        path = ROOT / "docs" / self.page
        begin, end = f"<!-- {self.name}: written by `make study` -->", f"<!-- end of {self.name} -->"
        before, _, rest = path.read_text(encoding="utf-8").partition(begin)
        body, found, after = rest.partition(end)
        assert found, f"{self.page} has no marks of {self.name}"
        old = body.splitlines()
        lines = [f"| {' | '.join(self.head)} |", "|---" * len(self.head) + "|"]
        for label in labels:
            lines += [self.rows[label]] if label in self.rows else [x for x in old if x.startswith(f"| {label} |")]
        path.write_text(f"{before}{begin}\n" + "\n".join(lines) + f"\n{end}{after}", encoding="utf-8")
