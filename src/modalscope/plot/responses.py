"""Draw measured against rebuilt responses, and spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.data.response import Response
from modalscope.modal.rebuilt import rebuilt
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, check_kind
from modalscope.plot._style import (
    DPI,
    INK,
    MUTED,
    SIZE,
    VERMILLION,
    aside,
    channel,
    dress,
    headline,
    key,
    mark_modes,
    new_axes,
    plain,
    unit_of,
)
from modalscope.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Identified(Protocol):
    """Anything that holds modes, such as an identification."""

    @property
    def modes(self) -> ModalModel:
        """The modes."""


@named()
def response(
    data: Response,
    modes: ModalModel | Identified | None = None,
    output: str | int | None = None,
    input: str | int | None = None,
    ax: Axes | tuple[Axes, ...] | None = None,
) -> Axes:
    """Draw one measured response and what the modes rebuild of it.

    Of a frequency response the magnitude, below it the phase, and the coherence where it is known; of an impulse response or a
    correlation the samples and below them what the modes leave unexplained. The phase of the modes is drawn on the branch of the
    measured one.

    Parameters
    ----------
    data : FrequencyResponse or ImpulseResponse
    modes : ModalModel or identification, optional
        Drawn beside the measurement, with the fit error |measured - rebuilt| / |measured| of this channel.
    output, input : str or int, optional
        Channel, by label or index; by default the one with the largest mean square.
    ax : Axes or (Axes, Axes) or (Axes, Axes, Axes), optional
        One for the upper panel alone, two, or a third one for the coherence; a new figure by default.

    Returns
    -------
    Axes
        The upper panel.

    Raises
    ------
    DataError
        A channel that is not there, or modes of other channels than the data's.
    """
    check_kind("a plot of responses", data, Response)
    drawn, data = data, data.picture()
    if modes is not None:
        found = modes if isinstance(modes, ModalModel) else getattr(modes, "modes", modes)
        check_kind("what is drawn over responses", found, ModalModel)
    power = np.sum(np.abs(data.values) ** 2, axis=0)
    i = channel("output", output, data.output_dofs, int(np.argmax(power.sum(axis=1))))
    j = channel("input", input, data.input_dofs, int(np.argmax(power[i])))
    known = data.coherence is not None
    upper, lower, third = _panels(ax, 3 if known else 2)
    measured = data.values[:, i, j]
    fit = None if modes is None else rebuilt(data, modes if isinstance(modes, ModalModel) else modes.modes)[:, i, j]
    if isinstance(data, FrequencyResponse):
        _spectrum(data, measured, fit, upper, lower, unit_of(data, i, j))
        if third is not None and data.coherence is not None:
            each = data.coherence.reshape(*data.coherence.shape[:2], -1)
            _coherence(third, data.frequencies, each[:, i, min(j, each.shape[2] - 1)])
        _finish((upper, lower, third), "frequency [Hz]")
    elif isinstance(data, ImpulseResponse):
        _samples(data, measured, fit, upper, lower, unit_of(data, i, j))
        _finish((upper, lower), "lag [s]" if data.ambient else "time [s]")
    headline(upper, f"output {plain(data.output_dofs[i])}, {data.column_word} {plain(data.input_dofs[j])}")
    if fit is not None:
        norm = float(np.linalg.norm(measured))
        if norm > 0 and drawn is data:
            aside(upper, f"fit error {100 * float(np.linalg.norm(measured - fit)) / norm:.3g} %")
    return upper


def _panels(ax: Axes | tuple[Axes, ...] | None, count: int) -> tuple[Axes, Axes | None, Axes | None]:
    """Return the panels that were given, or `count` new ones; None for those that are missing."""
    if ax is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=SIZE, dpi=DPI, layout="constrained")
        given = tuple(figure.subplots(count, 1, sharex=True, height_ratios=[2.6, 1, 0.6][:count]))
    else:
        given = tuple(ax) if isinstance(ax, tuple | list | np.ndarray) else (ax,)
    upper, lower, third = (*given, None, None)[:3]
    return upper, lower, third


def _pair(ax: Axes, x: Array, measured: Array, fit: Array | None) -> None:
    ax.plot(x, measured, color=INK, linewidth=1.0, label="measured")
    if fit is not None:
        ax.plot(x, fit, color=VERMILLION, linewidth=1.3, linestyle=(0, (4, 1.6)), label="rebuilt from the modes")


def _finish(panels: tuple[Axes | None, ...], xlabel: str) -> None:
    shown = [panel for panel in panels if panel is not None]
    for panel in shown[:-1]:
        panel.tick_params(labelbottom=False)
    shown[-1].set_xlabel(xlabel, fontsize=10.5, color=INK)
    key(shown[-1], handles=shown[0].get_legend_handles_labels()[0])


def _spectrum(
    data: FrequencyResponse, measured: Array, fit: Array | None, upper: Axes, lower: Axes | None, unit: str
) -> None:
    f = data.frequencies
    magnitude = [None if h is None else np.where(np.abs(h) > 0, np.abs(h), np.nan) for h in (measured, fit)]
    if magnitude[0] is not None:
        _pair(upper, f, magnitude[0], magnitude[1])
        if np.any(np.isfinite(magnitude[0])):
            upper.set_yscale("log")
    dress(upper, ylabel=f"magnitude{unit}")
    if f[-1] > f[0]:
        upper.set_xlim(f[0], f[-1])
    if lower is not None:
        start = _calmest(measured)
        lower.plot(*_wrapped(f, measured, start), color=INK, linewidth=0.9)
        if fit is not None:
            lower.plot(*_beside(f, measured, fit, start), color=VERMILLION, linewidth=1.2, linestyle=(0, (4, 1.6)))
        dress(lower, ylabel="phase [°]")
        lower.set_ylim(start - 30, start + 390)
        lower.set_yticks(np.arange(start, start + 361, 90))


def _phase(h: Array, start: float) -> Array:
    """Phase in degrees within [start, start + 360)."""
    return np.asarray((np.degrees(np.angle(h)) - start) % 360 + start)


def _calmest(h: Array) -> float:
    """Return the start of the scale at which the phase jumps least often: a real response flips between 180 and -180."""
    starts = (-180.0, -90.0, -270.0)
    return min(starts, key=lambda start: np.count_nonzero(np.abs(np.diff(_phase(h, start))) > 180))


def _wrapped(f: Array, h: Array, start: float) -> tuple[Array, Array]:
    """Lines and phase with a gap wherever it jumps from one end of the scale to the other."""
    phase = _phase(h, start)
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(np.asarray(f, dtype=float), jumps, np.nan), np.insert(phase, jumps, np.nan)


def _beside(f: Array, measured: Array, fit: Array, start: float) -> tuple[Array, Array]:
    """Lines and phase of the fit on the branch of the measured phase, nearer than half a turn to it, with a gap wherever it jumps."""
    nearest = _phase(measured, start) + np.degrees(np.angle(fit * np.conj(measured)))
    jumps = np.flatnonzero(np.abs(np.diff(nearest)) > 180) + 1
    return np.insert(np.asarray(f, dtype=float), jumps, np.nan), np.insert(nearest, jumps, np.nan)


def _coherence(ax: Axes, f: Array, values: Array) -> None:
    ax.plot(f, values, color=MUTED, linewidth=0.9)
    dress(ax, ylabel="coherence")
    ax.set_ylim(0, 1.05)
    ax.set_yticks([0, 0.5, 1])


def _samples(
    data: ImpulseResponse, measured: Array, fit: Array | None, upper: Axes, lower: Axes | None, unit: str
) -> None:
    _pair(upper, data.times, measured, fit)
    what = "correlation" if data.ambient else data.quantity or "response"
    dress(upper, ylabel=what + ("" if data.ambient else unit))
    upper.set_xlim(data.times[0], data.times[-1])
    if lower is not None:
        lower.plot(data.times, measured if fit is None else measured - fit, color=MUTED, linewidth=0.9)
        dress(lower, ylabel="measured" if fit is None else "difference")


# ------------------------------------------------------------------------------------------------------------- spectra
# Spectra of records: where there is energy, and in how many shapes.

#: So many singular values are drawn: more lie in the noise.
_DRAWN = 4


@named()
def spectra(found: Decomposition, ax: Axes | None = None, *, peaks: int | None = 12) -> Axes:
    """Draw the singular values of the outputs' spectra over frequency, and mark the peaks of the first (FDD).

    Parameters
    ----------
    found : Decomposition
        From `preprocess.decomposition`.
    ax : Axes, optional
        Where to draw; a new figure by default.
    peaks : int, optional
        How many peaks are marked, those that stand out most.
    """
    check_kind("a plot of spectra", found, Decomposition)
    ax = new_axes(ax)
    f, levels = found.frequencies, 10 * np.log10(np.maximum(found.singular_values, np.finfo(float).tiny))
    for k in range(min(levels.shape[1], _DRAWN)):
        ax.plot(
            f,
            levels[:, k],
            lw=1.2 if k == 0 else 0.8,
            color=f"C{k}",
            label=f"singular value {k + 1}",
            zorder=3 - k / 10,
        )
    inside = levels[f > 0, : min(levels.shape[1], _DRAWN)]
    ax.set_ylim(float(inside.min()) - 3, float(inside.max()) + 8)
    ax.set_xlim(0, float(f[-1]))
    dress(ax, xlabel="frequency [Hz]", ylabel="power spectral density [dB re unit²/Hz]")
    mark_modes(ax, found.peaks(peaks)[0], (0, float(f[-1])))
    key(ax)
    return ax
