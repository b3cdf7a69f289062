"""Modes of several bands as one result, each once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.modal.indicators import mac
from modalscope.model.checks import (
    DataError,
    check_band,
    check_each,
    check_kind,
)
from modalscope.model.keywords import named
from modalscope.model.mode_fields import PER_MODE, joined
from modalscope.model.modes import ModalModel

__all__ = ["evened", "merge_bands"]


@named()
def merge_bands(
    results: Sequence[ModalModel],
    bands: Sequence[tuple[float, float]],
    *,
    tolerance: float = 0.005,
    shape: float = 0.8,
) -> ModalModel:
    """Return the modes of several bands by frequency, those that lie in two of them once.

    Modes outside their own band are left out. Of two that agree, within `tolerance` or half of the larger bandwidth in frequency and
    above `shape` in MAC, the one that lies deeper inside its band stays: near an edge part of the resonance is missing.

    Parameters
    ----------
    results : sequence of ModalModel
        Of the same outputs and inputs.
    bands : sequence of (float, float)
        Of each result, Hz.
    tolerance : float
        Relative distance of frequencies that are one.
    shape : float
        Least modal assurance criterion of shapes that are one.

    Raises
    ------
    DataError
        No result, a band for each is missing, or other channels.

    Examples
    --------
    >>> from modalscope.systems import chain5
    >>> modes = chain5().modes()
    >>> len(merge_bands([modes, modes], [(0, 4.5), (4, 8)]))
    5
    """
    results = check_each("merge_bands", results, "a list of modes, one a band")
    for result in results:
        check_kind("each result of a band", result, ModalModel)
    bands = [check_band(band) for band in check_each("bands", bands, "a list of pairs in Hz")]
    if not results or len(results) != len(bands):
        raise DataError(
            f"{len(results)} results of {len(bands)} bands were asked to be merged",
            "there is not one band for each result",
            "Give one band for each.",
        )
    _same_channels(results)
    inside = [
        modes.take((modes.frequencies >= low) & (modes.frequencies <= high))
        for modes, (low, high) in zip(results, bands, strict=True)
    ]
    origin = np.concatenate([np.full(len(modes), i) for i, modes in enumerate(inside)])
    everything = joined(inside)
    f, half = everything.frequencies, np.abs(everything.poles.real) / (2 * np.pi)
    ends = np.array(bands, dtype=float)[origin.astype(int)].reshape(-1, 2)
    depth = np.minimum(f - ends[:, 0], ends[:, 1] - f) / f
    likeness = mac(everything.shapes)
    kept: list[int] = []
    for i in np.argsort(-depth, kind="stable"):
        near = np.abs(f[kept] - f[i]) <= np.maximum(tolerance * f[i], np.maximum(half[kept], half[i]))
        if not np.any(near & (likeness[i, kept] > shape) & (origin[kept] != origin[i])):
            kept.append(int(i))
    order = np.array(sorted(kept, key=lambda i: f[i]), dtype=int)
    words = ", ".join(f"{low:g} to {high:g} Hz" for low, high in bands)
    return everything.take(order).processed(f"merged from bands {words}")


def evened(parts: Sequence[ModalModel]) -> list[ModalModel]:
    """Return modes of several parts with the same fields: what only some have is NaN in the others, and what is not refined its own start.

    Parameters
    ----------
    parts : sequence of ModalModel
    """
    known = [name for name in PER_MODE if any(getattr(part, name) is not None for part in parts)]
    refined = any(part.unrefined is not None for part in parts)
    filled = []
    for part in parts:
        missing: dict[str, Any] = {name: np.full(len(part), np.nan) for name in known if getattr(part, name) is None}
        if refined and part.unrefined is None:
            missing["unrefined"] = part
        filled.append(replace(part, **missing) if missing else part)
    return filled


def _same_channels(results: Sequence[ModalModel]) -> None:
    first = results[0]
    for other in results[1:]:
        if other.output_dofs != first.output_dofs or other.input_dofs != first.input_dofs:
            raise DataError(
                "results of one set of channels were asked to be merged",
                "their outputs or inputs differ",
                "Select the same channels in every band.",
            )
