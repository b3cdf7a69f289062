"""The report of a store of months of records: made anew when the store has grown."""

from __future__ import annotations

from pathlib import Path
from threading import Lock

from modalscope.analysis.monitoring.store import Store
from modalscope.data.analysis import VERSION
from modalscope.interfaces.reporting.html import page
from modalscope.interfaces.reporting.months import months_sections


class MonthsReport:
    """The report of a store, of all records that it has when it is asked for.

    Raises `DataError`: no store, or one without tracks.
    """

    def __init__(self, store: Path) -> None:
        self.store, self.lock = store, Lock()
        self.seen, self.text = -1, ""
        self()

    def __call__(self) -> str:
        """Return the report."""
        with self.lock, Store(self.store) as store:
            if (count := len(store.records)) != self.seen:
                parts = list(months_sections(store))
                self.text = page(store.path.name, "Months of records", parts, f"modalscope {VERSION}")
                self.seen = count
            return self.text
