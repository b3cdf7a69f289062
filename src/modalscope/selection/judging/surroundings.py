"""Say what lies around a mode: how much of the response there is explained, the end of what was sampled, and that of its block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modalscope.data.modes import ModalModel
from modalscope.data.notes import Note
from modalscope.data.response import Response, line_step
from modalscope.data.shown import counted, percent
from modalscope.data.whitening import levelling
from modalscope.numerics.checks import Array, ComplexArray, RealArray

#: Names of what is said, among the reasons of a mode.
EXPLAINED_NEARBY, OF_NYQUIST, LEFT_AT_END = "explained_nearby", "of_nyquist", "left_at_end"

#: A mode of which this part or less was left where its block ended has died there.
DIED = 0.01

#: Lines around a mode: so many half bandwidths to either side, and one line at least.
_REACH, _LEAST_LINES = 2.0, 1.0


def explained_nearby(response: Response, fitted: Array, modes: ModalModel) -> RealArray:
    """Return 1 - sum |Y - fitted|^2 / sum |Y|^2 over all channels and the lines within two half bandwidths of each mode, (n,).

    Outputs and inputs count alike, whatever their units: each is divided by its level. NaN of modes outside the lines, and where nothing
    was measured. `fitted`: rebuilt from the modes, as the values of the response.
    """
    f, values = _lines(response, response.values)
    even = levelling(values)
    power = np.sum(np.abs(even.of_values(values)) ** 2, axis=(1, 2))
    left = np.sum(np.abs(even.of_values(values - _lines(response, fitted)[1])) ** 2, axis=(1, 2))
    step = float(np.ptp(f)) / max(len(np.unique(f)) - 1, 1)
    found = np.full(len(modes), np.nan)
    for k, (at, zeta) in enumerate(zip(modes.frequencies, modes.damping_ratios, strict=True)):
        near = np.abs(f - at) <= max(_REACH * zeta * at, _LEAST_LINES * step)
        if near.any() and f.min() <= at <= f.max() and power[near].sum() > 0:
            found[k] = max(1 - left[near].sum() / power[near].sum(), 0.0)
    return found


def left_at_end(response: Response, modes: ModalModel) -> RealArray:
    """Return exp(-zeta omega T), what is left of each mode after a block of T = 1 / line spacing, (n,); NaN of samples and windowed blocks.

    A transform of what goes on at the end of its block leaks: resonances look wider, or wavy.
    """
    grid = response.grid
    if grid is None or len(grid) < 2 or response.added_damping:
        return np.full(len(modes), np.nan)
    return np.asarray(np.exp(np.minimum(modes.poles.real, 0.0) / line_step(response)))


def note_on_ends(response: Response, modes: ModalModel) -> Note | None:
    """Return a note on modes that may not have died within blocks of the length that the lines of a response tell; None where all have."""
    left = left_at_end(response, modes)
    gone_on = np.flatnonzero(left > DIED)
    if not gone_on.size or not _of_a_transform(response):
        return None
    most, seconds = int(gone_on[np.argmax(left[gone_on])]), 1 / line_step(response)
    text = (
        f"If the responses come from blocks of {seconds:.4g} s without a window, {counted(gone_on.size, 'mode')} went on at their ends "
        f"({percent(float(left[most]), 2)} left at {modes.frequencies[most]:.4g} Hz): leakage biases damping. Measure longer blocks"
    )
    return Note(
        "leakage", {"modes": gone_on.size, "seconds": seconds, "frequency": float(modes.frequencies[most])}, text
    )


def widened_by_window(response: Response, modes: ModalModel) -> RealArray:
    """Return by what part damping is too high where responses are H1 of random forces under a Hann window, (n,); NaN of samples.

    What such spectra estimate is the impulse response times r(t), the autocorrelation of the window w over a block of T = 1 / line spacing:

        r(t) = 1 - (t / T)^2 2 pi^2 / 3 + ...,      since int w'^2 / int w^2 = (4 pi^2 / 3) / T^2.

    The slope of a t^2 under the weights exp(-2 sigma t) of a decay is 2 a / sigma, so that sigma grows by (4 pi^2 / 3) / (sigma T)^2, and
    with a half-power bandwidth of B = sigma T / pi lines by 4 / (3 B^2) of its value. Of fewer than two lines it is less than that.
    """
    if response.grid is None or len(response.grid) < 2 or response.added_damping:
        return np.full(len(modes), np.nan)
    bandwidths = np.maximum(-modes.poles.real / (np.pi * line_step(response)), np.finfo(float).eps)
    return np.asarray(4 / (3 * bandwidths**2))


def note_on_window(response: Response, modes: ModalModel) -> Note | None:
    """Return a note on modes whose damping a Hann window would bias by more than a hundredth and than its standard deviation, else None.

    A coherence shows that spectra were averaged, as those of random forces are; without one nothing speaks for such a window, nor where
    `processing` names another.
    """
    told = " ".join(getattr(response, "processing", ()))
    if getattr(response, "coherence", None) is None or ("excitation" in told and "hann window" not in told):
        return None
    bias, std = widened_by_window(response, modes), modes.damping_ratios_std
    known = np.zeros(len(modes)) if std is None else np.nan_to_num(std / modes.damping_ratios)
    wide = np.flatnonzero(bias > np.maximum(known, DIED))
    if not wide.size or not _of_a_transform(response):
        return None
    most = int(wide[np.argmax(bias[wide])])
    share = percent(float(bias[most]), 2) if bias[most] < 1 / 3 else "a third or more"
    text = (
        f"If the responses were averaged under a Hann window (random forces), damping is too high: by {share} at "
        f"{modes.frequencies[most]:.4g} Hz, and of {counted(wide.size, 'mode')} by more than intervals say. Measure longer blocks, or "
        "identify the records"
    )
    return Note("window", {"modes": wide.size, "frequency": float(modes.frequencies[most])}, text)


def _of_a_transform(response: Response) -> bool:
    """Whether the lines of a response are multiples of their spacing, as those of a discrete transform are."""
    grid = response.grid
    return grid is not None and not bool(np.any(np.abs(grid / line_step(response) % 1 - 0.5) < 0.4))


def with_reasons(modes: ModalModel, facts: Mapping[str, RealArray]) -> ModalModel:
    """Return modes with further reasons, (n,) each; what is not known is left out."""
    known = [{name: float(v[j]) for name, v in facts.items() if np.isfinite(v[j])} for j in range(len(modes))]
    own = modes.reasons or ({},) * len(modes)
    return replace(modes, reasons=tuple({**each, **more} for each, more in zip(own, known, strict=True)))


def _lines(response: Response, values: Array) -> tuple[RealArray, ComplexArray]:
    """Return lines in Hz and values on them, (F, l, m): of samples, those of their transform."""
    lines = getattr(response, "frequencies", None)
    if lines is not None:
        return np.asarray(lines, dtype=float), np.asarray(values)
    rate = response.sampling_rate or 1.0
    return np.asarray(np.fft.rfftfreq(len(values), 1 / rate), dtype=float), np.asarray(np.fft.rfft(values, axis=0))
