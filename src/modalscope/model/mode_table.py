"""Modes as a table: text for people, a data frame for programs, and the names that every file gives to the columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from modalscope.model.extras import optional_package

if TYPE_CHECKING:
    from modalscope.model.modes import ModalModel

__all__ = ["COLUMNS", "as_dataframe", "as_text", "cells_of_modes", "known_columns", "told"]

#: Column -> field: one number a mode, or nothing.
COLUMNS = {
    "frequency_spread_hz": "frequencies_spread",
    "damping_ratio_spread": "damping_ratios_spread",
    "frequency_std_hz": "frequencies_std",
    "damping_ratio_std": "damping_ratios_std",
    "frequency_repeatability_hz": "frequencies_repeatability",
    "damping_ratio_repeatability": "damping_ratios_repeatability",
    "gain": "gain",
}


def known_columns(modes: ModalModel) -> dict[str, Any]:
    """Return what is known of each mode, by column: frequency, damping ratio, kind, deviations, gain, indicators."""
    optional = {column: getattr(modes, field) for column, field in COLUMNS.items()}
    return {
        "frequency_hz": modes.frequencies,
        "damping_ratio": modes.damping_ratios,
        "kind": modes.kinds,
        **{column: values for column, values in optional.items() if values is not None},
        **modes.indicators,
    }


def as_text(modes: ModalModel) -> str:
    """Return the modes as a text table: frequency, damping, deviations, gain, indicators."""
    rows = cells_of_modes(modes)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in rows)


def cells_of_modes(modes: ModalModel) -> list[list[str]]:
    """Return the table of modes as text, cell by cell, the first row its heads."""
    columns: dict[str, list[str]] = {
        "mode": [str(i + 1) for i in range(len(modes))],
        "f [Hz]": [f"{v:.4f}" for v in modes.frequencies],
        "zeta [%]": [f"{100 * v:.3f}" for v in modes.damping_ratios],
    }
    if any(kind != "mode" for kind in modes.kinds):
        columns["kind"] = list(modes.kinds)
    for word, frequencies, damping_ratios in (
        ("spread", modes.frequencies_spread, modes.damping_ratios_spread),
        ("+-noise", modes.frequencies_std, modes.damping_ratios_std),
        ("+-repeat", modes.frequencies_repeatability, modes.damping_ratios_repeatability),
    ):
        if frequencies is not None:
            columns[f"f {word}"] = [told(v) for v in frequencies]
        if damping_ratios is not None:
            columns[f"zeta {word}"] = [told(100 * v) for v in damping_ratios]
    if modes.gain is not None:
        columns["gain"] = [_fixed(v, 1) for v in modes.gain]
    for name, values in modes.indicators.items():
        columns[name] = [_fixed(v, 3) for v in values]
    return [list(columns), *map(list, zip(*columns.values(), strict=True))]


def told(deviation: float) -> str:
    """Return a deviation with two digits; a dash where it is withheld.

    Examples
    --------
    >>> told(0.01234), told(float("nan"))
    ('0.012', '-')
    """
    return f"{deviation:.2g}" if deviation == deviation else "-"


def _fixed(value: float, decimals: int) -> str:
    """Return a number with that many decimals; a dash where there is none, as of modes that no order of the diagram shows."""
    return f"{value:.{decimals}f}" if value == value else "-"


def as_dataframe(modes: ModalModel) -> Any:
    """Return the table as a pandas DataFrame, in the columns of the files (see `ModalModel.to_dataframe`)."""
    pandas = optional_package("to_dataframe", "pandas", "pandas")
    return pandas.DataFrame(known_columns(modes))
