"""Draw measured and rebuilt responses, and the singular values of spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.data.rebuilt import rebuilt
from modalscope.data.response import Response
from modalscope.interfaces.plot._style import (
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
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, check_kind
from modalscope.signals.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: Maximum number of drawn singular values.
_MAX_CURVES = 4

#: Starts of the phase axis to choose from, in degrees.
_PHASE_STARTS = (-180.0, -90.0, -270.0)


class Identified(Protocol):
    """An object with modes, such as an identification."""

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
    """Draw one measured response and the response rebuilt from the modes.

    Frequency responses are drawn by magnitude, phase and coherence if known; impulse responses and correlations by samples and residual.
    The rebuilt phase is drawn on the branch of the measured one.

    Parameters
    ----------
    data : FrequencyResponse or ImpulseResponse
    modes : ModalModel or identification, optional
        Drawn over the measurement, with the fit error |measured - rebuilt| / |measured| of this channel.
    output, input : str or int, optional
        Channel, by label or index; by default the one with the largest mean square.
    ax : Axes or (Axes, Axes) or (Axes, Axes, Axes), optional
        The upper panel, optionally the lower one and that of the coherence; a new figure by default.

    Returns
    -------
    Axes
        The upper panel.

    Raises
    ------
    DataError
        An unknown channel, or modes of other channels.
    """
    check_kind("a plot of responses", data, Response)
    drawn, data = data, data.picture()
    if modes is not None:
        model: Any = modes if isinstance(modes, ModalModel) else getattr(modes, "modes", modes)
        check_kind("modes over responses", model, ModalModel)
    power = np.sum(np.abs(data.values) ** 2, axis=0)
    i = channel("output", output, data.output_dofs, int(np.argmax(power.sum(axis=1))))
    j = channel("input", input, data.input_dofs, int(np.argmax(power[i])))
    upper, lower, third = _panels(ax, 2 if data.coherence is None else 3)
    measured = data.values[:, i, j]
    fit = None if modes is None else rebuilt(data, model)[:, i, j]
    if isinstance(data, FrequencyResponse):
        _spectrum(data, measured, fit, upper, lower, unit_of(data, i, j))
        if third is not None and data.coherence is not None:
            coherence = data.coherence.reshape(*data.coherence.shape[:2], -1)
            third.plot(data.frequencies, coherence[:, i, min(j, coherence.shape[2] - 1)], color=MUTED, linewidth=0.9)
            dress(third, ylabel="coherence")
            third.set_ylim(0, 1.05)
            third.set_yticks([0, 0.5, 1])
        _finish((upper, lower, third), "frequency [Hz]")
    elif isinstance(data, ImpulseResponse):
        _samples(data, measured, fit, upper, lower, unit_of(data, i, j))
        _finish((upper, lower), "lag [s]" if data.ambient else "time [s]")
    headline(upper, f"output {plain(data.output_dofs[i])}, {data.column_word} {plain(data.input_dofs[j])}")
    if fit is not None:
        norm = float(np.linalg.norm(measured))
        if norm > 0 and drawn is data:
            aside(upper, f"unexplained {100 * float(np.linalg.norm(measured - fit)) / norm:.3g} %")
    return upper


def _panels(ax: Axes | tuple[Axes, ...] | None, count: int) -> tuple[Axes, Axes | None, Axes | None]:
    """Return the given panels, or `count` new ones; None for those that are missing."""
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
    magnitude, fitted = (None if h is None else np.where(np.abs(h) > 0, np.abs(h), np.nan) for h in (measured, fit))
    if magnitude is not None:
        _pair(upper, f, magnitude, fitted)
        if np.any(np.isfinite(magnitude)):
            upper.set_yscale("log")
    dress(upper, ylabel=f"magnitude{unit}")
    if f[-1] > f[0]:
        upper.set_xlim(f[0], f[-1])
    if lower is not None:
        # the axis starts where the phase jumps least often: a real response alternates between 180 and -180
        start = min(_PHASE_STARTS, key=lambda start: np.count_nonzero(np.abs(np.diff(_phase(measured, start))) > 180))
        phase = _phase(measured, start)
        lower.plot(*_with_gaps(f, phase), color=INK, linewidth=0.9)
        if fit is not None:
            fitted = phase + np.degrees(np.angle(fit * np.conj(measured)))
            lower.plot(*_with_gaps(f, fitted), color=VERMILLION, linewidth=1.2, linestyle=(0, (4, 1.6)))
        dress(lower, ylabel="phase [°]")
        lower.set_ylim(start - 30, start + 390)
        lower.set_yticks(np.arange(start, start + 361, 90))


def _phase(h: Array, start: float) -> Array:
    """Return the phase in degrees within [start, start + 360)."""
    return np.asarray((np.degrees(np.angle(h)) - start) % 360 + start)


def _with_gaps(f: Array, phase: Array) -> tuple[Array, Array]:
    """Return lines and phase with a gap at every jump from one end of the axis to the other."""
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(np.asarray(f, dtype=float), jumps, np.nan), np.insert(phase, jumps, np.nan)


def _samples(
    data: ImpulseResponse, measured: Array, fit: Array | None, upper: Axes, lower: Axes | None, unit: str
) -> None:
    _pair(upper, data.times, measured, fit)
    what = "correlation" if data.ambient else data.quantity or "response"
    dress(upper, ylabel=what + ("" if data.ambient else unit))
    upper.set_xlim(data.times[0], data.times[-1])
    if lower is not None:
        lower.plot(data.times, measured if fit is None else measured - fit, color=MUTED, linewidth=0.9)
        dress(lower, ylabel="measured" if fit is None else "residual")


@named()
def spectra(found: Decomposition, ax: Axes | None = None, *, peaks: int | None = 12) -> Axes:
    """Draw the singular values of the cross spectra of the outputs, and mark the peaks of the first (FDD).

    Parameters
    ----------
    found : Decomposition
        From `preprocess.decomposition`.
    ax : Axes, optional
        A new figure by default.
    peaks : int, optional
        Maximum number of marked peaks, the most prominent ones.
    """
    check_kind("a plot of spectra", found, Decomposition)
    ax = new_axes(ax)
    f, levels = found.frequencies, 10 * np.log10(np.maximum(found.singular_values, np.finfo(float).tiny))
    levels = levels[:, :_MAX_CURVES]
    for k, level in enumerate(levels.T):
        width = 1.2 if k == 0 else 0.8
        ax.plot(f, level, lw=width, color=f"C{k}", label=f"singular value {k + 1}", zorder=3 - k / 10)
    inside = levels[f > 0]
    ax.set_ylim(float(inside.min()) - 3, float(inside.max()) + 8)
    ax.set_xlim(0, float(f[-1]))
    dress(ax, xlabel="frequency [Hz]", ylabel="power spectral density [dB re unit²/Hz]")
    mark_modes(ax, found.peaks(peaks)[0], (0, float(f[-1])))
    key(ax)
    return ax
