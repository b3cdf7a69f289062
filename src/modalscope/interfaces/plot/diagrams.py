"""Draw the stabilization diagram over the mode indicator."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.data import FrequencyResponse, ImpulseResponse, ModalModel, StabilizationDiagram
from modalscope.data.indicators import cmif
from modalscope.data.response import Response
from modalscope.interfaces.plot._style import (
    BLUE,
    DOTTED,
    GREEN,
    MUTED,
    ORANGE,
    PALE,
    PURPLE,
    dress,
    key,
    mark_modes,
    new_axes,
    unit_of,
)
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, RealArray, check_kind
from modalscope.numerics.errors import check_choice
from modalscope.signals.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Curves behind the poles.
INDICATORS = ("cmif", "sum", "none")

#: Minimum lines of a spectrum of samples, so that peaks are drawn smooth.
_MIN_LINES = 4096

#: Agreement with a pole of the previous order: letter, words, and whether (frequency, damping, shape) agree.
LETTERS = (
    ("s", "stable", (True, True, True)),
    ("v", "frequency, shape", (True, False, True)),
    ("d", "frequency, damping", (True, True, False)),
    ("f", "frequency", (True, False, False)),
    ("o", "new", None),
)
_COLOURS = {"s": BLUE, "v": GREEN, "d": PURPLE, "f": "#B87700", "o": "#8A96A3"}

#: Maximum number of drawn singular values; further ones are noise in tests with a few references.
_MAX_CURVES = 4


def indicator_curves(response: Response, kind: str = "cmif") -> tuple[RealArray, RealArray]:
    """Return lines in Hz, (F,), and the curves of the mode indicator, (F, k).

    `cmif` gives the singular values of H at each line, `sum` the sum of the magnitudes. Impulse responses are zero-padded and transformed
    by FFT; correlations, which are truncated before they decay, are first multiplied by the falling half of a Hann window.
    """
    response = response.picture()
    if isinstance(response, FrequencyResponse):
        lines, values = response.frequencies, response.values
    else:
        assert isinstance(response, ImpulseResponse)
        samples = response.samples
        length = max(samples, 2 * _MIN_LINES)
        fall = 0.5 + 0.5 * np.cos(np.pi * np.arange(samples) / samples) if response.ambient else np.ones(samples)
        lines = np.asarray(np.fft.rfftfreq(length, 1 / response.sampling_rate), dtype=float)
        values = np.fft.rfft(response.values * fall[:, None, None], length, axis=0) / response.sampling_rate
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
    spectra: Decomposition | None = None,
) -> Axes:
    """Draw the poles of all orders, order over frequency, with the mode indicator of the data behind them.

    Letters state the agreement with a pole of the previous order: s all, v frequency and shape, d frequency and damping, f frequency,
    o none.

    Parameters
    ----------
    diagram : StabilizationDiagram
        Its oscillating poles are drawn, decaying or growing; real poles have no frequency.
    modes : ModalModel, optional
        Selected modes, marked by a line and their frequency.
    ax : Axes, optional
        A new figure by default.
    indicator : {"cmif", "sum", "none"}
        Curves behind the poles, on a logarithmic axis at the right: singular values of H, the sum of magnitudes, or none.
    limits : (float, float), optional
        Ends of the frequency axis in Hz; the band of the data by default.
    spectra : Decomposition, optional
        Spectra of the ambient record (`preprocess.decomposition`), drawn instead of the indicator.

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
    lowest, highest = limits or _band(diagram.response, diagram.settings.get("band"))
    if spectra is not None:
        check_kind("spectra behind a diagram", spectra, Decomposition)
    if indicator != "none":
        curves = indicator_curves(diagram.response, indicator) if spectra is None else spectra[:2]
        kind = "CMIF" if indicator == "cmif" else "sum of magnitudes"
        name = (
            f"mode indicator: {kind}{unit_of(diagram.response)}"
            if spectra is None
            else "singular values of the spectra"
        )
        _behind(ax, *curves, name, (lowest, highest))
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
    remaining = np.isin(diagram.kinds, ("mode", "unstable"))
    agree = np.stack([diagram.stable_frequency, diagram.stable_damping, diagram.stable_shape]).astype(bool)
    # smaller letters for many orders
    size = float(np.clip(300 / max(len(diagram.orders), 1), 4.6, 6.5))
    f, order = diagram.frequencies, diagram.order_of_pole
    groups: list[tuple[str, str, Array]] = []
    for letter, words, wanted in LETTERS:
        chosen = remaining if wanted is None else remaining & np.all(agree == np.array(wanted)[:, None], axis=0)
        remaining = remaining & ~chosen
        groups.append((letter, words, chosen))
    for letter, words, chosen in groups[::-1]:
        label = f"{words} ({np.count_nonzero(chosen)})"
        style: dict[str, Any] = {"marker": rf"$\mathbf{{{letter}}}$", "color": _COLOURS[letter], "markeredgewidth": 0}
        ax.plot(f[chosen], order[chosen], linestyle="none", markersize=size, label=label, **style)


