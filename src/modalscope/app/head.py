"""What is told of a result beside its modes."""

from __future__ import annotations

from typing import Any

from modalscope.identification.lookup import cell_label
from modalscope.modal.explained import explained
from modalscope.model.result import Result
from modalscope.plot.web.fits import fit_of_bands
from modalscope.reporting.scripts import result_script

__all__ = ["result_head"]


def result_head(result: Result) -> dict[str, Any]:
    """Return what is told of a result beside its modes.

    Parameters
    ----------
    result : Result
    """
    first = result.diagrams[0]
    head: dict[str, Any] = {
        "label": cell_label(first.method, first.domain),
        "orders": [first.orders[0], first.orders[-1]] if first.orders else [],
        "settings": [dict(settings.items()) for settings in result.settings],
        "notes": [note.to_dict() for note in result.notes],
        "findings": [finding._asdict() for finding in result.findings],
        "script": result_script(result),
        "columns": list(first.response.columns),
    }
    if len(result.modes) and not result.analysis.apart:
        left = fit_of_bands(result.modes, result.diagrams)
        if left is not None:
            head |= {"fit_error": left[0], "explained": explained(left[0])}
    return head
