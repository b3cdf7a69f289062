"""Describe modes: the numbers and words that terminal, page, report, notebook and files show of each of them.

Values have as many decimals as give the smallest interval two digits, at most those that give the lowest frequency six digits and the
smallest damping ratio, in per cent, five; three where no interval is known. Half-widths are those of 95 % intervals, of damping ratios in
their logarithm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from modalscope.data.indicators import mpc
from modalscope.data.mode_fields import half_widths, interval_ends, known_columns, told
from modalscope.data.modes import ModalModel
from modalscope.data.shown import text_table
from modalscope.numerics.checks import BoolArray, RealArray
from modalscope.selection.judging.grades import Grade, grades

#: Heads of the table of modes, by the field of `ModeDescription`.
HEADS = {
    "number": "mode",
    "frequency": "f [Hz]",
    "frequency_half": "± 95 %",
    "damping": "damping [%]",
    "damping_half": "± 95 %",
    "grade": "grade",
    "mpc": "MPC",
    "reason": "reason",
}

#: Columns of words, aligned to the left.
WORDS = tuple(i for i, name in enumerate(HEADS) if name in ("grade", "reason"))

#: Grade of values that are not final.
PRELIMINARY = Grade("preliminary", "value before refinement")


@dataclass(frozen=True, slots=True)
class ModeDescription:
    """What is shown of a mode, as text.

    `number`: counted from 1. `frequency` in Hz, `damping` in per cent, each with the half-width of its 95 % interval, a dash where that is
    not known. `grade`: good, look, doubtful or preliminary, with the `reason` that decides. `mpc`: of the reported shape.
    """

    number: str
    frequency: str
    frequency_half: str
    damping: str
    damping_half: str
    grade: str
    mpc: str
    reason: str

    def to_dict(self) -> dict[str, str]:
        """Return the texts by field, in the order of the table."""
        return {name: getattr(self, name) for name in HEADS}


def described(
    modes: ModalModel, holds: BoolArray | None = None, *, preliminary: bool = False
) -> tuple[ModeDescription, ...]:
    """Return the description of every mode.

    `holds`: as in `grades`. `preliminary`: the values will be refined; they have no grade.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> described(chain5().modes())[0].to_dict()["reason"]
    'uncertainty not known'
    """
    judged = (PRELIMINARY,) * len(modes) if preliminary else grades(modes, holds)
    f, percents = modes.frequencies, 100 * modes.damping_ratios
    halves = half_widths(modes)
    of_f = decimals(f, 6, halves[0])
    percent_halves = 100 * halves[1]
    of_damping = decimals(percents, 5 if np.isfinite(percent_halves).any() else 3, percent_halves)
    collinearity = _collinearity(modes)
    return tuple(
        ModeDescription(
            number=str(j + 1),
            frequency=f"{f[j]:.{of_f}f}",
            frequency_half=_two_digits(halves[0][j]),
            damping=f"{percents[j]:.{of_damping}f}",
            damping_half=_two_digits(percent_halves[j]),
            grade=judged[j].word,
            mpc=_fixed(collinearity[j], 2),
            reason=judged[j].reason,
        )
        for j in range(len(modes))
    )


def table_of(modes: ModalModel, *, wide: bool = False) -> list[list[str]]:
    """Return the table of modes cell by cell, its heads first; `wide`: with spreads, significance and indicators."""
    rows = [list(each.to_dict().values()) for each in described(modes)]
    heads = list(HEADS.values())
    more = _further(modes) if wide else {}
    at = len(heads) - 1  # the reason stays last
    listed = [heads[:at] + list(more) + heads[at:]]
    for j, row in enumerate(rows):
        listed.append(row[:at] + [values[j] for values in more.values()] + row[at:])
    return listed


def text_of(modes: ModalModel, *, wide: bool = False) -> str:
    """Return the table of modes as lines of text."""
    rows = table_of(modes, wide=wide)
    return text_table(rows, left=[k for k, head in enumerate(rows[0]) if head in ("grade", "reason")])


def _further(modes: ModalModel) -> dict[str, list[str]]:
    """Return further columns: kind where a pole is no mode, spreads over orders, significance, indicators."""
    columns: dict[str, list[str]] = {}
    if any(kind != "mode" for kind in modes.kinds):
        columns["kind"] = list(modes.kinds)
    if modes.frequencies_spread is not None:
        columns["f spread"] = [told(v) for v in modes.frequencies_spread]
    if modes.damping_ratios_spread is not None:
        columns["damping spread"] = [told(100 * v) for v in modes.damping_ratios_spread]
    if modes.gain is not None:
        columns["significance"] = [_fixed(v, 1) for v in modes.gain]
    for name, values in modes.indicators.items():
        if name != "mpc":  # stands in the table
            columns[name] = [_fixed(v, 3) for v in values]
    return columns


def columns_of(modes: ModalModel) -> dict[str, Any]:
    """Return the numbers of the modes by column, as files and data frames have them.

    Standard deviations, degrees of freedom and indicators; then 95 % intervals, MPC, grade, reason, type and remark.
    """
    (f, zeta), judged = interval_ends(modes, 0.95), grades(modes)
    columns = known_columns(modes)
    if np.isfinite(f).any() or np.isfinite(zeta).any():
        columns |= {"frequency_95_low_hz": f[:, 0], "frequency_95_high_hz": f[:, 1]}
        columns |= {"damping_ratio_95_low": zeta[:, 0], "damping_ratio_95_high": zeta[:, 1]}
    if len(modes.output_dofs) > 1:
        columns["mpc"] = _collinearity(modes)
    columns |= {"grade": [g.word for g in judged], "reason": [g.reason for g in judged]}
    named = [str(reason.get("name", "")).partition("; ") for reason in modes.reasons]
    return columns | ({"type": [n[0] for n in named], "remark": [n[2] for n in named]} if any(map(any, named)) else {})


def _collinearity(modes: ModalModel) -> RealArray:
    """Return the MPC of each reported shape; NaN for a single output, whose shape is one number."""
    return mpc(modes.shapes) if len(modes.output_dofs) > 1 else np.full(len(modes), np.nan)


def decimals(values: RealArray, digits: int, halves: Iterable[float] = ()) -> int:
    """Return the decimals that give the smallest value `digits` digits, fewer where two digits of the smallest interval need fewer."""
    positive = [v for v in values if np.isfinite(v) and v > 0]
    if not positive:
        return 3
    known = [half for half in halves if np.isfinite(half) and half > 0]
    most = digits - 1 - np.floor(np.log10(min(positive)))
    needed = 1 - np.floor(np.log10(min(known))) if known else most
    return int(np.clip(min(most, needed), 2, 6))


def _two_digits(value: float) -> str:
    """Return a number with two digits, such as 0.10 or 140; a dash where it is not known."""
    if not np.isfinite(value):
        return "-"
    if not 1e-6 <= value < 1e6:
        return f"{value:.2g}"
    return f"{float(f'{value:.1e}'):.{max(1 - int(np.floor(np.log10(float(f'{value:.1e}')))), 0)}f}"


def _fixed(value: float, decimals: int) -> str:
    """Return a number with that many decimals; a dash where it is not known."""
    return f"{value:.{decimals}f}" if np.isfinite(value) else "-"
