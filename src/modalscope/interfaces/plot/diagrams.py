"""Describe the stabilization diagram over the mode indicator, the indicator by itself, and what is told of orders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from modalscope.data import ModalModel, StabilizationDiagram
from modalscope.data.rebuilt import asked_ends
from modalscope.data.response import Response
from modalscope.interfaces.plot.on_axes import painted
from modalscope.interfaces.plot.picture import Axis, Line, Marks, Panel, Picture, axis_of, modes_marked, unit_of
from modalscope.interfaces.plot.web.poles import KINDS, behind, indicator_curves, level_of, pole_arrays
from modalscope.numerics.arguments import named
from modalscope.numerics.checks import Array, real_array
from modalscope.signals.preprocess.singular_spectra import Decomposition

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Inks of curves, from the first to those behind; maximum number of drawn curves, further ones are noise in tests with few references.
_BEHIND, _OVER, _MAX_CURVES = ("muted", "middle", "pale", "grid"), ("blue", "orange", "muted", "pale"), 4

#: Orders of which singular values are drawn, times the largest one.
_BEYOND = 3


@named(diagram=StabilizationDiagram, modes=ModalModel, indicator=("cmif", "sum", "none"), spectra=Decomposition)
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
    return painted(stabilization_picture([diagram], modes, indicator=indicator, limits=limits, spectra=spectra), ax)


def stabilization_picture(
    diagrams: Sequence[StabilizationDiagram],
    modes: ModalModel | None = None,
    *,
    indicator: str = "cmif",
    limits: tuple[float, float] | None = None,
    spectra: Decomposition | None = None,
) -> Picture:
    """Return the poles of all orders and bands, the selected modes, and the mode indicator or given spectra behind them."""
    low, high = limits or _ends(diagrams)
    poles, items = pole_arrays(diagrams), []
    inside = (poles["frequency"] >= low) & (poles["frequency"] <= high)
    for number, kind in enumerate(KINDS):
        chosen = (poles["kind"] == number) & inside
        words = f"{kind.words} ({np.count_nonzero(chosen)})"
        size = 0.8 if kind.words == "stable" else 0.7
        at = poles["frequency"][chosen], poles["order"][chosen]
        items.append(Marks(*at, kind.ink, kind.mark, words, size, kind.mark not in ("dot", "cross"), kind.letter))
    marked = [] if modes is None else modes_marked(modes.frequencies, (low, high))
    top = max((order for diagram in diagrams for order in diagram.orders), default=2)
    shown = indicator if spectra is None else "spectra"
    name = "" if shown == "none" else level_of(shown, diagrams[0].response)
    curves = [] if indicator == "none" else _curves(*behind(diagrams, 0, spectra, indicator), (low, high), _BEHIND, "")
    at_right = (axis_of(name, [curve.y for curve in curves], log=True), curves) if curves else None
    across, upward = Axis("frequency [Hz]", low, high), Axis("model order (states)", 0, 1.04 * top)
    panel = Panel(across, upward, items, marked=marked, behind=at_right)
    return Picture([panel], "Stabilization diagram: poles of all orders over frequency", above=True)


def _ends(diagrams: Sequence[StabilizationDiagram]) -> tuple[float, float]:
    """Return the span of the data of all bands, of samples limited to the chosen band."""
    ends = [d.response.span if d.response.grid is not None and len(diagrams) == 1 else asked_ends(d) for d in diagrams]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    return (low, high) if high > low else (0.0, 2 * high or 1.0)


def _curves(
    lines: Array, curves: Array, limits: tuple[float, float], inks: Sequence[str], words: str = "singular value"
) -> list[Line]:
    """Return curves (k, F) within limits, the first in front."""
    inside = (lines >= limits[0]) & (lines <= limits[1])
    drawn = [np.where(values > 0, values, np.nan)[inside] for values in curves[:_MAX_CURVES]]
    kept = [(k, y) for k, y in enumerate(drawn) if np.isfinite(y).any()]
    return [Line(lines[inside], y, inks[k], words and f"{words} {k + 1}", 0.8 if k else 1.1) for k, y in kept]


@named(response=Response, modes=ModalModel, kind=("cmif", "sum"))
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
        A new figure by default.
    kind : {"cmif", "sum"}

    Raises
    ------
    DataError
        An unknown kind.
    """
    return painted(indicator_picture(response, modes, kind), ax)


def indicator_picture(response: Response, modes: ModalModel | None = None, kind: str = "cmif") -> Picture:
    """Return the singular values of a response over frequency, or the sum of its magnitudes."""
    limits = response.span if response.span[1] > response.span[0] else (0.0, 2 * response.span[1] or 1.0)
    lines, values = indicator_curves(response, kind)
    curves = _curves(lines, values.T, limits, _OVER, "singular value" if kind == "cmif" else "")
    name = "singular values" if kind == "cmif" else "sum of magnitudes"
    upward = axis_of(name + unit_of(response), [curve.y for curve in curves], log=True)
    marked = [] if modes is None else modes_marked(modes.frequencies, limits)
    panel = Panel(Axis("frequency [Hz]", *limits), upward, curves[::-1], marked=marked)
    return Picture([panel], f"Mode indicator: {name} over frequency", above=True)


@named(diagram=StabilizationDiagram)
def fit_errors(diagram: StabilizationDiagram, ax: Axes | None = None) -> Axes:
    """Draw what is unexplained at each order; beyond the knee of the curve, more states fit only noise.

    Parameters
    ----------
    diagram : StabilizationDiagram
    ax : Axes, optional
    """
    return painted(fit_errors_picture(diagram), ax)


def fit_errors_picture(diagram: StabilizationDiagram) -> Picture:
    """Return what is unexplained at every order."""
    orders, errors = np.asarray(diagram.orders, dtype=float), 100 * np.asarray(diagram.fit_errors)
    return _counted(orders, errors, "model order (states)", "unexplained [%]", "Unexplained part at each order")


def singular_values_picture(source: Any, order: int | None = None, most: int | None = None) -> Picture:
    """Return singular values relative to the largest, those up to `most` orders; `order`: marked by a line."""
    given: Any = getattr(source, "singular_values", source)
    values = real_array("singular_values", given, "(values,)", 1)[: None if most is None else _BEYOND * most]
    largest = float(np.max(values, initial=0.0)) or 1.0
    numbers = np.arange(1.0, values.size + 1)
    title = "Singular values of the data matrix"
    return _counted(numbers, values / largest, "number", "singular value / largest", title, order)


def _counted(x: Array, y: Array, xlabel: str, ylabel: str, title: str, order: int | None = None) -> Picture:
    """Return single values over a count, on a logarithmic scale; `order`: marked by a line."""
    known = np.isfinite(y) & (y > 0)
    across, upward = axis_of(xlabel, [x, [0.0]], room=0.02), axis_of(ylabel, [y], log=True)
    items = [Line(x[known], y[known], "blue", "singular values" if order else "", mark="dot")]
    if order is not None:
        at = np.full(2, order + 0.5)
        items.append(Line(at, np.array([upward.low, upward.high]), "vermillion", f"order {order}", dashed=True))
    return Picture([Panel(across, upward, items)], title, (900, 480))
