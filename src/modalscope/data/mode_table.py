"""Lay modes out as a table: columns for files, cells of text for people."""

from __future__ import annotations

from typing import Any

from modalscope.data.mode_fields import COLUMNS, ModeFields


def known_columns(modes: ModeFields) -> dict[str, Any]:
    """Return what is known of each mode, by column: frequency, damping ratio, kind, deviations, gain, indicators."""
    optional = {column: getattr(modes, field) for column, field in COLUMNS.items()}
    return {
        "frequency_hz": modes.frequencies,
        "damping_ratio": modes.damping_ratios,
        "kind": modes.kinds,
        **{column: values for column, values in optional.items() if values is not None},
        **modes.indicators,
    }


def cells_of_modes(modes: ModeFields) -> list[list[str]]:
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