def _band(response: Response, asked: tuple[float, float] | None = None) -> tuple[float, float]:
    """Return the span of the data, of samples limited to the chosen band."""
    low, high = response.span
    if asked is not None and response.grid is None:
        low, high = max(low, asked[0]), min(high, asked[1])
    return (low, high) if high > low else (0.0, 2 * high or 1.0)


def _behind(ax: Axes, lines: RealArray, curves: RealArray, name: str, limits: tuple[float, float]) -> None:
    inside = (lines >= limits[0]) & (lines <= limits[1])
    twin = ax.twinx()
    ax.set_zorder(twin.get_zorder() + 1)
    ax.patch.set_visible(False)
    _draw(twin, lines[inside], curves[inside], ["#8C99A6", "#B7C0C9", "#CDD4DA", "#DDE2E6"])
    dress(twin, grid=False)
    twin.set_ylabel(name, fontsize=9.5, color=MUTED)
    twin.tick_params(labelsize=8.5, labelcolor=MUTED, length=2)
    twin.spines["right"].set_visible(True)
    twin.spines["left"].set_visible(False)


def _draw(ax: Axes, lines: RealArray, curves: RealArray, colours: list[str]) -> None:
    count = min(curves.shape[1], _MAX_CURVES, len(colours))
    for i in range(count):
        positive = np.where(curves[:, i] > 0, curves[:, i], np.nan)
        style: dict[str, Any] = {"color": colours[i], "linewidth": 1.2 if i == 0 else 0.9, "zorder": count - i}
        ax.plot(lines, positive, label=f"singular value {i + 1}", **style)
    if np.any(curves[:, :count] > 0):
        ax.set_yscale("log")


@named()
def indicator(
    response: Response, modes: ModalModel | None = None, ax: Axes | None = None, *, kind: str = "cmif"
) -> Axes:
    """Draw the complex mode indicator function, the singular values of H over frequency, or the sum of magnitudes.

    A peak of the first curve indicates a mode; a peak of the second curve below it, a second mode at nearly the same frequency. At most
    four curves are drawn.

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
    name = "singular values" if kind == "cmif" else "sum of magnitudes"
    dress(ax, xlabel="frequency [Hz]", ylabel=name + unit_of(response))
    limits = _band(response)
    ax.set_xlim(*limits)
    if modes is not None:
        mark_modes(ax, modes.frequencies, limits)
    if kind == "cmif":
        key(ax)
    return ax


@named()
def fit_errors(diagram: StabilizationDiagram, ax: Axes | None = None) -> Axes:
    """Draw the fit error of each order; beyond the knee of the curve, more states fit only noise.

    Parameters
    ----------
    diagram : StabilizationDiagram
    ax : Axes, optional
    """
    check_kind("a plot of fit errors", diagram, StabilizationDiagram)
    ax = new_axes(ax, (9.0, 4.8))
    positive = np.isfinite(diagram.fit_errors) & (diagram.fit_errors > 0)
    ax.plot(np.asarray(diagram.orders)[positive], diagram.fit_errors[positive], **DOTTED)
    if np.any(positive):
        from matplotlib.ticker import LogLocator, NullFormatter

        # plain numbers 1, 2, 5, 10: the axis may cover less than a decade
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(lambda number, _: f"{number:g}")
        ax.yaxis.set_minor_formatter(NullFormatter())
    dress(ax, xlabel="model order (states)", ylabel="unexplained |measured - rebuilt| / |measured|")
    return ax
