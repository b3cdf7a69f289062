"""Say of each mode how much of the response around it the modes explain, and how near it lies to the end of what was sampled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.response import Response
from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: Names of what is said, among the reasons of a mode.
EXPLAINED_NEARBY, OF_NYQUIST = "explained_nearby", "of_nyquist"

#: Lines around a mode: so many half bandwidths to either side, and one line at least.
_REACH, _LEAST_LINES = 2.0, 1.0


def explained_nearby(response: Response, fitted: Array, modes: ModalModel) -> RealArray:
    """Return 1 - sum |Y - fitted|^2 / sum |Y|^2 over all channels and the lines within two half bandwidths of each mode, (n,).

    NaN of modes outside the lines, and where nothing was measured. `fitted`: rebuilt from the modes, as the values of the response.
    """
    f, values = _lines(response, response.values)
    power = np.sum(np.abs(values) ** 2, axis=(1, 2))
    left = np.sum(np.abs(values - _lines(response, fitted)[1]) ** 2, axis=(1, 2))
    step = float(np.ptp(f)) / max(len(np.unique(f)) - 1, 1)
    found = np.full(len(modes), np.nan)
    for k, (at, zeta) in enumerate(zip(modes.frequencies, modes.damping_ratios, strict=True)):
        near = np.abs(f - at) <= max(_REACH * zeta * at, _LEAST_LINES * step)
        if near.any() and f.min() <= at <= f.max() and power[near].sum() > 0:
            found[k] = max(1 - left[near].sum() / power[near].sum(), 0.0)
    return found


def with_reasons(modes: ModalModel, facts: Mapping[str, RealArray]) -> ModalModel:
    """Return modes with further reasons, (n,) each; what is not known is left out."""
    own: list[dict[str, Any]] = [dict(each) for each in modes.reasons] or [{} for _ in range(len(modes))]
    for name, values in facts.items():
        for each, value in zip(own, values, strict=True):
            if np.isfinite(value):
                each[name] = float(value)
    return replace(modes, reasons=tuple(own))


def _lines(response: Response, values: Array) -> tuple[RealArray, ComplexArray]:
    """Return lines in Hz and values on them, (F, l, m): of samples, those of their transform."""
    lines = getattr(response, "frequencies", None)
    if lines is not None:
        return np.asarray(lines, dtype=float), np.asarray(values)
    rate = response.sampling_rate or 1.0
    return np.asarray(np.fft.rfftfreq(len(values), 1 / rate), dtype=float), np.asarray(np.fft.rfft(values, axis=0))
