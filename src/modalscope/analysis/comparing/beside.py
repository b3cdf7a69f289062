"""Find the modes of a consensus in the analysis of the same data, whose intervals and grades hold for both.

What methods share, such as leakage, loading by sensors and the noise of one record, makes none of them differ: that they agree says nothing
of it. The consensus is no better known than the refined modes of the same data, and has their grade.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from modalscope.analysis.workflow.analyze import analyze
from modalscope.data.mode_fields import half_widths
from modalscope.data.modes import ModalModel
from modalscope.data.results import Result
from modalscope.data.sameness import same_modes
from modalscope.numerics.checks import RealArray
from modalscope.numerics.errors import DataError, as_printed
from modalscope.numerics.progress import stage
from modalscope.selection.judging.grades import GRADES, Grade, grades


class Beside(NamedTuple):
    """A mode of the consensus in the analysis.

    `grade`: there. `values`, `half_widths` (2,): of frequency (Hz) and damping ratio there, of the 95 % intervals; NaN of a mode that it
    does not list, inf of one that the data do not determine.
    """

    grade: Grade
    values: RealArray
    half_widths: RealArray


def analysis_of(
    data: Any, band: Any, orders: int | Iterable[int] | None, options: Mapping[str, Any]
) -> tuple[Result | None, str]:
    """Return what `analyze` finds in the data of a comparison; None, and why, where it cannot use them."""
    try:
        with stage("identifying by the usual method"):
            return analyze(data, band=band, orders=orders, **options), ""
    except (DataError, ValueError, ArithmeticError, MemoryError) as error:
        return None, as_printed(error)


def beside(modes: ModalModel, found: Result | None) -> tuple[Beside, ...]:
    """Return every mode of a consensus in an analysis of the same data; without one, or not listed by it, it is at best worth a look.

    Modes are paired by `same_modes`.
    """
    partners = (
        {} if found is None else dict(zip(*(each.tolist() for each in same_modes(modes, found.modes)), strict=True))
    )
    known = () if found is None else grades(found.modes)
    widths = np.empty((0, 2)) if found is None else _widths(found.modes)
    nothing, every = np.full(2, np.nan), []
    for k, own in enumerate(grades(modes)):
        j = partners.get(k)
        if found is None or j is None:
            without = "no analysis of the same data" if found is None else _left_out(found.modes, modes, k)
            worse = own if own.word == GRADES[-1] else Grade(GRADES[1], without)
            every.append(Beside(worse, nothing, nothing))
        else:
            values = np.array([found.modes.frequencies[j], found.modes.damping_ratios[j]])
            every.append(Beside(known[j], values, widths[j]))
    return tuple(every)


def _widths(modes: ModalModel) -> RealArray:
    widths = np.stack(half_widths(modes), axis=1)
    return widths if modes.degrees is None else np.where(modes.degrees == 0, np.inf, widths)


def _left_out(found: ModalModel, modes: ModalModel, k: int) -> str:
    """Say that an analysis does not list a mode, and why, where a candidate that it left out lies within the half bandwidth."""
    f, half = modes.frequencies[k], modes.damping_ratios[k] * modes.frequencies[k]
    near = [c for c in found.left_out if abs(c.frequency - f) < half and c.reason]
    reason = min(near, key=lambda c: abs(c.frequency - f)).reason if near else ""
    return f"the analysis does not list it{f' ({reason})' if reason else ''}"
