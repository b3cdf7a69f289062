"""Describe measured and rebuilt responses, and the singular values of spectra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel
from modalscope.data.rebuilt import rebuilt
from modalscope.data.response import Response
from modalscope.data.results import Result
from modalscope.data.shown import percent
from modalscope.identification.identify import Identification
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import (
    Axis,
    Line,
    Panel,
    Picture,
    axis_of,
    channel,
    modes_marked,
    plain,
    unit_of,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, check_kind
from modalscope.signals.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Inks of drawn singular values, of which there are no more.
_INKS = ("blue", "orange", "muted", "pale")

#: Starts of the phase axis to choose from, in degrees.
_PHASE_STARTS = (-180.0, -90.0, -270.0)

#: Words of both curves.
MEASURED, REBUILT = "measured", "rebuilt from the modes"


@named(data=Response)
def response(
    data: Response,
    modes: ModalModel | Identification | Result | None = None,
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
    model: Any = modes if isinstance(modes, ModalModel) else getattr(modes, "modes", modes)
    if model is not None:
        check_kind("modes over responses", model, ModalModel)
    return painted(response_picture(data, model, output, input), ax)


def response_picture(
    data: Response, modes: ModalModel | None = None, output: str | int | None = None, input: str | int | None = None
) -> Picture:
    """Return one channel, measured and rebuilt, as lines or samples; that with the largest mean square by default."""
    shown = data.picture()
    power = np.sum(np.abs(shown.values) ** 2, axis=0)
    i = channel("output", output, shown.output_dofs, int(np.argmax(power.sum(axis=1))))
    j = channel("input", input, shown.input_dofs, int(np.argmax(power[i])))
    measured = shown.values[:, i, j]
    fit = None if modes is None else rebuilt(shown, modes)[:, i, j]
    title, unit = title_of(shown, i, j), unit_of(shown, i, j)
    aside = _unexplained(measured, fit) if shown is data else ""
    if isinstance(shown, FrequencyResponse):
        coherence = None if shown.coherence is None else coherence_of(shown.coherence, i, j)
        return lines_picture(shown.frequencies, measured, fit, coherence, unit, title, aside)
    assert isinstance(shown, ImpulseResponse)
    return _samples(shown, measured, fit, unit, title, aside)


def title_of(response: Response, output: int, column: int) -> str:
    """Return the names of a channel."""
    columns = response.input_dofs
    return f"output {plain(response.output_dofs[output])}, {response.column_word} {plain(columns[column])}"


def coherence_of(coherence: Array, output: int, column: int) -> Array:
    """Return the coherence of a channel, of an output with all inputs where there is no other."""
    each = coherence.reshape(*coherence.shape[:2], -1)
    return np.asarray(each[:, output, min(column, each.shape[2] - 1)])


def lines_picture(
    f: Array, measured: Array, fit: Array | None, coherence: Array | None, unit: str, title: str, aside: str = ""
) -> Picture:
    """Return magnitude and phase of a channel on lines (F,), measured and rebuilt, and its coherence, as far as they are known.

    The rebuilt phase is drawn on the branch of the measured one. `aside`: what is unexplained.
    """
    # a logarithmic axis has no zero
    sides = [np.where(np.abs(h) > 0, np.abs(h), np.nan) for h in (measured, fit) if h is not None]
    ends = (float(f[0]), float(f[-1])) if f[-1] > f[0] else (float(f[0]) - 1, float(f[0]) + 1)
    # the axis starts where the phase jumps least often: a real response alternates between 180 and -180
    start = min(_PHASE_STARTS, key=lambda start: np.count_nonzero(np.abs(np.diff(_phase(measured, start))) > 180))
    phase = _phase(measured, start)
    phases = [phase] if fit is None else [phase, phase + np.degrees(np.angle(fit * np.conj(measured)))]
    turns = tuple((t, f"{t:.0f}") for t in np.arange(start, start + 361, 90).tolist())
    curves = both([(f, side) for side in sides])
    across, upward = Axis("", *ends), Axis("phase [°]", start - 30, start + 390, named=turns)
    panels = [
        Panel(across, axis_of(f"magnitude{unit}", sides, log=True), curves, title, aside, 2.6),
        Panel(across, upward, both([_with_gaps(f, side) for side in phases])),
    ]
    if coherence is not None:
        shares = tuple((v, f"{v:g}") for v in (0.0, 0.5, 1.0))
        curve = Line(f, coherence, "muted", width=0.9)
        panels.append(Panel(across, Axis("coherence", 0.0, 1.05, named=shares), [curve], share=0.6))
    words = f"{title}: {MEASURED}" + ("" if fit is None else " and rebuilt")
    return Picture(_labelled(panels, "frequency [Hz]"), words)


def both(sides: Sequence[tuple[Array, Array]], words: tuple[str, str] = (MEASURED, REBUILT)) -> list[Line]:
    """Return the measured curve, and the rebuilt one over it, if there is one."""
    looks = (("ink", words[0], 1.0, False), ("vermillion", words[1], 1.3, True))
    return [Line(x, y, *look) for (x, y), look in zip(sides, looks, strict=False)]


def _labelled(panels: list[Panel], label: str) -> list[Panel]:
    """Return panels one below the other, of which the last has the label of all."""
    return [*panels[:-1], replace(panels[-1], x=replace(panels[-1].x, label=label))]


def _unexplained(measured: Array, fit: Array | None) -> str:
    norm = float(np.linalg.norm(measured))
    if fit is None or not norm > 0:
        return ""
    return f"unexplained {percent(float(np.linalg.norm(measured - fit)) / norm)}"


def _phase(h: Array, start: float) -> Array:
    """Return the phase in degrees within [start, start + 360)."""
    return np.asarray((np.degrees(np.angle(h)) - start) % 360 + start)


def _with_gaps(f: Array, phase: Array) -> tuple[Array, Array]:
    """Return lines and phase with a gap at every jump from one end of the axis to the other."""
    jumps = np.flatnonzero(np.abs(np.diff(phase)) > 180) + 1
    return np.insert(np.asarray(f, dtype=float), jumps, np.nan), np.insert(phase, jumps, np.nan)


def _samples(data: ImpulseResponse, measured: Array, fit: Array | None, unit: str, title: str, aside: str) -> Picture:
    """Return the samples of a channel, measured and rebuilt, and their difference."""
    what = "correlation" if data.ambient else data.quantity or "response"
    ends, sides = (float(data.times[0]), float(data.times[-1])), [h for h in (measured, fit) if h is not None]
    rest = measured if fit is None else measured - fit
    upward = axis_of(what + ("" if data.ambient else unit), sides)
    below = Line(data.times, rest, "muted", width=0.9)
    panels = [
        Panel(Axis("", *ends), upward, both([(data.times, side) for side in sides]), title, aside, 2.6),
        Panel(Axis("", *ends), axis_of("measured" if fit is None else "residual", [rest]), [below]),
    ]
    return Picture(_labelled(panels, "lag [s]" if data.ambient else "time [s]"), title)


@named(found=Decomposition)
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
    return painted(spectra_picture(found, peaks), ax)


def spectra_picture(found: Decomposition, peaks: int | None = 12) -> Picture:
    """Return the singular values of spectra with the peaks of the first."""
    f, levels = found.frequencies, 10 * np.log10(np.maximum(found.singular_values, np.finfo(float).tiny))
    levels = levels[:, : len(_INKS)]
    inside = levels[f > 0]
    curves = [Line(f, y, _INKS[k], f"singular value {k + 1}", 0.8 if k else 1.1) for k, y in enumerate(levels.T)]
    upward = Axis("power spectral density [dB re unit²/Hz]", float(inside.min()) - 3, float(inside.max()) + 8)
    marked = modes_marked(found.peaks(peaks)[0], (0, float(f[-1])))
    panel = Panel(Axis("frequency [Hz]", 0, float(f[-1])), upward, curves[::-1], marked=marked)
    return Picture([panel], "Singular values of the spectra over frequency", above=True)
