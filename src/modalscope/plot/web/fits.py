"""What modes leave of the data, by the same rule wherever it is told: reports, the page, what a report holds to zoom and turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modalscope.modal.heard import heard_lines
from modalscope.modal.rebuilt import fit_error, fit_error_heard, rebuilt
from modalscope.model import ModalModel, StabilizationDiagram
from modalscope.model.checks import Array
from modalscope.model.response import Response
from modalscope.plot.web.poles import rebuilt_lines

__all__ = ["Fit", "fit_of", "fit_of_bands"]

#: Fit error in all and per channel (l, m), or None when the modes cannot be rebuilt.
Fit = tuple[float, Array] | None


def fit_of(modes: ModalModel, response: Response) -> Fit:
    """Return what the modes leave of the data, in all and per channel; None when they cannot be rebuilt."""
    return None if modes.participation is None else fit_error_heard(response, rebuilt(response, modes))


def fit_of_bands(modes: ModalModel, diagrams: Sequence[StabilizationDiagram]) -> Fit:
    """Return the same of all bands together, each by its own modes on its own lines."""
    if len(diagrams) == 1 or modes.participation is None:
        return fit_of(modes, diagrams[0].response)
    parts = [_heard_part(modes, diagram, len(diagrams)) for diagram in diagrams]
    measured, own = (np.concatenate(side) for side in zip(*parts, strict=True))
    return fit_error(measured, own)


def _heard_part(modes: ModalModel, diagram: StabilizationDiagram, bands: int) -> tuple[Array, Array]:
    """Return measured and rebuilt values on the lines of a band that hold more than noise."""
    lines, measured, own = rebuilt_lines(modes, diagram, bands)
    heard = heard_lines(diagram.response)
    if heard.all():
        return measured, own
    kept = np.isin(lines, np.asarray(diagram.response.spectrum()[0])[heard])
    return measured[kept], own[kept]
