"""The stabilization diagram: poles of all orders over the mode indicator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.modal.indicators import cmif
from modalscope.model import FrequencyResponse, ImpulseResponse, ModalModel, StabilizationDiagram
from modalscope.model.checks import (
    Array,
    RealArray,
    check_choice,
    check_kind,
)
from modalscope.model.keywords import named
from modalscope.model.response import Response
from modalscope.plot._style import BLUE, MUTED, ORANGE, PALE, dress, key, mark_modes, new_axes, unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["INDICATORS", "fit_errors", "indicator", "indicator_curves", "stabilization"]

#: What can stand behind the poles.
INDICATORS = ("cmif", "sum", "none")

#: Singular values drawn: more than these lie in the noise of any test with a few references.
_CURVES = 4


def indicator_curves(response: Response, kind: str = "cmif") -> tuple[RealArray, RealArray]:
    """Return lines in Hz, (F,), and the curves of the mode indicator, (F, k).

    `cmif` gives the singular values of H at each line, `sum` the sum of the magnitudes. An impulse response is
    transformed by FFT as it stands.
    """
    response = response.picture()
    if isinstance(response, FrequencyResponse):
        lines, values = response.frequencies, response.values
    else:
        assert isinstance(response, ImpulseResponse)
        lines = np.asarray(np.fft.rfftfreq(response.samples, 1 / response.sampling_rate), dtype=float)
        values = np.fft.rfft(response.values, axis=0) / response.sampling_rate
    curves = cmif(values) if kind == "cmif" else np.abs(values).sum(axis=(1, 2))[:, None]
    return lines, curves


@named()
def stabilization(
    diagram: StabilizationDiagram,
    modes: ModalModel | None = None,
    ax: Axes | None = None,
    *,
    indicator: str = "cmif",
    limits: tuple[float, float] | None = None,
) -> Axes:
    """Draw the poles of all orders, frequency to the right and order up, over the mode indicator of the data.

    Parameters
    ----------
    diagram : StabilizationDiagram
        Its oscillating poles are drawn, decaying or growing; real poles have no place on a frequency axis.
    modes : ModalModel, optional
        Selected modes, marked by a line and their frequency.
    ax : Axes, optional
        Where to draw; a new figure by default.
    indicator : {"cmif", "sum", "none"}
        Behind the poles, on a logarithmic axis at the right: singular values of H, the sum of magnitudes, or nothing.
    limits : (float, float), optional
        Ends of the frequency axis in Hz; the band of the data by default.

    Returns
    -------
    Axes
        The axes of the poles.

    Raises
    ------
    DataError
        An unknown indicator.
    """
    check_kind("a plot of a stabilization diagram", diagram, StabilizationDiagram)
    if modes is not None:
        check_kind("what is marked in a diagram", modes, ModalModel)
    check_choice("indicator", indicator, INDICATORS)
    ax = new_axes(ax)
    lowest, highest = limits or _band(diagram.response)
    if indicator != "none":
        _behind(ax, diagram.response, indicator, (lowest, highest))
    _poles(ax, diagram)
    dress(ax, xlabel="frequency [Hz]", ylabel="model order (states)")
    if diagram.orders:
        ax.set_ylim(0, 1.04 * max(diagram.orders))
    ax.set_xlim(lowest, highest)
    if modes is not None:
        mark_modes(ax, modes.frequencies, (lowest, highest))
    handles, names = ax.get_legend_handles_labels()
    key(ax, handles=handles[::-1], labels=names[::-1])
    return ax


def _poles(ax: Axes, diagram: StabilizationDiagram) -> None:
    oscillates = np.isin(diagram.kinds, ("mode", "unstable"))
    stable = diagram.stable & oscillates
    steady = np.asarray(diagram.stable_frequency, dtype=bool) & oscillates & ~stable
    # the markers shrink where orders lie close, so that rows stay apart
    size = float(np.clip(260 / max(len(diagram.orders), 1), 3.2, 6.0))
    groups: tuple[tuple[str, Array, float, dict[str, Any]], ...] = (
        ("new", oscillates & ~stable & ~steady, 0.7, {"marker": "x", "color": "#98A2AD", "markeredgewidth": 0.8}),
        ("stable in frequency only", steady, 0.75, {"marker": "D", "color": ORANGE, "markerfacecolor": "white"}),
        ("stable", stable, 1.0, {"marker": "o", "color": BLUE, "markeredgecolor": "white", "markeredgewidth": 0.5}),
    )
    f, order = diagram.frequencies, diagram.order_of_pole
    for name, chosen, share, style in groups:
        label = f"{name} ({np.count_nonzero(chosen)})"
        ax.plot(f[chosen], order[chosen], linestyle="none", markersize=share * size, label=label, **style)


def _band(response: Response) -> tuple[float, float]:
    low, high = response.span
    return (low, high) if high > low else (0.0, 2 * high or 1.0)


def _behind(ax: Axes, response: Response, kind: str, limits: tuple[float, float]) -> None:
    lines, curves = indicator_curves(response, kind)
    inside = (lines >= limits[0]) & (lines <= limits[1])
    twin = ax.twinx()
    ax.set_zorder(twin.get_zorder() + 1)
    ax.patch.set_visible(False)
    _draw(twin, lines[inside], curves[inside], ["#8C99A6", "#B7C0C9", "#CDD4DA", "#DDE2E6"])
    dress(twin, grid=False)
    twin.set_ylabel(_names(kind) + unit_of(response), fontsize=9.5, color=MUTED)
    twin.tick_params(labelsize=8.5, labelcolor=MUTED, length=2)
    twin.spines["right"].set_visible(True)
    twin.spines["left"].set_visible(False)


def _names(kind: str) -> str:
    return "mode indicator: CMIF" if kind == "cmif" else "mode indicator: sum of magnitudes"


def _draw(ax: Axes, lines: RealArray, curves: RealArray, colours: list[str]) -> None:
    count = min(curves.shape[1], _CURVES, len(colours))
    for i in range(count):
        positive = np.where(curves[:, i] > 0, curves[:, i], np.nan)
        ax.plot(
            lines,
            positive,
            color=colours[i],
            linewidth=1.2 if i == 0 else 0.9,
            zorder=count - i,
            label=f"singular value {i + 1}",
        )
    if np.any(curves[:, :count] > 0):
        ax.set_yscale("log")


@named()
def indicator(
    response: Response,
    modes: ModalModel | None = None,
    ax: Axes | None = None,
    *,
    kind: str = "cmif",
) -> Axes:
    """Draw the complex mode indicator function, the singular values of H over frequency, or the sum of magnitudes.

    A peak of the first curve is a mode; a peak of the second one below it is a second mode at nearly the same
    frequency. At most four curves are drawn.

    Parameters
    ----------
    response : FrequencyResponse or ImpulseResponse
    modes : ModalModel, optional
        Marked by a line and their frequency.
    ax : Axes, optional
    kind : {"cmif", "sum"}

    Raises
    ------
    DataError
        An unknown kind.
    """
    check_kind("a plot of an indicator", response, (FrequencyResponse, ImpulseResponse))
    check_choice("kind", kind, INDICATORS[:2])
    ax = new_axes(ax, (9.0, 4.5))
    lines, curves = indicator_curves(response, kind)
    _draw(ax, lines, curves, [BLUE, ORANGE, MUTED, PALE])
    dress(
        ax,
        xlabel="frequency [Hz]",
        ylabel=("singular values" if kind == "cmif" else "sum of magnitudes") + unit_of(response),
    )
    limits = _band(response)
    ax.set_xlim(*limits)
    if modes is not None:
        mark_modes(ax, modes.frequencies, limits)
    if kind == "cmif":
        key(ax)
    return ax


@named()
def fit_errors(diagram: StabilizationDiagram, ax: Axes | None = None) -> Axes:
    """Draw how much of the data each order leaves unexplained; where the curve turns flat, more states add only noise.

    Parameters
    ----------
    diagram : StabilizationDiagram
    ax : Axes, optional
    """
    check_kind("a plot of fit errors", diagram, StabilizationDiagram)
    ax = new_axes(ax, (9.0, 4.8))
    known = np.isfinite(diagram.fit_errors) & (diagram.fit_errors > 0)
    ax.plot(
        np.asarray(diagram.orders)[known],
        diagram.fit_errors[known],
        color=BLUE,
        linewidth=0.9,
        marker="o",
        markersize=3.4,
    )
    if np.any(known):
        _plain_log(ax)
    dress(ax, xlabel="model order (states)", ylabel="fit error |measured - rebuilt| / |measured|")
    return ax


def _plain_log(ax: Axes) -> None:
    """Number a logarithmic axis 1, 2, 5, 10 in plain figures: it may cover less than a decade."""
    from matplotlib.ticker import LogLocator, NullFormatter

    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(lambda number, _: f"{number:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
